"""Same seed, same bits: whole syntheses on every device, in every shape of launch, against the reference."""

import functools
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, opencl, texture
from conftest import usable_devices

import simdtex

ROOT = Path(__file__).resolve().parent.parent
REQUIRED = bool(os.environ.get("SIMDTEX_REQUIRE_OPENCL"))

MULTIRES = {"method": "multires"}
PYRAMID = {"method": "pyramid", "iterations": 2}
COHERENT = {"search": "coherent"}

# sample shape, channels, type, output shape, options
RUNS = {
    "defaults": ((13, 12), None, np.uint8, (11, 14), {"order": 8}),
    "exact": ((30, 31), None, np.uint8, (12, 14), {"order": 8, "search": "exact"}),
    "paper": ((14, 13), None, np.uint8, (9, 11), {"preset": "paper", "order": 2}),
    "gibbs-source": ((12, 12), None, np.uint8, (15, 7), {"order": 5, "relaxation": "gibbs", "boundary": "open"}),
    "gibbs-density": (
        (12, 12),
        None,
        np.uint8,
        (9, 9),
        {"order": 2, "relaxation": "gibbs", "pixel": "density", "bandwidth": 0.5, "coherence": 0},
    ),
    "colour-icm": ((12, 11), 3, np.uint8, (10, 13), {"order": 2, "boundary": "open"}),
    "colour-gibbs-density": (
        (11, 12),
        3,
        np.uint8,
        (8, 9),
        {"order": 2, "relaxation": "gibbs", "pixel": "density", "coherence": 2.0},
    ),
    "colour-mode": ((11, 12), 3, np.uint8, (8, 9), {"order": 2, "pixel": "density", "bandwidth": 1.0}),
    "16-bit-two-channels": ((12, 12), 2, np.uint16, (9, 8), {"order": 8, "relaxation": "gibbs"}),
    "float32": ((12, 13), None, np.float32, (13, 7), {"order": 5}),
    "float64-density": (
        (12, 13),
        None,
        np.float64,
        (7, 9),
        {"order": 2, "relaxation": "gibbs", "pixel": "density", "bandwidth": 0.6},
    ),
    "bool": ((12, 12), None, np.bool_, (9, 9), {"order": 2}),
    "smaller-than-the-sample": ((17, 19), None, np.uint8, (5, 3), {"order": 2}),
    "larger-than-the-sample": ((9, 8), None, np.uint8, (23, 18), {"order": 2, "levels": 2}),
    "a-row": ((9, 8), None, np.uint8, (1, 17), {"order": 2}),
    "large-order": ((16, 16), None, np.uint8, (10, 12), {"order": 18, "levels": 1}),
    "all-phases-reflected": (
        (11, 12),
        None,
        np.uint8,
        (13, 10),
        {"order": 5, "phases": "all", "edges": "reflect", "levels": 3, "xi": -20.0},
    ),
    "coherent": ((20, 21), None, np.uint8, (26, 28), COHERENT | {"order": 8}),
    "coherent-16-bit-gibbs": ((13, 14), None, np.uint16, (17, 12), COHERENT | {"order": 5, "relaxation": "gibbs"}),
    "coherent-colour-density": (
        (12, 13),
        3,
        np.uint8,
        (14, 11),
        COHERENT | {"order": 2, "relaxation": "gibbs", "pixel": "density", "boundary": "open", "chance": 0},
    ),
    "coherent-luby": ((14, 13), None, np.uint8, (12, 13), COHERENT | {"order": 2, "schedule": "luby"}),
    "coherent-lattice": ((14, 13), 3, np.uint8, (12, 13), COHERENT | {"order": 2, "lattice": "4,1,-1,4"}),
    "coherent-block": ((14, 13), None, np.uint8, (12, 13), COHERENT | {"order": 2, "schedule": "block:5x4"}),
    "coherent-array": ((14, 13), None, np.uint8, (12, 13), COHERENT | {"order": 2, "array": "4x8"}),
    "multires": ((13, 11), None, np.uint8, (15, 18), MULTIRES),
    "multires-luminance": ((9, 10), 3, np.uint8, (13, 8), MULTIRES | {"alpha": 3, "beta": 1, "levels": 4}),
    "multires-open-free": (
        (12, 9),
        None,
        np.uint8,
        (10, 13),
        MULTIRES | {"boundary": "open", "parity": "free", "alpha": 0.5},
    ),
    "multires-16-bit": ((12, 12), None, np.uint16, (9, 16), MULTIRES | {"boundary": "open", "alpha": 1}),
    "multires-float64-two-channels": ((10, 13), 2, np.float64, (14, 7), MULTIRES | {"parity": "free", "beta": 0.5}),
    "multires-bool": ((12, 11), None, np.bool_, (13, 13), MULTIRES | {"alpha": 1.5}),
    "multires-mended": ((17, 20), 3, np.uint8, (21, 23), MULTIRES | {"alpha": 0.4}),
    "multires-keep-cut": ((17, 20), 3, np.uint8, (21, 23), MULTIRES | {"edges": "keep", "seams": "cut"}),
    "multires-larger-than-the-sample": ((7, 6), None, np.uint8, (33, 29), MULTIRES | {"alpha": 1.5}),
    "multires-smaller-than-the-sample": ((23, 26), None, np.uint8, (5, 4), MULTIRES | {"orientations": 0}),
    "multires-a-row": ((9, 8), None, np.uint8, (1, 17), MULTIRES),
    "multires-of-a-row": ((1, 17), None, np.uint8, (3, 40), MULTIRES | {"alpha": 1, "boundary": "open"}),
    "multires-all-candidates": ((8, 9), None, np.float32, (10, 13), MULTIRES | {"alpha": np.inf}),
    "pyramid": ((34, 36), None, np.uint8, (32, 40), {"method": "pyramid"}),
    "pyramid-colour": ((20, 17), 3, np.uint8, (19, 23), PYRAMID),
    "pyramid-lookup": ((20, 17), None, np.uint16, (19, 23), PYRAMID | {"match": "lookup", "orientations": 1}),
    "pyramid-six": ((17, 20), None, np.float64, (18, 16), PYRAMID | {"orientations": 6, "edges": "wrap", "levels": 2}),
    "pyramid-laplacian": ((20, 17), 2, np.float32, (19, 23), PYRAMID | {"pyramid": "laplacian", "color": "channels"}),
    "pyramid-laplacian-lookup": (
        (17, 20),
        None,
        np.bool_,
        (18, 16),
        PYRAMID | {"pyramid": "laplacian", "match": "lookup", "levels": 3},
    ),
    "pyramid-a-row": ((9, 8), None, np.uint8, (1, 17), PYRAMID | {"orientations": 2}),
    "pyramid-no-levels": ((9, 8), None, np.uint8, (8, 9), PYRAMID | {"levels": 0, "orientations": 2}),
    "solid": ((17, 20), None, np.uint8, (10, 8, 9), {"iterations": 1, "levels": 1, "orientations": 2}),
    "solid-average": (
        (17, 20),
        3,
        np.uint8,
        (8, 9, 7),
        {"iterations": 1, "levels": 1, "solids": "average", "slices": "each", "orientations": 2},
    ),
    "mix": ((17, 20), 3, np.uint8, (16, 18), {"palette": 0, "average": [1, 2], "iterations": 1}),
}
SOME = ("defaults", "colour-gibbs-density")
LONG = ("pyramid-six", "pyramid-laplacian-lookup", "pyramid-a-row", "pyramid-no-levels", "solid-average")
"""Not that they compute long: their kernels are to be compiled for sizes that no other has."""

# Forms of a launch: work-group size, vector width, candidates in registers, bytes of scratch memory.
FORMS = [
    *({"vector": vector} for vector in (1, 4, 8, 16)),
    *({"work_group": size} for size in (1, 3, 16)),
    *({"step": step} for step in (1, 2, 8)),
    {"scratch": 1},
    {"scratch": 5_000, "vector": 4},
]
EXACT = [{}, {"step": 2, "vector": 1}, {"scratch": 5_000}]
"""Of the exact search: work-items that share a site."""
MIXED = [
    {"work_group": 3, "vector": 4, "step": 2, "scratch": 5_000},
    {"work_group": 16, "vector": 1, "step": 8, "scratch": 40_000},
]


def synthesis(name, device):
    """Everything that a run gives but its times: the image, source map, temperatures, stages and counts."""
    sample_shape, channels, dtype, shape, options = RUNS[name]
    sample = texture(sample_shape, channels, dtype, 5)
    make = simdtex.synthesize
    if name == "mix":
        make, sample = simdtex.mix, [sample, texture(sample_shape[::-1], channels, dtype, 6)]
    elif name.startswith("solid"):
        make = simdtex.synthesize_solid
    axis = None if channels is None else -1
    if make is simdtex.synthesize and "method" not in options:
        options = {"search": "exact"} | options
    image, output = make(sample, shape, channel_axis=axis, rng=2**40 + 3, device=device, full_output=True, **options)
    reports = output.statistics.get("levels") or output.statistics["iterations"]
    own = ("seconds", "skipped")  # the machine's own; the reference skips nothing
    counts = [{k: v for k, v in report.items() if k not in own} for report in reports]
    stages = [array for stage in output.stages for array in (stage.image, stage.source, stage.candidates)]
    arrays = [image, output.source, output.temperature, *stages]
    missing_arrays = {"mrf": 2 * len(output.stages), "multires": 1, "pyramid": 2}
    method = options.get("method", "pyramid" if make is not simdtex.synthesize else "mrf")
    assert sum(array is None for array in arrays) == missing_arrays[method]
    return [array for array in arrays if array is not None], [counts, output.statistics["options"].get("alpha")]


@functools.cache
def expected(name):
    return synthesis(name, REFERENCE)


def check(name, device):
    arrays, counts = synthesis(name, device)
    theirs, their_counts = expected(name)
    assert_same_bits(arrays, theirs)
    assert counts == their_counts


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in RUNS])
def test_every_device_has_the_references_bits(machine, name):
    check(name, machine)


def named(options):
    return "-".join(f"{key}-{value}" for key, value in options.items())


@pytest.mark.parametrize("options", FORMS, ids=named)
def test_the_form_of_a_launch_changes_no_bit(cl_device, options):
    check("defaults", opencl(cl_device, **options))


@pytest.mark.parametrize("options", EXACT, ids=named)
def test_the_form_of_a_launch_changes_no_bit_of_the_exact_search(cl_device, options):
    check("exact", opencl(cl_device, **options))


@pytest.mark.parametrize("options", MIXED, ids=named)
def test_the_form_of_a_launch_changes_no_bit_of_a_colour(cl_device, options):
    check("colour-gibbs-density", opencl(cl_device, **options))


def test_small_scratch_memory_makes_many_pieces(cl_device):
    """Else the test above would show nothing."""
    small, large = opencl(cl_device, scratch=5_000, vector=4), opencl(cl_device)
    assert small.chunk(150, 24, 1) < 10 < large.chunk(150, 24, 1)


def test_the_work_group_changes_no_bit_of_multires(cl_device):
    """It has no other form: its launches keep no distances."""
    check("multires-luminance", opencl(cl_device, work_group=3))


def test_the_form_of_a_launch_changes_no_bit_of_a_pyramid(cl_device):
    machine = opencl(cl_device, work_group=3, vector=4, scratch=5_000)
    for name in ("pyramid-colour", "pyramid-laplacian-lookup"):
        check(name, machine)


def test_the_references_pieces_change_no_bit():
    from simdtex.machine.reference import Reference

    for name in SOME:
        check(name, Reference(20_000))
    check("a-row", Reference(1))


@pytest.mark.parametrize("name", SOME)
def test_a_run_after_another_has_the_same_bits(any_device, name):
    """No state is left in a machine, and none in its memory pool."""
    machine = opencl(any_device, work_group=16)
    for other in ("larger-than-the-sample", name, "smaller-than-the-sample"):
        check(other, machine)
    check(name, machine)


@pytest.mark.parametrize("seed", [0, 1, 2**32 - 1, 2**32, 2**64 - 1])
def test_any_seed_has_the_references_bits(cl_device, seed):
    machine = opencl(cl_device, work_group=16)
    sample = texture((9, 10))
    options = {"order": 1, "rng": seed, "relaxation": "gibbs", "levels": 1}
    ours = simdtex.synthesize(sample, (7, 8), device=machine, **options)
    assert_same_bits(ours, simdtex.synthesize(sample, (7, 8), device=REFERENCE, **options))


CHILD = """
import json, sys
import test_bits
from simdtex.machine.devices import find
from simdtex.machine import open_machine
from simdtex.machine.opencl import OpenCL
machine = open_machine(sys.argv[1]) if sys.argv[1] != "llvmpipe" else OpenCL(find("llvmpipe"), vector=1, work_group=8)
print(json.dumps({"units": machine.info.compute_units, "name": machine.name}), flush=True)
for name in sys.argv[2:]:
    test_bits.check(name, machine)
    print("same bits:", name, flush=True)
"""


def child(code, *arguments, **variables):
    """Run Python in a process of its own; give back its end and all that it printed."""
    env = {key: value for key, value in os.environ.items() if not key.startswith("OCLGRIND")}
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests"), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env=env | {"PYTHONPATH": path} | variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
        check=False,
    )


def missing(what):
    (pytest.fail if REQUIRED else pytest.skip)(f"{what} is not here")


@pytest.mark.parametrize(("threads", "driver"), [(1, None), (2, None), (1, "basic")])
def test_any_number_of_threads_has_the_references_bits(threads, driver):
    """And the driver ``basic``, which has no thread of its own."""
    pocl = [info for info in usable_devices() if info.platform.startswith("Portable Computing")]
    info = next((info for info in pocl if info.compute_units > 1), None)
    if info is None:
        pytest.skip("no PoCL device of several threads here")
    # PoCL before version 4 reads the first of the two variables, from 4 on the second.
    limits = {"POCL_MAX_PTHREAD_COUNT": str(threads), "POCL_CPU_MAX_CU_COUNT": str(threads)}
    driver = driver or re.match(r"[a-z]+", info.name)[0]
    done = child(CHILD, info.platform, "defaults", POCL_DEVICES=driver, **limits)
    assert done.returncode == 0, done.stdout
    first, *rest = done.stdout.splitlines()
    assert json.loads(first)["units"] == threads, "PoCL heeds the limit"
    assert "same bits: defaults" in rest


def vendors(folder, library):
    """A folder that shows the loader one runtime alone."""
    (folder / "only.icd").write_text(f"{library}\n")
    return str(folder)


def library(pattern):
    found = sorted(Path("/usr/lib").glob(pattern))
    return found[0] if found else None


QUICK = ("a-row", "multires-open-free")


@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in (*SOME, "multires"))]
)
def test_rusticl_has_the_references_bits(tmp_path, name):
    """Mesa's runtime on its software rasteriser: slow, and independent of all others."""
    found = library("**/libRusticlOpenCL.so.1")
    if found is None:
        pytest.skip("rusticl is not here")
    variables = {"OCL_ICD_VENDORS": vendors(tmp_path, found), "RUSTICL_ENABLE": "llvmpipe"}
    done = child(CHILD, "llvmpipe", name, **variables)
    if "No device matches" in done.stdout or "cannot be used" in done.stdout:
        pytest.skip("rusticl has no usable device here")
    assert done.returncode == 0, done.stdout
    assert done.stdout.count("same bits") == 1


TINY = """
import sys
import numpy as np
import simdtex
from cases import REFERENCE, assert_same_bits, ising, texture
from simdtex.machine.devices import find
from simdtex.machine.opencl import OpenCL

info = find("oclgrind")
colour, grey = texture((6, 5), 3), texture((7, 6))
few = (np.indices((5, 6)).sum(0) // 2 % 3).astype(np.uint8)
runs = [
    (grey, None, {"order": 1, "levels": 2}),
    (texture((8, 9)), None, {"order": 5, "levels": 2, "search": "exact"}),
    (grey, None, {"order": 2, "levels": 1, "relaxation": "gibbs", "pixel": "density", "boundary": "open"}),
    (colour, -1, {"order": 1, "levels": 2, "edges": "reflect", "pixel": "density", "relaxation": "gibbs"}),
    (grey, None, {"order": 1, "levels": 1, "schedule": "luby"}),
    (grey, None, {"order": 1, "levels": 1, "schedule": "block:2x3", "array": "2x2"}),
    (grey, None, {"method": "multires", "alpha": 0.6}),
    (colour, -1, {"method": "multires", "boundary": "open", "parity": "free", "alpha": 0.5}),
    (grey, None, {"method": "pyramid", "iterations": 1, "levels": 1, "orientations": 2}),
    (grey, None, {"method": "pyramid", "iterations": 1, "pyramid": "laplacian", "match": "lookup"}),
]
machines = [OpenCL(info, work_group=3, vector=4), OpenCL(info, work_group=4, vector=1)]
machines = [OpenCL(info), *machines]
for number, (sample, axis, options) in enumerate(runs):
    for machine in machines[: 3 if number < 2 else 1]:
        options |= {"rng": 1, "channel_axis": axis} | ({} if "method" in options else {"free_sweeps": 1, "novelty": 0})
        ours = simdtex.synthesize(sample, (5, 7), device=machine, **options)
        assert_same_bits(ours, simdtex.synthesize(sample, (5, 7), device=REFERENCE, **options))
for options in ({"temperature": np.full((5, 6), 0.5)}, {"estimator": "histogram"}):
    options |= {"order": 1, "greys": 3}
    tables = [simdtex.lcpdf(few, few, [(2, 2), (2, 3), (1, 1)], device=m, **options) for m in (machines[0], REFERENCE)]
    assert_same_bits(*tables)
for schedule in ("block:2x2", "raster", "synchronous"):
    options = {"seeds": 3, "sweeps": 2, "burn_in": 1}
    chains = [ising(m, (4, 5), [2.0, 3.0], schedule, **options) for m in (machines[0], REFERENCE)]
    assert_same_bits(*(one.spins for one in chains))
options = {"iterations": 1, "levels": 1, "orientations": 2, "rng": 1}
assert_same_bits(*(simdtex.synthesize_solid(grey, (3, 4, 2), device=m, **options) for m in (machines[0], REFERENCE)))
print("same bits throughout")
"""

PLANTED = """
import numpy as np
import pyopencl as cl
from simdtex.machine.devices import find
from simdtex.machine.opencl import OpenCL

machine = OpenCL(find("oclgrind"))
program = cl.Program(machine.context, '''
__kernel void race(__global int *sum) { sum[0] = sum[0] + (int)get_global_id(0); }
__kernel void outside(__global int *sum) { sum[get_global_id(0) + 1] = 1; }
''').build()
target = cl.Buffer(machine.context, cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR, hostbuf=np.zeros(4, np.int32))
cl.Kernel(program, "PLANT")(machine.queue, (4,), (2,), target)
machine.sync()
"""

REPORT = re.compile(r"data race|Invalid (read|write)|uninitialized|out of bounds", re.IGNORECASE)


def under_oclgrind(folder, code):
    found = library("oclgrind/liboclgrind-rt-icd.so") or library("**/liboclgrind-rt-icd.so")
    if found is None:
        missing("Oclgrind")
    variables = {"OCL_ICD_VENDORS": vendors(folder, found), "OCLGRIND_DATA_RACES": "1"}
    return child(code, OCLGRIND_CHECK_API="1", PYOPENCL_NO_CACHE="1", **variables)


def test_no_kernel_races_or_leaves_its_bounds(tmp_path):
    done = under_oclgrind(tmp_path, TINY)
    assert done.returncode == 0, done.stdout
    assert "same bits throughout" in done.stdout
    assert not REPORT.search(done.stdout), done.stdout
    # pyopencl asks devices for what an OpenCL 1.2 device does not know; no other call may be wrong.
    assert set(re.findall(r"Function: (\w+)", done.stdout)) <= {"clGetDeviceInfo"}, done.stdout


@pytest.mark.parametrize(("plant", "words"), [("race", "data race"), ("outside", "Invalid write")])
def test_a_planted_fault_is_reported(tmp_path, plant, words):
    """So that the silence of the test above means something."""
    done = under_oclgrind(tmp_path, PLANTED.replace("PLANT", plant))
    assert done.returncode == 0, done.stdout
    assert words in done.stdout, done.stdout
    assert REPORT.search(done.stdout)
