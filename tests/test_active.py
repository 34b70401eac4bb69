"""Which sites are active: counted and listed on the machine as NumPy counts and lists them."""

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits
from hypothesis import given, settings
from hypothesis import strategies as st

from simdtex.model.lattice import Grid
from simdtex.ops import sites as sites_module
from simdtex.ops.sites import among, stretches, survey


@st.composite
def temperatures(draw):
    grid = Grid(
        draw(st.integers(1, 40)), draw(st.integers(1, 60)), draw(st.sampled_from([1, 2, 4])), draw(st.booleans())
    )
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    share = draw(st.sampled_from([0.0, 0.02, 0.5, 1.0]))
    t = rng.integers(1, 1025, (grid.height, grid.width)) * (rng.random((grid.height, grid.width)) < share)
    return grid, t.astype(np.uint16)


@given(case=temperatures())
@settings(max_examples=30)
def test_a_survey_counts_sites_and_heat(machine, case):
    grid, t = case
    here = t[:: grid.spacing, :: grid.spacing]
    expected = int((here > 0).sum()), int(here.sum())
    assert survey(REFERENCE, grid, t) == survey(machine, grid, machine.put(t)) == expected


@given(case=temperatures(), groups=st.integers(1, 9), chunk=st.sampled_from([1, 3, 256]))
@settings(max_examples=40)
def test_the_active_sites_of_a_list_stay_in_order_group_by_group(machine, case, groups, chunk):
    grid, t = case
    rng = np.random.default_rng(groups)
    sites = rng.permutation(grid.sites())
    starts = np.concatenate([[0], np.sort(rng.integers(0, sites.size + 1, groups - 1)), [sites.size]])
    expected = [s[t.ravel()[s] > 0] for s in np.split(sites, starts[1:-1])]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sites_module, "CHUNK", chunk)
        begins, firsts = stretches(starts)
    for m in (REFERENCE, machine):
        kept, bounds = among(m, m.put(sites), m.put(begins), firsts, m.put(t))
        kept = np.asarray(m.get(kept))
        assert_same_bits(kept, np.concatenate(expected).astype(np.int32))
        for group, (begin, end) in zip(expected, np.stack([bounds[:-1], bounds[1:]], 1).tolist(), strict=True):
            assert_same_bits(kept[begin:end], group)
