# SPDX-License-Identifier: BSD-3-Clause
"""Count the functions of the package that a default ``simdtex synth`` calls, and how deep the calls nest.

    python benchmarks/trace.py [--list]

Runs ``simdtex synth sample.png -o out.png`` in this process through `simdtex.__main__.main`, the installed command, on
128x128 pixels of brick (the output is 256x256). Prints one line:

- the number of distinct code objects of the package, by file and qualified name, that are called on any thread from the
  import of the package on, first with and then without lambdas, comprehensions and generator expressions. The bodies of
  classes count, the bodies of modules do not; the third number leaves the bodies of classes out as well;
- the number of files they are in;
- the largest number of frames of the package on one thread's stack, modules included.

The command's own output goes to stderr.
"""

import argparse
import contextlib
import importlib.util
import inspect
import sys
import tempfile
import threading
from itertools import groupby
from pathlib import Path

from PIL import Image
from skimage import data


class Tracer:
    """A profile function that records the package's code objects and the depth of its frames."""

    def __init__(self):
        self.package = Path(importlib.util.find_spec("simdtex").origin).parent
        self.called, self.depth = {}, 0

    def __call__(self, frame, event, _):
        prefix = f"{self.package}/"
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(prefix):
            return
        if code.co_name != "<module>":
            self.called[code.co_filename.removeprefix(prefix), code.co_qualname] = code
        depth = 0
        while frame:
            depth += frame.f_code.co_filename.startswith(prefix)
            frame = frame.f_back
        self.depth = max(self.depth, depth)


def traced(sample, output):
    """A `Tracer` of ``simdtex synth SAMPLE -o OUTPUT``."""
    tracer, sys.argv = Tracer(), ["simdtex", "synth", str(sample), "-o", str(output)]
    threading.setprofile(tracer)
    sys.setprofile(tracer)
    try:
        from simdtex.__main__ import main as simdtex

        with contextlib.redirect_stdout(sys.stderr), contextlib.suppress(SystemExit):
            simdtex()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return tracer


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", action="store_true", help="also print the functions, by file")
    wanted = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sample, output = Path(folder, "sample.png"), Path(folder, "out.png")
        Image.fromarray(data.brick()[:128, :128]).save(sample)
        tracer = traced(sample, output)
        if not output.exists():
            sys.exit("the run failed")
    named = [code for code in tracer.called.values() if not code.co_name.startswith("<")]
    functions = sum(bool(code.co_flags & inspect.CO_OPTIMIZED) for code in named)
    files = {file for file, _ in tracer.called}
    print(
        f"{len(tracer.called)} functions and class bodies ({len(named)} without comprehensions and lambdas, "
        f"{functions} without class bodies too) in {len(files)} files, {tracer.depth} deep"
    )
    if wanted.list:
        for file, group in groupby(sorted(tracer.called), key=lambda key: key[0]):
            print(file)
            for _, name in group:
                print(f"    {name}")


if __name__ == "__main__":
    main()
