"""`simdtex.tileset` and ``simdtex tileset``: corner tiles, and what other programs read."""

import re
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture
from click.testing import CliRunner
from skimage import data

import simdtex
from simdtex.commands import main
from simdtex.io import image
from simdtex.jobs.tilesets import files as tilesets
from simdtex.jobs.tilesets.corners import CYCLE, TORUS, corners_of, numbers, plane, torus
from simdtex.jobs.tilesets.job import Tileset
from simdtex.options import DataWarning

GRAVEL, GRASS = data.gravel()[:64, :64], data.grass()[:60, :64]
QUICK = {"order": 2, "rng": 1, "xi": -8.0, "device": REFERENCE}


def made(sample=GRAVEL, size=24, **options):
    return simdtex.tileset(sample, size, full_output=True, **(QUICK | options))


@pytest.fixture(scope="module")
def tiles():
    return made()


def run(*words):
    return CliRunner().invoke(main, ["tileset", *map(str, words)], prog_name="simdtex")


@pytest.mark.parametrize("colours", TORUS)
def test_the_torus_has_each_combination_once(colours):
    found = corners_of(torus(colours)).reshape(-1, 4)
    assert len(found) == len({*map(tuple, found.tolist())}) == colours**4
    for corners in found:
        row, col = divmod(numbers(colours)[tuple(corners)], colours**2)
        grid = torus(colours)
        around = [grid[(row + y) % len(grid), (col + x) % len(grid)] for y in (0, 1) for x in (0, 1)]
        assert around == corners.tolist()
    cycle = CYCLE[colours]
    assert len({a + b for a, b in zip(cycle, cycle[1:] + cycle[0], strict=True)}) == len(cycle) == colours**2


def around_borders(packed, side, half):
    """The pixels on both sides of the border above each tile, and of that on its left, by the border's two colours."""
    found = {}
    grid = torus(2)
    for (row, col), here in np.ndenumerate(grid):
        for down, pixels in ((False, packed), (True, packed.swapaxes(0, 1))):
            y, x = (col, row) if down else (row, col)
            part = np.take(pixels, np.arange(y * side - half, y * side + half), axis=0, mode="wrap")
            other = grid[(row + down) % 4, (col + (not down)) % 4]
            found.setdefault((down, here, other), []).append(part[:, x * side : (x + 1) * side])
    return found


def test_a_border_is_the_same_in_all_tiles_that_have_it(tiles):
    (packed, output), size = tiles, 24
    half = Tileset(None, (size, size), 2, *[None] * 3).narrow
    for picture in (packed, output.source):
        borders = around_borders(picture, size, half)
        assert len(borders) == 8
        for those in borders.values():
            assert len(those) == 4
            for one in those[1:]:
                assert_same_bits(those[0], one)
    wide = Tileset(None, (size, size), 2, *[None] * 3).wide
    rolled = np.roll(packed, (wide, wide), (0, 1))
    for colour in (0, 1):
        squares = [rolled[y * size :, x * size :][: 2 * wide, : 2 * wide] for y, x in np.argwhere(torus(2) == colour)]
        for one in squares[1:]:
            assert_same_bits(squares[0], one)


def test_the_three_runs_share_no_random_number(monkeypatch):
    plans, plan = [], Tileset.plan
    monkeypatch.setattr(Tileset, "plan", lambda *given: plans.append(plan(*given)) or plans[-1])
    simdtex.tileset(texture((14, 15)), 16, order=1, levels=2, rng=1, device=REFERENCE)
    grids = [one.grid(0) for one in plans]
    keys = np.concatenate([grid.places(np.arange(grid.size)) for grid in grids])
    assert (len(plans), np.unique(keys).size) == (3, keys.size)


def test_all_pixels_are_from_the_sample(tiles):
    _, output = tiles
    assert output.source.shape == (96, 96, 2) and (output.source >= 0).all()
    assert output.statistics["corners"] == torus(2).tolist()
    exact, more = made(finish=0, array="64x64")
    assert_same_bits(exact, GRAVEL[more.source[..., 0], more.source[..., 1]])
    assert [one["job"] for one in more.statistics["runs"]][-1] == "tiles" and len(more.statistics["runs"]) == 3
    assert all(one["accounting"]["steps"] for one in more.statistics["runs"])


def test_a_plane_is_made_of_the_tiles(tiles):
    packed, _ = tiles
    corners = np.random.default_rng(3).integers(0, 2, (4, 6))
    found = plane(packed, corners)
    assert found.shape == (3 * 24, 5 * 24)
    for row, col in np.ndindex(3, 5):
        y, x = divmod(numbers(2)[tuple(corners[row : row + 2, col : col + 2].ravel())], 4)
        tile = packed[y * 24 : y * 24 + 24, x * 24 : x * 24 + 24]
        assert_same_bits(found[row * 24 : row * 24 + 24, col * 24 : col * 24 + 24], tile)
    assert_same_bits(plane(packed, np.pad(torus(2), (0, 1), "wrap")), packed)


def lines(picture, axis):
    """The mean difference between each line and the next."""
    return np.abs(np.diff(picture.astype(float), axis=axis)).mean(1 - axis)


def test_no_border_of_a_plane_differs_from_the_other_lines():
    packed, _ = made(data.gravel()[:128, :128], 48, order=8)
    laid = plane(packed, np.random.default_rng(1).integers(0, 2, (9, 9)))
    shuffled = packed.reshape(4, 48, 4, 48).swapaxes(1, 2)[::-1, ::-1].swapaxes(1, 2).reshape(packed.shape)
    wrong = plane(shuffled, np.random.default_rng(1).integers(0, 2, (9, 9)))  # tiles in the wrong places
    for axis in (0, 1):
        borders, found = [], []
        for one in (laid, wrong):
            steps = lines(one, axis)
            at = np.arange(47, 383, 48)
            others = np.delete(steps, at)
            borders.append((steps[at].mean() - others.mean()) / others.std())
            found.append((steps[at].max() - others.mean()) / others.std())
        assert abs(borders[0]) < 1.5 and found[0] < 3, (borders, found)
        assert borders[1] > 2


def test_the_bytes_are_those_of_the_reference(machine):
    options = {"order": 2, "rng": 5, "xi": -8.0}
    for sample, size in ((GRAVEL, (20, 28)), ([GRAVEL, GRASS], 16)):
        one, other = (simdtex.tileset(sample, size, device=device, **options) for device in (machine, REFERENCE))
        assert_same_bits(one, other)


@pytest.mark.parametrize(("tile", "better"), [((30, 200), r"\d+x\d+"), ((30, 40), "40x\\d+")])
def test_a_lattice_that_does_not_fit_a_tile_is_refused_with_tiles_that_fit(tile, better):
    with pytest.raises(ValueError, match=f"fit tiles of {tile[1]}x{tile[0]}; make tiles of {better}$") as refused:
        simdtex.tileset(GRAVEL, tile, lattice=((20, 0), (0, 20)), order=2)
    cols, rows = map(int, str(refused.value).split()[-1].split("x"))
    made = simdtex.tileset(GRAVEL, (rows, cols), lattice=((20, 0), (0, 20)), order=2, rng=1)
    assert made.shape == (4 * rows, 4 * cols)


def test_a_lattice_has_one_phase_at_all_corners():
    row, col = np.indices((96, 96))
    tone = np.random.default_rng(1).integers(120, 230, (9, 8))
    bricks = np.where((row % 12 < 2) | (col % 13 < 2), 40, tone[row // 12, col // 13]).astype(np.uint8)
    packed, output = made(bricks, (36, 39), finish=0)
    assert output.statistics["lattice"] and output.statistics["lattice"]["deformation"] < 0.01
    place = output.source
    for axis, period in ((0, 12), (1, 13)):
        apart = (place[..., axis] - np.indices(packed.shape)[axis]) % period
        common = np.bincount(apart.ravel()).max() / apart.size
        assert common > 0.9
    corners = place[::36, ::39].reshape(-1, 2)
    assert len({(y % 12, x % 13) for y, x in corners.tolist()}) == 1


def test_a_pattern_that_does_not_fit_is_told():
    row, col = np.indices((96, 96))
    tone = np.random.default_rng(1).integers(120, 230, (4, 4))
    bricks = np.where((row % 24 < 3) | (col % 24 < 3), 40, tone[row // 24, col // 24]).astype(np.uint8)
    with pytest.warns(DataWarning, match=r"no whole cells .* tiles of 34x34; \d+x\d+ fit better"):
        made(bricks, 34)


def test_terrain_has_the_texture_of_each_corner():
    _, output = made([GRAVEL, GRASS], 32)
    number = output.source[..., 2]
    grid = torus(2)
    for y, x in np.ndindex(4, 4):
        corner = np.take(
            np.take(number, np.arange(-5, 5) + 32 * y, 0, mode="wrap"), np.arange(-5, 5) + 32 * x, 1, mode="wrap"
        )
        assert (corner == grid[y, x]).all()
    for y, x in np.argwhere((corners_of(grid) == corners_of(grid)[..., :1]).all(-1)):
        assert (number[32 * y : 32 * y + 32, 32 * x : 32 * x + 32] == grid[y, x]).all()
    three, output = made([GRAVEL, GRASS, 255 - GRAVEL], 16)
    assert three.shape == (144, 144) and {*np.unique(output.source[..., 2])} == {0, 1, 2}


@pytest.mark.parametrize(
    ("sample", "size", "options", "told"),
    [
        (GRAVEL, 15, {}, "give 16 or more"),
        (GRAVEL, (16, 16, 16), {}, "two integers"),
        (GRAVEL, 24, {"colours": 4}, "colours is 4; give 3 or fewer"),
        (GRAVEL, 24, {"colors": 3}, "did you mean 'colours'"),
        ([GRAVEL, GRASS], 24, {"colours": 3}, "3 colours and 2 samples"),
        ([GRAVEL] * 4, 24, {}, "4 samples"),
        (GRAVEL[:30, :30], 128, {}, "40x40 known pixels"),
        (GRAVEL, 24, {"boundary": "open"}, "leave boundary out"),
        (GRAVEL, 24, {"preset": "paper", "pixel": "density"}, 'give pixel="source"'),
        (np.where(np.indices((64, 64))[0] % 6 < 1, np.nan, GRAVEL), 32, {}, "known pixels"),
    ],
)
def test_what_cannot_be_made_is_refused(sample, size, options, told):
    with pytest.raises((ValueError, TypeError), match=told):
        made(sample, size, **options)


def test_progress_ascends_and_names_the_jobs():
    seen = []
    made(callback=lambda progress: seen.append((progress.fraction, progress.job, progress.image().ndim)))
    fractions = [one[0] for one in seen]
    assert fractions == sorted(fractions) and 0 <= fractions[0] < 0.1 and 0.9 < fractions[-1] <= 1
    assert list(dict.fromkeys(one[1] for one in seen))[-1] == "tiles" and {one[2] for one in seen} == {2}


def test_a_stopped_run_continues_to_the_same_bytes(tmp_path, tiles):
    class Stop(Exception):
        pass

    for when in ("borders from top to bottom", "tiles"):
        kept = simdtex.Checkpoint(tmp_path / "state", every=0)

        def stop(progress, when=when):
            if progress.job == when and progress.fraction > 0.3:
                raise Stop

        with pytest.raises(Stop):
            made(checkpoint=kept, callback=stop)
        picture, _ = made(checkpoint=tmp_path / "state", rng=None)
        assert_same_bits(picture, tiles[0])


# -- The command, and the files for other programs

SMALL = ("--size", "24x20", "--order", 2, "--seed", 3, "--device", "reference")


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
    done = run("gravel.png", "-o", "out", *SMALL)
    assert done.exit_code == 0, done.output
    assert "16 tiles of 24x20" in done.output
    packed = image.read("out/gravel.png").pixels
    expected = simdtex.tileset(GRAVEL, (20, 24), order=2, rng=3, device=REFERENCE)
    assert_same_bits(packed, expected)
    for a, b, c, d in np.ndindex(2, 2, 2, 2):
        row, col = divmod(numbers(2)[a, b, c, d], 4)
        tile = packed[row * 20 : row * 20 + 20, col * 24 : col * 24 + 24]
        assert_same_bits(image.read(f"out/gravel-{a}{b}{c}{d}.png").pixels, tile)
    assert len([*(folder / "out").iterdir()]) == 1 + 16 + 5
    assert run("gravel.png", "-o", "out", *SMALL).exit_code == 0  # files of its own are replaced
    assert "--colours is 99; give 3 or fewer" in run("gravel.png", "-o", "out", "--colours", 99).output
    (folder / "out" / "mine.txt").write_text("mine")
    done = run("gravel.png", "-o", "out", *SMALL)
    assert done.exit_code == 2 and "holds other files (mine.txt)" in done.output
    assert (folder / "out" / "mine.txt").read_text() == "mine"


def test_terrains_of_samples_of_one_name_are_told_apart(folder):
    done = run("gravel.png", shutil.copy("grass.png", "grass/gravel.png"), "-o", "out", *SMALL)
    assert done.exit_code == 0, done.output
    assert re.findall(r'wangcolor name="([^"]*)"', Path("out/tiles.tsx").read_text()) == ["gravel 1", "gravel 2"]


def test_all_maps_of_a_material_have_one_arrangement(folder):
    done = run("gravel", "-o", "out", *SMALL, "--finish", 0)
    assert done.exit_code == 0, done.output
    for which in ("", "-0110"):
        albedo, height = (image.read(f"out/gravel_{role}{which}.png").pixels for role in ("albedo", "height"))
        assert_same_bits(albedo[..., 0], 255 - height)
    done = run("gravel", "grass", "-o", "terrain", *SMALL, "--finish", 0)
    assert done.exit_code == 0, done.output
    names = [f"gravel_{role}-grass_{role}" for role in ("albedo", "height")]
    albedo, height = (image.read(f"terrain/{name}.png").pixels for name in names)
    assert_same_bits(albedo[..., 0], 255 - height)
    (folder / "grass" / "grass_ao.png").symlink_to("grass_height.png")
    done = run("gravel", "grass", "-o", "other", *SMALL)
    assert done.exit_code == 2 and "gravel has no ao map" in done.output
    (folder / "grass" / "grass_ao.png").unlink()
    (folder / "grass" / "grass_height.png").unlink()
    done = run("gravel", "grass", "-o", "other", *SMALL)
    assert done.exit_code == 2 and "grass has no height map" in done.output and not (folder / "other").exists()
    done = run("gravel", "grass.png", "-o", "other", *SMALL)
    assert done.exit_code == 2 and "not all samples are" in done.output


@pytest.mark.skipif(not shutil.which("tmxrasterizer"), reason="tmxrasterizer (Debian's tiled) is not installed")
def test_tiled_shows_the_plane(folder):
    done = run("grass", "gravel", "-o", "out", *SMALL)
    assert done.exit_code == 0, done.output
    words = ["tmxrasterizer", "out/plane.tmx", "shown.png"]
    subprocess.run(words, check=True, env={"QT_QPA_PLATFORM": "offscreen", "PATH": "/usr/bin:/bin"})
    shown = image.read("shown.png").pixels[..., :3]
    assert_same_bits(shown, image.read("out/plane.png").pixels)


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
    text = tilesets.glsl(numbers(colours))
    found = [*map(int, re.search(r"\((.*)\);", text.partition("PLACE")[2])[1].split(", "))]
    assert found == [numbers(colours)[at] for at in np.ndindex(*[colours] * 4)]
    page = Path(__file__).parents[3] / "docs" / "readers" / "tiles.glsl"
    assert colours != 2 or page.read_text(encoding="utf-8") == text
    assert text.count("\n") < 30 and text.count("{") == text.count("}") == 2
