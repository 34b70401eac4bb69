"""``simdtex maspar``, as its user meets it, and its page."""

import io
import json

import numpy as np
import PIL.Image
import pytest
from cases import assert_same_bits, texture
from click.testing import CliRunner

from simdtex import maspar
from simdtex.commands import main
from simdtex.io.image import read, write
from simdtex.maspar import report
from simdtex.model.lattice import Grid


def test_the_command_writes_what_synth_writes_and_prints_the_times_of_1998(tmp_path):
    write(tmp_path / "sample.png", texture((14, 13)))
    common = [str(tmp_path / "sample.png"), "--order", "2", "--seed", "3", "--size", "12x10", "--device", "reference"]
    ours = ["maspar", *common, "-o", str(tmp_path / "ours.png"), "--array", "4x4", "--mapping", "hierarchical"]
    done = CliRunner().invoke(main, ours)
    assert done.exit_code == 0, done.output
    assert f"{tmp_path / 'ours.png'}: 12x10 from 13x14 in " in done.output
    for word in ("A MasPar MP-1 of 4x4 PEs", "distance", "x-net", "all"):
        assert word in done.output
    theirs = ["synth", *common, "-o", str(tmp_path / "theirs.png"), "--preset", "paper"]
    assert CliRunner().invoke(main, theirs).exit_code == 0
    assert_same_bits(*(read(tmp_path / f"{name}.png").pixels for name in ("ours", "theirs")))
    quiet = CliRunner().invoke(main, [*ours, "-q", "--array", "1k"])
    assert (quiet.exit_code, quiet.output) == (0, "")


def test_the_page_has_the_seconds_the_active_pes_and_a_film(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "FRAMES", 3)
    write(tmp_path / "sample.png", texture((14, 13)))
    words = ["maspar", "sample.png", "-o", "out.png", "--order", "2", "--seed", "3", "--size", "12x10"]
    more = ["--array", "8x8", "--report", "page", "--film", "coloring,raster", "--device", "reference"]
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, words + more)
    assert done.exit_code == 0, done.output
    page = (tmp_path / "page" / "index.html").read_text(encoding="utf-8")
    for word in ("simdtex maspar sample.png", "8x8 PEs (cut-and-stack, 4 virtual layers)", "idle PEs", "film"):
        assert word in page
    with PIL.Image.open(tmp_path / "page" / "film.png") as film:
        assert film.n_frames == 3
        assert film.height > 2 * film.width / 3  # PEs above pictures
    results = json.loads((tmp_path / "page" / "results.json").read_text())
    sample = read(tmp_path / "sample.png").pixels
    how = {"array": "8x8", "order": 2, "rng": 3, "device": "reference", "full_output": True}
    _, run = maspar.synthesize(sample, (10, 12), **how)
    assert results["seconds"] == {name: pytest.approx(each) for name, each in run.seconds.items()}
    assert results["utilisation"] == pytest.approx([one.active.mean() for one in run.steps])
    (cooling,) = [row for row in report.section_table(run).rows if row["section"] == "cooling"]
    of_cooling = run.counts["cooling"]["integer"]
    assert set(run.counts["cooling"]) == {"integer", "broadcast"}
    assert f"{1 - of_cooling.active / of_cooling.instructions / 64:.0%}" == cooling["idle PEs"]


def test_a_film_shows_each_site_once_in_a_sweep():
    for name, length in (("synchronous", 1), ("checkerboard", 2), ("raster", 48)):
        ahead = report.steps(name, Grid.of((6, 8)), 1, 5)
        assert (sum(next(ahead) for _ in range(length)) == np.ones((6, 8))).all()


def test_a_film_lights_the_sites_of_a_step(monkeypatch):
    monkeypatch.setattr(report, "FRAMES", 2)
    steps = [np.eye(2, dtype=bool), ~np.eye(2, dtype=bool)]
    with PIL.Image.open(io.BytesIO(report.film({"a": iter(steps)}, {"a": [np.full((1, 1), 9, np.uint8)] * 2}))) as film:
        frames = []
        for number in range(2):
            film.seek(number)
            frames.append(np.array(film.convert("RGB")))
    top, left, half = 4 * report.TEXT + report.GAP, report.GAP, report.SIDE // 2
    corners = [[frame[top + y * half, left + x * half].tolist() for y, x in ((0, 0), (0, 1))] for frame in frames]
    dark, done, lit = report.COLOURS.tolist()
    assert corners == [[lit, dark], [done, lit]]
    assert (frames[1][top + report.SIDE + report.GAP :, left : left + report.SIDE][: report.SIDE] == 9).all()
