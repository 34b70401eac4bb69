"""Masked arrays: where a mask would be lost, and with it which values are there, they are refused."""

import numpy as np
import pytest
from cases import texture

import simdtex
from simdtex.experiments.ensemble import as_ensemble, as_image
from simdtex.io import image, volume
from simdtex.model.source_map import apply_source_map, save_source_map

GREY = texture((20, 20))
LOW = GREY % 4


def masked(array, place=(0, 1)):
    found = np.ma.array(array, copy=True)
    found[place] = np.ma.masked
    return found


PLACES = np.zeros((4, 4, 2), np.int32)
ON = {"device": "reference", "rng": 1}
REFUSED = {
    "solid": lambda _: simdtex.synthesize_solid(masked(GREY), (4, 4, 4), **ON),
    "solid start": lambda _: simdtex.synthesize_solid(GREY, (4, 4, 4), start=masked(np.ones((4, 4, 4))), **ON),
    "multires": lambda _: simdtex.synthesize(masked(GREY), (9, 9), method="multires", **ON),
    "pyramid": lambda _: simdtex.synthesize(masked(GREY), (9, 9), method="pyramid", **ON),
    "start": lambda _: simdtex.synthesize(GREY, (9, 9), method="pyramid", start=masked(np.ones((9, 9))), **ON),
    "mix": lambda _: simdtex.mix([GREY, masked(GREY)], (9, 9), **ON),
    "extend": lambda _: simdtex.extend(masked(GREY), left=3, **ON),
    "lcpdf image": lambda _: simdtex.lcpdf(masked(LOW), LOW, [[1, 1]], order=1, greys=4, device="reference"),
    "lcpdf sample": lambda _: simdtex.lcpdf(LOW, masked(LOW), [[1, 1]], order=1, greys=4, device="reference"),
    "lcpdf sites": lambda _: simdtex.lcpdf(LOW, LOW, masked([[1, 1]]), order=1, greys=4, device="reference"),
    "temperature": lambda _: simdtex.lcpdf(
        LOW, LOW, [[1, 1]], order=1, greys=4, temperature=masked(np.ones((20, 20))), device="reference"
    ),
    "mask": lambda _: simdtex.synthesize(GREY, (9, 9), mask=masked(GREY > 0), **ON),
    "guide": lambda _: simdtex.synthesize(GREY, (20, 20), guide=(masked(GREY), GREY), **ON),
    "output's guide": lambda _: simdtex.synthesize(GREY, (20, 20), guide=(GREY, masked(GREY)), **ON),
    "quality": lambda _: simdtex.quality.coverage(masked(GREY), GREY),
    "output": lambda _: simdtex.quality.seam(masked(GREY)),
    "image of an ensemble": lambda _: as_image(masked(GREY)),
    "ensemble": lambda _: as_ensemble(masked(np.ones((2, 3, 3)))),
    "map": lambda _: apply_source_map(PLACES, masked(GREY)),
    "source map": lambda folder: save_source_map(folder / "a.npz", masked(PLACES)),
    "picture": lambda folder: image.write(folder / "a.png", masked(GREY)),
    "volume": lambda folder: volume.write(folder / "a.npz", masked(np.ones((2, 3, 3)))),
    "alpha": lambda _: image.split_alpha(masked(GREY)),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_mask_that_would_be_lost_is_refused(tmp_path, case):
    with pytest.raises(ValueError, match=r"masked|known everywhere") as said:
        REFUSED[case](tmp_path)
    assert any(remedy in str(said.value) for remedy in ("fill them first", 'method="mrf"'))
    assert list(tmp_path.iterdir()) == []


def test_masked_arrays_without_a_masked_value_are_arrays(tmp_path):
    whole = np.ma.array(GREY, mask=np.zeros(GREY.shape, bool))
    image.write(tmp_path / "a.png", whole)
    assert np.array_equal(image.read(tmp_path / "a.png").pixels, GREY)
    made = [simdtex.synthesize(one, (9, 9), method="multires", **ON) for one in (GREY, whole)]
    assert np.array_equal(*made)


def test_where_a_mask_means_unknown_it_is_taken():
    simdtex.synthesize(masked(GREY), (9, 9), order=1, **ON)
    simdtex.fill(masked(GREY), order=1, **ON)
