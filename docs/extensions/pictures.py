# SPDX-License-Identifier: BSD-3-Clause
"""The gallery shows the figures that a block of an example has named."""

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst


def named(block, block_vars, gallery_conf):
    """What sphinx-gallery calls after each block of an example."""
    found = block_vars["example_globals"].items()
    new = [(name, one) for name, one in found if isinstance(one, Figure) and one.get_gid() is None]
    paths = []
    for (_, figure), path in zip(new, block_vars["image_path_iterator"], strict=False):
        figure.set_gid("shown")
        figure.savefig(path)
        paths.append(path)
    return figure_rst(paths, gallery_conf["src_dir"])
