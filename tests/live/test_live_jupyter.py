"""The widget in JupyterLab, in a real browser: its controls keep their keys, which mean other things to a notebook."""

import os
import socket
import subprocess
import sys
import urllib.request
from importlib.util import find_spec

import pytest
from browsing import browser, missing, shown, until

LACKS = missing() or ("" if find_spec("jupyterlab") else "JupyterLab is not installed (pip install 'jupyterlab>=4.2')")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(LACKS), reason=f"no test in JupyterLab: {LACKS}"),
    pytest.mark.xdist_group("browser"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # Selenium's own connections
]
if not LACKS:
    import nbformat
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

CODE = """
from skimage import data
import simdtex
simdtex.Live(data.gravel()[:48, :48], device="reference")
"""
RUN = """
const done = arguments[0], app = window.jupyterapp;
(async () => {
  const panel = app.shell.currentWidget;
  await panel.context.ready;
  await panel.sessionContext.ready;
  await app.commands.execute("notebook:run-cell");
  return true;
})().then(done, (error) => done(String(error)));
"""
"""Runs the first cell once the kernel is ready."""
CONTROLS = ("canvas.view", "button:not(:disabled)", "input[type=checkbox]", "select", "input[type=number]", "summary")
SETTINGS = (
    "--LabApp.news_url= --LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate --no-browser --allow-root"
)
SETTINGS += " --expose-app-in-browser --ip=127.0.0.1 --ServerApp.port_retries=0 --IdentityProvider.token=key"


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab")
    cells = [nbformat.v4.new_code_cell(code) for code in (CODE, "1", "2")]
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    nbformat.write(nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel}), folder / "live.ipynb")
    names = ("JUPYTER_CONFIG_DIR", "JUPYTERLAB_SETTINGS_DIR", "JUPYTERLAB_WORKSPACES_DIR", "JUPYTER_DATA_DIR")
    own = {name: str(folder / name) for name in (*names, "JUPYTER_RUNTIME_DIR", "IPYTHONDIR")}
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}"
    with open(folder / "log", "wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "jupyterlab", f"--port={port}", *SETTINGS.split()],
            cwd=folder,
            env=os.environ | own,
            stdout=log,
            stderr=subprocess.STDOUT,
        )

    def answers():
        assert process.poll() is None, (folder / "log").read_text(encoding="utf-8")
        try:
            with urllib.request.urlopen(f"{address}/api?token=key", timeout=10) as answer:
                return answer.status == 200
        except OSError:
            return False

    try:
        until(answers, 120)
        yield f"{address}/lab/tree/live.ipynb?token=key&reset"
    finally:
        process.terminate()
        process.wait()


@pytest.fixture(scope="module")
def notebook(lab):
    """A browser in which the first cell shows the widget."""
    with browser() as driver:
        driver.get(lab)
        until(lambda: len(cells(driver)) == 3, 120)
        driver.set_script_timeout(120)
        assert driver.execute_async_script(RUN) is True
        until(lambda: all(visible(driver, selector) for selector in CONTROLS), 120)
        yield driver


def cells(driver):
    return driver.find_elements(By.CSS_SELECTOR, ".jp-Notebook .jp-Cell")


def visible(driver, selector):
    code = "return [...document.querySelectorAll(arguments[0])].filter((each) => each.checkVisibility())"
    return driver.execute_script(code, f".simdtex {selector}")


def press(driver, *keys):
    """Press keys where the focus is; the number of cells that are then left."""
    ActionChains(driver).send_keys(*keys).perform()
    driver.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(() => arguments[0]()))")
    return len(cells(driver))


def test_keys_of_the_widget_are_no_commands_of_the_notebook(notebook):
    """``d d`` deletes the cell, ``x`` cuts it, ``a`` and ``b`` add one, in JupyterLab's command mode."""
    for selector in CONTROLS:
        control = visible(notebook, selector)[0]
        notebook.execute_script("arguments[0].focus()", control)
        assert notebook.switch_to.active_element == control
        assert notebook.find_elements(By.CSS_SELECTOR, ".jp-Notebook.jp-mod-commandMode")
        assert press(notebook, "dd") == press(notebook, "xab") == 3, selector
        assert notebook.switch_to.active_element == control
    visible(notebook, "h2")[0].click()
    assert press(notebook, "dd") == 3


@pytest.mark.parametrize(("theme", "paper"), [("Dark", "rgb(25, 24, 23)"), ("Light", "rgb(251, 250, 247)")])
def test_the_widget_has_the_theme_of_the_notebook(notebook, theme, paper):
    shown(notebook, width=1400, dark=theme == "Light")  # the system has the other one
    notebook.execute_script(f"jupyterapp.commands.execute('apputils:change-theme', {{theme: 'JupyterLab {theme}'}})")
    colour = "return getComputedStyle(document.querySelector('.simdtex')).backgroundColor"
    until(lambda: notebook.execute_script(colour) == paper)


def test_the_same_keys_delete_a_cell_that_has_the_focus(notebook):
    cells(notebook)[2].find_element(By.CSS_SELECTOR, ".jp-InputPrompt").click()
    press(notebook, "dd")
    until(lambda: len(cells(notebook)) == 2)


def test_a_widget_whose_kernel_was_started_anew_says_so(notebook):
    kernel = "window.jupyterapp.shell.currentWidget.sessionContext.session.kernel"
    notebook.execute_async_script(f"{kernel}.restart().finally(arguments[0])")
    until(lambda: [one.text for one in visible(notebook, "[role=status]")][:1] == ["Not connected."])
    assert "no longer connected. Run its cell again." in visible(notebook, "[role=alert]")[0].text
    assert not visible(notebook, ":is(button, input, select):not(:disabled)")
