# SPDX-License-Identifier: BSD-3-Clause
"""What each figure of merit says of pictures whose fault is known; the table of docs/reference/quality.rst.

    python benchmarks/quality_cases.py [--out docs/study/quality.csv] [--device TEXT]

The sample is 128 x 128 pixels of the gravel of scikit-image, the pictures are 256 x 256.
"""

import argparse
from pathlib import Path

import numpy as np
import tables
from figures import further
from scipy.ndimage import gaussian_filter
from skimage import data

import simdtex

FIGURES = {
    "plausibility": "plausibility",
    "coverage": "coverage",
    "copying": "copying",
    "repeats": "repeats",
    "salt": "salt",
    "contrast": "contrast",
    "histogram_distance": "histogram",
    "seam": "seam",
    "effective_share": "effective share",
}


def cases(photograph, sample, device):
    """Pictures by what they are, with their source maps where they have one."""
    rng = np.random.default_rng(1)
    rows, cols = sample.shape
    real = photograph[-2 * rows :, -2 * cols :]
    row, col = np.indices(real.shape)
    yield "another part of the photograph", real, None
    made, output = simdtex.synthesize(sample, real.shape, rng=1, device=device, full_output=True)
    yield "``mrf`` with its defaults", made, output.source
    tiled = np.stack([row % rows, col % cols], -1)
    yield "the sample, tiled", np.tile(sample, (2, 2)), tiled
    corner = tiled % 32
    yield "32 x 32 pixels of it, tiled", sample[corner[..., 0], corner[..., 1]], corner
    places = rng.integers(0, (rows, cols), (*real.shape, 2))
    yield "its pixels in no order", sample[places[..., 0], places[..., 1]], places
    yield "the photograph, blurred", np.rint(gaussian_filter(real.astype(float), 1.5)).astype(np.uint8), None
    salted = np.where(rng.random(real.shape) < 0.03, rng.permutation(real.ravel()).reshape(real.shape), real)
    yield "the photograph, 3 % of its pixels moved", salted, None
    yield "the photograph, at 3/4 of its brightness", (real * 0.75).astype(np.uint8), None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent.parent / "docs" / "study" / "quality.csv")
    parser.add_argument("--device")
    options = parser.parse_args()
    photograph = data.gravel()
    sample = photograph[:128, :128]
    table = []
    for name, picture, source in cases(photograph, sample, options.device):
        found = vars(simdtex.quality.measure(sample, picture, source)) | further(sample, picture)
        table.append([name, *("" if found[figure] is None else f"{found[figure]:.2f}" for figure in FIGURES)])
        print(*table[-1], sep="  ", flush=True)
    tables.write(options.out, ["picture", *FIGURES.values()], table)


if __name__ == "__main__":
    main()
