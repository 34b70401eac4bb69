"""The live page in a notebook: the widget, the notebook among the examples, and results that show themselves."""

import json
import re
import subprocess
import sys
import time
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from live import asked, texture

import simdtex
from simdtex.io.image import read_bytes
from simdtex.live import widget
from simdtex.live.server import FILES
from simdtex.model.display import source_colours
from simdtex.run import Output

ROOT = Path(__file__).resolve().parent.parent
EXECUTE = """
import json, sys
import nbformat
from nbclient import NotebookClient
book = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(book, timeout=300, kernel_name="python3").execute()
print(json.dumps([output for cell in book.cells for output in cell.get("outputs", [])]))
"""


def test_a_widget_takes_messages_and_gives_results(monkeypatch):
    sent = []
    monkeypatch.setattr(widget.Live, "send", lambda self, message, buffers=None: sent.append(message))
    live = simdtex.Live(np.moveaxis(texture(), -1, 0), channel_axis=0, name="wall.png", device="reference")
    assert (live.image, live.source, live.maps, live.command) == (None, None, {}, "")
    for message in ({"kind": "hello"}, asked()):
        live._handle_custom_msg(message, [])
    end = time.monotonic() + 60
    while live.image is None and time.monotonic() < end:
        time.sleep(0.01)
    assert [message["kind"] for message in sent][:2] == ["hello", "picture"]
    options = {"rng": 7, "order": 4, "device": "reference"}
    whole, output = simdtex.synthesize(texture(), (28, 36), channel_axis=-1, full_output=True, **options)
    np.testing.assert_array_equal(live.image, whole)
    np.testing.assert_array_equal(live.source, output.source)
    assert live.command.startswith("simdtex synth wall.png ")
    live.close()


def test_a_cell_waits_for_the_first_result_and_for_later_ones(monkeypatch):
    monkeypatch.setattr(widget.Live, "send", lambda self, message, buffers=None: None)
    live = simdtex.Live(texture(20, 24), channel_axis=-1, device="reference")
    image = live.wait()
    assert image is live.image and image.shape == (40, 48, 3)
    live._handle_custom_msg(asked(seed=3), [])
    assert live.wait().shape == (28, 36, 3) and "--seed 3" in live.command
    live._handle_custom_msg(asked(options={"finish": 99}), [])
    with pytest.raises(ValueError, match="finish is 99"):
        live.wait()
    live._handle_custom_msg(asked(width=3000, height=3000), [])
    with pytest.raises(TimeoutError, match=r"within 0\.2 s"):
        live.wait(timeout=0.2)
    live._handle_custom_msg({"kind": "cancel"}, [])
    live.close()
    with pytest.raises(ValueError, match="closed"):
        live.wait()
    empty = simdtex.Live(device="reference")
    with pytest.raises(ValueError, match="no picture yet"):
        empty.wait()
    empty.close()


def test_the_widget_has_the_page_of_the_server():
    assert FILES["live.js"][0]() == widget.Live._esm
    assert FILES["live.css"][0]() == widget.Live._css
    assert widget.Live._esm.count("export default") == 1
    for path in (ROOT / "simdtex" / "live" / "page").glob("*.js"):  # none is forgotten
        assert path.read_text(encoding="utf-8") in widget.Live._esm


def test_bad_samples_are_refused():
    with pytest.raises(ValueError, match="give"):
        simdtex.Live(texture())
    with pytest.raises(TypeError, match="convert"):
        simdtex.Live(np.array([["a"]]))


def test_a_missing_package_is_named():
    code = (
        "import sys; sys.modules['anywidget'] = None\nimport simdtex\n"
        "try: simdtex.Live()\nexcept ValueError as error: print(error)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told == "simdtex.Live needs a package of its own; install it with: pip install 'simdtex[notebook]'\n"


def test_a_result_shows_its_picture_and_its_arrangement():
    sample = texture()
    options = {"rng": 1, "order": 4, "device": "reference", "full_output": True}
    image, output = simdtex.synthesize(sample, (28, 36), channel_axis=-1, **options)
    pictures = re.findall(r'src="data:image/png;base64,([^"]+)" alt="([^"]+)"', output._repr_html_())
    assert [alt for _, alt in pictures] == ["the picture", "where from in the sample"]
    shown, arranged = (read_bytes("a", b64decode(data)).pixels for data, _ in pictures)
    np.testing.assert_array_equal(shown, image)
    rows, cols = output.source.reshape(-1, 2).max(axis=0) + 1
    np.testing.assert_array_equal(arranged, source_colours(output.source, (rows, cols)))
    assert "seed 1" in output._repr_html_() and "<script" not in output._repr_html_()
    stages, seconds = len(output.stages), f"{output.statistics['seconds']:.2f} s"
    told = f"28x36, source, temperature, {stages} stages, seed 1, device reference, {seconds}"
    assert repr(output) == f"Output({told})"
    assert repr(Output(None)) == "Output()"


@pytest.mark.parametrize("kind", ["channels first", "solid", "pyramid", "several samples", "floats"])
def test_any_result_shows_itself(kind):
    sample, options = texture(), {"rng": 1, "device": "reference", "full_output": True}
    if kind == "solid":
        _, output = simdtex.synthesize_solid(sample[..., 0], (8, 16, 24), iterations=1, **options)
        assert "the middle slice" in output._repr_html_()
    elif kind == "pyramid":
        _, output = simdtex.synthesize(sample, (24, 24), method="pyramid", channel_axis=-1, iterations=1, **options)
    elif kind == "several samples":
        _, output = simdtex.synthesize([sample, sample], (24, 24), channel_axis=-1, order=4, **options)
    elif kind == "floats":
        _, output = simdtex.synthesize(sample[..., 0] / 7, (24, 24), order=4, **options)
    else:
        _, output = simdtex.synthesize(np.moveaxis(sample, -1, 0), (24, 24), channel_axis=0, order=4, **options)
    assert output._repr_html_().count("<img") == 1 + (kind in ("channels first", "floats"))


@pytest.mark.slow
def test_the_notebook_runs():
    notebook = ROOT / "examples" / "live.ipynb"
    found = subprocess.run([sys.executable, "-c", EXECUTE, str(notebook)], capture_output=True, text=True, timeout=500)
    assert found.returncode == 0, found.stderr[-2000:]
    outputs = json.loads(found.stdout.splitlines()[-1])
    assert any("data:image/png" in str(one.get("data", {}).get("text/html", "")) for one in outputs)
    assert any("application/vnd.jupyter.widget-view+json" in one.get("data", {}) for one in outputs)
