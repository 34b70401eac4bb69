"""A browser and a live page for it: what browser tests, the screenshots of the docs and the benchmark share."""

import base64
import os
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

AXE = Path(__file__).parent / "browser" / "node_modules" / "axe-core" / "axe.min.js"
"""`make browser` fetches it."""

DROP = """
const [files, place] = arguments;
const transfer = new DataTransfer();
for (const [name, data] of files) {
  const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
  transfer.items.add(new File([bytes], name, { type: "image/png" }));
}
const target = document.querySelector(place);
window.dropped = performance.now();
target.dispatchEvent(new DragEvent("drop", { dataTransfer: transfer, bubbles: true, cancelable: true }));
"""


def missing():
    """What a browser lacks here, in words; empty where it lacks nothing."""
    try:
        import selenium  # noqa: F401
    except ModuleNotFoundError:
        return "Selenium is not installed (pip install 'simdtex[test]')"
    if not chromium() or not shutil.which("chromedriver"):
        return "Chromium and its driver are not installed (Debian: apt install chromium chromium-driver)"
    return ""


def chromium():
    found = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome"))
    return next(filter(None, found), None)


@contextmanager
def browser(folder=None, *, width=1400, height=1000, dark=False):
    """Chromium that reaches no host but this machine; downloads go into a folder."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = chromium()
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    kept = {"download.default_directory": str(folder), "profile.default_content_setting_values.automatic_downloads": 1}
    options.add_experimental_option("prefs", kept if folder else {})
    rules = "host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
    for argument in ("headless=new", "no-sandbox", rules, "disable-dev-shm-usage", "hide-scrollbars"):
        options.add_argument(f"--{argument}")
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        shown(driver, width=width, height=height, dark=dark)
        yield driver
    finally:
        driver.quit()


def shown(driver, *, width, height=1000, dark=False):
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})


@contextmanager
def live(*words, **environment):
    """``simdtex live`` in a process of its own: the process, and the page's address."""
    process = subprocess.Popen(
        [sys.executable, "-m", "simdtex", "live", "--no-browser", *words],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | environment,
    )
    try:
        yield process, process.stdout.readline().split()[0]
    finally:
        process.kill()
        process.communicate()


def drop(driver, *paths, place=".simdtex"):
    files = [[Path(path).name, base64.b64encode(Path(path).read_bytes()).decode()] for path in paths]
    driver.execute_script(DROP, files, place)


def until(found, timeout=90):
    """Wait until something is so; what it is."""
    end = time.monotonic() + timeout
    while True:
        if value := found():
            return value
        if time.monotonic() > end:
            raise AssertionError(f"it is not so within {timeout} s: {found}")
        time.sleep(0.02)
