# SPDX-License-Identifier: BSD-3-Clause
"""What each figure of merit says of pictures whose fault is known; the table of docs/reference/quality.rst.

    python benchmarks/quality_cases.py [--out docs/study/quality.csv] [--device TEXT]

The sample is 128 x 128 pixels of the gravel of scikit-image, the pictures are 256 x 256.
"""

import common
import numpy as np
from figures import further
from scipy.ndimage import gaussian_filter
from skimage import data

import simdtex

FIGURES = (
    *("plausibility", "coverage", "copying", "repeats", "salt", "contrast"),
    *("histogram_distance", "seam", "effective_share"),
)


def cases(photograph, sample, device):
    """Pictures by what they are, with their source maps where they have one."""
    rng = np.random.default_rng(1)
    rows, cols = sample.shape
    real = photograph[-2 * rows :, -2 * cols :]
    yield "another part of the photograph", real, None
    made, output = simdtex.synthesize(sample, real.shape, rng=1, device=device, full_output=True)
    yield "``mrf`` with its defaults", made, output.source
    tiled = np.stack(np.indices(real.shape), -1) % (rows, cols)
    places = {
        "the sample, tiled": tiled,
        "32 x 32 pixels of it, tiled": tiled % 32,
        "its pixels in no order": rng.integers(0, (rows, cols), (*real.shape, 2)),
    }
    for name, source in places.items():
        yield name, sample[source[..., 0], source[..., 1]], source
    yield "the photograph, blurred", np.rint(gaussian_filter(real.astype(float), 1.5)).astype(np.uint8), None
    salted = np.where(rng.random(real.shape) < 0.03, rng.permutation(real.ravel()).reshape(real.shape), real)
    yield "the photograph, 3 % of its pixels moved", salted, None
    yield "the photograph, at 3/4 of its brightness", (real * 0.75).astype(np.uint8), None


@common.command
def main(out=common.DOCS / "study" / "quality.csv", device=None):
    photograph, rows = data.gravel(), []
    sample = photograph[:128, :128]
    for name, picture, source in cases(photograph, sample, device):
        found = vars(simdtex.quality.measure(sample, picture, source)) | further(sample, picture)
        rows.append([name, *("" if found[figure] is None else f"{found[figure]:.2f}" for figure in FIGURES)])
    header = ["picture", *(figure.removesuffix("_distance").replace("_", " ") for figure in FIGURES)]
    common.table("", header, rows, out)


if __name__ == "__main__":
    main()
