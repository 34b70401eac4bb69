"""A floor under the figures of quality: what the method ``mrf`` made of three textures when they were last measured.

Means over the seeds 1 and 2, of pictures as large as their sample. A figure may be worse by `MARGIN`, about two
standard deviations of such a mean over other seeds: a change that only draws other numbers stays above the floor, one
that makes poorer pictures does not. After a change that is meant to alter pictures, measure anew: run this file.
"""

import functools

import numpy as np
import pytest
from cases import opencl
from skimage import data

import simdtex
from simdtex.experiments.quality import Quality, measure

SIDE = {"default": 128, "exact": 96}
SEEDS = 1, 2
SAMPLES = "brick", "grass", "gravel"
FIGURES = "plausibility", "coverage", "copying", "histogram_distance", "effective_share"

MARGIN = {"plausibility": 0.05, "coverage": 0.13, "copying": 0.1, "histogram_distance": 0.1, "effective_share": 0.2}

# In the order of FIGURES.
MEASURED = {
    ("brick", "default"): (0.203, 0.15, 0.0, 0.055, 0.534),
    ("grass", "default"): (0.322, 0.343, 0.256, 0.042, 0.854),
    ("gravel", "default"): (0.256, 0.274, 0.294, 0.038, 0.865),
    ("brick", "exact"): (0.225, 0.205, 0.0, 0.056, 0.275),
    ("grass", "exact"): (0.284, 0.307, 0.325, 0.045, 0.832),
    ("gravel", "exact"): (0.416, 0.426, 0.005, 0.073, 0.702),
}
SEARCHES = {"default": "auto", "exact": "exact"}


@functools.cache
def texture(name, search):
    return getattr(data, name)()[: SIDE[search], : SIDE[search]]


def figures(name, search, device, **options):
    """The mean of each figure over the seeds."""
    sample, found = texture(name, search), []
    for seed in SEEDS:
        image, output = simdtex.synthesize(
            sample, sample.shape, search=SEARCHES[search], rng=seed, device=device, full_output=True, **options
        )
        found.append(measure(sample, image, output.source))
    return {figure: float(np.mean([getattr(each, figure) for each in found])) for figure in FIGURES}


def below_the_floor(name, search, found):
    """The figures that are worse than measured by more than the margin; those that a picture lacks are not."""
    worse = set()
    for figure, once in zip(FIGURES, MEASURED[name, search], strict=True):
        now = getattr(found, figure) if isinstance(found, Quality) else found[figure]
        sign = -1 if figure == "effective_share" else 1  # the only one of which more is better
        if now is not None and sign * (now - once) > MARGIN[figure]:
            worse.add(figure)
    return worse


@pytest.mark.parametrize(
    ("name", "search"), [pytest.param(*key, marks=[pytest.mark.slow] * (key[1] == "exact")) for key in MEASURED]
)
def test_quality_stays_above_the_floor(any_device, name, search):
    found = figures(name, search, opencl(any_device))
    assert not below_the_floor(name, search, found), found


@pytest.mark.parametrize("name", SAMPLES)
def test_a_hasty_relaxation_falls_below_the_floor(any_device, name):
    """One sweep for each site, and no finish that melts what is torn: the floor is high enough to tell."""
    found = figures(name, "default", opencl(any_device), xi=-1000.0, free_sweeps=0, finish=0.0)
    assert "plausibility" in below_the_floor(name, "default", found), found


if __name__ == "__main__":
    for name, search in MEASURED:
        row = figures(name, search, None)
        print(name, search, [round(value, 3) for value in row.values()])
