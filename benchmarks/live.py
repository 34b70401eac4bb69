# SPDX-License-Identifier: BSD-3-Clause
"""What it costs to watch a run on the live page, and how quick the page is in a real browser.

    python benchmarks/live.py [--sizes 256 512 1024] [--runs 9] [--device TEXT] [--large 4096]

Runs with and without a page that looks at them take turns; the ratio is that of their medians. Then Chromium drops a
picture on the page, and counts what it sees. The last part opens a large result, zooms and pans, and tells the page's
memory. It needs what the browser tests need.
"""

import sys
import tempfile
import time
from functools import partial
from itertools import count
from pathlib import Path
from statistics import median

import common
from skimage import data

import simdtex
from simdtex.io.image import write
from simdtex.live.job import Picture

sys.path.insert(0, str(common.DOCS.parent / "tests"))

from browsing import browser, drop, until  # they are beside the tests
from browsing import live as serving
from live import Fake

SAMPLE = data.immunohistochemistry()[150:278, 100:228]


def watched(page, size, seeds):
    """Seconds of a run on the page, and the frames that it sent."""
    after = len(page.got)
    message, _ = page.ask("result", kind="make", job="synth", width=size, height=size, seed=next(seeds))
    frames = sum(one["kind"] == "frame" and one["of"] == "run" for one, _ in page.got[after:])
    page.got.clear()
    return message["seconds"], frames


def cost(machine, sizes, runs):
    page = Fake(Picture("sample.png", SAMPLE, -1), machine=machine)
    given = {"channel_axis": -1, "device": machine, "full_output": True}
    for size in sizes:
        page.ask("frame", kind="view", left=0, top=0, width=size, height=size)
        run, seeds = partial(common.timed, simdtex.synthesize, SAMPLE, (size, size), **given), count()
        jobs = {"alone": lambda run=run, seeds=seeds: run(rng=next(seeds))[1]}
        found = common.in_turns(runs, jobs | {"watched": partial(watched, page, size, count())})
        alone, seen, frames = (median(each) for each in (found["alone"], *zip(*found["watched"], strict=True)))
        times = f"alone {alone:.3f} s, watched {seen:.3f} s, ratio {seen / alone:.3f}"
        print(f"{size}x{size}: {times}; {frames:.0f} frames, {frames / seen:.1f} a second")
    page.session.close()


WATCH = """
page.marks = [];
const before = page.on_frame.bind(page);
page.on_frame = (message, buffers) => {
  before(message, buffers);
  if (message.of === "run") requestAnimationFrame(() => page.marks.push(performance.now()));
};
"""


def dropped(driver, path, numbers):
    """Drop a picture; return the milliseconds to the first frame, and the frames a second."""
    script, number = driver.execute_script, next(numbers)
    script("page.marks.length = 0")
    drop(driver, path)
    until(lambda: script("return page.results.size") == number)
    time.sleep(0.2)
    marks = script("return page.marks.map((one) => one - window.dropped)")
    return marks[0], 1000 * (len(marks) - 1) / (marks[-1] - marks[0]) if len(marks) > 1 else 0


def in_a_browser(device, runs, large):
    words = ["--device", device] if device else []
    with tempfile.TemporaryDirectory() as folder, serving(*words) as (_, address), browser(folder) as driver:
        script = driver.execute_script
        path = Path(folder) / "sample.png"
        write(path, SAMPLE)
        driver.get(address)
        until(lambda: script("return page.status.textContent") == "Ready.")
        time.sleep(8)  # its kernels are built
        script(WATCH)
        found = common.in_turns(runs, {"": partial(dropped, driver, path, count(1))})[""]
        first, rates = zip(*found, strict=True)
        print(f"from the drop to the first frame on the screen: {median(first):.0f} ms, at most {max(first):.0f}")
        print(f"frames a second on the screen at 256x256: median {median(rates):.1f}, least {min(rates):.1f}")
        script(f"page.width.value = page.height.value = {large}; page.make()")
        until(lambda: script("return page.results.size") == runs + 2, 1200)
        began = time.perf_counter()
        for turn in range(40):
            way = 1 if turn % 8 < 4 else -1
            script("page.view.zoom(arguments[0]); page.view.pan(arguments[1], arguments[1])", way, 97)
            time.sleep(0.1)
        script("page.view.fit()")
        time.sleep(1)
        took = time.perf_counter() - began
        width, height = script("const { width, height } = page.view.panes[0].frame; return [width, height]")
        used = script("return performance.memory.usedJSHeapSize") / 2**20
        seen = f"the view has {width}x{height} pixels, the page {used:.0f} MiB"
        print(f"{large}x{large}: 40 zooms and pans in {took:.1f} s; {seen}")


@common.command
def main(sizes=(256, 512, 1024), runs=9, device=None, large=4096):
    machine = simdtex.open_machine(device)
    print(machine.name)
    cost(machine, sizes, runs)
    in_a_browser(device, runs, large)


if __name__ == "__main__":
    main()
