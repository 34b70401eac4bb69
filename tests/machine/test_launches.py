"""The list of kernel launches in the documentation names every function of every kernel, and no other."""

import re
from pathlib import Path

from cases import texture

import simdtex
from simdtex.machine.opencl import OpenCL, kernel_files

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "concepts" / "cost.rst").read_text(encoding="utf-8").partition("\n.. _launches:\n")[2]


def named():
    first = re.findall(r"^   \* - (.*(?:\n       .*)*)", PAGE, re.MULTILINE)
    return {name for cell in first for name in re.findall(r"``([a-z]+(?:_[a-z]+)*)``", cell)}


def test_every_function_of_a_kernel_is_named_and_every_name_is_one():
    known = {function for function, file in kernel_files().items() if not file.startswith("maspar/")}
    assert len(known) > 50
    assert known - named() == {"lcpdf_histogram"}, "which the text names"
    assert {"lcpdf_density", "lcpdf_histogram"} <= set(re.findall(r"``(\w+)``", PAGE))
    assert named() <= known


LAUNCHED = {
    *("start", "active_survey", "active_count", "active_keep", "use"),
    *("coloring_sites", "coloring_count", "coloring_list", "relax_coherent", "relax_exact"),
}


def test_a_run_launches_what_the_page_says(cl_device):
    machine = OpenCL(cl_device, profile=True)
    options = {"order": 8, "levels": 2, "finish": 0.0, "full_output": True}
    _, output = simdtex.synthesize(texture((30, 31)), (30, 26), rng=1, device=machine, **options)
    assert {kernel["name"] for kernel in output.statistics["kernels"]} == LAUNCHED
