# SPDX-License-Identifier: BSD-3-Clause
"""The samples of every study: crops of pictures that scikit-image carries."""

from skimage import data


def grey():
    """Brick, grass and gravel, 128x128."""
    return {name: getattr(data, name)()[:128, :128] for name in ("brick", "grass", "gravel")}


def colour():
    """Tissue, wood and stars, 96x96."""
    return {
        "tissue": data.immunohistochemistry()[76:172, 126:222],
        "wood": data.coffee()[266:362, 486:582],
        "stars": data.hubble_deep_field()[346:442, 166:262],
    }
