# SPDX-License-Identifier: BSD-3-Clause
"""Check the built documentation: `python docs/check.py docs/_build/html`, which `make docs` does.

Every link within the pages leads to a page and a place on it, and no page loads anything from elsewhere. Where
Chromium, its driver and Selenium are installed, a browser without a network opens the pages: formulas are drawn, the
search finds pages, no line of code runs out of its box, and at the width of a phone no page scrolls sideways.
"""

import argparse
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from browsing import browser, missing  # they are beside the tests

PHONE = 390
"""Width of a phone in CSS pixels."""

LOADING = {"img": "src", "script": "src", "link": "href", "iframe": "src", "source": "src", "video": "src"}
"""Elements that make a browser load something, and the attribute that says what."""


class Page(HTMLParser):
    """What a page links to, what it loads, and the places on it."""

    def __init__(self, path):
        super().__init__()
        self.path, self.links, self.loads, self.places = path, [], [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        told = dict(attributes)
        self.places |= {told[name] for name in ("id", "name") if told.get(name)}
        if tag == "a" and told.get("href"):
            self.links.append(told["href"])
        if tag in LOADING and told.get(LOADING[tag]) and told.get("rel") not in ("canonical", "index", "search"):
            self.loads.append(told[LOADING[tag]])
        self.loads += [one.split()[0] for one in (told.get("srcset") or "").split(",") if one.split()]


def pages(folder):
    """Every page by its path."""
    return {path.resolve(): Page(path) for path in sorted(folder.rglob("*.html")) if "_static" not in path.parts}


def broken(found):
    """Sentences about links and pictures that lead nowhere."""
    faults = []
    for path, page in found.items():
        for link in [*page.links, *page.loads]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            there = there / "index.html" if there.is_dir() else there
            place = unquote(parts.fragment)
            if not there.is_file():
                faults.append(f"{path.name}: there is no {link}")
            elif place and there in found and place not in found[there].places:
                faults.append(f"{path.name}: {there.name} has no place {place!r}")
    return faults


def elsewhere(folder, found):
    """Sentences about what a page or a style sheet loads from another host."""
    faults = [
        f"{path.name} loads {load}"
        for path, page in found.items()
        for load in page.loads
        if urlsplit(load).netloc or urlsplit(load).scheme not in ("", "data")
    ]
    for sheet in folder.rglob("*.css"):
        for load in re.findall(r"(?:url\(|@import )[\"']?((?:https?:)?//[^\"')]+)", sheet.read_text("utf-8")):
            faults.append(f"{sheet.name} loads {load}")
    return faults


WIDER = """
const room = document.documentElement.clientWidth;
if (document.documentElement.scrollWidth <= room) return "";
const wide = [...document.querySelectorAll("body *")].filter(e => e.getBoundingClientRect().right > room + 1);
return `${document.documentElement.scrollWidth} px: ` + wide.slice(-1).map(e => e.outerHTML.slice(0, 120));
"""


def sideways(folder, width=PHONE):
    """Sentences about pages that scroll sideways at this width."""
    faults = []
    with browser(width=width, height=844) as driver:
        for path in pages(folder):
            driver.get(path.as_uri())
            wide = driver.execute_script(WIDER)
            if wide:
                faults.append(f"{path.name} is wider than {width} px: {wide}")
    return faults


SLOW = ("GL Driver Message (OpenGL, Performance", "fallback to software WebGL")
"""What a browser without a GPU says about canvases."""

LONG = """
const wide = [...document.querySelectorAll("article pre")].filter(e => e.scrollWidth > e.clientWidth + 1);
return wide.map(e => e.innerText.split("\\n").reduce((a, b) => a.length < b.length ? b : a).slice(0, 120));
"""


def opened(folder, words=("temperature", "neighbourhood", "seamless")):
    """Sentences about flat formulas, code wider than its box, loads that fail, and words that no search finds."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait

    faults = []
    with browser(width=1280, height=900) as driver:
        for path in pages(folder):
            driver.get(path.as_uri())
            flat = driver.execute_script(
                "return [...document.querySelectorAll('math')].filter(e => e.getBoundingClientRect().height < 5).length"
            )
            if flat:
                faults.append(f"{path.name}: {flat} formulas are not drawn")
            faults += [f"{path.name}: code runs out of its box: {line}" for line in driver.execute_script(LONG)]
            said = [entry["message"] for entry in driver.get_log("browser")]
            faults += [f"{path.name}: {one}" for one in said if not any(about in one for about in SLOW)]
        for word in words:
            driver.get(f"{(folder / 'search.html').resolve().as_uri()}?q={word}")
            hits = WebDriverWait(driver, 20).until(
                lambda d: (
                    d.find_elements(By.CSS_SELECTOR, "#search-results ul.search li a")
                    or "did not match any" in d.page_source
                )
            )
            if hits is True:
                faults.append(f"the search does not find {word!r}")
    return faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the pages are")
    parser.add_argument("--without-browser", action="store_true", help="only what needs no browser")
    args = parser.parse_args()
    found = pages(args.folder)
    if not found:
        sys.exit(f"there are no pages in {args.folder}")
    faults = [*broken(found), *elsewhere(args.folder, found)]
    why = "not asked for" if args.without_browser else missing()
    if why:
        print(f"Not checked in a browser: {why}.")
    else:
        faults += [*opened(args.folder), *sideways(args.folder)]
    print(
        "\n".join(dict.fromkeys(faults))
        or f"{len(found)} pages: every link leads somewhere, nothing is loaded from elsewhere."
    )
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
