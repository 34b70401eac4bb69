"""The list of kernel launches in the documentation names every function of every kernel, and no other."""

import re
from pathlib import Path

import pytest
from cases import slow_but, texture

import simdtex
from simdtex.machine.opencl import OpenCL, kernel_files

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "concepts" / "cost.rst").read_text(encoding="utf-8").partition("\n.. _launches:\n")[2]


def named():
    """The names in the first column of the section's tables that could be functions."""
    first = re.findall(r"^   \* - (.*(?:\n       .*)*)", PAGE, re.MULTILINE)
    return {name for cell in first for name in re.findall(r"``([a-z]+(?:_[a-z]+)*)``", cell)}


def test_every_function_of_a_kernel_is_named_and_every_name_is_one():
    known = {function for function, file in kernel_files().items() if not file.startswith("maspar/")}
    assert len(known) > 50
    assert known - named() == {"lcpdf_histogram"}, "which the text names"
    assert {"lcpdf_density", "lcpdf_histogram"} <= set(re.findall(r"``(\w+)``", PAGE))
    assert named() <= known


ALWAYS = {"start", "active_survey"}
GROUPS = {"active_count", "active_keep", "coloring_sites", "coloring_count", "coloring_list"}
RUNS = {
    "default": ({}, GROUPS | {"use", "relax_coherent", "relax_exact"}),
    "exact": ({"search": "exact", "balance": 0}, GROUPS | {"relax_exact"}),
    "synchronous": ({"schedule": "synchronous"}, GROUPS | {"use", "relax_coherent", "relax_exact", "commit"}),
    "mode": (
        {"search": "exact", "pixel": "density", "balance": 0},
        GROUPS | {"relax_exact", "lcpdf_density", "temperature", "commit"},
    ),
    "luby": ({"schedule": "luby"}, {"use", "relax_coherent", "relax_exact", "luby_priority", "luby_round"}),
}


@pytest.mark.parametrize("name", slow_but(("default",), RUNS))
def test_a_run_launches_what_the_page_says(cl_device, name):
    options, expected = RUNS[name]
    options = {"order": 8, "levels": 2, "finish": 0.0} | options
    machine = OpenCL(cl_device, profile=True)
    _, output = simdtex.synthesize(texture((30, 31)), (30, 26), rng=1, device=machine, full_output=True, **options)
    launched = {kernel["name"] for kernel in output.statistics["kernels"]}
    assert launched == ALWAYS | expected
