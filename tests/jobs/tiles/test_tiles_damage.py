"""A store that is damaged gives the bytes of one that is not, or a sentence: never another picture."""

import shutil
from pathlib import Path

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


DAMAGES = {
    "removed": Path.unlink,
    "flipped": flipped,
    "emptied": lambda path: path.write_bytes(b""),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-3]),
}


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


PARTS = [
    ("sweep", "work/level0/READ/values/c/0/1/1", "level 0 begins again with: simdtex resume"),
    ("sweep", "work/level0/READ/source/c/1/1", "level 0 begins again with: simdtex resume"),
    ("sweep", "work/level0/READ/temperature/zarr.json", "level 0 begins again with: simdtex resume"),
    ("sweep", "work/level0/WRITE/values/c/0/0/0", None),  # what the present turn writes
    ("sweep", "work/level0/WRITE/source/zarr.json", None),
    ("sweep", "work/turn", "level 0 begins again with: simdtex resume"),
    ("sweep", "work/tally*/c/1/0", None),
    ("sweep", "work/tally*/zarr.json", None),
    ("sweep", "zarr.json", None),
    ("sweep", "work/zarr.json", None),
    ("begin", "work/level0/zarr.json", None),
    ("begin", "work/level1/*/values/c/0/0/0", "level 1 begins again with: simdtex resume"),
    ("begin", "work/given/held0/known/c/1/1", "and nothing makes it again; remove the store and begin anew"),
    ("show", "work/given/values/c/1/1/0", "and nothing makes it again; remove the store and begin anew"),
    ("begin", "work/run", "and nothing makes it again; remove the store and begin anew"),
    ("show", "image/c/0/1", None),
    ("show", "image/zarr.json", None),
    ("show", "source/c/0/1/0", None),
]


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize(("phase", "part", "words"), PARTS, ids=lambda one: one and one.replace("/", "."))
def test_damage_is_mended_or_said(tmp_path, stopped, whole, phase, part, words, damage):
    path, sentences = tmp_path / "o.zarr", []
    shutil.copytree(stopped(phase, 3, 2 if phase == "sweep" else 1), path)
    where = part_of(path, part)
    DAMAGES[damage](where)
    image = gone_on(path, sentences)
    if words is None:
        assert sentences == []
    else:
        assert words in sentences[0]
        assert str(where.relative_to(path)) in sentences[0] or "zarr.json" in where.name
    if words is None or "begin anew" not in words:
        assert_same_bits(image.compute(), whole)
        assert sorted(one.name for one in path.iterdir()) == ["checksums", "image", "source", "zarr.json"]


PLACES = [
    ("sweep", "work/level0/READ/values/c/0/0/0", "work/level0/READ/values/c/0/0/1", "level 0 begins again with"),
    ("sweep", "work/turn", "work/run", "and nothing makes it again"),
    ("show", "image/c/0/0", "image/c/0/1", None),
    ("sweep", "work/level0/WRITE/values/c/0/0/0", "work/level0/READ/values/c/0/0/0", "level 0 begins again with"),
    ("sweep", "work/level0/READ/source/c/0/0", "work/level0/WRITE/source/c/0/0", None),  # the present turn writes it
    ("sweep", "work/tally*/c/0/0", "work/tally*/c/1/0", None),
    ("sweep", "work/begun0", "work/turn", "level 0 begins again with"),
    ("begin", "work/given/held0/known/c/0/0", "work/given/held0/known/c/1/1", "and nothing makes it again"),
    ("show", "source/c/0/1/0", "source/c/1/0/0", None),
    ("show", "checksums/c/0/0/1", "checksums/c/0/1/0", None),
]


@pytest.mark.parametrize(("phase", "part", "other", "words"), PLACES, ids=lambda one: one and one.replace("/", "."))
def test_a_chunk_in_the_place_of_another_one_is_damage(tmp_path, stopped, finished, whole, phase, part, other, words):
    path, sentences = tmp_path / "o.zarr", []
    shutil.copytree(stopped(phase, 3, 2 if phase == "sweep" else 1), path)
    one, two = part_of(path, part), part_of(path, other)
    assert one.read_bytes() != two.read_bytes()
    shutil.copyfile(one, two)
    image = gone_on(path, sentences)
    if words is None:
        assert sentences == []
    else:
        assert f"{two.relative_to(path)} of {path} is missing or damaged" in sentences[0]
        assert words in sentences[0]
    if image is not None:
        assert_same_bits(image.compute(), whole)
        assert_same_bits(zarr.open_group(path)["source"][:], zarr.open_group(finished)["source"][:])


@pytest.fixture(scope="module")
def moments(tmp_path_factory):
    """Return copies of three stores after every tile, and when finished: two of one run, and one of another seed."""
    found, place = {}, tmp_path_factory.mktemp("moments")
    for name, rng in (("one", 11), ("again", 11), ("other", 12)):
        path, copies = place / f"{name}.zarr", []

        def keep(progress, path=path, copies=copies):
            copies.append(path.with_name(f"{path.stem}{len(copies)}"))
            shutil.copytree(path, copies[-1])

        image = made_in(path, source_map=True, callback=keep, rng=rng).compute()
        keep(None)
        found[name] = copies, image
    return found


def mixed(path, one, other, chosen):
    """Make a store of the files of two copies: those that are chosen from the other."""
    names = {file.relative_to(copy) for copy in (one, other) for file in copy.rglob("*") if file.is_file()}
    for name in sorted(names):
        if (source := (other if chosen(name) else one) / name).exists():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, path / name)


@pytest.mark.parametrize("how", ["older first", "newer first", "at random", "again", "other", "finished"])
@pytest.mark.parametrize("seed", range(6))
def test_a_copy_of_several_moments_gives_the_same_picture_or_a_sentence(tmp_path, moments, how, seed):
    """As of a backup that was made while the run went on, or a restored part; never another picture."""
    rng = np.random.default_rng(seed)
    copies, expected = moments["one"]
    picked = sorted(rng.choice(len(copies) - 1, 2, replace=False))
    one, other = (copies[number] for number in picked)
    if how in moments:
        other = moments[how][0][picked[1]]
    elif how == "finished":
        one, other = copies[-1], moments["other"][0][-1]
    names = sorted(file.relative_to(one) for file in one.rglob("*") if file.is_file())
    part = names[rng.integers(len(names))]
    chosen = {"older first": lambda name: name > part, "newer first": lambda name: name < part}
    path, sentences = tmp_path / "o.zarr", []
    mixed(path, one, other, chosen.get(how, lambda name: rng.random() < 0.5))
    try:
        image = gone_on(path, sentences)
        found = None if image is None else image.compute()
    except ValueError as error:
        assert how == "finished" and "checksum" in str(error)  # Zarr's, of a chunk
        return
    if found is not None:
        root = zarr.open_group(path)
        copies, expected = moments["one" if root.attrs["simdtex"]["seed"] == 11 else "other"]
        assert_same_bits(found, expected)
        assert_same_bits(root["source"][:], zarr.open_group(copies[-1])["source"][:])
    else:
        assert how in ("again", "other", "finished")


def test_a_plane_of_an_earlier_turn_is_damage(tmp_path, moments):
    copies, expected = moments["one"]
    stores = [Store(str(copy)) for copy in copies[:-1]]
    late = next(n for n, store in enumerate(stores) if (turn := store.turn).level == 0 and turn.cooling == 1)
    early = next(store for store in stores if store.turn.number == stores[late].turn.number - 1)
    path, sentences = tmp_path / "o.zarr", []
    shutil.copytree(copies[late], path)
    where, old = (part_of(Path(store), "work/level0/READ/values/c/0/0/1") for store in (path, early.where))
    assert old.read_bytes() != where.read_bytes()
    shutil.copyfile(old, where)
    image = gone_on(path, sentences)
    assert f"{where.relative_to(path)} of {path} is missing or damaged; level 0 begins again" in sentences[0]
    assert_same_bits(image.compute(), expected)


@pytest.mark.parametrize("damage", ["removed", "cut", "another"])
@pytest.mark.parametrize("part", ["image/c/3/3", "source/c/1/0/0"])
def test_a_finished_store_is_checked(tmp_path, finished, whole, part, damage):
    path = tmp_path / "o.zarr"
    shutil.copytree(finished, path)
    image = TileStore(path).resume()
    assert image.chunks[0][:2] == (4, 4)
    assert_same_bits(image.compute(), whole)
    if damage == "another":
        shutil.copyfile(path / part.replace("c/1/", "c/2/").replace("c/3/", "c/2/"), path / part)
    else:
        DAMAGES[damage](path / part)
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
        ("image/zarr.json", b'"name": "bytes"', b'"name": "bytes2"'),
        ("source/zarr.json", b'"little"', b'"big"'),
        ("source/zarr.json", b'"fill_value": 0', b'"fill_value": 1'),
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


def test_the_picture_has_checksums(tmp_path, stopped):
    path = tmp_path / "o.zarr"
    shutil.copytree(stopped("show", 3), path)
    image = TileStore(path).resume(REFERENCE)
    flipped(path / "image/c/0/1")
    with pytest.raises(ValueError, match="checksum"):
        image.compute()


def test_a_store_that_goes_during_the_run_is_not_made_again(tmp_path):
    path = tmp_path / "o.zarr"

    def remove(progress):
        if progress.phase == "sweep":
            shutil.rmtree(path)

    with pytest.raises(
        ValueError, match=r"o\.zarr was removed or moved while the run went on; put it back, or begin anew"
    ):
        made_in(path, callback=remove)
    assert not path.exists()


def test_nothing_is_written_where_a_store_was(tmp_path, stopped):
    path = tmp_path / "o.zarr"
    shutil.copytree(stopped("sweep", 3, 2), path)
    store = Store(str(path))
    turn = store.turn
    assert store.done(turn, 0)  # which opens the arrays
    shutil.rmtree(path)
    with pytest.raises(files.Damaged, match=r"zarr\.json"):
        store.note(turn, 0, np.zeros(462, np.int64))
    assert not path.exists()


def test_the_working_state_of_a_leader_that_was_killed_while_it_cleaned_is_removed(tmp_path, stopped, whole):
    path = tmp_path / "o.zarr"
    shutil.copytree(stopped("show", 3), path)
    TileStore(path).resume(REFERENCE)
    shutil.copytree(stopped("show", 3) / "work" / "given", path / "work" / "given")
    assert TileStore(path).finished
    assert_same_bits(TileStore(path).resume(REFERENCE).compute(), whole)
    assert not (path / "work").exists()


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


@pytest.mark.parametrize("tasks", [1, 3])
def test_several_tiles_are_one_task(tmp_path, whole, monkeypatch, tasks):
    monkeypatch.setattr(layout, "TASKS", tasks)
    seen = []
    given = {"known": KNOWN, "callback": lambda progress: seen.append((progress.level, progress.tile))}
    image = made_in(tmp_path / "o.zarr", **given)
    assert_same_bits(image.compute(), whole)
    each = -(-4 // tasks)
    assert {tile for level, tile in seen if level == 0} == {min(4, each * n) for n in range(1, -(-4 // each) + 1)}


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
    (path / "image" / "zarr.json").unlink()
    with pytest.raises(
        ValueError, match=r"image/zarr.json of .* is missing or damaged, and nothing makes it again; remove the store"
    ):
        TileStore(path).resume(REFERENCE)
