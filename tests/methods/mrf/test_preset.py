"""The preset ``paper`` makes its sample's texture; the literal density, for which all equations hold too, does not."""

import pytest
from skimage import data

import simdtex
from simdtex.jobs.studies.quality import coverage, plausibility

GRAVEL = data.gravel()[:96, :96]


@pytest.fixture
def faults(script):
    """Return the function that names the figures by which an output is none of the sample's texture."""
    figures = script("textures").figures

    def found(sample, output):
        mean, deviation, specks, coarse = figures(sample, output)
        within = {
            "mean": abs(mean) < 0.15,
            "deviation": 0.85 < deviation < 1.15,
            "specks": specks < 1.3,
            "coarse sites": coarse < 1.4,
            "plausibility": plausibility(sample, output) < 0.4,
            "coverage": coverage(sample, output) < 0.45,
        }
        return {name for name, holds in within.items() if not holds}

    return found


def test_the_preset_makes_the_texture(machine, faults):
    given = {"preset": "paper", "order": 18, "rng": 1, "device": machine}
    assert not faults(GRAVEL, simdtex.synthesize(GRAVEL, (96, 96), **given))
    literal = simdtex.synthesize(GRAVEL, (96, 96), pixel="density", relaxation="gibbs", **given)
    assert {"mean", "specks", "plausibility", "coverage"} <= faults(GRAVEL, literal)
