"""The study of a folder of samples: one command gives pictures, sheets and a table, before and after."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from cases import texture
from test_quality import deviation, half_size, noise

from simdtex.experiments.quality import measure
from simdtex.io.image import read, write

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"
QUICK = "order=2"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import study

    return study


@pytest.fixture
def figures(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import figures

    return figures


@pytest.fixture
def folder(tmp_path):
    """Two samples, one in colour, and a file that is no picture."""
    (tmp_path / "in").mkdir()
    write(tmp_path / "in" / "grey.png", texture((20, 24)))
    write(tmp_path / "in" / "red.tif", texture((18, 16), 3, np.uint16))
    (tmp_path / "in" / "notes.md").write_text("no picture")
    return tmp_path


def run(folder, monkeypatch, *words):
    """What the command says; it ends well."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import study

    command = ["study.py", "--samples", folder / "in", "--after", QUICK, "--device", "reference", *words]
    monkeypatch.setattr(sys, "argv", [str(word) for word in command])
    study.main()


def table(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def holds(sheet, picture):
    """Whether a picture stands on a sheet at 1:1."""
    rows, cols = picture.shape[:2]
    colours = np.stack([picture] * 3, axis=-1) if picture.ndim == 2 else picture
    corners = np.argwhere((sheet == colours[0, 0]).all(axis=-1))
    return any(np.array_equal(sheet[i : i + rows, j : j + cols], colours) for i, j in corners)


def test_one_command_studies_a_folder(folder, monkeypatch, capsys):
    out = folder / "out"
    run(folder, monkeypatch, "--out", out, "--seeds", 2, "--before", "order=1")
    made = [
        f"{at}{name}" for at in ("", "before/") for name in ("grey-seed2.png", "grey.png", "red-seed2.png", "red.png")
    ]
    sheets = ["sheets/grey.png", "sheets/red.png", "sheets.png", "figures.csv"]
    assert names(out) == sorted([*made, *sheets])
    rows = table(out / "figures.csv")
    order = [(name, setting, seed) for name in ("grey", "red") for seed in "12" for setting in ("before", "after")]
    assert [(row["sample"], row["setting"], row["seed"]) for row in rows] == order
    last = read(out / "red-seed2.png").pixels
    assert last.shape == (36, 32, 3) and last.dtype == np.uint16
    found = measure(read(folder / "in" / "red.tif").pixels, last)
    assert float(rows[-1]["coverage"]) == pytest.approx(found.coverage, abs=5e-5)
    assert float(rows[-1]["effective_share"]) > 0 and rows[-1]["repeats"] == ""  # too small for repeats
    sheet = read(out / "sheets" / "grey.png").pixels
    for picture in (
        "in/grey.png",
        "out/grey.png",
        "out/grey-seed2.png",
        "out/before/grey.png",
        "out/before/grey-seed2.png",
    ):
        assert holds(sheet, read(folder / picture).pixels), picture
    every = read(out / "sheets.png").pixels
    assert holds(every, read(out / "grey.png").pixels) and not holds(every, read(out / "grey-seed2.png").pixels)
    said = capsys.readouterr().out
    assert "left out: " in said and "notes.md" in said
    after = [float(row["coverage"]) for row in rows if row["setting"] == "after"]
    line = next(line for line in said.split("\nafter ")[-1].splitlines() if line.startswith("coverage "))
    assert line.split()[1:3] == [f"{np.mean(after):.3f}", f"{max(after):.3f}"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--out", "in/out", "--before", "order"], "order is no option: give NAME=VALUE"),
        (["--out", "in/out", "--before", "odor=1"], "unknown option 'odor'"),
        (["--out", "a", "--only", "none"], "there is no picture"),
        ([], "--samples needs --out"),
    ],
)
def test_bad_input_gets_one_sentence(folder, monkeypatch, capsys, words, says):
    monkeypatch.chdir(folder)
    with pytest.raises(SystemExit) as ended:
        run(folder, monkeypatch, *words)
    assert ended.value.code == 2
    assert says in capsys.readouterr().err.splitlines()[-1]


def test_the_worst_is_far_from_what_is_best(study):
    def result(name, **figures):
        return study.Result(name, "after", 1, None, figures)

    found = study.summary(
        [
            result("a", salt=0.25, coverage=0.1, effective_share=0.3),
            result("b", salt=3.0, coverage=0.4, effective_share=0.2),
        ]
    )
    assert {figure: worst[2] for figure, worst in found.items()} == {
        **{"salt": "a", "coverage": "b", "effective_share": "b"},
    }
    assert found["salt"][:2] == (1.625, 0.25)


def naive_repeats(picture, scale, step):
    """The share of patches of 16 x 16 that stand again at half the size."""
    half = half_size(picture)
    places = [(i, j) for i in range(half.shape[0] - 15) for j in range(half.shape[1] - 15)]
    asked = [(i, j) for i, j in places if i % (step // 2) == j % (step // 2) == 0]
    again = 0
    for i, j in asked:
        here = half[i : i + 16, j : j + 16]
        far = [(k, m) for k, m in places if max(abs(i - k), abs(j - m)) >= 8]
        again += any(np.sqrt(((here - half[k : k + 16, m : m + 16]) ** 2).mean()) < 0.35 * scale for k, m in far)
    return again / len(asked)


@pytest.mark.parametrize("channels", [(), (3,)])
def test_repeats_against_loops(figures, channels):
    sample, output = noise(20, (56, 60, *channels)), noise(21, (64, 80, *channels))
    output[26:64, :40] = output[:38, 40:]
    scale = deviation(half_size(sample))
    expected = naive_repeats(output, scale, 8), naive_repeats(sample, scale, 8)
    assert 0 < expected[0] < 1
    assert figures.repeats(sample, output) == pytest.approx(expected)


def test_a_repeat_is_as_near_as_035_and_as_far_as_half_a_patch(figures):
    ground = noise(22, (24, 48), float).repeat(2, 0).repeat(2, 1)  # 48 x 96
    ground *= 10 / ground.std()
    sign = np.where(noise(23, (24, 48)) > 100, 1.0, -1.0).repeat(2, 0).repeat(2, 1)

    def share(off, apart):
        made = noise(24, (24, 48), float).repeat(2, 0).repeat(2, 1)
        made[:, apart : apart + 32] = (ground + off * 10 * sign)[:, :32]
        made[:, :32] = ground[:, :32]
        return figures.repeats(ground, made)[0]

    assert share(0.3, 40) > 0 == share(0.4, 40)
    for period, expected in ((14, 0), (16, 2 / 3), (28, 0)):  # of three places each way the outer two are 16 apart
        columns = np.tile(noise(25, (48, period // 2), float).repeat(2, 1), (1, 4))[:, :48]
        assert figures.repeats(columns, columns)[0] == pytest.approx(expected)
        assert figures.repeats(columns, columns.T[:48])[0] == pytest.approx(expected)


@pytest.mark.parametrize("channels", [(), (3,)])
@pytest.mark.parametrize("levels", [2, 200])
def test_a_sample_has_its_own_salt(figures, channels, levels):
    sample = np.random.default_rng(30).integers(0, levels, (40, 50, *channels)).astype(np.uint8)
    assert figures.salt(sample, sample) == pytest.approx(1.0)


def test_salt_counts_odd_pixels(figures):
    sample = np.zeros((40, 50), np.uint8)
    sample[5::10, 5::10] = np.arange(100, 120).reshape(4, 5)  # 20 of 2000 are odd: the 10 largest make 0.5 %
    assert figures.salt(sample, np.zeros_like(sample)) == 0.0
    output = np.zeros_like(sample)
    output[3::6, 3::6] = 200  # 7 x 8
    assert figures.salt(sample, output) == pytest.approx(56 / 2000 / 0.005)
    output[output > 0] = 105  # less than the threshold of 109
    assert figures.salt(sample, output) == 0.0
    in_blue = np.stack([sample * 0, sample * 0, sample], axis=-1)
    made = np.stack([output * 0, (output > 0) * 200, output * 0], axis=-1)
    assert figures.salt(in_blue, made) == pytest.approx(56 / 2000 / 0.005)  # of any channel
