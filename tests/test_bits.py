"""The same bits in other processes: any number of threads, other runtimes, and a simulator that sees races."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import usable_devices
from runs import digest
from tiny import JOBS

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.slow

CHILD = """
import json, sys
from runs import digest, outcome
from simdtex.machine.devices import find
from simdtex.machine import open_machine
from simdtex.machine.opencl import OpenCL
machine = open_machine(sys.argv[1]) if sys.argv[1] != "llvmpipe" else OpenCL(find("llvmpipe"), vector=1, work_group=8)
print(json.dumps([machine.info.compute_units, digest(outcome(sys.argv[2], machine)[0])]), flush=True)
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


@pytest.mark.parametrize(("threads", "driver"), [(2, None), (1, None), (1, "basic")])
def test_any_number_of_threads_has_the_references_bits(reference, threads, driver):
    """And the driver ``basic``, which has no thread of its own."""
    pocl = [info for info in usable_devices() if info.platform.startswith("Portable Computing")]
    info = next((info for info in pocl if info.compute_units > 1), None)
    if info is None:
        pytest.skip("no PoCL device of several threads here")
    # PoCL before version 4 reads the first of the two variables, from 4 on the second.
    limits = {"POCL_MAX_PTHREAD_COUNT": str(threads), "POCL_CPU_MAX_CU_COUNT": str(threads)}
    driver = driver or re.match(r"[a-z]+", info.name)[0]
    done = child(CHILD, info.platform, "more", POCL_DEVICES=driver, **limits)
    assert done.returncode == 0, done.stdout
    assert json.loads(done.stdout) == [threads, digest(reference("more")[0])], "PoCL heeds the limit"


def vendors(folder, *patterns):
    """Write the .icd file of one runtime into a folder, and return the folder; None if it is not installed."""
    found = [path for pattern in patterns for path in sorted(Path("/usr/lib").glob(pattern))]
    (folder / "only.icd").write_text("".join(f"{path}\n" for path in found[:1]))
    return str(folder) if found else None


@pytest.mark.parametrize("name", ["multires-open", "more", "density-colour"])
def test_rusticl_has_the_references_bits(tmp_path, reference, name):
    """Mesa's runtime on its software rasteriser: slow, and independent of all others."""
    found = vendors(tmp_path, "**/libRusticlOpenCL.so.1")
    if found is None:
        pytest.skip("rusticl is not here")
    done = child(CHILD, "llvmpipe", name, OCL_ICD_VENDORS=found, RUSTICL_ENABLE="llvmpipe")
    if "No device matches" in done.stdout or "cannot be used" in done.stdout:
        pytest.skip("rusticl has no usable device here")
    assert done.returncode == 0, done.stdout
    assert json.loads(done.stdout.splitlines()[-1])[1] == digest(reference(name)[0])


TINY = """
import sys
import numpy as np
import simdtex
from cases import REFERENCE, assert_same_bits, ising, texture
from simdtex.machine.devices import find
from simdtex.machine.opencl import OpenCL
from tiny import exact_sizes

exact_sizes()
info = find("oclgrind")
colour, grey = texture((6, 5), 3), texture((7, 6))
few = (np.indices((5, 6)).sum(0) // 2 % 3).astype(np.uint8)
runs = [
    (grey, None, {"order": 1, "levels": 2}),
    (texture((8, 9)), None, {"order": 5, "levels": 2, "search": "exact"}),
    (grey, None, {"order": 2, "levels": 1, "relaxation": "gibbs", "pixel": "density", "boundary": "open"}),
    (colour, -1, {"order": 1, "levels": 2, "edges": "reflect", "pixel": "density", "relaxation": "gibbs"}),
    (grey, None, {"order": 1, "levels": 1, "schedule": "synchronous"}),
    (grey, None, {"order": 1, "levels": 1, "schedule": "luby"}),
    (grey, None, {"order": 1, "levels": 1, "schedule": "block:2x3", "array": "2x2"}),
    (grey, None, {"method": "multires", "alpha": 0.6}),
    (colour, -1, {"method": "multires", "boundary": "open", "parity": "free", "alpha": 0.5}),
    (grey, None, {"method": "pyramid", "iterations": 1, "levels": 1, "orientations": 2}),
    (grey, None, {"method": "pyramid", "iterations": 1, "pyramid": "laplacian", "match": "lookup"}),
]
machines = [OpenCL(info, work_group=3, vector=4), OpenCL(info, items=32)]
for number, (sample, axis, options) in enumerate(runs):
    for machine in machines[: 2 if number in (0, 1, 4) else 1]:
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


def under_oclgrind(folder, code, *arguments, races="1"):
    found = vendors(folder, "oclgrind/liboclgrind-rt-icd.so", "**/liboclgrind-rt-icd.so")
    if found is None:
        (pytest.fail if os.environ.get("SIMDTEX_REQUIRE_OPENCL") else pytest.skip)("Oclgrind is not here")
    variables = {"OCL_ICD_VENDORS": found, "OCLGRIND_DATA_RACES": races}
    return child(code, *arguments, OCLGRIND_CHECK_API="1", PYOPENCL_NO_CACHE="1", **variables)


EVERY = "import runpy; runpy.run_module('tiny', run_name='__main__')"
SLOWEST = ("tileset", "tiles", "classify", "maps")


@pytest.mark.parametrize(
    ("code", "arguments", "races"),
    [
        (TINY, [], "1"),
        (EVERY, [{"vector": 16}], "0"),  # a vector also reads sites that others write, without an effect
        (EVERY, [{"items": 32}, *(name for name in JOBS if name not in SLOWEST)], "0"),
    ],
    ids=["races", "every-job", "items"],
)
def test_no_kernel_races_or_leaves_its_bounds(tmp_path, code, arguments, races):
    done = under_oclgrind(tmp_path, code, *map(str, arguments), races=races)
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
