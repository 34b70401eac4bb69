"""What it costs to watch a run on the live page, and how quick the page is in a real browser.

    python benchmarks/live.py [--sizes 256 512 1024] [--runs 9] [--device TEXT] [--large 4096]

Runs with and without a page that looks at them take turns; the ratio is that of their medians. Then Chromium drops a
picture on the page, and counts what it sees. The last part opens a large result, zooms and pans, and tells the page's
memory. It needs what the browser tests need.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import PIL.Image
from skimage import data

import simdtex
from simdtex.live.job import Picture
from simdtex.machine import open_machine

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from browsing import browser, drop, until  # noqa: E402  # they are beside the tests
from browsing import live as serving  # noqa: E402
from live import Fake  # noqa: E402

SAMPLE = data.immunohistochemistry()[150:278, 100:228]


def plain(machine, size, seed):
    began = time.perf_counter()
    simdtex.synthesize(SAMPLE, (size, size), channel_axis=-1, rng=seed, device=machine, full_output=True)
    return time.perf_counter() - began


def watched(page, size, seed):
    after = len(page.got)
    message, _ = page.ask("result", kind="make", job="synth", width=size, height=size, seed=seed)
    frames = sum(one["kind"] == "frame" and one["of"] == "run" for one, _ in page.got[after:])
    page.got.clear()
    return message["seconds"], frames


def cost(machine, sizes, runs):
    page = Fake(Picture("sample.png", SAMPLE, -1), machine=machine)
    for size in sizes:
        page.ask("frame", kind="view", left=0, top=0, width=size, height=size)
        alone, seen, frames = [], [], []
        for seed in range(runs + 1):
            order = (0, 1) if seed % 2 else (1, 0)
            for which in order:
                if which:
                    seconds, count = watched(page, size, seed)
                    seen.append(seconds)
                    frames.append(count)
                else:
                    alone.append(plain(machine, size, seed))
        alone, seen, frames = alone[1:], seen[1:], frames[1:]  # the first of each warms up
        share, rate = median(seen) / median(alone), median(frames) / median(seen)
        print(
            f"{size}x{size}: alone {median(alone):.3f} s, watched {median(seen):.3f} s, ratio {share:.3f}; "
            f"{median(frames):.0f} frames, {rate:.1f} a second"
        )
    page.session.close()


WATCH = """
page.marks = [];
const before = page.on_frame.bind(page);
page.on_frame = (message, buffers) => {
  before(message, buffers);
  if (message.of === "run") requestAnimationFrame(() => page.marks.push(performance.now()));
};
"""


def in_a_browser(device, runs, large):
    words = ["--device", device] if device else []
    with tempfile.TemporaryDirectory() as folder, serving(*words) as (_, address), browser(folder) as driver:
        script = driver.execute_script
        path = Path(folder) / "sample.png"
        PIL.Image.fromarray(SAMPLE).save(path)
        driver.get(address)
        until(lambda: script("return page.status.textContent") == "Ready.")
        time.sleep(8)  # its kernels are built
        script(WATCH)
        first, rates = [], []
        for count in range(1, runs + 2):
            script("page.marks.length = 0")
            drop(driver, path)
            until(lambda count=count: script("return page.results.size") == count)
            time.sleep(0.2)
            marks = script("return page.marks.map((one) => one - window.dropped)")
            first.append(marks[0])
            rates.append(1000 * (len(marks) - 1) / (marks[-1] - marks[0]) if len(marks) > 1 else 0)
        print(
            f"from the drop to the first frame on the screen: {median(first[1:]):.0f} ms, at most {max(first[1:]):.0f}"
        )
        print(f"frames a second on the screen at 256x256: median {median(rates[1:]):.1f}, least {min(rates[1:]):.1f}")
        script(f"page.width.value = page.height.value = {large}; page.make()")
        until(lambda: script("return page.results.size") == runs + 2, 1200)
        begun = script("return performance.now()")
        for turn in range(40):
            script(
                "page.view.zoom(arguments[0]); page.view.pan(arguments[1], arguments[1])", 1 if turn % 8 < 4 else -1, 97
            )
            time.sleep(0.1)
        script("page.view.fit()")
        time.sleep(1)
        frame = script("const { width, height } = page.view.panes[0].frame; return [width, height]")
        used = script("return performance.memory.usedJSHeapSize") / 2**20
        took = (script("return performance.now()") - begun) / 1000
        print(
            f"{large}x{large}: 40 zooms and pans in {took:.1f} s; the view has {frame[0]}x{frame[1]} pixels, "
            f"the page {used:.0f} MiB"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="*", default=[256, 512, 1024])
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--device")
    parser.add_argument("--large", type=int, default=4096)
    args = parser.parse_args()
    machine = open_machine(args.device)
    print(machine.name)
    cost(machine, args.sizes, args.runs)
    in_a_browser(args.device, args.runs, args.large)


if __name__ == "__main__":
    main()
