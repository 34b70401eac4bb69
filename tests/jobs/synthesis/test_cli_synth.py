"""``simdtex synth``, ``solid`` and ``mix``: samples, known values, guides, and the options of each method."""

import re

import numpy as np
import PIL.Image
import pytest
from cases import texture
from commands import names, pixels, refused, run
from volumes import loaded

import simdtex
from simdtex.cli.inputs import last_iteration
from simdtex.figures.sheet import view
from simdtex.io import image
from simdtex.model.source_map import load_source_map

OPTIONS = {"order": 2, "rng": 5, "device": "reference"}
QUICK = ["--order", 2, "--seed", 5, "--device", "reference"]
RED, BLUE, GREEN = (255, 0, 0), (0, 0, 255), (0, 255, 0)


def test_an_order_that_was_chosen_to_fit_is_said(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    image.write("tile.png", (np.indices((7, 7)).sum(0) % 3 * 60).astype(np.uint8))
    words = ["tile.png", "-o", "more.png", "--size", 3, "--device", "reference"]
    assert "has order 15, the largest that fits the sample.\n" in run("synth", *words).output
    assert "has order" not in run("synth", *words, "--order", 2).output


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Samples, masks, tables, pictures of known values, and guides."""
    rng = np.random.default_rng(2)
    noise = rng.integers(0, 256, (24, 20), dtype=np.uint8)
    noise[:, 10:] //= 4  # a bright half and a dark one
    write = {
        "sample.png": noise,
        "second.png": rng.integers(0, 256, (16, 28), dtype=np.uint8),
        "normal.png": rng.integers(0, 65536, (24, 20, 3), dtype=np.uint16),
        "normal2.png": rng.integers(0, 65536, (16, 28, 3), dtype=np.uint16),
        "facies.tif": (noise > 90).astype(np.uint8) * np.uint8(3),
        "left.png": np.where(np.arange(20) < 10, np.uint8(255), np.uint8(0)) * np.ones((24, 1), np.uint8),
    }
    known = rng.integers(0, 256, (14, 20), dtype=np.uint8)
    there = np.zeros((14, 20), bool)
    there[5:9, 4:12] = True
    write["known.png"] = np.dstack([known, there * np.uint8(255)])
    write["known.tif"] = np.where(there, known, np.nan).astype(np.float32)
    write["unknown.tif"] = np.where(there, np.nan, 7.5).astype(np.float32)
    labels = np.zeros((24, 20, 3), np.uint8)
    labels[:, :10], labels[:, 10:] = RED, BLUE
    wanted = np.zeros((16, 18, 3), np.uint8)
    wanted[:, :], wanted[3:13, 4:15] = RED, BLUE
    strange = wanted.copy()
    strange[0, 0] = GREEN
    open_ = np.dstack([wanted, np.where(np.arange(18) < 12, np.uint8(255), np.uint8(0)) * np.ones((16, 1), np.uint8)])
    write |= {"labels.png": labels, "wanted.png": wanted, "strange.png": strange, "open.png": open_}
    write["labels2.png"] = np.broadcast_to(np.array(BLUE, np.uint8), (16, 28, 3))
    monkeypatch.chdir(tmp_path)
    for name, one in write.items():
        image.write(name, one)
    (tmp_path / "wells.csv").write_text("x,y,value\n3,4,200\n10.4,7,17\n")
    return tmp_path


def made(*words):
    result = run("synth", *words, *QUICK)
    assert result.exit_code == 0, result.output
    return pixels("out.tif")


def test_several_samples_and_maps_of_them(folder):
    args = ["sample.png", "second.png", "-o", "out.tif", "--size", "18x16", "--shares", "1,2", "--finish", 0]
    out = made(*args, "--also", "normal.png,normal2.png=carried.png", "--source-map", "s.npz")
    samples = [pixels("sample.png"), pixels("second.png")]
    assert np.array_equal(out, simdtex.synthesize(samples, (16, 18), shares=(1, 2), finish=0.0, **OPTIONS))
    source, carried = load_source_map("s.npz"), pixels("carried.png")
    assert set(np.unique(source[..., 2])) == {0, 1}
    for k, other in enumerate((pixels("normal.png"), pixels("normal2.png"))):
        here = source[..., 2] == k
        assert np.array_equal(carried[here], other[source[here][:, 0], source[here][:, 1]])


def numbered(picture):
    return (picture[..., 2] > 0).astype(np.uint8)


def test_masks_known_pictures_and_guides_are_those_of_the_function(folder):
    files = ("sample.png", "second.png", "labels.png", "labels2.png", "wanted.png", "strange.png", "known.tif")
    sample, second, labels, labels2, wanted, strange, known = map(pixels, files)
    open_ = np.where(np.arange(18) < 12, numbered(wanted), np.nan)
    cases = [
        (["--size", "18x16", "--sample-mask", "left.png"], {"mask": pixels("left.png") > 0}),
        (["--known", "known.png"], {"known": known}),
        (["--known", "known.tif"], {"known": known}),
        (["--guide", "labels.png=wanted.png"], {"guide": (numbered(labels), numbered(wanted))}),
        (["--guide", "labels.png=strange.png", "--no-labels"], {"guide": (labels, strange), "labels": False}),
        (["--guide", "labels.png=open.png"], {"guide": (numbered(labels), open_), "labels": True}),
    ]
    for args, how in cases:
        made_by = simdtex.synthesize(sample, (14, 20) if "known" in how else (16, 18), **how, **OPTIONS)
        assert np.array_equal(made("sample.png", "-o", "out.tif", *args), made_by), args
    out = made("sample.png", "second.png", "-o", "out.tif", "--guide", "labels.png,labels2.png=wanted.png")
    guide = [numbered(labels), numbered(labels2)], numbered(wanted)
    assert np.array_equal(out, simdtex.synthesize([sample, second], (16, 18), guide=guide, **OPTIONS))
    out = made("unknown.tif", "-o", "out.tif", "--stages", folder / "stages", "--size", "16x12")
    assert np.array_equal(out, simdtex.synthesize(pixels("unknown.tif"), (12, 16), **OPTIONS)) and (out == 7.5).all()


def test_a_table_is_kept(folder):
    args = ["sample.png", "-o", "out.tif", "--size", "20x14", "--known", "wells.csv"]
    out = made(*args, "--source-map", "s.npz")
    assert out[-1 - 4, 3] == 200 and out[-1 - 7, 10] == 17, "y points north"
    known = simdtex.place_hard_data([[3, 4, 200], [10.4, 7, 17]], (14, 20), "uint8")[::-1]
    assert np.array_equal(out, simdtex.synthesize(pixels("sample.png"), (14, 20), known=known, **OPTIONS))
    assert (load_source_map(folder / "s.npz")[-1 - 4, 3] == -1).all()
    (folder / "wells.csv").write_text("x,y,v\n3,40,1\n")
    assert "wells.csv is at x 3.0, y 40.0, outside" in run("synth", *args, *QUICK).output


def indexed(path, indices, colours, **options):
    """Write a picture with a palette."""
    picture = PIL.Image.fromarray(indices)
    picture.putpalette(np.array(colours, np.uint8).tobytes())
    picture.save(path, **options)


@pytest.mark.parametrize("command", ["synth", "extend", "fill --sample"])
def test_a_palette_is_categories_and_is_kept(folder, command):
    indexed(folder / "facies.png", pixels("facies.tif"), [RED, RED, GREEN, BLUE])
    more = {"synth": ["--size", 12], "extend": ["--right", 3]}.get(command, ["--mask", "hole.png"])
    image.write(folder / "hole.png", np.pad(np.full((4, 4), 255, np.uint8), ((9, 11), (8, 8))))
    for name in ("facies.png", "facies.tif"):
        words = [*command.split(), name, *[name][: " " in command], *more, "-o", name.replace("facies", "out")]
        result = run(*words, *QUICK, "--categorical")
        assert result.exit_code == 0, result.output
    with PIL.Image.open(folder / "out.png") as made:
        assert made.mode == "P" and np.array_equal(made, pixels("out.tif"))
        assert made.getpalette()[:12] == [*RED, *RED, *GREEN, *BLUE]


def test_known_categories_have_the_palette_of_the_sample(folder):
    facies, colours = pixels("facies.tif"), [RED, RED, GREEN, BLUE]
    known = np.where(np.arange(20) % 7, np.uint8(1), facies[:16])
    indexed(folder / "facies.png", facies, colours)
    indexed(folder / "known.png", known, colours[:3], transparency=1)
    args = ["facies.png", "--known", "known.png", "--size", "20x16", "-o", "out.tif", "--categorical"]
    hidden = np.ma.MaskedArray(known, known == 1)
    found = simdtex.synthesize(facies, (16, 20), known=hidden, categorical=True, **OPTIONS)
    assert np.array_equal(made(*args), found)
    indexed(folder / "known.png", known, colours[::-1], transparency=1)
    result = run("synth", *args, *QUICK)
    assert result.exit_code == 2 and "facies.png have different palettes; save both with the same" in result.output


def test_guides_with_palettes_are_labels_by_their_colours(folder):
    """However many there are, and in whatever order; or by their indices, beside numbers."""
    sample, labels, wanted = (pixels(name) for name in ("sample.png", "labels.png", "wanted.png"))
    options = {"guide_weight": 4.0, "labels": True} | OPTIONS
    spread = (np.arange(480).reshape(24, 20) // 8).astype(np.uint8)  # too many for other colours to be labels
    tones = np.stack([np.arange(256), np.arange(256)[::-1], np.full(256, 7)], -1)
    indexed(folder / "labels.png", spread, tones)
    indexed(folder / "wanted.png", 255 - spread[:16, :18], tones[::-1])
    args = ["sample.png", "-o", "out.tif", "--guide-weight", 4, "--guide"]
    found = simdtex.synthesize(sample, (16, 18), guide=(spread, spread[:16, :18]), **options)
    assert np.array_equal(made(*args, "labels.png=wanted.png"), found)
    indexed(folder / "wanted.png", numbered(wanted), [GREEN, RED])
    image.write(folder / "labels.tif", numbered(labels))
    found = simdtex.synthesize(sample, (16, 18), guide=(numbered(labels), numbered(wanted)), **options)
    assert np.array_equal(made(*args, "labels.tif=wanted.png"), found)


OUT = ["-o", "out.tif"]
ONE, TWO = ["sample.png", *OUT], ["sample.png", "second.png", *OUT]
BAD = [
    ([*ONE, "--method", "multires", "--order", 1], "unknown option 'order'"),
    (["unknown.tif", *OUT, "--method", "multires"], "known everywhere"),
    ([*ONE, "--method", "pyramid", "--also", "normal.png=n.png"], "takes no pixel from the sample; give one picture"),
    ([*TWO, "--sample-mask", "left.png"], "give one for each sample"),
    ([*TWO, "--also", "normal.png,second.png=n.png"], "convert them to one type"),
    ([*TWO, "--also", "normal.png,normal.png=n.png"], "28x16"),
    ([*TWO, "--report", "report"], "leave it out"),
    ([*ONE, "--known", "known.png", "--also", "normal.png=n.png"], "leave --also out"),
    ([*ONE, "--known", "known.png", "--source-map", "s.png"], ".npz"),
    ([*ONE, "--guide", "labels.png"], "SAMPLE-GUIDE=OUTPUT-GUIDE"),
    ([*ONE, "--guide", "labels.png=strange.png"], "the colour (0, 255, 0)"),
]


@pytest.mark.parametrize(("args", "words"), BAD)
def test_bad_input_gets_one_sentence_and_writes_nothing(folder, args, words):
    refused(words, "synth", *args, *(QUICK if "--method" not in args else QUICK[2:]))


def test_known_values_of_a_vast_picture_are_not_placed(folder, monkeypatch):
    monkeypatch.setattr("simdtex.machine.memory.available", lambda: 2**30)
    monkeypatch.setattr("simdtex.io.hard_data.place_hard_data", lambda *_: pytest.fail("which takes 4 GiB"))
    result = run("synth", *ONE, "--known", "wells.csv", "--size", "46341x46341", *QUICK)
    assert result.exit_code == 2 and "4096 MiB of this computer's memory and 1024 MiB is available" in result.output


# -- The methods multires and pyramid, ``simdtex solid`` and ``simdtex mix``

GREY, COLOUR = texture((16, 14)), texture((16, 14), 3, seed=1)
OTHER, START = texture((15, 17), 3, seed=2), texture((12, 20), seed=3)
SAME, EACH = {"rng": 5, "device": "reference"}, {"levels": 1, "iterations": 2}
SEEDED, FEW = ["--seed", 5, "--device", "reference"], ["--levels", 1, "--iterations", 2]
PYRAMID = ["synth", "grey.png", "-o", "out.png", "--method", "pyramid", *SEEDED]
SOLID = ["solid", "grey.png", "-o", "out.npz", *SEEDED]
MIX = ["mix", "colour.png", "other.png", "-o", "out.png", *SEEDED]


@pytest.fixture
def textures(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, picture in {"grey": GREY, "colour": COLOUR, "other": OTHER, "start": START}.items():
        image.write(f"{name}.png", picture)
    return tmp_path


def ends(result, said, statistics):
    """The last lines of a command that has made something."""
    assert result.exit_code == 0, result.output
    first, second = result.output.splitlines()[-2:]
    assert re.fullmatch(rf"{said} in [\d.]+ s on .+, seed 5", first)
    assert second == last_iteration(statistics)


def test_multires_is_what_python_makes(textures):
    args = ["--size", "22x18", "--alpha", "0.6", "--levels", 3, "--boundary", "open", "--preset", "paper"]
    args += ["--stages", "st", "--source-map", "s.npz", "--also", "colour.png=c.png"]
    result = run("synth", "grey.png", "-o", "out.png", "--method", "multires", *SEEDED, *args)
    assert result.exit_code == 0, result.output
    options = {"alpha": 0.6, "levels": 3, "boundary": "open", "preset": "paper"} | SAME
    np.testing.assert_array_equal(pixels("out.png"), simdtex.synthesize(GREY, (18, 22), method="multires", **options))
    source = load_source_map("s.npz")
    np.testing.assert_array_equal(pixels("c.png"), COLOUR[source[..., 0], source[..., 1]])
    assert names("st") == sorted(f"{kind}level{level}.png" for kind in ("", "candidates-") for level in range(3))
    assert "candidates per level, coarse to fine: " in result.output


def test_pyramid_is_what_python_makes(textures):
    args = ["--size", "22x20", "--pyramid", "laplacian", "--edges", "wrap", "--preset", "paper", *FEW]
    options = {"pyramid": "laplacian", "edges": "wrap", "match": "lookup", **EACH, **SAME}
    made, output = simdtex.synthesize(GREY, (20, 22), method="pyramid", full_output=True, **options)
    ends(run(*PYRAMID, *args), r"out\.png: 22x20 from 14x16", output.statistics)
    np.testing.assert_array_equal(pixels("out.png"), made)


def test_stages_replace_those_of_an_earlier_run(textures):
    (textures / "st").mkdir()
    image.write("st/level3.png", GREY)
    image.write("st/iteration09.png", GREY)
    assert run(*PYRAMID, "--stages", "st", *FEW).exit_code == 0
    assert names("st") == ["iteration01.png", "iteration02.png"]
    np.testing.assert_array_equal(np.sort(pixels("st/iteration02.png"), None), np.sort(pixels("out.png"), None))
    (textures / "st" / "mine.txt").write_text("kept")
    again = run(*PYRAMID, "--stages", "st", *FEW)
    assert again.exit_code == 2 and again.output.count("\n") == 1 and (textures / "st" / "mine.txt").exists()


def test_solid_is_what_python_makes(textures):
    args = ["--size", "5x10x8", "-o", "out.nrrd", "-o", "slices", "--view", "v.png", "--preset", "paper", *FEW]
    options = {"solids": "average", "slices": "each", "match": "lookup", "channel_axis": -1, **EACH, **SAME}
    made, output = simdtex.synthesize_solid(COLOUR, (5, 10, 8), full_output=True, **options)
    result = run("solid", "colour.png", *SOLID[2:], *args, "--stages", "st")
    ends(result, r"out\.npz, out\.nrrd, slices, v\.png: 5x10x8 from 14x16", output.statistics)
    for name in ("out.npz", "out.nrrd", "slices"):
        np.testing.assert_array_equal(loaded(name), made)
    np.testing.assert_array_equal(pixels("v.png"), view(made))
    assert names("st") == ["iteration01.png", "iteration02.png"]
    np.testing.assert_array_equal(pixels("st/iteration02.png"), made[2])


MIXTURES = [
    (["--palette", "other.png", "--pattern", 1], {"palette": 1, "pattern": 0}),
    (["--pattern", "./other.png", "--color", "channels"], {"pattern": 1, "color": "channels"}),
    (["--average", "1,0.5", "--edges", "wrap"], {"average": [1, 0.5], "edges": "wrap"}),
    (["--low", 2, "--high", "colour.png"], {"low": 1, "high": 0}),
]


@pytest.mark.parametrize(("args", "options"), MIXTURES)
def test_mix_is_what_python_makes(textures, args, options):
    options = {"channel_axis": -1, **EACH, **SAME, **options}
    made, output = simdtex.mix([COLOUR, OTHER], (20, 22), full_output=True, **options)
    ends(run(*MIX, "--size", "22x20", *FEW, *args), r"out\.png: 22x20 from 2 samples", output.statistics)
    np.testing.assert_array_equal(pixels("out.png"), made)


def test_a_path_wins_over_a_number(textures):
    image.write("1.png", GREY)
    (textures / "1.png").rename("2")
    assert run("mix", "2", "start.png", *MIX[3:], "--pattern", "2", *FEW).exit_code == 0
    np.testing.assert_array_equal(pixels("out.png"), simdtex.mix([GREY, START], (32, 28), pattern=0, **EACH, **SAME))


NONE = "is none of the samples; give the path of one as in the command, or its number, 1 to 2"
BAD_TEXTURES = [
    ([*SOLID, "--size", "4x5"], "size '4x5' is not DEPTHxHEIGHTxWIDTH"),
    ([*SOLID, "--size", "8", "-o", "out.xyz"], "end its name in one of .npy, .npz"),
    ([*SOLID, "--size", "8", "--view", "v.npz"], "end its name in one of .png"),
    ([*MIX[:4], "out.xyz"], "ends in .xyz"),
    ([*MIX, "--palette", "grey.png"], f"--palette grey.png {NONE}"),
    ([*MIX, "--pattern", 0], f"--pattern 0 {NONE}"),
    ([*MIX, "--pattern", 3], NONE),
]


@pytest.mark.parametrize(("args", "words"), BAD_TEXTURES)
def test_bad_textures_get_one_sentence_and_write_nothing(textures, args, words):
    refused(words, *args, "--stages", "st")
