"""The session that the documentation plays is one of this version."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import simdtex

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "docs"))
import recorded


@pytest.fixture(scope="module")
def recording():
    return recorded.unpack(recorded.FILE.read_text(encoding="ascii"))


def test_recorded_pictures_and_reasons_are_those_of_a_run(recording):
    found, data = recording
    shape = (recorded.SIDE, recorded.SIDE)
    rules = recorded.OPTIONS | {"rng": recorded.SEED, "device": "reference"}
    replay = simdtex.replay(recorded.sample(), shape, **rules)
    assert [list(one) for one in replay.sweeps] == found["inside"][0]["panes"][0]["sweeps"]
    for key, moment in found["moments"][1::20]:
        (n, sets), level = json.loads(key), moment[0]
        _, ((begin, size),) = found["frames"][f"picture {key}"]
        seen = np.frombuffer(data[begin : begin + size], np.uint8).reshape(*shape, 4)
        image = replay.at(n, sets).image[..., 0].repeat(2**level, 0).repeat(2**level, 1)
        np.testing.assert_array_equal(seen[..., 0], image[: shape[0], : shape[1]])
        row, col = recorded.PIXELS[0]
        reason = found["explained"][f"{row},{col} {key}"]["reason"]
        try:
            assert reason == replay.explain_pixel(row, col, n, sets).reason
        except ValueError as error:
            assert reason == str(error)


def test_the_recording_is_small_and_packs(recording):
    assert recorded.FILE.stat().st_size < 700_000
    assert recorded.unpack(recorded.pack(*recording)) == recording
