"""The kernels compiled by clang for GPUs that are not here: no result is left to a device, and scratch has a limit."""

from itertools import groupby

import portable
import pytest
from portable import Build

from simdtex.machine.opencl import kernel_folder

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not portable.CLANG, reason=portable.NO_CLANG)]

MOST_SCRATCH = {"mrf/lcpdf": 2304}
"""Bytes of scratch that kernels of a file may take on a gfx1100, of others 640: more than the largest in the table."""

HARMLESS = {
    "const float allowed =": "a bound, with a margin that is larger than one rounding",
    "d[q] = fma(g.spread, least_noise": "a bound, likewise",
    "heat += t * in;": "sums of whole numbers below 2^24, which are exact",
    "guide = in +": "a product with 0 or 1",
    "data = in * g.hard": "products with 0 or 1",
}
"""Lines of relax_*.cl and their headers with a product in a sum that may be contracted, and why no result changes."""


def tabled() -> list[Build]:
    """The builds of the table, and the files that only CPUs use."""
    files = {path.relative_to(kernel_folder()).with_suffix("").as_posix() for path in kernel_folder().rglob("*.cl")}
    known = list(portable.recorded())
    return [*known, *(Build(file, "") for file in sorted(files - {build.file for build in known}))]


FILES = {file: list(found) for file, found in groupby(sorted(tabled()), lambda build: build.file)}


@pytest.mark.parametrize("vector", [1, 16])
@pytest.mark.parametrize("file", FILES)
def test_no_result_is_left_to_the_device(file, vector):
    """OpenCL allows a division 2.5 ulp and a square root 3, and some compilers contract in spite of the pragma."""
    found = set()
    for build in FILES[file]:
        for name, line, operation in portable.unsafe(build.compiled("spir", vector)):
            text = (kernel_folder() / name).read_text(encoding="utf-8").splitlines()[line - 1]
            if not (file.startswith("mrf/relax") and any(words in text for words in HARMLESS)):
                found.add(f"{name}:{line}: {text.strip()} ({operation})")
    assert not found


DEVICES_MAY_CHOOSE = """
#pragma OPENCL FP_CONTRACT OFF
__kernel void k(__global float *a)
{
    a[0] = a[1] / a[2];
    a[3] = sqrt(a[4]);
    a[5] = native_exp(a[6]);
    a[7] = a[8] - a[9] * a[10];
    a[11] = a[12] + -(a[13] * 3.0f);
    a[14] = mad(a[15], a[16], a[17]);
    a[18] = fma(a[19], a[20], a[21]);
    a[22] = a[23] + a[24] * 0x1p-9f;
    a[25] = fma(a[26], a[27], 0.0f) + a[28];
}
"""


def test_what_is_left_to_a_device_is_found(monkeypatch):
    monkeypatch.setattr(portable, "kernel_source", lambda name: f'#line 1 "{name}"\n{DEVICES_MAY_CHOOSE}')
    found = [line for _, line, _ in portable.unsafe(Build("k", "").compiled("spir"))]
    assert found == [5, 6, 7, 8, 9, 10]


def test_the_table_has_what_default_runs_build_and_a_limit_on_scratch(any_device):
    known = portable.recorded()
    assert portable.builds() == list(known), "make portable writes the table"
    assert all((kernel_folder() / f"{file}.cl").is_file() for file in FILES)
    for build, kernels in known.items():
        found = portable.sizes(build)
        assert found.keys() == kernels.keys()
        if portable.CLANG.endswith("-15"):
            assert found == kernels, "make portable writes the table"
        for kernel, (_, scratch, _) in found.items():
            assert scratch <= MOST_SCRATCH.get(build.file, 640), f"{kernel} with {build.defines}"
