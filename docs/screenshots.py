# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of docs/live.rst: `python docs/screenshots.py` writes docs/_static/live-*.png.

It needs what the browser tests need: Chromium, its driver and Selenium.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import PIL.Image
from skimage import data

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))

from browsing import browser, drop, live, shown, until  # noqa: E402  # they are beside the tests

OUT = ROOT / "docs" / "_static"
COLOURS = 128
"""Of a screenshot, so that it is small."""


def keep(driver, name):
    """Write what the browser shows."""
    driver.execute_script("return new Promise((done) => setTimeout(done, 400))")
    path = OUT / f"live-{name}.png"
    driver.save_screenshot(str(path))
    with PIL.Image.open(path) as picture:
        picture.convert("RGB").quantize(COLOURS).save(path, optimize=True)
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size // 1024} KiB")


def main():
    with tempfile.TemporaryDirectory() as folder, live() as (_, address), browser(folder, height=900) as driver:
        script = driver.execute_script
        sample = Path(folder) / "tissue.png"
        PIL.Image.fromarray(data.immunohistochemistry()[150:350, 100:300]).save(sample)
        driver.get(address)
        until(lambda: script("return page.said") == "Ready.")

        def made(count):
            until(lambda: script("return page.results.size") == count, 120)

        drop(driver, sample)
        made(1)
        keep(driver, "result")
        script("page.seed = 3; page.make()")
        made(2)
        script("page.showLayer('arrangement')")
        until(lambda: script("return page.seen") == "arrangement")
        keep(driver, "arrangement")
        script("page.go('paint'); page.showLayer('picture'); page.painting.width = 40")
        until(lambda: script("return page.seen") == "picture")
        script(
            "const { brush } = page.painting; brush.begin([90, 160]); brush.add([150, 120]); brush.add([260, 110]);"
            "page.view.draw()"
        )
        keep(driver, "hole")
        shown(driver, width=390, height=844, dark=True)
        script("page.go('make'); page.view.fit(); scrollTo(0, 0)")
        keep(driver, "phone")
        shown(driver, width=1400, height=900)
        ground = Path(folder) / "ground.png"
        textures = [data.brick(), data.grass(), data.gravel()]
        PIL.Image.fromarray(np.hstack([one[:360, :180] for one in textures])).save(ground)
        script("page.setTask('classes'); scrollTo(0, 0)")
        drop(driver, ground)
        until(lambda: script("return page.view.cols") == 540)
        for label in (1, 2, 3):
            script(
                "page.painting.label = arguments[0]; page.painting.width = 24; const x = 180 * arguments[0] - 90;"
                "const { brush } = page.painting;"
                "brush.begin([x, 60]); brush.add([x - 30, 180]); brush.add([x + 30, 300])",
                label,
            )
        before = script("return page.results.size")
        script("page.painting.brush.end()")
        made(before + 1)
        keep(driver, "classes")
        script("page.setTask('more')")
        drop(driver, sample)
        made(before + 2)
        for count, schedule in enumerate(("coloring", "checkerboard"), before + 3):
            script(
                "page.width = page.height = 128;page.options.mrf.values = {schedule: arguments[0]}; page.make()",
                schedule,
            )
            made(count)
        script("page.go('why')")
        until(lambda: script("return page.inside.open"))
        script("page.inside.look(arguments[0])", before + 3)
        until(lambda: script("return page.inside.panes.length") == 2)
        script("page.showLayer('sets')")
        script("page.inside.seek(page.inside.sweeps.findIndex(([level]) => level === 0) + 2, 1)")
        until(lambda: script("return !page.inside.waiting"))
        script("page.inside.pick(60, 64)")
        until(lambda: script("return page.view.panes.every(({why}) => why)"))
        shown(driver, width=1400, height=1500)
        script("scrollTo(0, 0)")
        keep(driver, "inside")


if __name__ == "__main__":
    main()
