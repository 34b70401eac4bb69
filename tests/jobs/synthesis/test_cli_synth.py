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

# -- ``simdtex synth`` with several samples, masks, known values and guides, end to end.

OPTIONS = {"order": 2, "rng": 5, "device": "reference"}
QUICK = ["--order", 2, "--seed", 5, "--device", "reference"]
RED, BLUE, GREEN = (255, 0, 0), (0, 0, 255), (0, 255, 0)


@pytest.mark.parametrize(("side", "more", "said"), [(7, [], True), (7, ["--order", 2], False), (9, [], False)])
def test_an_order_that_was_chosen_to_fit_is_said(tmp_path, monkeypatch, side, more, said):
    monkeypatch.chdir(tmp_path)
    image.write("tile.png", (np.indices((side, side)).sum(0) % 3 * 60).astype(np.uint8))
    words = ["tile.png", "-o", "more.png", "--size", 3, *more, "--device", "reference"]
    assert ("has order 15, the largest that fits the sample.\n" in run("synth", *words).output) == said


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
        "all.png": np.full((16, 28), 255, np.uint8),
        "none.png": np.zeros((24, 20), np.uint8),
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


def synth(*words):
    return run("synth", *words, *QUICK)


def made(*words):
    result = synth(*words)
    assert result.exit_code == 0, result.output
    return pixels("out.tif")


def test_several_samples_and_maps_of_them(folder):
    args = ["sample.png", "second.png", "-o", "out.tif", "--size", "18x16", "--shares", "1,2", "--finish", 0]
    also = ["--also", "normal.png,normal2.png=carried.png", "--source-map", "s.npz"]
    out = made(*args, *also)
    samples = [pixels("sample.png"), pixels("second.png")]
    assert np.array_equal(out, simdtex.synthesize(samples, (16, 18), shares=(1, 2), finish=0.0, **OPTIONS))
    source = load_source_map(folder / "s.npz")
    maps = [pixels("normal.png"), pixels("normal2.png")]
    carried = pixels("carried.png")
    assert set(np.unique(source[..., 2])) == {0, 1}
    for k, other in enumerate(maps):
        here = source[..., 2] == k
        assert np.array_equal(carried[here], other[source[here][:, 0], source[here][:, 1]])


def test_a_mask_says_what_may_be_used(folder):
    args = ["sample.png", "-o", "out.tif", "--size", "22x18", "--sample-mask", "left.png", "--source-map", "s.npz"]
    out = made(*args)
    assert load_source_map(folder / "s.npz")[..., 1].max() < 10
    mask = pixels("left.png") > 0
    assert np.array_equal(out, simdtex.synthesize(pixels("sample.png"), (18, 22), mask=mask, **OPTIONS))


def test_a_sample_may_be_unknown_in_parts(folder):
    unknown = pixels("unknown.tif")
    out = made("unknown.tif", "-o", "out.tif", "--stages", folder / "stages", "--size", "24x20")
    assert np.array_equal(out, simdtex.synthesize(unknown, (20, 24), **OPTIONS))
    assert (out == 7.5).all()
    refused("known everywhere", "synth", "unknown.tif", "-o", "again.tif", "--method", "multires", *QUICK)


def test_a_table_is_kept(folder):
    args = ["sample.png", "-o", "out.tif", "--size", "20x14", "--known", "wells.csv"]
    out = made(*args, "--source-map", "s.npz")
    assert out[-1 - 4, 3] == 200 and out[-1 - 7, 10] == 17, "y points north"
    known = simdtex.place_hard_data([[3, 4, 200], [10.4, 7, 17]], (14, 20), "uint8")[::-1]
    sample = pixels("sample.png")
    assert np.array_equal(out, simdtex.synthesize(sample, (14, 20), known=known, **OPTIONS))
    assert (load_source_map(folder / "s.npz")[-1 - 4, 3] == -1).all()


@pytest.mark.parametrize("name", ["known.png", "known.tif"])
def test_a_picture_says_what_is_known_and_how_large_the_output_is(folder, name):
    out = made("sample.png", "-o", "out.tif", "--known", name)
    known = pixels("known.tif")
    there = ~np.isnan(known)
    assert out.shape == (14, 20) and out.dtype == np.uint8
    assert np.array_equal(out[there], known[there])
    assert np.array_equal(out, simdtex.synthesize(pixels("sample.png"), (14, 20), known=known, **OPTIONS))


def test_categories_are_never_mixed(folder):
    args = ["facies.tif", "-o", "out.tif", "--size", 16]
    out = made(*args, "--categorical")
    facies = pixels("facies.tif")
    assert set(np.unique(out)) <= {0, 3}
    assert np.array_equal(out, simdtex.synthesize(facies, (16, 16), categorical=True, **OPTIONS))


def indexed(path, indices, colours, **options):
    """Write a picture with a palette."""
    picture = PIL.Image.fromarray(indices)
    picture.putpalette(np.array(colours, np.uint8).tobytes())
    picture.save(path, **options)


@pytest.mark.parametrize("command", ["synth", "extend", "fill", "fill --sample"])
def test_a_palette_is_categories_and_is_kept(folder, command):
    facies = pixels("facies.tif")
    indexed(folder / "facies.png", facies, [RED, RED, GREEN, BLUE])
    more = {"synth": ["--size", 16], "extend": ["--right", 3]}.get(command, ["--mask", "hole.png"])
    image.write(folder / "hole.png", np.pad(np.full((4, 4), 255, np.uint8), ((9, 11), (8, 8))))
    for name in ("facies.png", "facies.tif"):
        words = [*command.split(), name, *[name][: " " in command], *more, "-o", name.replace("facies", "out")]
        words += ["--order", 2, "--seed", 5, "--categorical"]
        result = run(*words, "--device", "reference")
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
    result = synth(*args)
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


def numbered(picture):
    return (picture[..., 2] > 0).astype(np.uint8)


def test_colours_are_labels(folder):
    args = ["sample.png", "-o", "out.tif", "--guide", "labels.png=wanted.png", "--source-map", "s.npz"]
    out = made(*args, "--guide-weight", 4, "--novelty", 0)
    sample, labels, wanted = (pixels(name) for name in ("sample.png", "labels.png", "wanted.png"))
    guide = numbered(labels), numbered(wanted)
    found = simdtex.synthesize(sample, (16, 18), guide=guide, guide_weight=4.0, novelty=0.0, **OPTIONS)
    assert np.array_equal(out, found)
    source = load_source_map(folder / "s.npz")
    assert (numbered(labels)[source[..., 0], source[..., 1]] == guide[1]).mean() > 0.9


def test_colours_are_numbers_where_it_says_so(folder):
    args = ["sample.png", "-o", "out.tif", "--guide", "labels.png=strange.png", "--no-labels"]
    sample, labels, wanted = (pixels(name) for name in ("sample.png", "labels.png", "strange.png"))
    found = simdtex.synthesize(sample, (16, 18), guide=(labels, wanted), labels=False, **OPTIONS)
    assert np.array_equal(made(*args), found)


def test_what_is_transparent_in_the_guide_of_the_output_is_left_open(folder):
    out = made("sample.png", "-o", "out.tif", "--guide", "labels.png=open.png")
    wanted = numbered(pixels("wanted.png")).astype(float)
    wanted[:, 12:] = np.nan
    guide = numbered(pixels("labels.png")), wanted
    sample = pixels("sample.png")
    assert np.array_equal(out, simdtex.synthesize(sample, (16, 18), guide=guide, labels=True, **OPTIONS))


def test_each_sample_has_its_guide(folder):
    args = ["sample.png", "second.png", "-o", "out.tif", "--guide", "labels.png,labels2.png=wanted.png"]
    out = made(*args)
    samples = [pixels("sample.png"), pixels("second.png")]
    guides = [numbered(pixels(name)) for name in ("labels.png", "labels2.png")]
    guide = guides, numbered(pixels("wanted.png"))
    assert np.array_equal(out, simdtex.synthesize(samples, (16, 18), guide=guide, **OPTIONS))


OUT = ["-o", "out.tif"]
ONE, TWO = ["sample.png", *OUT], ["sample.png", "second.png", *OUT]
BAD = {
    "an option of another method": ([*ONE, "--method", "multires", "--order", 1], "unknown option 'order'"),
    "a mask too few": ([*TWO, "--sample-mask", "left.png"], "give one for each sample"),
    "maps of two kinds": ([*TWO, "--also", "normal.png,second.png=n.png"], "convert them to one type"),
    "maps of another size": ([*TWO, "--also", "normal.png,normal.png=n.png"], "28x16"),
    "a report of several": ([*TWO, "--report", "report"], "leave it out"),
    "maps of what is known": ([*ONE, "--known", "known.png", "--also", "normal.png=n.png"], "leave --also out"),
    "a source map that holds no -1": ([*ONE, "--known", "known.png", "--source-map", "s.png"], ".npz"),
    "one guide alone": ([*ONE, "--guide", "labels.png"], "SAMPLE-GUIDE=OUTPUT-GUIDE"),
    "a size beside a guide": ([*ONE, "--guide", "labels.png=wanted.png", "--size", 20], "16x18"),
    "a strange colour": ([*ONE, "--guide", "labels.png=strange.png"], "the colour (0, 255, 0)"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_sentence_and_writes_nothing(folder, case):
    args, words = BAD[case]
    refused(words, "synth", *args, *QUICK)


def test_known_values_of_a_vast_picture_are_not_placed(folder, monkeypatch):
    monkeypatch.setattr("simdtex.machine.memory.available", lambda: 2**30)
    monkeypatch.setattr("simdtex.io.hard_data.place_hard_data", lambda *_: pytest.fail("which takes 4 GiB"))
    result = synth(*ONE, "--known", "wells.csv", "--size", "46341x46341")
    assert result.exit_code == 2 and "4096 MiB of this computer's memory and 1024 MiB is available" in result.output


# -- The methods multires and pyramid, ``simdtex solid`` and ``simdtex mix``

GREY, COLOUR = texture((32, 28)), texture((32, 28), 3, seed=1)
OTHER, START = texture((30, 34), 3, seed=2), texture((24, 40), seed=3)
FILES = ["colour.png", "grey.png", "other.png", "start.png", "wide.png"]
SAME = {"rng": 5, "device": "reference"}
SEEDED = ["--seed", 5, "--device", "reference"]
FEW = ["--levels", 1, "--iterations", 2]
EACH = {"levels": 1, "iterations": 2}


@pytest.fixture
def textures(tmp_path, monkeypatch):
    """A folder with samples and nothing else; the present one."""
    pictures = {"grey": GREY, "colour": COLOUR, "other": OTHER, "start": START, "wide": texture((32, 28), 3, np.uint16)}
    for name, picture in pictures.items():
        image.write(tmp_path / f"{name}.png", picture)
    monkeypatch.chdir(tmp_path)
    return tmp_path


PYRAMID = ["synth", "grey.png", "-o", "out.png", "--method", "pyramid", *SEEDED]
SOLID = ["solid", "grey.png", "-o", "out.npz", *SEEDED]
MIX = ["mix", "colour.png", "other.png", "-o", "out.png", *SEEDED]


MULTIRES = ["synth", "grey.png", "-o", "out.png", "--method", "multires", *SEEDED]


def test_everything_at_once(textures):
    args = ["--size", "44x36", "--alpha", "0.6", "--orientations", 3]
    args += ["--levels", 4, "--boundary", "open", "--preset", "paper"]
    result = run(*MULTIRES, *args, "--stages", "st", "--source-map", "s.npz", "--also", "colour.png=c.png")
    assert result.exit_code == 0, result.output
    options = {"alpha": 0.6, "orientations": 3, "levels": 4, "boundary": "open", "preset": "paper"} | SAME
    np.testing.assert_array_equal(pixels("out.png"), simdtex.synthesize(GREY, (36, 44), method="multires", **options))
    source = load_source_map("s.npz")
    np.testing.assert_array_equal(pixels("c.png"), COLOUR[source[..., 0], source[..., 1]])
    assert names("st") == sorted(f"{kind}level{level}.png" for kind in ("", "candidates-") for level in range(4))
    assert "candidates per level, coarse to fine: " in result.output


# -- ``simdtex synth --method pyramid``, ``simdtex solid`` and ``simdtex mix``

OPTIONS_PYRAMID = {
    "plain": ([], {}),
    "sharing options": (
        ["--orientations", 2, "--levels", 2, "--edges", "wrap", "--iterations", 1],
        {"orientations": 2, "levels": 2, "edges": "wrap", "iterations": 1},
    ),
    "tables": (
        ["--pyramid", "laplacian", "--preset", "paper", *FEW],
        {"pyramid": "laplacian", "match": "lookup", **EACH},
    ),
}


@pytest.mark.parametrize("case", OPTIONS_PYRAMID)
def test_synth_is_what_python_makes(textures, case):
    args, options = OPTIONS_PYRAMID[case]
    result = run(*PYRAMID, "--size", "44x40", *args)
    assert result.exit_code == 0, result.output
    expected, output = simdtex.synthesize(GREY, (40, 44), method="pyramid", full_output=True, **options, **SAME)
    np.testing.assert_array_equal(pixels("out.png"), expected)
    first, second = result.output.splitlines()[-2:]
    assert re.fullmatch(r"out\.png: 44x40 from 28x32 in [\d.]+ s on .+, seed 5", first)
    assert second == last_iteration(output.statistics)
    assert names() == sorted([*FILES, "out.png"])


def test_stages_of_synth_replace_those_of_an_earlier_run(textures):
    (textures / "st").mkdir()
    image.write("st/level3.png", GREY)
    image.write("st/iteration09.png", GREY)
    assert run(*PYRAMID, "--stages", "st", *FEW).exit_code == 0
    assert names("st") == ["iteration01.png", "iteration02.png"]
    np.testing.assert_array_equal(np.sort(pixels("st/iteration02.png"), None), np.sort(pixels("out.png"), None))
    (textures / "st" / "mine.txt").write_text("kept")
    again = run(*PYRAMID, "--stages", "st", *FEW)
    assert again.exit_code == 2 and again.output.count("\n") == 1 and (textures / "st" / "mine.txt").exists()


@pytest.mark.parametrize("more", [["--source-map", "map.npz"], ["--also", "colour.png=c.png"]], ids=str)
def test_a_method_without_sources_has_no_source_map(textures, more):
    words = "takes no pixel from the sample; give one picture, and leave --source-map and --also out"
    refused(words, *PYRAMID, "--stages", "st", *more)


def test_solid_is_what_python_makes(textures):
    args = ["--preset", "paper", "--orientations", 2, "--edges", "wrap", *FEW]
    result = run(
        *SOLID, "--size", "6x10x8", "-o", "out.nrrd", "-o", "out.tif", "-o", "slices", "--view", "v.png", *args
    )
    assert result.exit_code == 0, result.output
    options = {"solids": "average", "slices": "each", "match": "lookup", "orientations": 2, "edges": "wrap", **EACH}
    expected, output = simdtex.synthesize_solid(GREY, (6, 10, 8), full_output=True, **options, **SAME)
    for name in ("out.npz", "out.nrrd", "out.tif", "slices"):
        np.testing.assert_array_equal(loaded(name), expected)
    np.testing.assert_array_equal(pixels("v.png"), view(expected))
    first, second = result.output.splitlines()[-2:]
    written = r"out\.npz, out\.nrrd, out\.tif, slices, v\.png"
    assert re.fullmatch(rf"{written}: 6x10x8 from 28x32 in [\d.]+ s on .+, seed 5", first)
    assert second == last_iteration(output.statistics)


def test_stages_of_a_solid_are_its_middle_slice(textures):
    (textures / "st").mkdir()
    image.write("st/iteration09.png", GREY)
    assert run("solid", "colour.png", *SOLID[2:], "--size", "5x12x9", "--stages", "st", *FEW).exit_code == 0
    assert names("st") == ["iteration01.png", "iteration02.png"]
    made = loaded("out.npz")
    assert made.shape == (5, 12, 9, 3)
    np.testing.assert_array_equal(pixels("st/iteration02.png"), made[2])


SOLID_SIZES = ["0", "4x5", "4x5x6x7", "1.5"]
BAD_SOLID = {
    **{f"size {text}": (["--size", text], f"size '{text}' is not DEPTHxHEIGHTxWIDTH") for text in SOLID_SIZES},
    "suffix": (["-o", "out.xyz"], "end its name in one of .npy, .npz"),
    "view suffix": (["--view", "v.npz"], "end its name in one of .png"),
    "no folder": (["--view", "nowhere/v.png"], "the folder nowhere does not exist"),
}


@pytest.mark.parametrize("case", BAD_SOLID)
def test_bad_solids_get_one_sentence_and_write_nothing(textures, case):
    args, words = BAD_SOLID[case]
    size = [] if "--size" in args else ["--size", "8"]
    refused(words, *SOLID, *size, "--stages", "st", *args)


MIXTURES = {
    "average of all": ([], {}),
    "palette by path, pattern by number": (["--palette", "other.png", "--pattern", 1], {"palette": 1, "pattern": 0}),
    "pattern by path": (["--pattern", "./other.png"], {"pattern": 1}),
    "weights": (["--average", "1,0.5"], {"average": [1, 0.5]}),
    "low and high": (["--low", 2, "--high", "colour.png"], {"low": 1, "high": 0}),
    "colours": (
        ["--palette", 2, "--color", "channels", "--edges", "wrap"],
        {"palette": 1, "color": "channels", "edges": "wrap"},
    ),
}


@pytest.mark.parametrize("case", MIXTURES)
def test_mix_is_what_python_makes(textures, case):
    args, options = MIXTURES[case]
    result = run(*MIX, "--size", "44x40", "--orientations", 2, *FEW, *args)
    assert result.exit_code == 0, result.output
    options = {"orientations": 2, "channel_axis": -1, **EACH, **options}
    expected, output = simdtex.mix([COLOUR, OTHER], (40, 44), full_output=True, **options, **SAME)
    np.testing.assert_array_equal(pixels("out.png"), expected)
    first, second = result.output.splitlines()[-2:]
    assert re.fullmatch(r"out\.png: 44x40 from 2 samples in [\d.]+ s on .+, seed 5", first)
    assert second == last_iteration(output.statistics)


def test_a_path_wins_over_a_number(textures):
    image.write("1.png", GREY)
    (textures / "1.png").rename("2")
    assert run("mix", "2", "start.png", *MIX[3:], "--pattern", "2", *FEW).exit_code == 0
    expected = simdtex.mix([GREY, START], (64, 56), pattern=0, **EACH, **SAME)
    np.testing.assert_array_equal(pixels("out.png"), expected)


P = "give the path of one as in the command, or its number, 1 to 2"
BAD_MIX = {
    "unknown palette": (["--palette", "grey.png"], f"--palette grey.png is none of the samples; {P}"),
    "pattern 0": (["--pattern", 0], f"--pattern 0 is none of the samples; {P}"),
    "pattern 3": (["--pattern", 3], P),
    "negative": (["--low", -1, "--high", 1], f"--low -1 is none of the samples; {P}"),
    "no number": (["--high", "1.0", "--low", 1], f"--high 1.0 is none of the samples; {P}"),
    "weights in words": (["--average", "much,little"], "--average much,little must be numbers separated by commas"),
}


@pytest.mark.parametrize("case", BAD_MIX)
def test_bad_mixtures_get_one_sentence_and_write_nothing(textures, case):
    args, words = BAD_MIX[case]
    refused(words, *MIX, "--stages", "st", *args)
