"""The live page in a real browser: what people do with it, by the keyboard too, and how it fails."""

import os
import shlex
import shutil
import subprocess
import sys
import zipfile
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from browsing import AXE, browser, drop, live, missing, shown, until
from live import png, striped, texture

import simdtex
from simdtex.io.image import example
from simdtex.live import script, style

REQUIRE = "SIMDTEX_REQUIRE_BROWSER"
ROOT = Path(__file__).resolve().parents[2]
TOKEN = "a-token-for-the-browser"
LACKS = missing() or ("" if AXE.exists() else "axe-core is not installed (make browser, which needs npm)")
if LACKS and os.environ.get(REQUIRE):
    raise RuntimeError(f"{REQUIRE} is set, and {LACKS}")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(LACKS), reason=f"no test in a browser: {LACKS}"),
    pytest.mark.xdist_group("browser"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # Selenium's own connections
]
if not LACKS:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import Select


@pytest.fixture(scope="module")
def served():
    with live(SIMDTEX_LIVE_TOKEN=TOKEN) as (_, address):
        yield address


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    folder = tmp_path_factory.mktemp("downloads")
    with browser(folder) as driver:
        driver.folder = folder
        yield driver


class Page:
    def __init__(self, driver, address):
        self.driver, self.folder = driver, driver.folder
        driver.switch_to.new_window("tab")
        self.handle = driver.current_window_handle
        shown(driver, width=1400)
        driver.get(address)
        until(lambda: self.script("return Boolean(window.page && window.page.ready)"))

    def all(self, selector):
        return self.driver.find_elements(By.CSS_SELECTOR, selector)

    def one(self, selector):
        (found,) = self.all(selector)
        return found

    def labelled(self, text):
        label = self.driver.find_element(By.XPATH, f"//label[normalize-space()='{text}']")
        return self.driver.find_element(By.ID, label.get_attribute("for"))

    def button(self, text):
        return self.driver.find_element(By.XPATH, f"//button[normalize-space()='{text}']")

    def script(self, text, *arguments):
        return self.driver.execute_script(text, *arguments)

    @property
    def status(self):
        found = self.all("[role=status]")
        return found[0].text if found else ""

    @property
    def alert(self):
        return self.one("[role=alert]").text

    @property
    def results(self):
        return len(self.all(".strip li:not(.current)"))

    def result(self, number, timeout=120):
        until(lambda: self.results == number, timeout)

    def put(self, label, value):
        field = self.labelled(label)
        self.script("arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('change'))", field, value)

    def choose(self, label, text):
        Select(self.labelled(label)).select_by_visible_text(text)

    def download(self, name):
        """Download a file of the result: its bytes."""
        self.script("arguments[0].click()", self.one(f".result [data-file='{name}']"))
        path = self.folder / name
        until(lambda: path.exists() and path.stat().st_size)
        data = path.read_bytes()
        path.unlink()
        return data

    @property
    def command(self):
        return shlex.split(self.one("[aria-label='Command line']").get_attribute("textContent"))

    def assert_command_repeats(self, folder):
        """The command line, where the sample is, writes the result's bytes."""
        subprocess.run([sys.executable, "-m", *self.command, "--quiet"], cwd=folder, check=True, timeout=120)
        output = self.command[self.command.index("-o") + 1]
        assert (folder / output).read_bytes() == self.download(output)

    def canvas(self):
        """What the view shows, (rows, cols, 4)."""
        size, data = self.script(
            "const c = document.querySelector('canvas.view'); const d = c.getContext('2d').getImageData(0, 0, c.width, "
            "c.height).data; return [[c.height, c.width], Array.from(d)]"
        )
        return np.array(data, np.uint8).reshape(*size, 4)

    def paint(self, label, left, top, right, bottom):
        """Draw a stroke with the mouse, from one pixel of the layer to another."""
        self.one(f".tools [aria-label='{label}']").click()
        canvas = self.one("canvas.view")
        x, y, unit = self.script("return [page.view.left, page.view.top, page.view.unit]")
        start = [int((left - x) * unit - canvas.size["width"] / 2), int((top - y) * unit - canvas.size["height"] / 2)]
        move = ActionChains(self.driver).move_to_element_with_offset(canvas, *start).click_and_hold()
        move.move_by_offset(int((right - left) * unit), int((bottom - top) * unit)).release().perform()

    def sees(self, picture):
        """Whether the view shows these pixels, (rows, cols, 3), as they are."""
        zoom = self.script(
            "const v = page.view, zoom = Math.max(1, Math.floor(v.unit));"
            "const least = (all, side) => Math.round((all - side / zoom) / 2);"
            "const [left, top] = [least(v.cols, v.canvas.width), least(v.rows, v.canvas.height)];"
            "Object.assign(v, {unit: zoom, fitted: false, left, top}); v.panes[0].frame = null; v.moved(); return zoom"
        )
        until(lambda: self.script("return page.view.panes[0].frame && !page.view.drawing"))
        seen = self.canvas()
        rows, cols = (zoom * side for side in picture.shape[:2])
        top, left = (seen.shape[0] - rows) // 2, (seen.shape[1] - cols) // 2
        shown_there = seen[top - zoom : top + rows + zoom, left - zoom : left + cols + zoom, :3]
        wanted = picture.repeat(zoom, 0).repeat(zoom, 1)
        windows = np.lib.stride_tricks.sliding_window_view(shown_there, wanted.shape)
        return bool((windows == wanted).all((-3, -2, -1)).any())

    def faults(self):
        self.script(AXE.read_text(encoding="utf-8"))
        found = self.driver.execute_async_script("const done = arguments[0]; axe.run(document).then(done)")
        return [f"{one['id']}: {node['html'][:150]}" for one in found["violations"] for node in one["nodes"]]


@pytest.fixture
def page(chromium, served):
    first = chromium.current_window_handle
    found = Page(chromium, served)
    yield found
    for handle in set(chromium.window_handles) - {first}:
        chromium.switch_to.window(handle)
        chromium.close()
    chromium.switch_to.window(first)


@pytest.fixture
def wall(tmp_path):
    path = tmp_path / "wall.png"
    path.write_bytes(png(texture(64, 72)))
    return path


@pytest.fixture
def made(page, wall):
    """A page with the result of a dropped picture."""
    drop(page.driver, wall)
    page.result(1)
    return page


@contextmanager
def beside(page, address):
    other = Page(page.driver, address)
    try:
        yield other
    finally:
        other.driver.close()
        other.driver.switch_to.window(page.handle)


def test_a_dropped_picture_gives_the_bytes_of_the_command_line(page, wall):
    drop(page.driver, wall)
    page.result(1)
    width, height = (int(page.labelled(f"Result {side}").get_attribute("value")) for side in ("width", "height"))
    assert abs(width - 144) < 15 and abs(height - 128) < 15, "twice the sample, or a size near it that its lattice fits"
    assert page.command[:5] == ["simdtex", "synth", "wall.png", "-o", "texture.png"]
    page.assert_command_repeats(wall.parent)
    assert f"{width} \u00d7 {height} in " in page.one(".doing").text
    assert page.sees(np.array(PIL.Image.open(wall.parent / "texture.png"))), "the pixels are seen as they are"


def test_a_run_pauses_resumes_and_is_cancelled(made, wall):
    made.script("page.auto = false")
    made.put("Result width", 700)
    made.put("Result height", 700)
    made.button("Make the texture").click()
    until(lambda: made.script("return page.running"))
    made.button("Pause").click()
    until(lambda: made.status == "Paused.")

    def still():
        before = made.script("return page.frames")
        made.script("return new Promise((done) => setTimeout(done, 700))")
        return made.script("return page.frames") == before

    until(still)  # once what was on its way has arrived
    assert made.results == 1
    Select(made.labelled("Layer")).select_by_value("temperature")
    until(lambda: made.script("return page.seen") == "temperature")
    made.button("Resume").click()
    made.result(2)
    made.assert_command_repeats(wall.parent)
    made.put("Result height", 4000)
    made.button("Make the texture").click()
    until(lambda: made.script("return page.running"))
    made.button("Cancel").click()
    until(lambda: made.status == "Cancelled.")
    assert made.results == 2


def test_a_painted_hole_is_filled_and_nothing_else_changes(made):
    made.button("Paint").click()
    until(lambda: made.one(".tools").is_displayed())
    canvas = made.one("canvas.view")
    ActionChains(made.driver).move_to_element(canvas).click_and_hold().move_by_offset(30, 20).release().perform()
    made.button("Fill the hole").click()
    made.result(2)
    with zipfile.ZipFile(BytesIO(made.download("texture.zip"))) as archive:
        hole, before, after = (
            np.array(PIL.Image.open(archive.open(name))) for name in ("hole.png", "result-1.png", "texture.png")
        )
    assert 0 < (hole > 0).mean() < 0.2
    assert (before[hole == 0] == after[hole == 0]).all()
    assert (before[hole > 0] != after[hole > 0]).any()


def test_painted_classes_are_labelled_and_strokes_undone(page, tmp_path):
    page.script("page.setTask('classes')")
    (tmp_path / "ground.png").write_bytes(png(striped()))
    drop(page.driver, tmp_path / "ground.png")
    until(lambda: page.one(".hint").text.startswith("No label is painted yet; paint over two or more textures"))
    until(lambda: page.script("return page.view.cols") == 96)
    page.paint("Label 1", 20, 10, 20, 38)
    until(lambda: page.one(".hint").text.startswith("Only label 1 is painted;"))
    page.paint("Label 3", 60, 10, 60, 38)
    page.result(1)
    assert not page.one(".hint").text and not page.all("[role=alert]:not([hidden])")
    page.paint("Label 3", 50, 10, 70, 10)
    page.result(2)
    ActionChains(page.driver).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform()
    page.result(3)  # without the last stroke
    page.button("Redo").click()
    page.result(4)
    (tmp_path / "strokes.png").write_bytes(page.download("strokes.png"))
    page.assert_command_repeats(tmp_path)
    labels, painted = (np.array(PIL.Image.open(tmp_path / f"{name}.png")) for name in ("labels", "strokes"))
    assert set(np.unique(painted)) == {0, 1, 3} and painted[10, 50] == painted[38, 60] == 3
    wanted = zip(("Unknown", "Label 1", "Label 3"), [(labels == label).mean() for label in (0, 1, 3)], strict=True)
    assert page.one(".classes").text.split("\n") == [f"{name}: {100 * share:.1f} %" for name, share in wanted]


def test_everything_is_done_by_the_keyboard_alone(page):
    def keys(*what):
        ActionChains(page.driver).send_keys(*what).perform()

    def focused():
        return page.driver.switch_to.active_element

    def tab_to(found, most=80, back=False):
        for _ in range(most):
            keys(*[Keys.SHIFT] * back, Keys.TAB, *[Keys.NULL] * back)
            if found(focused()):
                return
        raise AssertionError("the keyboard does not get there")

    tab_to(lambda one: one.text == "brick")
    keys(Keys.ENTER)
    page.result(1)
    tab_to(lambda one: one.get_attribute("aria-label") == "Zoom in")
    scale = page.script("return page.view.unit")
    keys(Keys.ENTER)
    assert page.script("return page.view.unit") > scale
    tab_to(lambda one: one.tag_name == "canvas")
    left = page.script("return page.view.left")
    keys(Keys.ARROW_RIGHT)
    assert page.script("return page.view.left") > left
    keys("0")
    assert page.script("return page.view.unit") == scale
    tab_to(lambda one: one.text == "Paint", back=True)
    keys(Keys.ENTER)
    until(lambda: page.button("Fill the hole"))
    tab_to(lambda one: one.tag_name == "canvas")
    keys(" ", Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_DOWN, " ")
    assert len(page.script("return page.painting.strokes.hole[0].points")) == 4
    tab_to(lambda one: one.text == "Fill the hole")
    keys(Keys.ENTER)
    page.result(2)
    tab_to(lambda one: one.get_attribute("data-file") == "texture.png")
    keys(Keys.ENTER)
    until(lambda: list(page.folder.glob("texture*.png"))).pop().unlink()


def test_a_killed_server_is_told_and_a_new_one_is_given_the_picture_and_its_map(chromium, wall, tmp_path):
    (tmp_path / "normal.png").write_bytes(png(texture(64, 72, seed=5)))
    with live("--device", "reference", SIMDTEX_LIVE_TOKEN=TOKEN) as (process, address):
        page = Page(chromium, address)
        port = address.split(":")[2].split("/")[0]
        drop(page.driver, wall)
        until(lambda: page.script("return Boolean(page.picture)"))
        page.script("page.method = 'pyramid'; page.width = page.height = 32; page.make()")
        drop(page.driver, tmp_path / "normal.png", place=".maps")
        until(lambda: len(page.all(".maps li")) == 1)
        process.kill()
        until(lambda: page.alert.startswith("The connection to simdtex is lost."))
        assert page.status == "Not connected."
    with live("--device", "reference", "--port", port, SIMDTEX_LIVE_TOKEN=TOKEN) as (process, _):
        until(lambda: page.results)
        assert page.one(".maps li").get_attribute("textContent").startswith("normal")
        assert not page.all("[role=alert]:not([hidden])")
        page.driver.refresh()
        until(lambda: page.script("return Boolean(window.page && page.picture)"))
        process.kill()
        until(lambda: page.alert)
    with live("--device", "reference", "--port", port, SIMDTEX_LIVE_TOKEN=TOKEN):
        until(lambda: "give the picture again" in page.alert)  # the page that was loaded again has no file
        assert page.one(".start").is_displayed() and not page.one(".columns").is_displayed()
    chromium.close()
    chromium.switch_to.window(chromium.window_handles[0])


def test_a_page_that_loses_its_connection_keeps_what_is_not_asked_for_yet(made):
    made.script("page.auto = false")
    made.script("page.setPart([8, 4, 50, 60])")
    made.script("page.painting.change({sample: [{label: 1, width: 9, points: [[9, 9]]}], output: [], hole: []})")
    made.put("Coherence", 1.5)
    made.script("page.connection.socket.close()")
    until(lambda: made.status == "Not connected.")
    until(lambda: made.status == "Result 1 is ready." and "seed" in made.one(".doing").text)
    assert made.script("return page.layer") == "picture"
    assert made.script("return [page.part, page.painting.strokes.sample.length]") == [[8, 4, 50, 60], 1]
    assert made.labelled("Coherence").get_attribute("value") == "1.5"


def test_a_finger_scrolls_the_page_and_chooses_a_part_if_it_is_to(made):
    shown(made.driver, width=390, height=700)
    made.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})

    def swipe(selector, across=1, down=-3):
        made.script("arguments[0].scrollIntoView({block: 'center'})", made.one(selector))
        box = made.script("return arguments[0].getBoundingClientRect().toJSON()", made.one(selector))
        before = made.script("return scrollY")
        x, y = box["x"] + 20, box["y"] + box["height"] / 2
        moves = [("Move", [{"x": x + across * i, "y": y + down * i}]) for i in range(1, 30)]
        for kind, points in [("Start", [{"x": x, "y": y}]), *moves, ("End", [])]:
            made.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})
        made.script("return new Promise((done) => setTimeout(done, 200))")
        return made.script("return scrollY") - before

    try:
        made.script("document.querySelector('.columns').style.paddingBottom = '900px'")
        for selector in ("canvas.preview", "canvas.view"):
            assert swipe(selector) > 30, selector
            swipe(selector, across=2, down=-1)
        assert made.script("return [page.part, page.view.fitted]") == [None, True]
        made.script("page.chooseByFinger(true)")
        assert abs(swipe("canvas.preview")) < 30  # what stands above it may have changed its height
        assert made.script("return page.part") is not None
        made.result(2)
    finally:
        made.driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})


def test_the_page_begins_with_a_place_to_drop_a_picture_and_examples(page, wall):
    assert page.one(".start").is_displayed() and not page.one(".columns").is_displayed() and page.faults() == []
    assert [one.text for one in page.all(".examples button")] == ["tissue", "brick", "grass", "gravel"]
    drop(page.driver, wall, place=".start")
    page.result(1)
    assert not page.one(".start").is_displayed()


def test_sizes_and_seeds_are_chosen_and_results_say_what_changed(made):
    made.script("page.auto = false")
    made.script("arguments[0].click()", made.one("[aria-label='256 \u00d7 256']"))
    made.script("arguments[0].click()", made.button("Four seeds"))
    made.result(5)
    seeds = made.script("return [...page.results.values()].map(({settings}) => settings.seed)")
    assert len(set(seeds)) == 5 and np.ptp(seeds[1:]) == 3
    captions = [one.text.split(", ", 1)[1] for one in made.all(".strip li:not(.current) button:first-child span")]
    changes = [f"256 \u00d7 256, seed {seeds[1]}", *(f"seed {seed}" for seed in seeds[2:])]
    assert captions == ["More of the texture", *changes]
    made.script("arguments[0].click()", made.one("[aria-label='Delete result 5']"))
    until(lambda: made.results == 4 and made.script("return page.shown") == 4)
    made.script("page.options.mrf.values = {finish: 99}; page.make()")
    until(lambda: made.alert.startswith("Soften seams (finish) is 99; "))


def test_dropped_files_are_one_material(page, tmp_path):
    paths = [tmp_path / f"wall_{role}.png" for role in ("normal", "albedo", "height")]
    for seed, path in enumerate(paths):
        path.write_bytes(png(texture(64, 72, seed=seed)))
    drop(page.driver, *paths)
    page.result(1)
    assert page.script("return [page.picture.name, page.maps]") == ["wall_albedo.png", ["wall-normal", "wall-height"]]
    until(lambda: "map wall-height" in page.script("return page.found ? page.found.layers : []"))
    paths[0].write_bytes(png(texture(32, 32)))
    drop(page.driver, paths[0], place=".maps")
    until(lambda: page.alert.startswith("Wall_normal.png is 32x32 and the picture 72x64"))
    assert page.script("return page.maps.length") == 2


def test_it_keeps_nobody_out_fits_everywhere_and_loads_nothing_from_elsewhere(page, wall, served):
    page.driver.get_log("browser")
    drop(page.driver, wall)
    page.result(1)
    loaded = page.script("return performance.getEntriesByType('resource').map((one) => one.name)")
    assert {name.rsplit("/", 1)[0] for name in loaded} == {served.rstrip("/")}
    assert page.driver.get_log("browser") == [], "nothing is complained of"
    controls = page.all("button, input, select, summary, textarea, a[href], [tabindex]")
    assert len(controls) > 30 and all(one.get_attribute("data-lm-suppress-shortcuts") is not None for one in controls)
    page.script("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    for dark in (False, True):
        shown(page.driver, width=1400, dark=dark)
        assert page.faults() == []
    for window, cell in ((320, None), (820, None), (1400, 300)):  # of a notebook
        shown(page.driver, width=window)
        page.script(f"document.getElementById('simdtex-live').style.width = '{cell}px'" if cell else "")
        scrolled = "document.querySelector('.simdtex')" if cell else "document.documentElement"
        until(lambda: page.script("return !page.view.drawing"))
        assert page.script(f"return {scrolled}.scrollWidth") <= (cell or window)
        assert page.script("return document.querySelector('canvas.view').clientWidth") > 0.4 * min(cell or window, 800)


# -- a look inside a run


@pytest.fixture
def inside(page):
    """A page with two results that differ in their schedule, looked into."""
    page.button("grass").click()
    page.result(1)
    small = "page.width = page.height = 48; page.options.mrf.values = {order: 4%s}; page.make()"
    page.script(small % "")
    page.result(2)
    page.script(small % ", schedule: 'checkerboard'")
    page.result(3)
    page.button("Why").click()
    until(lambda: page.script("return page.inside.open"))
    return page


def explained(page, pane=0):
    until(lambda: page.script("return Boolean(page.view.panes[arguments[0]].why)", pane))
    return page.script("return page.view.panes[arguments[0]].why", pane)


def at(page):
    until(lambda: page.script("return !page.inside.waiting && !page.inside.late"))
    return page.script("return page.inside.at")


def test_a_click_explains_a_pixel(inside):
    canvas = inside.one("canvas.view")
    inside.script("page.view.zoom(1)")
    left = inside.script("return page.view.left")
    ActionChains(inside.driver).move_to_element(canvas).click().perform()
    why = explained(inside)
    pixel = tuple(why["pixel"])
    assert max(abs(side - 24) for side in pixel) <= 1, "in the middle"
    expected = simdtex.explain(example("grass")[:192, :192], (48, 48), pixel, order=4, schedule="checkerboard", rng=1)
    assert why["reason"] == expected.reason
    assert len(inside.all(".reason tbody tr")) == len(expected.shown())
    assert ", ".join(map(str, expected.candidates.place[expected.taken])) in inside.one(".reason tr.taken").text
    canvas.send_keys(Keys.ARROW_RIGHT)
    until(lambda: explained(inside)["pixel"] == [pixel[0], pixel[1] + 1])
    assert inside.script("return page.view.left") == left, "the view stays where it is"
    canvas.send_keys(Keys.ESCAPE)
    until(lambda: not inside.all(".reason table"))
    canvas.send_keys(Keys.ENTER)
    assert explained(inside)["pixel"] == [24, 24]
    assert inside.faults() == []


def test_the_line_of_time_steps_plays_and_is_a_slider_for_the_pointer_and_for_keys(inside):
    assert at(inside) is None
    sweeps = inside.script("return page.inside.sweeps")
    inside.one("[aria-label='A sweep back']").click()
    until(lambda: at(inside) == [len(sweeps) - 1, 2])
    inside.one("[aria-label='A set of sites back']").click()
    until(lambda: at(inside) == [len(sweeps) - 1, 1])
    until(lambda: inside.script("return page.seen") == "sets")
    assert "set 1 of 2" in inside.one(".moment").text
    seen = inside.canvas()
    magenta = (seen[..., :3] == [255, 30, 155]).all(-1).mean() / (seen[..., 3] > 0).mean()
    assert 0.2 < magenta < 0.6, "half of the sites have relaxed last"
    inside.script("page.inside.seek(0, 0)")
    until(lambda: at(inside) == [0, 0])
    inside.button("Play").click()
    until(lambda: at(inside) is not None and at(inside)[0] > 3)
    inside.button("Stop").click()
    assert 3 < at(inside)[0] < len(sweeps)
    line = inside.one("[role=slider][aria-label=Time]")
    bands = [one.text for one in inside.all(".band > span")]
    assert bands[-2:] == ["level 0 (full size)", "result"] and "level 1 (half size)" in bands
    cells = inside.all(".sweep")
    heights = inside.script("return [...document.querySelectorAll('.sweep i')].map((i) => parseFloat(i.style.height))")
    np.testing.assert_allclose(heights, [100 * one[4] for one in sweeps], atol=0.01)
    up, down = [1, sweeps[1][2]], [0, sweeps[0][2]]
    moves = {Keys.HOME: [0, 0], Keys.ARROW_RIGHT: [0, 1], Keys.ARROW_UP: up, Keys.ARROW_LEFT: [1, 1]}
    for keys, moment in (moves | {Keys.ARROW_DOWN: down, Keys.END: None}).items():
        line.send_keys(keys)
        until(lambda moment=moment: at(inside) == moment)
        assert line.get_attribute("aria-valuetext") == inside.one(".moment").text
    assert line.get_attribute("aria-valuenow") == line.get_attribute("aria-valuemax")
    drag = ActionChains(inside.driver).move_to_element(cells[2]).click_and_hold()
    drag.move_to_element(cells[4]).release().perform()
    until(lambda: at(inside) == [4, round(sweeps[4][2] / 2)])
    assert "now" in cells[4].get_attribute("class") and cells[4].find_elements(By.CSS_SELECTOR, ".mark")
    assert inside.faults() == []


SLIDE = "const one = page.inside[arguments[0]]; one.value = arguments[1]; one.dispatchEvent(new Event('input'));"


def test_order_and_trust_act_on_the_pixel_without_a_run(inside):
    inside.script(
        "page.options.mrf.values = {order: 4, search: 'exact', balance: 0, levels: 2, relaxation: 'gibbs'}; page.make()"
    )
    inside.result(4)
    until(lambda: inside.script("return page.inside.open && page.inside.panes[0].result") == 4)
    inside.script("page.inside.seekPlace(0, 2, 1)")
    at(inside)
    inside.script("page.inside.pick(11, 21)")
    first = explained(inside)
    assert (first["order"], len(first["offsets"])) == (4, 12)
    for name, *values in (("order", 2, 8), ("trust", 0.5, 1)):  # the last answer counts
        for value in values:
            inside.script(SLIDE, name, value)
        until(lambda: not inside.script("return page.inside.explaining || page.inside.again"))
        now = explained(inside)
        assert now["order"] == 8 and len(now["offsets"]) == 24
        assert (np.array(now["trust"]) == 1).all() == (name == "trust")
    assert "order 8, 24 neighbours; doubt t of the neighbours: 0 %" in inside.one(".dice output").text
    inside.button("As in the run").click()
    until(lambda: explained(inside)["totals"] == first["totals"])
    assert inside.script("return page.results.size") == 4
    moment = at(inside)
    inside.script("page.options.mrf.values.bandwidth = 0.5; page.make()")  # the pixel is watched from run to run
    inside.result(5)
    until(lambda: inside.script("return page.inside.open && page.inside.panes[0].result") == 5)
    assert explained(inside)["pixel"] == [11, 21] and at(inside) == moment
    inside.choose("Beside it", "Result 4")
    until(lambda: "Result 4 beside it: Bandwidth 0.5 to 0.15." in inside.one(".captions").text)


def test_a_link_and_a_saved_view_bring_all_of_it_back(inside, served):
    inside.script("page.inside.seekPlace(0, 2, 1); page.showLayer('temperature')")
    at(inside)
    inside.script("page.view.zoom(1); page.inside.pick(20, 31)")
    explained(inside)
    place = "return [page.inside.at, page.inside.pixel, page.layer]"
    wanted = inside.script(place)
    inside.button("Copy a link").click()
    link = inside.driver.current_url
    assert link.endswith(
        "#grass&method=mrf&size=48,48&seed=1&order=4&schedule=checkerboard&pixel=20,31&moment=0,2,1&layer=temperature"
    )
    with beside(inside, served + link[link.index("#") :]) as other:
        until(lambda: other.status == "The view is restored.")
        until(lambda: other.script(place) == wanted)
        assert explained(other)["pixel"] == [20, 31]
        other.script("location.hash = '#granite&size=40,24'")
        until(lambda: 'no example "granite"' in other.alert)
    inside.choose("Beside it", "Result 2")
    until(lambda: inside.script("return page.inside.panes.length") == 2)
    corner = "return [page.view.unit, page.view.left]"
    wanted = inside.script(place), inside.script(corner)
    inside.button("Save this view").click()
    path = inside.folder / "grass-view.json"
    until(lambda: path.exists() and path.stat().st_size)
    with beside(inside, served) as other:
        drop(other.driver, path, place=".start")
        until(lambda: other.status == "The view is restored.")
        assert (other.script(place), other.script(corner)) == wanted
        settings = other.script("return page.inside.panes.map(({result}) => page.results.get(result).settings.options)")
        assert settings == [{"order": 4, "schedule": "checkerboard"}, {"order": 4}]


def test_the_lecture_has_six_questions_on_one_screen_and_needs_nothing(page):
    page.button("grass").click()
    page.result(1)
    page.script("page.method = 'multires'; page.make(); page.go('why')")
    page.result(2)
    button = page.button("Lecture: why this pixel?")
    button.click()
    until(lambda: page.one(".questions").is_displayed())
    shown(page.driver, width=1280, height=720)
    box = page.one(".questions")
    bottom = "return document.querySelector(arguments[0]).getBoundingClientRect().bottom"
    for number in range(1, 7):
        title, asked = page.one(".questions h2").text, page.one(".questions p").text
        assert title.startswith(f"{number} of 6") and title.endswith("?") and page.one(".pointed").is_displayed()
        if number == 3:
            until(lambda: page.all(".reason tr"))
            for place in (".questions", ".panes canvas", ".reason table", ".dice", ".reason > figure canvas"):
                assert page.script(bottom, place) <= 720
            chances = "return [...document.querySelectorAll('.reason .bars')].map((one) => one.textContent);"
            wider = "const h = document.querySelector('.dice input'); h.value = 2; h.dispatchEvent(new Event('input'));"
            before, wider = page.script(chances), f"{wider} {chances}"
            until(lambda before=before, wider=wider: page.script(wider) != before, 10)  # an explanation may follow
            draw = "document.querySelector('.dice button').click(); return document.querySelector('.dice output').value"
            until(lambda draw=draw: "The dice say" in page.script(draw), 10)  # here, too
        box.send_keys(Keys.ENTER)
        assert page.one(".questions p").text != asked, "the answer"
        assert page.faults() == []
        if number == 6:
            until(lambda: len(page.all(".films figure")) == 4)
            captions = [one.text for one in page.all(".films figcaption")]
            assert captions[0].startswith("coloring 16 steps a sweep") and "No two neighbours" in captions[0]
            assert captions[2].startswith("synchronous 1 step a sweep") and "100 %" in captions[2]
            assert page.script(bottom, ".films") <= 720
        box.send_keys(Keys.ARROW_LEFT, "n")
        box.send_keys(Keys.ENTER)
    assert not page.one(".questions").is_displayed()
    assert page.driver.switch_to.active_element == button
    assert explained(page)["weighed"] in (44 * 44, 24 * 24), "all candidates of a level, at a pixel at random"
    shown(page.driver, width=1400)


def test_the_recording_of_the_docs_plays_without_a_server(page, tmp_path):
    sys.path.insert(0, str(ROOT / "docs"))
    import recorded

    moments = recorded.unpack(recorded.FILE.read_text("ascii"))[0]["moments"]
    (tmp_path / "live.js").write_text(script().replace("export default", "window.simdtexLive ="), encoding="utf-8")
    (tmp_path / "live.css").write_text(style(), encoding="utf-8")
    shutil.copy(recorded.FILE, tmp_path)
    (tmp_path / "page.html").write_text(
        '<!doctype html><html lang="en"><title>t</title><link rel="stylesheet" href="live.css">'
        '<div id="simdtex-recorded"></div><script src="recording.js"></script><script src="live.js"></script></html>'
    )
    page.driver.get((tmp_path / "page.html").as_uri())
    until(lambda: page.all(".reason p") and page.one(".moment").text == "The result.")
    until(lambda: page.script("return document.querySelector('canvas.view').width") and page.canvas()[..., 3].any())
    before = page.canvas()
    back, (level, last, sets) = page.one("[aria-label='A sweep back']"), moments[-1][1]
    for sweep in (last, last - 1):  # the end of the last one is the result
        back.click()
        said = f"Level {level}, sweep {sweep} of {last}, set {sets} of {sets}"
        until(lambda said=said: page.one(".moment").text.startswith(said))
    until(lambda: (page.canvas() != before).any())
    ActionChains(page.driver).move_to_element(page.one("canvas.view")).click().perform()
    until(lambda: page.all(".reason tr.taken"))
    assert page.faults() == []
