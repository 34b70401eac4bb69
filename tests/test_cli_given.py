"""``simdtex synth`` with several samples, masks, known values and guides, end to end."""

import numpy as np
import PIL.Image
import pytest
from click.testing import CliRunner

import simdtex
from simdtex.cli import main
from simdtex.io import image
from simdtex.model.source_map import load_source_map

OPTIONS = {"order": 2, "rng": 5, "device": "reference"}
RED, BLUE, GREEN = (255, 0, 0), (0, 0, 255), (0, 255, 0)


@pytest.fixture
def folder(tmp_path):
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
    for name, pixels in write.items():
        image.write(tmp_path / name, pixels)
    (tmp_path / "wells.csv").write_text("x,y,value\n3,4,200\n10.4,7,17\n")
    return tmp_path


def run(folder, *args):
    """Run a command; what ends like a file is one of the folder."""
    placed = [placed_in(folder, str(arg)) for arg in args]
    return CliRunner().invoke(main, placed)


def placed_in(folder, text):
    if not text.endswith((".png", ".tif", ".npz", ".npy", ".csv")):
        return text
    return "=".join(",".join(f"{folder}/{name}" for name in part.split(",")) for part in text.split("="))


def synth(folder, *args):
    return run(folder, "synth", *args, "--order", 2, "--seed", 5, "--device", "reference")


def made(folder, *args):
    result = synth(folder, *args)
    assert result.exit_code == 0, result.output
    return pixels(folder, "out.tif")


def pixels(folder, name):
    return image.read(folder / name).pixels


def listing(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_several_samples_and_maps_of_them(folder):
    args = ["sample.png", "second.png", "-o", "out.tif", "--size", "18x16", "--shares", "1,2", "--finish", 0]
    also = ["--also", "normal.png,normal2.png=carried.png", "--source-map", "s.npz"]
    out = made(folder, *args, *also)
    samples = [pixels(folder, "sample.png"), pixels(folder, "second.png")]
    assert np.array_equal(out, simdtex.synthesize(samples, (16, 18), shares=(1, 2), finish=0.0, **OPTIONS))
    source = load_source_map(folder / "s.npz")
    maps = [pixels(folder, "normal.png"), pixels(folder, "normal2.png")]
    carried = pixels(folder, "carried.png")
    assert set(np.unique(source[..., 2])) == {0, 1}
    for k, other in enumerate(maps):
        here = source[..., 2] == k
        assert np.array_equal(carried[here], other[source[here][:, 0], source[here][:, 1]])


def test_a_mask_says_what_may_be_used(folder):
    args = ["sample.png", "-o", "out.tif", "--size", "22x18", "--sample-mask", "left.png", "--source-map", "s.npz"]
    out = made(folder, *args)
    assert load_source_map(folder / "s.npz")[..., 1].max() < 10
    mask = pixels(folder, "left.png") > 0
    assert np.array_equal(out, simdtex.synthesize(pixels(folder, "sample.png"), (18, 22), mask=mask, **OPTIONS))


def test_each_sample_has_its_mask(folder):
    masks = ["--sample-mask", "none.png", "--sample-mask", "all.png"]
    made(folder, "sample.png", "second.png", "-o", "out.tif", "--size", 20, *masks, "--source-map", "s.npz")
    assert (load_source_map(folder / "s.npz")[..., 2] == 1).all()


def test_a_sample_may_be_unknown_in_parts(folder):
    unknown = pixels(folder, "unknown.tif")
    out = made(folder, "unknown.tif", "-o", "out.tif", "--stages", folder / "stages", "--size", "24x20")
    assert np.array_equal(out, simdtex.synthesize(unknown, (20, 24), **OPTIONS))
    assert (out == 7.5).all()
    refused = synth(folder, "unknown.tif", "-o", "again.tif", "--method", "multires")
    assert refused.exit_code == 2 and "known everywhere" in refused.output


def test_a_table_is_kept(folder):
    args = ["sample.png", "-o", "out.tif", "--size", "20x14", "--known", "wells.csv"]
    out = made(folder, *args, "--source-map", "s.npz")
    assert out[4, 3] == 200 and out[7, 10] == 17
    known = simdtex.place_hard_data([[3, 4, 200], [10.4, 7, 17]], (14, 20), "uint8")
    sample = pixels(folder, "sample.png")
    assert np.array_equal(out, simdtex.synthesize(sample, (14, 20), known=known, **OPTIONS))
    assert (load_source_map(folder / "s.npz")[4, 3] == -1).all()


@pytest.mark.parametrize("name", ["known.png", "known.tif"])
def test_a_picture_says_what_is_known_and_how_large_the_output_is(folder, name):
    out = made(folder, "sample.png", "-o", "out.tif", "--known", name)
    known = pixels(folder, "known.tif")
    there = ~np.isnan(known)
    assert out.shape == (14, 20) and out.dtype == np.uint8
    assert np.array_equal(out[there], known[there])
    assert np.array_equal(out, simdtex.synthesize(pixels(folder, "sample.png"), (14, 20), known=known, **OPTIONS))


def test_categories_are_never_mixed(folder):
    args = ["facies.tif", "-o", "out.tif", "--size", 16]
    out = made(folder, *args, "--categorical")
    facies = pixels(folder, "facies.tif")
    assert set(np.unique(out)) <= {0, 3}
    assert np.array_equal(out, simdtex.synthesize(facies, (16, 16), categorical=True, **OPTIONS))


def indexed(path, indices, colours, **options):
    """Write a picture with a palette."""
    picture = PIL.Image.fromarray(indices)
    picture.putpalette(np.array(colours, np.uint8).tobytes())
    picture.save(path, **options)


@pytest.mark.parametrize("command", ["synth", "extend", "fill", "fill --sample"])
def test_a_palette_is_categories_and_is_kept(folder, command):
    facies = pixels(folder, "facies.tif")
    indexed(folder / "facies.png", facies, [RED, RED, GREEN, BLUE])
    more = {"synth": ["--size", 16], "extend": ["--right", 3]}.get(command, ["--mask", "hole.png"])
    image.write(folder / "hole.png", np.pad(np.full((4, 4), 255, np.uint8), ((9, 11), (8, 8))))
    for name in ("facies.png", "facies.tif"):
        words = [*command.split(), name, *[name][: " " in command], *more, "-o", name.replace("facies", "out")]
        words += ["--order", 2, "--seed", 5, "--categorical"]
        result = run(folder, *words, "--device", "reference")
        assert result.exit_code == 0, result.output
    with PIL.Image.open(folder / "out.png") as made:
        assert made.mode == "P" and np.array_equal(made, pixels(folder, "out.tif"))
        assert made.getpalette()[:12] == [*RED, *RED, *GREEN, *BLUE]


def test_known_categories_have_the_palette_of_the_sample(folder):
    facies, colours = pixels(folder, "facies.tif"), [RED, RED, GREEN, BLUE]
    known = np.where(np.arange(20) % 7, np.uint8(1), facies[:16])
    indexed(folder / "facies.png", facies, colours)
    indexed(folder / "known.png", known, colours[:3], transparency=1)
    args = ["facies.png", "--known", "known.png", "--size", "20x16", "-o", "out.tif", "--categorical"]
    hidden = np.ma.MaskedArray(known, known == 1)
    found = simdtex.synthesize(facies, (16, 20), known=hidden, categorical=True, **OPTIONS)
    assert np.array_equal(made(folder, *args), found)
    indexed(folder / "known.png", known, colours[::-1], transparency=1)
    result = synth(folder, *args)
    assert result.exit_code == 2 and "facies.png have different palettes; save both with the same" in result.output


def test_guides_with_palettes_are_labels_by_their_colours(folder):
    """However many there are, and in whatever order; or by their indices, beside numbers."""
    sample, labels, wanted = (pixels(folder, name) for name in ("sample.png", "labels.png", "wanted.png"))
    options = {"guide_weight": 4.0, "labels": True} | OPTIONS
    spread = (np.arange(480).reshape(24, 20) // 8).astype(np.uint8)  # too many for other colours to be labels
    tones = np.stack([np.arange(256), np.arange(256)[::-1], np.full(256, 7)], -1)
    indexed(folder / "labels.png", spread, tones)
    indexed(folder / "wanted.png", 255 - spread[:16, :18], tones[::-1])
    args = ["sample.png", "-o", "out.tif", "--guide-weight", 4, "--guide"]
    found = simdtex.synthesize(sample, (16, 18), guide=(spread, spread[:16, :18]), **options)
    assert np.array_equal(made(folder, *args, "labels.png=wanted.png"), found)
    indexed(folder / "wanted.png", numbered(wanted), [GREEN, RED])
    image.write(folder / "labels.tif", numbered(labels))
    found = simdtex.synthesize(sample, (16, 18), guide=(numbered(labels), numbered(wanted)), **options)
    assert np.array_equal(made(folder, *args, "labels.tif=wanted.png"), found)


def numbered(picture):
    return (picture[..., 2] > 0).astype(np.uint8)


def test_colours_are_labels(folder):
    args = ["sample.png", "-o", "out.tif", "--guide", "labels.png=wanted.png", "--source-map", "s.npz"]
    out = made(folder, *args, "--guide-weight", 4, "--novelty", 0)
    sample, labels, wanted = (pixels(folder, name) for name in ("sample.png", "labels.png", "wanted.png"))
    guide = numbered(labels), numbered(wanted)
    found = simdtex.synthesize(sample, (16, 18), guide=guide, guide_weight=4.0, novelty=0.0, **OPTIONS)
    assert np.array_equal(out, found)
    source = load_source_map(folder / "s.npz")
    assert (numbered(labels)[source[..., 0], source[..., 1]] == guide[1]).mean() > 0.9


def test_colours_are_numbers_where_it_says_so(folder):
    args = ["sample.png", "-o", "out.tif", "--guide", "labels.png=strange.png", "--no-labels"]
    sample, labels, wanted = (pixels(folder, name) for name in ("sample.png", "labels.png", "strange.png"))
    found = simdtex.synthesize(sample, (16, 18), guide=(labels, wanted), labels=False, **OPTIONS)
    assert np.array_equal(made(folder, *args), found)


def test_what_is_transparent_in_the_guide_of_the_output_is_left_open(folder):
    out = made(folder, "sample.png", "-o", "out.tif", "--guide", "labels.png=open.png")
    wanted = numbered(pixels(folder, "wanted.png")).astype(float)
    wanted[:, 12:] = np.nan
    guide = numbered(pixels(folder, "labels.png")), wanted
    sample = pixels(folder, "sample.png")
    assert np.array_equal(out, simdtex.synthesize(sample, (16, 18), guide=guide, labels=True, **OPTIONS))


def test_each_sample_has_its_guide(folder):
    args = ["sample.png", "second.png", "-o", "out.tif", "--guide", "labels.png,labels2.png=wanted.png"]
    out = made(folder, *args)
    samples = [pixels(folder, "sample.png"), pixels(folder, "second.png")]
    guides = [numbered(pixels(folder, name)) for name in ("labels.png", "labels2.png")]
    guide = guides, numbered(pixels(folder, "wanted.png"))
    assert np.array_equal(out, simdtex.synthesize(samples, (16, 18), guide=guide, **OPTIONS))


OUT = ["-o", "out.tif"]
ONE, TWO = ["sample.png", *OUT], ["sample.png", "second.png", *OUT]
CATEGORIES = ["facies.tif", *OUT, "--categorical"]
BAD = {
    "samples of another method": ([*TWO, "--method", "pyramid"], "takes one sample"),
    "an option of another method": ([*ONE, "--method", "multires", "--order", 1], "unknown option 'order'"),
    "a mask too few": ([*TWO, "--sample-mask", "left.png"], "give one for each sample"),
    "a mask of another size": ([*ONE, "--sample-mask", "all.png"], "20 x 24"),
    "maps of two kinds": ([*TWO, "--also", "normal.png,second.png=n.png"], "convert them to one type"),
    "maps of another size": ([*TWO, "--also", "normal.png,normal.png=n.png"], "28x16"),
    "a report of several": ([*TWO, "--report", "report"], "leave it out"),
    "known of another size": (
        [*ONE, "--known", "known.png", "--size", "20x20"],
        "known is 14x20x1 and the output 20x20x1",
    ),
    "maps of what is known": ([*ONE, "--known", "known.png", "--also", "normal.png=n.png"], "leave --also out"),
    "a source map that holds no -1": ([*ONE, "--known", "known.png", "--source-map", "s.png"], ".npz"),
    "one guide alone": ([*ONE, "--guide", "labels.png"], "SAMPLE-GUIDE=OUTPUT-GUIDE"),
    "a size beside a guide": ([*ONE, "--guide", "labels.png=wanted.png", "--size", 20], "16x18"),
    "a strange colour": ([*ONE, "--guide", "labels.png=strange.png"], "the colour (0, 255, 0)"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_sentence_and_writes_nothing(folder, case):
    args, words = BAD[case]
    before = listing(folder)
    result = synth(folder, *args)
    assert result.exit_code == 2, result.output
    assert words in result.output
    assert len(result.output.strip().splitlines()) == 1
    assert listing(folder) == before


def test_known_values_of_a_vast_picture_are_not_placed(folder, monkeypatch):
    monkeypatch.setattr("simdtex.machine.memory.available", lambda: 2**30)
    monkeypatch.setattr("simdtex.io.hard_data.place_hard_data", lambda *_: pytest.fail("which takes 4 GiB"))
    result = synth(folder, *ONE, "--known", "wells.csv", "--size", "46341x46341")
    assert result.exit_code == 2 and "4096 MiB of this computer's memory and 1024 MiB is available" in result.output
