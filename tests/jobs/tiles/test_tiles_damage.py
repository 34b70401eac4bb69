"""A store that is damaged gives the bytes of one that is not, or a sentence: never another picture."""

import shutil

import numpy as np
import pytest
from cases import REFERENCE, assert_same_bits, texture

import simdtex
from simdtex import TileStore
from simdtex.io import files
from simdtex.jobs.tiles import layout
from simdtex.jobs.tiles.store import Store
from simdtex.jobs.tiles.tasks import context

zarr = pytest.importorskip("zarr")
pytestmark = pytest.mark.slow

SAMPLE = texture((22, 25), seed=2)
SHAPE = 14, 15
KNOWN = np.ma.masked_array(texture(SHAPE, seed=4), np.indices(SHAPE).sum(0) % 9 > 0)
OPTIONS = {"order": 1, "levels": 2, "xi": -8.0, "rng": 11, "device": REFERENCE}


def made_in(path, source_map=False, **given):
    """Make the output in tiles of 8 x 8."""
    return simdtex.synthesize(SAMPLE, SHAPE, store=TileStore(path, 8, source_map=source_map), **OPTIONS | given)


class Stop(Exception):
    pass


def flipped(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)


@pytest.fixture(scope="module")
def whole():
    return simdtex.synthesize(SAMPLE, SHAPE, known=KNOWN, **OPTIONS)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """Return a store that was stopped after so many tiles of a phase of the finest level."""
    made = {}

    def store(phase, tile, sweep=1):
        def stop(progress):
            if (progress.level, progress.phase, progress.tile, progress.sweep) == (0, phase, tile, sweep):
                raise Stop

        if (phase, tile, sweep) not in made:
            made[phase, tile, sweep] = path = tmp_path_factory.mktemp("store") / "o.zarr"
            with pytest.raises(Stop):
                made_in(path, known=KNOWN, source_map=True, callback=stop)
        return made[phase, tile, sweep]

    return store


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Return a finished store with tiles of 8 x 8 in chunks of 4 x 4."""
    path = tmp_path_factory.mktemp("store") / "o.zarr"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(layout, "CHUNK", 4)
        made_in(path, known=KNOWN, source_map=True)
    return path


def part_of(path, part):
    """Return the file of a store that a pattern names; READ and WRITE are the states that its turn reads and writes."""
    number = Store(str(path)).turn.number if "READ" in part or "WRITE" in part else 0
    (found,) = path.glob(part.replace("READ", str(number - 1)).replace("WRITE", str(number)))
    return found


def gone_on(path, sentences):
    """Resume until the output is there, and return it; None if it has to begin anew."""
    for _ in range(5):
        context.cache_clear()
        try:
            return TileStore(path).resume(REFERENCE)
        except ValueError as error:
            sentences.append(str(error))
            if "begin anew" in sentences[-1]:
                return None
    raise AssertionError("no end")


AGAIN, ANEW = "level 0 begins again with: simdtex resume", "and nothing makes it again; remove the store and begin anew"
REMOVED, FLIPPED = "removed", "flipped"
PARTS = [
    ("sweep", "work/level0/READ/values/c/0/1/1", FLIPPED, AGAIN),
    ("sweep", "work/level0/READ/values/c/0/1/1", REMOVED, AGAIN),
    ("sweep", "work/level0/READ/temperature/zarr.json", REMOVED, AGAIN),
    ("sweep", "work/level0/WRITE/values/c/0/0/0", FLIPPED, None),  # what the present turn writes
    ("sweep", "work/turn", FLIPPED, AGAIN),
    ("sweep", "work/tally*/c/1/0", REMOVED, None),
    ("sweep", "zarr.json", FLIPPED, None),
    ("sweep", "work/zarr.json", REMOVED, None),
    ("begin", "work/level1/*/values/c/0/0/0", FLIPPED, "level 1 begins again with: simdtex resume"),
    ("begin", "work/given/held0/known/c/1/1", FLIPPED, ANEW),
    ("show", "work/given/values/c/1/1/0", REMOVED, ANEW),
    ("begin", "work/run", FLIPPED, ANEW),
    ("show", "image/c/0/1", FLIPPED, None),
    ("show", "image/zarr.json", REMOVED, None),
    # what is another one's
    ("sweep", "work/level0/READ/values/c/0/0/1", "work/level0/READ/values/c/0/0/0", AGAIN),
    ("sweep", "work/level0/READ/values/c/0/0/0", "work/level0/WRITE/values/c/0/0/0", AGAIN),
    ("sweep", "work/level0/WRITE/source/c/0/0", "work/level0/READ/source/c/0/0", None),
    ("sweep", "work/run", "work/turn", ANEW),
    ("sweep", "work/turn", "work/begun0", AGAIN),
    ("show", "image/c/0/1", "image/c/0/0", None),
    ("show", "checksums/c/0/1/0", "checksums/c/0/0/1", None),
]


@pytest.mark.parametrize(("phase", "part", "damage", "words"), PARTS)
def test_damage_is_mended_or_said(tmp_path, stopped, finished, whole, phase, part, damage, words):
    path, sentences = tmp_path / "o.zarr", []
    shutil.copytree(stopped(phase, 3, 2 if phase == "sweep" else 1), path)
    where = part_of(path, part)
    if damage == REMOVED:
        where.unlink()
    elif damage == FLIPPED:
        flipped(where)
    else:
        assert part_of(path, damage).read_bytes() != where.read_bytes()
        shutil.copyfile(part_of(path, damage), where)
    image = gone_on(path, sentences)
    if words is None:
        assert sentences == []
    else:
        assert words in sentences[0]
        assert str(where.relative_to(path)) in sentences[0] or "zarr.json" in where.name
    if words != ANEW:
        assert_same_bits(image.compute(), whole)
        assert_same_bits(zarr.open_group(path)["source"][:], zarr.open_group(finished)["source"][:])
        assert sorted(one.name for one in path.iterdir()) == ["checksums", "image", "source", "zarr.json"]


def test_a_chunk_of_another_store_is_damage(tmp_path, stopped):
    """It has the place and the content, and the name of its own store in its checksum."""
    path, name, sentences = tmp_path / "o.zarr", "work/given/held0/known/c/0/0", []
    shutil.copytree(stopped("sweep", 3, 2), path)
    shutil.copyfile(stopped("begin", 3) / name, path / name)
    assert gone_on(path, sentences) is None
    assert f"{name} of {path} is missing or damaged, and nothing makes it again" in sentences[0]


@pytest.mark.parametrize(
    ("part", "other"), [("image/c/3/3", None), ("image/c/3/3", "image/c/2/3"), ("source/c/1/0/0", "source/c/2/0/0")]
)
def test_a_finished_store_is_checked(tmp_path, finished, whole, part, other):
    path = tmp_path / "o.zarr"
    shutil.copytree(finished, path)
    image = TileStore(path).resume()
    assert image.chunks[0][:2] == (4, 4)
    assert_same_bits(image.compute(), whole)
    if other:
        shutil.copyfile(path / other, path / part)
    else:
        (path / part).unlink()
    with pytest.raises(
        ValueError, match=rf"{part} of .* is missing or damaged, and nothing makes it again; remove the store and begin"
    ):
        TileStore(path).resume()


@pytest.mark.parametrize(
    ("part", "old", "new"),
    [
        ("image/zarr.json", b'"separator": "/"', b'"separator": "."'),
        ("source/zarr.json", b"14", b"13"),
        ("zarr.json", b'"arrays"', b'"arrayc"'),
        ("checksums/zarr.json", b"2,", b"1,"),
        ("image/zarr.json", b'"attributes": {}', b'"attributes": {"mine": 1}'),
    ],
)
def test_the_description_of_a_finished_store_is_checked(tmp_path, finished, whole, part, old, new):
    path = tmp_path / "o.zarr"
    shutil.copytree(finished, path)
    where = path / part
    assert old in where.read_bytes()
    where.write_bytes(where.read_bytes().replace(old, new, 1))
    if b"mine" in new:
        assert_same_bits(TileStore(path).resume().compute(), whole)
        return
    with pytest.raises(ValueError, match=rf"{part} of .* is missing or damaged, and nothing makes it"):
        TileStore(path).resume()


def test_a_store_that_goes_during_the_run_is_not_made_again(tmp_path):
    path = tmp_path / "o.zarr"

    def remove(progress):
        if progress.phase == "sweep":
            shutil.rmtree(path)

    with pytest.raises(ValueError, match=r"o\.zarr was removed or moved while the run went on; put it back, or begin"):
        made_in(path, callback=remove)
    assert not path.exists()


def test_the_working_state_of_a_leader_that_was_killed_while_it_cleaned_is_removed(tmp_path, stopped, whole):
    path = tmp_path / "o.zarr"
    shutil.copytree(stopped("show", 3), path)
    TileStore(path).resume(REFERENCE)
    shutil.copytree(stopped("show", 3) / "work" / "given", path / "work" / "given")
    assert TileStore(path).finished
    image = TileStore(path).resume(REFERENCE)
    assert_same_bits(image.compute(), whole)
    assert not (path / "work").exists()
    flipped(path / "image/c/0/1")
    with pytest.raises(ValueError, match="checksum"):
        image.compute()


def test_a_chunk_and_its_folders_are_on_the_disk_before_its_tile_is_done(tmp_path, monkeypatch):
    """Flushed in the order: the file, its new folders, and only then the row of the task."""
    flushed, real = [], files._sync

    def sync(path, *flags):
        flushed.append(str(path.relative_to(tmp_path)) if path.is_dir() else "file")
        real(path, *flags)

    monkeypatch.setattr(files, "_sync", sync)
    made_in(tmp_path / "o.zarr")
    turns = [n for n in range(1, 99) if f"o.zarr/work/level0/{n}/values/c/0/1" in flushed]
    for folder in (f"o.zarr/work/level0/{n}/values/c" for n in turns):
        at = flushed.index(f"{folder}/0/1")
        assert flushed[at - 1] == "file"
        assert set(flushed[:at]) > {folder, f"{folder}/0"}
        assert flushed.index(f"o.zarr/work/tally{folder.split('/')[3]}/c/2") > at
    assert len(turns) > 3
    assert "." in flushed  # the name of the store itself


def test_several_tiles_are_one_task(tmp_path, whole, monkeypatch):
    monkeypatch.setattr(layout, "TASKS", 3)
    seen = []
    given = {"known": KNOWN, "callback": lambda progress: seen.append((progress.level, progress.tile))}
    image = made_in(tmp_path / "o.zarr", **given)
    assert_same_bits(image.compute(), whole)
    assert {tile for level, tile in seen if level == 0} == {2, 4}


def test_a_full_disk_is_said_and_the_run_goes_on_later(tmp_path, stopped, whole, monkeypatch):
    path = tmp_path / "o.zarr"
    shutil.copytree(stopped("sweep", 3, 2), path)
    context.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(files, "_sync", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
        words = r"could not be written \(No space left on device\): free some space, and continue with: simdtex resume "
        with pytest.raises(ValueError, match=words):
            TileStore(path).resume(REFERENCE)
        with pytest.raises(ValueError, match=rf"^{tmp_path}/new\.zarr/.* could not be written .*: free some space"):
            made_in(tmp_path / "new.zarr")
    assert_same_bits(TileStore(path).resume(REFERENCE).compute(), whole)
