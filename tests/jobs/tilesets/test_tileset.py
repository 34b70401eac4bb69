"""`simdtex.tileset` and ``simdtex tileset``: corner tiles, and what other programs read."""

import re
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture
from commands import refused, run
from skimage import data

import simdtex
from simdtex.io import image
from simdtex.jobs.tilesets import files as tilesets
from simdtex.jobs.tilesets.corners import CYCLE, TORUS, corners_of, numbers, plane, torus
from simdtex.jobs.tilesets.job import Tileset
from simdtex.options import DataWarning

GRAVEL, GRASS = data.gravel()[:40, :40], data.grass()[:36, :40]
QUICK = {"order": 2, "rng": 1, "xi": -8.0, "device": REFERENCE}


def made(sample=GRAVEL, size=16, **options):
    return simdtex.tileset(sample, size, full_output=True, **(QUICK | options))


@pytest.fixture(scope="module")
def tiles():
    return made()


def tileset(*words):
    done = run("tileset", *words, *SMALL)
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.parametrize("colours", TORUS)
def test_the_torus_has_each_combination_once(colours):
    grid, found = torus(colours), corners_of(torus(colours)).reshape(-1, 4)
    assert len(found) == len({*map(tuple, found.tolist())}) == colours**4
    for corners in found:
        row, col = divmod(numbers(colours)[tuple(corners)], colours**2)
        around = [grid[(row + y) % len(grid), (col + x) % len(grid)] for y in (0, 1) for x in (0, 1)]
        assert around == corners.tolist()
    cycle = CYCLE[colours]
    assert len({a + b for a, b in zip(cycle, cycle[1:] + cycle[0], strict=True)}) == len(cycle) == colours**2


def test_a_border_is_the_same_in_all_tiles_that_have_it(tiles):
    (packed, output), size, grid = tiles, 16, torus(2)
    job = Tileset(None, (size, size), 2, *[None] * 3)
    for picture in (packed, output.source):
        borders = {}  # the pixels on both sides of the border above each tile, and of that on its left, by its colours
        for (row, col), here in np.ndenumerate(grid):
            for down, pixels in ((False, picture), (True, picture.swapaxes(0, 1))):
                y, x = (col, row) if down else (row, col)
                part = np.take(pixels, np.arange(-job.narrow, job.narrow) + y * size, axis=0, mode="wrap")
                other = grid[(row + down) % 4, (col + (not down)) % 4]
                borders.setdefault((down, here, other), []).append(part[:, x * size : (x + 1) * size])
        assert [len(those) for those in borders.values()] == [4] * 8
        for those in borders.values():
            assert all((those[0] == one).all() for one in those[1:])
    rolled = np.roll(packed, (job.wide, job.wide), (0, 1))
    for colour in (0, 1):
        places = np.argwhere(grid == colour) * size
        squares = [rolled[y:, x:][: 2 * job.wide, : 2 * job.wide] for y, x in places]
        assert all((squares[0] == one).all() for one in squares[1:])


def test_the_three_runs_share_no_random_number(monkeypatch):
    plans, plan = [], Tileset.plan
    monkeypatch.setattr(Tileset, "plan", lambda *given: plans.append(plan(*given)) or plans[-1])
    simdtex.tileset(texture((14, 15)), 16, order=1, levels=2, rng=1, device=REFERENCE)
    grids = [one.grid(0) for one in plans]
    keys = np.concatenate([grid.places(np.arange(grid.size)) for grid in grids])
    assert (len(plans), np.unique(keys).size) == (3, keys.size)


def test_all_pixels_are_from_the_sample(tiles):
    _, output = tiles
    assert output.source.shape == (64, 64, 2) and (output.source >= 0).all()
    assert output.statistics["corners"] == torus(2).tolist()
    exact, more = made(finish=0, array="64x64")
    assert_same_bits(exact, GRAVEL[more.source[..., 0], more.source[..., 1]])
    runs = more.statistics["runs"]
    assert runs[-1]["job"] == "tiles" and len(runs) == 3 and all(one["accounting"]["steps"] for one in runs)


def test_a_plane_is_made_of_the_tiles(tiles):
    packed, _ = tiles
    corners = np.random.default_rng(3).integers(0, 2, (4, 6))
    found = plane(packed, corners)
    assert found.shape == (3 * 16, 5 * 16)
    for row, col in np.ndindex(3, 5):
        y, x = divmod(numbers(2)[tuple(corners[row : row + 2, col : col + 2].ravel())], 4)
        tile = packed[y * 16 : y * 16 + 16, x * 16 : x * 16 + 16]
        assert_same_bits(found[row * 16 : row * 16 + 16, col * 16 : col * 16 + 16], tile)
    assert_same_bits(plane(packed, np.pad(torus(2), (0, 1), "wrap")), packed)


@pytest.mark.slow
def test_no_border_of_a_plane_differs_from_the_other_lines():
    packed, _ = made(data.gravel()[:128, :128], 48, order=8)
    laid = plane(packed, np.random.default_rng(1).integers(0, 2, (9, 9)))
    shuffled = packed.reshape(4, 48, 4, 48).swapaxes(1, 2)[::-1, ::-1].swapaxes(1, 2).reshape(packed.shape)
    wrong = plane(shuffled, np.random.default_rng(1).integers(0, 2, (9, 9)))  # tiles in the wrong places
    for axis in (0, 1):
        figures = []
        for one in (laid, wrong):
            steps, at = np.abs(np.diff(one.astype(float), axis=axis)).mean(1 - axis), np.arange(47, 383, 48)
            others = np.delete(steps, at)
            figures.append((np.array([steps[at].mean(), steps[at].max()]) - others.mean()) / others.std())
        assert abs(figures[0][0]) < 1.5 and figures[0][1] < 3 and figures[1][0] > 2, figures


@pytest.mark.slow
def test_the_bytes_are_those_of_the_reference(machine):
    options = {"order": 2, "rng": 5, "xi": -8.0}
    ours, theirs = (simdtex.tileset([GRAVEL, GRASS], (16, 18), device=on, **options) for on in (machine, REFERENCE))
    assert_same_bits(ours, theirs)


def test_a_lattice_that_does_not_fit_a_tile_is_refused_with_tiles_that_fit():
    with pytest.raises(ValueError, match=r"fit tiles of 20x16; make tiles of 20x20$"):
        made(GRAVEL, (16, 20), lattice=((10, 0), (0, 10)))
    assert made(GRAVEL, 20, lattice=((10, 0), (0, 10)))[0].shape == (80, 80)


def bricks(rows, cols, joint, side):
    row, col = np.indices((side, side))
    tone = np.random.default_rng(1).integers(120, 230, (side // rows + 1, side // cols + 1))
    return np.where((row % rows < joint) | (col % cols < joint), 40, tone[row // rows, col // cols]).astype(np.uint8)


def test_a_lattice_has_one_phase_at_all_corners_and_one_that_does_not_fit_is_told():
    packed, output = made(bricks(8, 9, 2, 48), (16, 18), finish=0)
    assert output.statistics["lattice"] and output.statistics["lattice"]["deformation"] < 0.01
    place = output.source
    for axis, period in ((0, 8), (1, 9)):
        apart = (place[..., axis] - np.indices(packed.shape)[axis]) % period
        assert np.bincount(apart.ravel()).max() / apart.size > 0.9
    corners = place[::16, ::18].reshape(-1, 2)
    assert len({(y % 8, x % 9) for y, x in corners.tolist()}) == 1
    with pytest.warns(DataWarning, match="no whole cells .* tiles of 20x20; 24x24 fit better"):
        made(bricks(12, 12, 2, 48), 20)


def test_terrain_has_the_texture_of_each_corner():
    _, output = made([GRAVEL, GRASS], 16)
    number, grid = output.source[..., 2], torus(2)
    around = np.roll(number, (4, 4), (0, 1))
    for (y, x), colour in np.ndenumerate(grid):
        assert (around[16 * y : 16 * y + 8, 16 * x : 16 * x + 8] == colour).all()
    for y, x in np.argwhere((corners_of(grid) == corners_of(grid)[..., :1]).all(-1)):
        assert (number[16 * y : 16 * y + 16, 16 * x : 16 * x + 16] == grid[y, x]).all()
    three, output = made([GRAVEL, GRASS, 255 - GRAVEL], 16)
    assert three.shape == (144, 144) and {*np.unique(output.source[..., 2])} == {0, 1, 2}


@pytest.mark.parametrize(
    ("sample", "size", "options", "told"),
    [
        (GRAVEL, 15, {}, "give 16 or more"),
        (GRAVEL, 24, {"colours": 4}, "colours is 4; give 3 or fewer"),
        ([GRAVEL, GRASS], 24, {"colours": 3}, "3 colours and 2 samples"),
        (GRAVEL[:30, :30], 128, {}, "40x40 known pixels"),
        (GRAVEL, 24, {"boundary": "open"}, "leave boundary out"),
        (GRAVEL, 24, {"preset": "paper", "pixel": "density"}, 'give pixel="source"'),
        (np.where(np.indices((40, 40))[0] % 6 < 1, np.nan, GRAVEL), 32, {}, "known pixels"),
    ],
)
def test_what_cannot_be_made_is_refused(sample, size, options, told):
    with pytest.raises(ValueError, match=told):
        made(sample, size, **options)


def test_progress_ascends_and_names_the_jobs():
    seen = []
    made(callback=lambda progress: seen.append((progress.fraction, progress.job, progress.image().ndim)))
    fractions, jobs, axes = zip(*seen, strict=True)
    assert [*fractions] == sorted(fractions) and 0 <= fractions[0] < 0.1 and 0.9 < fractions[-1] <= 1
    assert [*dict.fromkeys(jobs)][-1] == "tiles" and {*axes} == {2}


# -- The command, and the files for other programs

SMALL = ("--size", "18x16", "--order", 2, "--seed", 3, "--device", "reference")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, picture in (("gravel", GRAVEL), ("grass", GRASS)):
        image.write(f"{name}.png", picture)
        (tmp_path / name).mkdir()
        image.write(f"{name}/{name}_albedo.png", np.stack([picture] * 3, -1))
        image.write(f"{name}/{name}_height.png", 255 - picture)
    return tmp_path


def test_the_files_of_a_set(folder):
    assert "16 tiles of 18x16" in tileset("gravel.png", "-o", "out")
    packed = image.read("out/gravel.png").pixels
    assert_same_bits(packed, simdtex.tileset(GRAVEL, (16, 18), order=2, rng=3, device=REFERENCE))
    for a, b, c, d in np.ndindex(2, 2, 2, 2):
        row, col = divmod(numbers(2)[a, b, c, d], 4)
        tile = packed[row * 16 : row * 16 + 16, col * 18 : col * 18 + 18]
        assert_same_bits(image.read(f"out/gravel-{a}{b}{c}{d}.png").pixels, tile)
    assert len([*(folder / "out").iterdir()]) == 1 + 16 + 5
    tileset("gravel.png", "-o", "out")  # files of its own are replaced
    refused("--colours is 99; give 3 or fewer", "tileset", "gravel.png", "-o", "out", "--colours", 99)
    (folder / "out" / "mine.txt").write_text("mine")
    refused("holds other files (mine.txt)", "tileset", "gravel.png", "-o", "out", *SMALL)


def test_terrains_of_samples_of_one_name_are_told_apart(folder):
    tileset("gravel.png", shutil.copy("grass.png", "grass/gravel.png"), "-o", "out")
    assert re.findall(r'wangcolor name="([^"]*)"', Path("out/tiles.tsx").read_text()) == ["gravel 1", "gravel 2"]


def test_all_maps_of_a_material_have_one_arrangement(folder):
    tileset("gravel", "grass", "-o", "terrain", "--finish", 0)
    for which in ("", "-0110"):
        names = [f"terrain/gravel_{role}-grass_{role}{which}.png" for role in ("albedo", "height")]
        albedo, height = (image.read(name).pixels for name in names)
        assert_same_bits(albedo[..., 0], 255 - height)
    (folder / "grass" / "grass_ao.png").symlink_to("grass_height.png")
    words = ["-o", "other", *SMALL]
    refused("gravel has no ao map", "tileset", "gravel", "grass", *words)
    (folder / "grass" / "grass_ao.png").unlink()
    (folder / "grass" / "grass_height.png").unlink()
    refused("grass has no height map", "tileset", "gravel", "grass", *words)
    refused("not all samples are", "tileset", "gravel", "grass.png", *words)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("tmxrasterizer"), reason="tmxrasterizer (Debian's tiled) is not installed")
def test_tiled_shows_the_plane(folder):
    tileset("grass", "gravel", "-o", "out")
    words = ["tmxrasterizer", "out/plane.tmx", "shown.png"]
    subprocess.run(words, check=True, env={"QT_QPA_PLATFORM": "offscreen", "PATH": "/usr/bin:/bin"})
    assert_same_bits(image.read("shown.png").pixels[..., :3], image.read("out/plane.png").pixels)


def test_terrains_of_editors_are_the_corners():
    about = "a.png", (20, 24), ["sand", "grass"], corners_of(torus(2))
    root = ElementTree.fromstring(tilesets.tiled_set(*about).encode())
    assert [one.get("name") for one in root.iter("wangcolor")] == ["sand", "grass"]
    found = {int(one.get("tileid")): [*map(int, one.get("wangid").split(","))] for one in root.iter("wangtile")}
    text = tilesets.godot_set(*about)
    assert 'path="a.png"' in text and "tile_size = Vector2i(24, 20)" in text and "terrain_set_0/mode = 1" in text
    quoted = tilesets.godot_set('a"\\b.png', (20, 24), ['a"', "ä"], about[-1])
    assert r'path="a\"\\b.png"' in quoted and r'terrain_0/name = "a\""' in quoted and 'name = "ä"' in quoted
    for (row, col), _ in np.ndenumerate(torus(2)):
        a, b, c, d = corners_of(torus(2))[row, col].tolist()
        assert found[row * 4 + col] == [0, b + 1, 0, d + 1, 0, c + 1, 0, a + 1]
        bits = re.findall(rf"^{col}:{row}/0/terrains_peering_bit/(\w+) = (\d)$", text, re.MULTILINE)
        sides = ("top_left_corner", "top_right_corner", "bottom_left_corner", "bottom_right_corner")
        assert bits == [*zip(sides, map(str, (a, b, c, d)), strict=True)]


@pytest.mark.parametrize("colours", TORUS)
def test_the_shader_finds_each_tile(colours):
    text, page = tilesets.glsl(numbers(colours)), Path(__file__).parents[3] / "docs" / "readers" / "tiles.glsl"
    places = [*map(int, re.search(r"\((.*)\);", text.partition("PLACE")[2])[1].split(", "))]
    assert places == numbers(colours).ravel().tolist()
    assert colours != 2 or page.read_text(encoding="utf-8") == text
