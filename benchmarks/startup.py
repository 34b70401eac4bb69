"""What a whole process of ``simdtex synth`` takes, and what its parts take: imports, opening the device, the run.

    python benchmarks/startup.py [--runs 9] [--device TEXT]

Every run is a process of its own, after two that fill the caches of programs; medians of wall-clock time.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from skimage import data

from simdtex.io.image import write

SIZE = "256x256"
PARTS = """
import json, sys, time
laps, began = {}, [time.perf_counter()]
def lap(name):
    began.append(time.perf_counter())
    laps[name] = began[-1] - began[-2]
import numpy
lap("import numpy")
import simdtex.cli.textures, simdtex.io.image, simdtex.jobs.synthesis, simdtex.methods.mrf
lap("import simdtex")
import pyopencl
lap("import pyopencl")
from simdtex.machine import devices, open_machine
devices.devices(probe=False)
lap("find the platforms")
info = devices.find(sys.argv[1] or None)
lap("probe the device")
machine = open_machine(str(info.index))
lap("open the machine")
pixels = simdtex.io.image.read(sys.argv[2]).pixels
lap("read the picture")
made = simdtex.synthesize(pixels, (256, 256), rng=1, device=machine)
lap("run, with loading programs")
simdtex.io.image.write(sys.argv[3], made)
lap("write the picture")
print(json.dumps(laps))
"""


def timed(words: list[str]) -> tuple[float, str]:
    began = time.perf_counter()
    told = subprocess.run([sys.executable, *words], check=True, capture_output=True, text=True).stdout
    return time.perf_counter() - began, told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--device", default="", help="as of the command line")
    arguments = parser.parse_args()

    with tempfile.TemporaryDirectory() as folder:
        sample, output = str(Path(folder, "brick.png")), str(Path(folder, "more.png"))
        write(sample, data.brick()[:128, :128])
        command = ["-m", "simdtex", "synth", sample, "-o", output, "--size", SIZE, "--seed", "1"]
        command += ["--device", arguments.device] if arguments.device else []
        whole, python, laps = [], [], []
        for number in range(arguments.runs + 2):
            seconds, told = timed(command)
            if number >= 2:
                whole.append(seconds)
                python.append(timed(["-c", "pass"])[0])
                laps.append(json.loads(timed(["-c", PARTS, arguments.device, sample, output])[1]))

    print(told.strip())
    print(f"{'the whole process':28s} {median(whole):6.3f} s, at best {min(whole):.3f}")
    parts = {"python itself": median(python)} | {name: median(lap[name] for lap in laps) for name in laps[0]}
    for name, seconds in parts.items():
        print(f"  {name:26s} {seconds:6.3f} s")
    print(f"  {'the rest, and the end':26s} {median(whole) - sum(parts.values()):6.3f} s")


if __name__ == "__main__":
    main()
