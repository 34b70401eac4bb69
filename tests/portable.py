"""The kernels as clang compiles them for GPUs: the builds of small jobs, their registers and scratch, and LLVM's code.

``python tests/portable.py`` (``make portable``) runs the jobs on an OpenCL device at the settings of GPUs, and writes
what they build, with registers and bytes of scratch, to docs/devices/builds.csv.
"""

import csv
import inspect
import math
import re
import shutil
import struct
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from cases import ising, texture
from runs import RUNS, Run, call, hole, volume

import simdtex
from simdtex.machine import devices
from simdtex.machine.opencl import NONE, OpenCL, kernel_files, kernel_source

TABLE = Path(__file__).resolve().parent.parent / "docs" / "devices" / "builds.csv"
COLUMNS = ("file", "defines", "kernel", "gfx1100 registers", "gfx1100 scratch", "sm_86 local memory")
CLANG = next(filter(None, (shutil.which(f"clang-{version}") for version in range(15, 30))), "")
NO_CLANG = "clang is missing, 15 or newer: apt install clang-15 (Debian 12, Ubuntu)"

LANGUAGE = (
    "-x",
    "cl",
    "-cl-std=CL1.2",
    "-Xclang",
    "-finclude-default-header",
    "-Wno-everything",
    "-Werror=pedantic",
    "-S",
    "-o",
    "-",
    "-",
)
BUILTINS = ("-nogpulib", "-include", str(Path(__file__).with_suffix(".h")))
TARGETS = {
    "amdgcn": ("-target", "amdgcn-amd-amdhsa", "-mcpu=gfx1100", "-O3", *BUILTINS),
    "nvptx": ("-target", "nvptx64-nvidia-nvcl", "-march=sm_86", "-O3", *BUILTINS),
    "spir": ("-target", "spir64", "-emit-llvm", "-gline-tables-only", "-O2"),
}
"""Assembly of GPUs of AMD and NVIDIA, the newest that clang 15 knows, and LLVM's code, for any device."""

SMALL, COLOUR = ((20, 19), (16, 15)), {"channels": 3, "levels": 2}
NAMED = (
    *("defaults", "paper", "mode-colour", "known", "known-lattice", "partly", "categories", "several", "soft-all"),
    *("volume", "volume-data", "known-blocks", "array", "fill-colour", "extend", "multires", "pyramid"),
    *("pyramid-laplacian", "solid", "solid-average", "mix", "maspar", "maspar-mode", "classify", "estimate"),
)
JOBS = {
    **{name: RUNS[name] for name in NAMED},
    "colour": call(simdtex.synthesize, *SMALL, **COLOUR),
    "colour-exact": call(simdtex.synthesize, *SMALL, search="exact", **COLOUR),
    "volume-wide": volume((4, 9, 10), order=8, levels=1),
    "fill": Run(simdtex.fill, lambda: ((texture((14, 15)), hole()), {"levels": 1})),
    "ising": Run(lambda device: ising(device, (8, 8), (2.0,), "coloring", sweeps=1), lambda: ((), {})),
}
"""Small runs that build kernels as default runs do."""


class Build(NamedTuple):
    """A file of kernels and its -D constants, in their order."""

    file: str
    defines: str

    def compiled(self, target: str, vector: int = 1) -> str:
        """Return the assembly, or LLVM's code, for a target, with another constant V."""
        defines = [f"-D{one}" for one in self.defines.replace(" V=1", f" V={vector}").split()]
        if vector > 1:  # a CPU, on which a work-item relaxes a site by itself
            defines = [re.sub("(-DITEMS)=.*", r"\1=1", one) for one in defines]
        words = [CLANG, *TARGETS[target], *defines, *LANGUAGE]
        source = kernel_source(f"{self.file}.cl")
        return subprocess.run(words, input=source, capture_output=True, text=True, check=True).stdout


def builds() -> list[Build]:
    """Return what the jobs build on the preferred device, as if it were a GPU."""
    found, kernel, listed = set(), OpenCL.kernel, devices.devices

    def noted(self, function, defines=NONE):
        constants = " ".join(f"{key}={defines[key]}" for key in sorted(defines))
        found.add(Build(kernel_files()[function], constants))
        return kernel(self, function, defines)

    def pretended(probe=True):
        return [replace(info, kind="gpu") if info.handle else info for info in listed(probe)]

    with patch.object(OpenCL, "kernel", noted), patch.object(devices, "devices", pretended):
        machine = OpenCL(devices.find())
        for run in JOBS.values():
            given, options = run.inputs()
            how = {"rng": 1} if "rng" in inspect.signature(run.function).parameters else {}
            opens = run.function in (simdtex.simulate, simdtex.estimate)  # which take no open machine
            run.function(*given, device=str(machine.info.index) if opens else machine, **options | how)
    return sorted(found)


def sizes(build: Build) -> dict[str, tuple[int, int, int]]:
    """Return the vector registers and scratch of a gfx1100, and the local memory of PTX, of each kernel of a build."""
    amd, ptx = build.compiled("amdgcn"), build.compiled("nvptx")
    assert ".extern .func" not in ptx, "a builtin function that tests/portable.h lacks"
    number = {
        key: re.findall(rf"^ +\.{key}: +(\w+)$", amd, re.MULTILINE)
        for key in ("name", "vgpr_count", "private_segment_fixed_size")
    }
    local = {"entry": {}, "func": {"": 0}}
    parts = re.split(r"^(?:\.visible |\.weak )?\.(entry|func) *(?:\(.*?\) *)?(\w+)\(", ptx, flags=re.MULTILINE)
    for kind, name, body in zip(parts[1::3], parts[2::3], parts[3::3], strict=True):
        local[kind][name] = sum(map(int, re.findall(r"__local_depot\d+\[(\d+)\]", body)))
    called = max(local["func"].values())  # by a kernel, at most
    found = zip(number["name"], number["vgpr_count"], number["private_segment_fixed_size"], strict=True)
    return {name: (int(registers), int(scratch), local["entry"][name] + called) for name, registers, scratch in found}


def recorded() -> dict[Build, dict[str, tuple[int, ...]]]:
    """Return the table, as `sizes` of each build."""
    found = {}
    with TABLE.open(newline="", encoding="utf-8") as file:
        for name, defines, kernel, *numbers in list(csv.reader(file))[1:]:
            found.setdefault(Build(name, defines), {})[kernel] = tuple(map(int, numbers))
    return found


INEXACT = re.compile(r"fmuladd|(sqrt|exp\d*|log\w*|pow|sin|cos|tan|native\w*|half\w*|divide|mad|recip\w*)D?v?\d*[_f]*")
"""Functions whose result OpenCL leaves to the device within some ulp, in names of C++."""


def unsafe(code: str) -> Iterator[tuple[str, int, str]]:
    """Yield each line of LLVM's code whose bits a device may choose, after the file and line that it comes from.

    These are divisions of floats, inexact functions, and sums and differences with a product, which a compiler may
    contract in spite of the pragma. A product with a power of 2 is exact, so that contraction changes nothing.
    """
    marks = dict(re.findall(r"^(!\d+) = (.*)$", code, re.MULTILINE))

    def place(mark: str) -> tuple[str, int]:
        line, at = int(re.search(r"line: (\d+)", marks[mark])[1]), marks[mark]
        while "file: " not in at:
            at = marks[re.search(r"scope: (!\d+)", at)[1]]
        return re.search(r'filename: "([^"]*)"', marks[re.search(r"file: (!\d+)", at)[1]])[1], line

    for body in re.findall(r"^define .*?^}", code, re.MULTILINE | re.DOTALL):
        products = set()
        for result, operation, rest in re.findall(r"^ *(%\S+) = (?:tail )?(\w+) (.*)$", body, re.MULTILINE):
            product = not products.isdisjoint(re.findall(r"%[\w.]+", rest))
            if (operation == "fmul" and not exact(rest)) or (operation == "fneg" and product):
                products.add(result)
            called = re.search(r"@(?:llvm\.|_Z\d+)(\w+)", rest) if operation == "call" else None
            inexact = called and INEXACT.match(called[1])
            if operation in ("fdiv", "frem") or (operation in ("fadd", "fsub") and product) or inexact:
                yield *place(re.search(r"!dbg (!\d+)", rest)[1]), f"{operation} {rest.partition(', !')[0]}"


def exact(product: str) -> bool:
    """Return whether LLVM's code of a product has a factor that is a power of 2."""
    factors = re.findall(r"(?<=[ (])(-?\d\.\d+e[-+]\d+|0x[\dA-F]{16})\b", product)
    values = [struct.unpack(">d", bytes.fromhex(one[2:]))[0] if one[1] == "x" else float(one) for one in factors]
    return bool(values) and all(abs(math.frexp(value)[0]) == 0.5 for value in values)


def main() -> None:
    """Write the table."""
    if not CLANG:
        raise SystemExit(NO_CLANG)
    TABLE.parent.mkdir(exist_ok=True)
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for build in builds():
            table.writerows([*build, kernel, *numbers] for kernel, numbers in sizes(build).items())


if __name__ == "__main__":
    main()
