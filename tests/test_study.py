"""The study of a folder of samples: one command gives pictures, sheets and a table, before and after."""

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from cases import texture

from simdtex.experiments.quality import measure
from simdtex.io.image import read, write

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"
QUICK = "order=2"


@pytest.fixture
def over_folder(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    import over_folder

    return over_folder


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


def test_an_earlier_study_is_what_was_before(folder, monkeypatch, capsys):
    first, second = folder / "first", folder / "second"
    run(folder, monkeypatch, "--out", first, "--only", "g*")
    run(folder, monkeypatch, "--out", second, "--before-dir", first)
    rows = table(second / "figures.csv")
    assert [(row["sample"], row["setting"]) for row in rows] == [
        ("grey", "before"),
        ("grey", "after"),
        ("red", "after"),
    ]
    assert rows[0]["coverage"] == rows[1]["coverage"] and rows[0]["effective_share"] == "" != rows[1]["effective_share"]
    assert "red" in capsys.readouterr().out
    assert "before" not in {name.partition("/")[0] for name in names(second)}
    assert holds(read(second / "sheets" / "grey.png").pixels, read(first / "grey.png").pixels)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--out", "in/out", "--before", "order"], "order is no option: give NAME=VALUE"),
        (["--out", "in/out", "--before", "odor=1"], "unknown option 'odor'"),
        (["--out", "a", "--before-dir", "a"], "would be lost"),
        (["--out", "a", "--before", "order=1", "--before-dir", "b"], "give one of them"),
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


def test_two_samples_of_one_name_are_refused(folder, monkeypatch, capsys):
    write(folder / "in" / "grey.jpg", texture((20, 24)))
    with pytest.raises(SystemExit):
        run(folder, monkeypatch, "--out", folder / "out")
    assert "are called grey" in capsys.readouterr().err
    run(folder, monkeypatch, "--out", folder / "out", "--only", "grey.png")
    assert "grey.png" in names(folder / "out")


def test_options_are_read_as_python_has_them(over_folder):
    assert over_folder.parsed("") == {}
    found = over_folder.parsed("order=8, coherence=0.5,preset=paper,levels=None,array=4x4")
    assert found == {"order": 8, "coherence": 0.5, "preset": "paper", "levels": None, "array": "4x4"}


def test_the_worst_is_far_from_what_is_best(over_folder):
    def result(name, **figures):
        return over_folder.Result(name, "after", 1, None, figures)

    found = over_folder.summary(
        [
            result("a", salt=0.25, coverage=0.1, innovation=0.3, coarse_contrast=-0.3),
            result("b", salt=3.0, coverage=0.4, innovation=0.2, coarse_contrast=0.1),
        ]
    )
    assert {figure: worst[2] for figure, worst in found.items()} == {
        **{"salt": "a", "coverage": "b", "innovation": "b", "coarse_contrast": "a"},
    }
    assert found["salt"][:2] == (1.625, 0.25)
