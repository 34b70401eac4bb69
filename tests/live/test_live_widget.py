"""Results in a notebook: the live page as a widget, and what shows itself."""

import pickle
import re
import subprocess
import sys
from base64 import b64decode
from pathlib import Path

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest
import xarray
from click.testing import CliRunner
from live import asked, texture
from nbclient import NotebookClient
from skimage import data

import simdtex
from simdtex.commands import main
from simdtex.figures.sheet import GAP, STRIP
from simdtex.io.grids import CartesianGrid
from simdtex.io.hard_data import HardData
from simdtex.io.image import Image, Metadata, read, read_bytes, write
from simdtex.jobs.simulation.report import write_volumes
from simdtex.live import widget
from simdtex.live.server import FILES
from simdtex.machine.devices import DeviceInfo
from simdtex.model.display import category_colours, source_colours
from simdtex.run import Output, Progress, Stage

ROOT = Path(__file__).resolve().parents[2]
BRICK = data.brick()[:40, :60]
HALVES = np.repeat(np.array([3, 7], np.uint8), 8)[:, None] * np.ones(20, np.uint8)
OPTIONS = {"order": 2, "rng": 1, "device": "reference"}


def drawn(figure, path):
    figure.savefig(path)
    return read(path).pixels[..., :3]


def test_a_widget_takes_messages_and_gives_results(monkeypatch):
    sent = []
    monkeypatch.setattr(widget.Live, "send", lambda self, message, buffers=None: sent.append(message["kind"]))
    live = simdtex.Live(np.moveaxis(texture(), -1, 0), channel_axis=0, name="wall.png", device="reference")
    assert (live.image, live.source, live.maps, live.command) == (None, None, {}, "")
    for message in ({"kind": "hello"}, asked()):
        live._handle_custom_msg(message, [])
    assert live.wait(60) is live.image and sent[:2] == ["hello", "picture"]
    whole, output = simdtex.synthesize(texture(), (28, 36), channel_axis=-1, full_output=True, **OPTIONS | {"rng": 7})
    np.testing.assert_array_equal(live.image, whole)
    np.testing.assert_array_equal(live.source, output.source)
    assert live.command.startswith("simdtex synth wall.png ")
    live.close()
    with pytest.raises(ValueError, match="give"):
        simdtex.Live(texture())


@pytest.mark.slow
def test_a_cell_waits_for_the_first_result_and_for_later_ones(monkeypatch):
    monkeypatch.setattr(widget.Live, "send", lambda self, message, buffers=None: None)
    live = simdtex.Live(texture(10, 12), channel_axis=-1, device="reference")
    assert live.wait().shape == (20, 24, 3)
    live._handle_custom_msg(asked(seed=3), [])
    assert live.wait().shape == (28, 36, 3) and "--seed 3" in live.command
    live._handle_custom_msg(asked(options={"finish": 99}), [])
    with pytest.raises(ValueError, match="finish is 99"):
        live.wait()
    live._handle_custom_msg(asked(width=600, height=600), [])
    with pytest.raises(TimeoutError, match=r"within 0\.2 s"):
        live.wait(timeout=0.2)
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


@pytest.mark.slow
def test_a_missing_package_is_named():
    code = (
        "import sys; sys.modules['anywidget'] = None\nimport simdtex\n"
        "try: simdtex.Live()\nexcept ValueError as error: print(error)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told == "simdtex.Live needs a package of its own; install it with: pip install 'simdtex[notebook]'\n"


def test_a_result_shows_its_picture_and_its_arrangement():
    options = OPTIONS | {"full_output": True}
    image, output = simdtex.synthesize(texture(), (28, 36), channel_axis=-1, **options)
    pictures = re.findall(r'src="data:image/png;base64,([^"]+)" alt="([^"]+)"', output._repr_html_())
    assert [alt for _, alt in pictures] == ["the picture", "where from in the sample"]
    shown, arranged = (read_bytes("a", b64decode(data)).pixels for data, _ in pictures)
    np.testing.assert_array_equal(shown, image)
    rows, cols = output.source.reshape(-1, 2).max(axis=0) + 1
    np.testing.assert_array_equal(arranged, source_colours(output.source, (rows, cols)))
    assert "seed 1" in output._repr_html_() and "<script" not in output._repr_html_()
    stages, seconds = len(output.stages), f"{output.statistics['seconds']:.2f} s"
    told = f"28x36, source, temperature, {stages} stages, seed 1, device reference, {seconds}"
    assert (repr(output), repr(Output(None))) == (f"Output({told})", "Output()")
    _, output = simdtex.synthesize([texture(12, 12)] * 2, (14, 14), channel_axis=-1, **options)
    assert output._repr_html_().count("<img") == 1
    _, output = simdtex.synthesize(np.moveaxis(texture(12, 12) / 7, -1, 0), (14, 14), channel_axis=0, **options)
    assert output._repr_html_().count("<img") == 2
    del options["order"]
    _, output = simdtex.synthesize_solid(texture(channels=1), (8, 12, 16), iterations=1, **options)
    assert output._repr_html_().count("<img") == 1 and "the middle slice" in output._repr_html_()


def executed(book):
    NotebookClient(book, timeout=300, kernel_name="python3").execute()
    return [[one.get("data", {}) for one in cell.get("outputs", [])] for cell in book.cells]


@pytest.mark.slow
def test_the_notebook_runs():
    book = nbformat.read(ROOT / "examples" / "live.ipynb", as_version=4)
    outputs = [one for cell in executed(book) for one in cell]
    assert any("data:image/png" in str(one.get("text/html", "")) for one in outputs)
    assert any("application/vnd.jupyter.widget-view+json" in one for one in outputs)


def test_a_picture_is_drawn_pixel_by_pixel(tmp_path):
    colour, solid = data.coffee()[:50, :30], np.stack([BRICK * 0, BRICK / 510, BRICK * 0])
    solid[1, 3, 4] = np.nan
    figure = simdtex.show(colour, titles=["coffee"], tiled=True)
    assert figure.axes[0].get_title() == "coffee"
    assert (drawn(figure, tmp_path / "a.png")[24:174, 24:114] == np.tile(colour, (3, 3, 1))).all()
    shown = drawn(simdtex.show(np.moveaxis(colour, -1, 0), channel_axis=0), tmp_path / "a.png")
    assert (shown[24:274, 24:174] == colour.repeat(5, 0).repeat(5, 1)).all()
    stretched = np.rint((BRICK - BRICK.min()) / np.ptp(BRICK) * 255)
    stretched[3, 4] = 255
    figure = simdtex.show(solid, BRICK.astype(np.uint16) * 257, BRICK > 99)
    shown = drawn(figure, tmp_path / "a.png")[24:184, :, 0]
    assert (abs(shown[:, 24:264] - stretched.repeat(4, 0).repeat(4, 1)) <= 1).all()
    assert (shown[:, 552:792] == np.where(BRICK > 99, 255, 0).repeat(4, 0).repeat(4, 1)).all()
    for pictures, titles, words in (([], [], "0 pictures"), ([BRICK], "ab", "2 titles"), ([BRICK[0]], [], "shape")):
        with pytest.raises(ValueError, match=words):
            simdtex.show(*pictures, titles=titles)


@pytest.mark.slow
def test_a_script_keeps_no_figure_and_a_notebook_draws_each_figure_once_and_in_order():
    code = (
        "import simdtex, numpy\nfor _ in range(25): simdtex.show(numpy.eye(9)).canvas.draw()\nimport matplotlib.pyplot"
    )
    told = f"{code}\nprint(matplotlib.pyplot.get_backend(), matplotlib.pyplot.get_fignums())"
    result = subprocess.run([sys.executable, "-W", "error", "-c", told], capture_output=True, text=True)
    assert (result.stdout.lower(), result.stderr) == ("agg []\n", "")
    cells = ["simdtex.show(a)", "simdtex.show(a);\n1", "simdtex.show(a)\nsimdtex.show(a, a)"]
    book = nbformat.v4.new_notebook()
    book.cells = [nbformat.v4.new_code_cell(f"import simdtex, numpy\na = numpy.eye(9)\n{text}") for text in cells]
    pictures = [[one["image/png"] for one in cell if "image/png" in one] for cell in executed(book)]
    assert [len(some) for some in pictures] == [1, 1, 2]
    assert len(pictures[2][0]) < len(pictures[2][1]), "the figure of two pictures is the second"


def test_realisations_are_arrays_of_xarray_that_draw_themselves(tmp_path):
    training = xarray.DataArray(HALVES / 10, dims=("y", "x"), name="porosity", attrs={"units": "%"})
    made = simdtex.simulate(training, 10, shape=(6, 8), **OPTIONS)
    figure = made.plot()
    assert [axes.get_title() for axes in figure.axes] == [*(f"realisation {k}" for k in range(8)), ""]
    assert figure.axes[-1].get_ylabel() == "porosity, %" and len(made.plot(number=2).axes) == 3
    same = [made.copy(), pickle.loads(pickle.dumps(made)), made + 0, made.sel(realisation=slice(9)), made.load()]
    assert all(type(one) is type(made) and np.array_equal(one, made) for one in same)
    assert made[3].plot().axes[0].get_title() == "realisation 3" and isinstance(made, xarray.DataArray)
    assert len(made.plot.hist()[0]) == 10 and made[0].plot(x="x").axes.get_xlabel() == "x"  # of xarray
    made.to_netcdf(tmp_path / "made.nc")
    with xarray.open_dataarray(tmp_path / "made.nc") as back:
        assert len(simdtex.show(back).axes) == 9
    volume = simdtex.simulate(np.stack([HALVES] * 4), 1, shape=(4, 5, 6), categorical=True, source=True, **OPTIONS)
    assert volume.plot().axes[0].get_title() == "realisation 0, z = 2"
    with pytest.raises(ValueError, match="no realisations and no estimate"):
        simdtex.show(xarray.Dataset())
    plt.close("all")  # those of xarray


def test_an_estimate_has_a_map_of_each_category_and_of_the_entropy():
    known = np.where(np.indices(HALVES.shape)[0] == 2, HALVES, np.nan)
    made = simdtex.estimate(HALVES, known=known, categorical=True, device="reference")
    share = 100 * made.probability.sel(category=7).values.mean()
    titles = [axes.get_title() for axes in made.plot().axes]
    assert titles[1:3] == [f"category 7, share {share:.0f} %", "entropy, bits"]
    training = xarray.DataArray(HALVES, dims=("y", "x"), attrs={"units": "m"})
    made = simdtex.estimate(training, known=known, device="reference")
    assert [axes.get_title() for axes in simdtex.show(made).axes[:2]] == ["mean, m", "variance, (m)²"]


ENDS = np.where(np.isin(np.indices(HALVES.shape)[0], [0, 15]), HALVES, np.nan)


@pytest.mark.parametrize("ground", [pytest.param(False, marks=pytest.mark.slow), True])
def test_maps_have_north_up_in_plots(tmp_path, ground):
    options = {"origin": (5, 5), "cell": (10, 10)} if ground else {}
    axes, bar = simdtex.simulate(HALVES, 1, known=ENDS, categorical=True, **OPTIONS, **options).plot().axes
    assert bar.get_yticklabels()[0].get_text().startswith("3: ") and bool(axes.get_xlabel()) == ground
    shown = drawn(axes.figure, tmp_path / "a.png")
    for row, value in ((0, 0), (15, 1)):
        across, up = axes.transData.transform((105, 10 * row + 5) if ground else (10, row))
        assert (shown[len(shown) - 1 - int(up), int(across)] == category_colours(2)[value]).all()
        assert (up > len(shown) / 2) == (row == 15)


@pytest.mark.slow
@pytest.mark.parametrize("ground", [False, True])
def test_maps_have_north_up_in_reports_and_pictures_their_first_row(tmp_path, monkeypatch, ground):
    monkeypatch.chdir(tmp_path)
    write("t.png", HALVES)
    np.save("known.npy", ENDS)
    words = ["simulate", "t.png", "-o", "o.npz", "--known", "known.npy", "--report", "page", "--categorical"]
    words += ["--order", "2", "--device", "reference", *["--origin", "5,5", "--cell", "10,10"] * ground]
    result = CliRunner().invoke(main, words)
    assert result.exit_code == 0, result.output
    first, last = category_colours(2)
    sheet = read("page/realisations.png").pixels[GAP + STRIP :, GAP : GAP + 20]
    inside = sheet[: int(np.flatnonzero((sheet == 255).all((1, 2)))[0])]
    assert (inside[0] == first).all() and (inside[-1] == last).all()
    column = read("page/maps.png").pixels[:, 300].tolist()  # of viridis: yellow where all realisations have 7
    assert column.index([253, 231, 36]) < column.index([68, 1, 84])
    cube = xarray.DataArray(np.indices((1, 4, 5, 6))[2], dims=("realisation", "z", "y", "x"))
    write_volumes("cube", cube.values[0], cube.assign_attrs({"cell_y": 1.0} if ground else {}), False)
    column = read("cube/slices.png").pixels[:, 300].tolist()
    assert column.index([253, 231, 36]) < column.index([68, 1, 84])


TEXTS = {
    "<NumPy reference>": lambda: simdtex.open_machine("reference"),
    "<0: cpu-x (PoCL), cpu, no>": lambda: DeviceInfo(0, "PoCL", "cpu-x", "cpu", reason="no"),
    "Stage(level=0, image=uint8 40x60)": lambda: Stage(0, BRICK),
    "Progress(level=0, levels=1, fraction=0.5, doing='x'": lambda: Progress(
        fraction=0.5, doing="x", image=print, maps={"use": lambda: 1}
    ),
    "CartesianGrid(values={'a': 'uint8": lambda: CartesianGrid({"a": BRICK[None]}, (0, 0, 0), (1, 1, 1)),
    "HardData(points=float64 99x2": lambda: HardData(np.zeros((99, 2)), np.zeros((99, 1)), ("v",), tuple(range(99))),
    "Image(pixels=uint8 40x60": lambda: Image(BRICK, None, Metadata(exif=b"0" * 999)),
    "Neighbours(offsets=": lambda: simdtex.explain(BRICK[:12, :12], (9, 9), (1, 2), **OPTIONS).neighbours,
    "<Replay of ": lambda: simdtex.replay(BRICK[:12, :12], (9, 9), **OPTIONS),
    "Checkpoint('": lambda: simdtex.Checkpoint("here"),
    "TextureClassifier(rng=3, unknown=0.1)": lambda: simdtex.TextureClassifier(rng=3, unknown=0.1),
}


def test_a_result_is_a_short_text():
    for words, made in TEXTS.items():
        text = repr(made())
        assert text.startswith(words) and len(text) < 200 and "\n" not in text and " at 0x" not in text
