"""Files that cannot be written leave the old ones and nothing else; files that unpack to far too much are refused."""

import errno
import io
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import threading
import time
import tracemalloc
import zipfile
import zlib
from contextlib import contextmanager
from pathlib import Path

import imagecodecs
import numpy as np
import PIL.Image
import PIL.ImageFile
import pytest
import tifffile
from volumes import loaded, png

from simdtex.figures.page import Section, write_report
from simdtex.io import decode, files, image, volume
from simdtex.io.files import Damaged, atomic_folder, atomic_path, exclusive, read_checked, write_checked
from simdtex.io.hard_data import read_hard_data
from simdtex.model.source_map import load_source_map, save_source_map

# -- The atomic writer: each write fails in turn and leaves the old file and nothing else; checksums; killed processes.


def picture(seed, dtype=np.uint8):
    return np.random.default_rng(seed).integers(0, 256, (40, 40)).astype(dtype)


def block(seed):
    return np.random.default_rng(seed).integers(0, 256, (4, 40, 40), dtype=np.uint8)


def many(seed):
    xarray = pytest.importorskip("xarray")
    return xarray.DataArray(block(seed), dims=("realisation", "y", "x"))


def page(path, seed):
    write_report(path, f"Report {seed}", "What it is.", [Section("One", ["words " * 2000])], {"seed": seed})


WRITERS = {
    "a.png": lambda path, seed: image.write(path, picture(seed)),
    "a.npy": lambda path, seed: image.write(path, picture(seed)),
    "a.tif": lambda path, seed: image.write(path, picture(seed)),
    "deep.png": lambda path, seed: image.write(path, picture(seed, np.uint16)),
    "a.exr": lambda path, seed: image.write(path, picture(seed, np.uint16).astype(np.float32)),
    "v.npz": lambda path, seed: volume.write(path, block(seed)),
    "v.nrrd": lambda path, seed: volume.write(path, block(seed)),
    "v.tif": lambda path, seed: volume.write(path, block(seed)),
    "slices": lambda path, seed: volume.write(path, block(seed)),
    "r.zarr": lambda path, seed: volume.write_realisations(path, many(seed)),
    "r.nc": lambda path, seed: volume.write_realisations(path, many(seed)),
    "r.npz": lambda path, seed: volume.write_realisations(path, many(seed)),
    "r.gslib": lambda path, seed: volume.write_realisations(path, many(seed)),
    "map.npz": lambda path, seed: save_source_map(path, np.random.default_rng(seed).integers(0, 99, (40, 40, 2))),
    "report": page,
}


def removed(name, path):
    """Remove a store of realisations, which is never replaced."""
    if name == "r.zarr":
        shutil.rmtree(path)


def everything(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@contextmanager
def full_after(size):
    """No file may grow beyond a size: what a full disk is to every library, whatever it writes with."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def refused(name, path):
    """The write fails, with one sentence that names what was to be written and nothing hidden."""
    with pytest.raises(ValueError, match=r"could not be written \(.+\): (choose another|free some)") as said:
        WRITERS[name](path, 2)
    text = str(said.value)
    assert text.startswith(str(path)) and ".simdtex-" not in text and "[Errno" not in text and "\n" not in text


@pytest.mark.parametrize("name", WRITERS)
def test_no_more_space_at_any_byte(tmp_path, name):
    path = tmp_path / name
    WRITERS[name](path, 1)
    first = everything(tmp_path)
    largest = max(len(data) for data in first.values())
    removed(name, path)
    before = everything(tmp_path)
    for size in (0, 7, largest // 2, largest - 40):
        with full_after(size):
            refused(name, path)
        assert everything(tmp_path) == before
    WRITERS[name](path, 2)
    assert everything(tmp_path).keys() == first.keys() and everything(tmp_path) != first


def test_files_hold_no_time(tmp_path):
    written = []
    for number in range(2):
        folder = tmp_path / str(number)
        folder.mkdir()
        for name, write in WRITERS.items():
            write(folder / name, 1)
        written.append(everything(folder))
        time.sleep(2.1 * (number == 0))  # the times in a ZIP archive are even
    assert [name for name in written[0] if written[0][name] != written[1][name]] == []


@pytest.mark.parametrize("name", ["a.png", "slices", "r.zarr", "report"])
@pytest.mark.parametrize("fault", ["open", "fsync", "replace", "rename", "mkdir"])
def test_every_call_of_the_system_fails_in_turn(tmp_path, monkeypatch, name, fault):
    path = tmp_path / name
    WRITERS[name](path, 1)
    removed(name, path)
    before, real, calls, failing = everything(tmp_path), getattr(os, fault), 0, 0

    def faulty(*args, **kwargs):
        nonlocal calls
        if fault == "open" and not args[1] & (os.O_WRONLY | os.O_RDWR):
            return real(*args, **kwargs)  # of a folder that is being removed
        calls += 1
        if calls == failing:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), args[0])
        return real(*args, **kwargs)

    monkeypatch.setattr(files.os, fault, faulty)
    WRITERS[name](path, 1)
    removed(name, path)
    for turn in range(1, min(calls, 5) + 1):
        calls, failing = 0, turn
        try:
            WRITERS[name](path, 2)
        except ValueError as error:
            assert "could not be written (No space left on device): free some space" in str(error)
            assert str(error).startswith(str(path)) and ".simdtex-" not in str(error)
            assert everything(tmp_path) == before
        else:
            assert fault == "mkdir"  # of a folder that is there
            failing = 0
            removed(name, path)
            WRITERS[name](path, 1)
            removed(name, path)


def leftover(name, days):
    """Make a hidden file that a process left so many days ago."""
    name.touch()
    os.utime(name, (time.time() - days * 86400,) * 2)


def test_old_leftovers_are_removed_and_recent_ones_are_not(tmp_path):
    for name, days in (("0" * 16, 2), ("1" * 16, 0.5), ("notes", 2)):
        leftover(tmp_path / f".simdtex-{name}", days)
    (tmp_path / f".simdtex-{'2' * 16}.zarr" / "part").mkdir(parents=True)
    os.utime(tmp_path / f".simdtex-{'2' * 16}.zarr", (0, 0))
    image.write(tmp_path / f"{'b' * 251}.npy", picture(1))  # whose hidden name is not too long
    assert sorted(os.listdir(tmp_path)) == [f".simdtex-{'1' * 16}", ".simdtex-notes", f"{'b' * 251}.npy"]


@pytest.mark.parametrize("writer", [atomic_path, atomic_folder])
def test_an_unfinished_output_that_looks_old_is_kept_while_its_writer_lives(tmp_path, writer):
    with writer(tmp_path / "a.zarr") as temporary:
        os.utime(temporary, (0, 0))
        image.write(tmp_path / "b.npy", picture(1))
        assert temporary.exists()
    assert sorted(os.listdir(tmp_path)) == ["a.zarr", "b.npy"]


def test_a_lock_has_one_holder_at_a_time(tmp_path):
    inside, counts, end = [], [], time.monotonic() + 0.3

    def take():
        while time.monotonic() < end:
            try:
                with exclusive(tmp_path / "state"):
                    inside.append(1)
                    time.sleep(0.0002)
                    counts.append(len(inside))
                    inside.pop()
            except ValueError as error:
                assert "another run is at work in" in str(error)
                time.sleep(0)

    threads = [threading.Thread(target=take) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(counts) > 20 and set(counts) == {1}
    assert os.listdir(tmp_path) == []


def test_a_failed_write_into_a_folder_names_the_folder(tmp_path, monkeypatch):
    """Whatever writes into it, such as the atomic writer of one of its files, and whichever way the path was given."""
    monkeypatch.chdir(tmp_path)
    for path in ("out", tmp_path / "out"):
        words = rf"^{re.escape(str(path))}/a\.npy could not be written \(.+\): (free some|choose another) .*$"
        with full_after(100), pytest.raises(ValueError, match=words), atomic_folder(path) as temporary:
            image.write(temporary / "a.npy", picture(1))
    assert os.listdir(tmp_path) == []


def test_a_folder_in_which_a_thread_still_writes_is_removed(tmp_path):
    def write(folder):
        for number in range(12):
            (folder / str(number)).mkdir(parents=True, exist_ok=True)
            time.sleep(0.02)

    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "out.zarr") as temporary:
        thread = threading.Thread(target=write, args=(temporary,))
        thread.start()
        time.sleep(0.05)
        raise KeyboardInterrupt
    thread.join()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_was_taken_away_comes_back(tmp_path):
    """A process is killed between taking the old folder away and putting the new one there."""
    volume.write(tmp_path / "a", block(1))
    kill = "import os, sys; from pathlib import Path; from simdtex.io import volume; import numpy as np\n"
    kill += "rename = Path.rename\n"
    kill += "Path.rename = lambda self, to: rename(self, to) if 'old' in to.name else os.kill(os.getpid(), 9)\n"
    kill += "volume.write(sys.argv[1], np.ones((2, 3, 4), np.uint8))\n"
    done = subprocess.run([sys.executable, "-c", kill, tmp_path / "a"], check=False)
    assert done.returncode == -9 and "a" not in os.listdir(tmp_path)
    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "a"):
        raise KeyboardInterrupt
    assert np.array_equal(loaded(tmp_path / "a"), block(1))


def keep(path, array):
    write_checked(path, lambda file: np.savez(file, array=array))


def test_a_checked_file_gives_back_what_was_written_or_says_that_it_is_damaged(tmp_path):
    path = tmp_path / "state.npz"
    keep(path, block(1))
    with read_checked(path) as file, np.load(file) as arrays:
        assert np.array_equal(arrays["array"], block(1))
    whole = path.read_bytes()
    for at in (0, 20, 78, 79, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(Damaged, match=r"state\.npz is damaged: its checksum does not match"):
            read_checked(path)
    for short in (b"", whole[:50], whole[:79], whole[:-1], whole + b"0"):
        path.write_bytes(short)
        with pytest.raises(Damaged):
            read_checked(path)
    with pytest.raises(FileNotFoundError):
        read_checked(tmp_path / "none")


def command(folder, *words):
    return [sys.executable, "-m", "simdtex", "synth", "sample.png", "-o", "out.png", "--device", "reference", *words]


@pytest.fixture
def tiny(tmp_path):
    """A disk of 64 KiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", disk], capture_output=True, check=False)
    if mounted.returncode:
        pytest.skip("no disk may be mounted here")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)


@pytest.mark.slow
def test_a_finished_picture_does_not_wait_for_its_stages(tmp_path, tiny):
    image.write(tmp_path / "sample.png", np.random.default_rng(1).integers(0, 256, (24, 20), dtype=np.uint8))
    (tiny / "ballast").write_bytes(bytes(56 * 1024))
    words = ["--method", "multires", "--size", "64x64", "--stages", tiny / "st", "--source-map", tiny / "map.npz"]
    done = subprocess.run(
        command(tmp_path, *words), cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 2, done.stderr
    assert image.read(tmp_path / "out.png").pixels.shape == (64, 64)
    said = [line for line in done.stderr.splitlines() if line.startswith("simdtex: ")]
    assert len(said) == 1 and "/st/" in said[0], "one sentence, of all that could not be written"
    words = "could not be written (No space left on device): free some space"
    assert all(words in part for part in said[0].split("; "))
    assert not [path for path in tmp_path.rglob("*") if path.name.startswith(".")]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_process_that_is_asked_to_end_cleans_up(tmp_path, number):
    image.write(tmp_path / "sample.png", np.random.default_rng(2).integers(0, 256, (64, 64), dtype=np.uint8))
    words = command(tmp_path, "--size", "200x200", "--stages", "st", "--order", "8")
    running = subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while not any((tmp_path / "st").glob("level*.png")):
        assert running.poll() is None and time.monotonic() < deadline, running.communicate()
        time.sleep(0.02)
    running.send_signal(number)
    running.send_signal(number)  # as timeout does
    _, errors = running.communicate(timeout=120)
    assert running.returncode == 128 + number, errors
    assert "Traceback" not in errors and "stopped" in errors and not (tmp_path / "out.png").exists()
    assert not [path for path in tmp_path.rglob("*") if path.name.startswith(".")]


# -- Files that unpack to far more than they are: told by their headers, before anything is decoded.

PIXELS = 10_000
MANY = np.zeros((101, 100), np.uint8)  # just too many


def saved(array, kind, **options):
    file = io.BytesIO()
    PIL.Image.fromarray(array).save(file, kind, **options)
    return file.getvalue()


def npy(shape, dtype="<f8", data=b""):
    header = f"{{'descr': {dtype!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header) + 1) + header + b"\n" + data


def zipped(**files):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


def tiff(*pages, **options):
    file = io.BytesIO()
    with tifffile.TiffWriter(file) as writer:
        for page in pages:
            writer.write(page, metadata=None, photometric="minisblack", **options)
    return file.getvalue()


PICTURES = {
    "PNG": png(200_000, 200_000),
    "a PNG of a pixel too many": saved(MANY, "PNG"),
    "a 16-bit PNG of a pixel too many": imagecodecs.png_encode(MANY.astype(np.uint16)),
    "JPEG": saved(MANY, "JPEG"),
    "BMP": saved(MANY, "BMP"),
    "GIF": b"GIF89a" + struct.pack("<HH", 65535, 65535) + b"\0\0\0,\0\0\0\0\1\0\1\0\0\2\2D\1\0;",
    "WebP": saved(MANY, "WEBP"),
    "TGA": saved(MANY, "TGA"),
    "JPEG 2000": saved(MANY, "JPEG2000"),
    "JPEG 2000 of 12 bits": imagecodecs.jpeg2k_encode(
        np.dstack([MANY] * 3).astype(np.uint16), bitspersample=12, level=0
    ),
    "AVIF": saved(np.dstack([MANY] * 3), "AVIF"),
    "PBM": b"P4 101 100\n" + bytes(1300),
    "TIFF": tiff(MANY),
    "npy": npy((50_000, 50_000)),
    "npy in channels": npy((10, 10, 10**9)),
}


def refused_limits(reading, path, words, peak=4 * 2**20):
    """Reading ends in one sentence that names the file, and takes no more memory than `peak`."""
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=words) as said:
            reading(path)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert str(path) in str(said.value) and "\n" not in str(said.value) and len(str(said.value)) < 400
    assert most < peak


TOO_LARGE = rf"(pixels|bytes|cells|frames) and no more than \d+ are read: .*, or set {files.VARIABLE} higher"


def test_pictures_of_too_many_pixels_are_not_decoded(tmp_path, monkeypatch, caplog, capfd):
    def never(*_, **__):
        raise AssertionError("it is decoded")

    monkeypatch.setattr(PIL.ImageFile.ImageFile, "load", never)
    monkeypatch.setattr(tifffile.TiffPage, "asarray", never)
    for name in ("png_decode", "jpeg2k_decode", "avif_decode"):
        monkeypatch.setattr(imagecodecs, name, never)
    for kind, data in PICTURES.items():
        (tmp_path / f"{kind}.png").write_bytes(data)
        refused_limits(lambda path: image.read(path, max_pixels=PIXELS), tmp_path / f"{kind}.png", TOO_LARGE)
    assert not caplog.records and not "".join(capfd.readouterr())


def test_more_than_pillow_allows_is_read_where_it_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(PIL.Image, "MAX_IMAGE_PIXELS", 1000)
    (tmp_path / "a.png").write_bytes(saved(MANY, "PNG"))
    with pytest.raises(ValueError, match=TOO_LARGE):
        image.read(tmp_path / "a.png", max_pixels=PIXELS)
    assert image.read(tmp_path / "a.png", max_pixels=10_100).pixels.shape == (101, 100)
    assert PIL.Image.MAX_IMAGE_PIXELS == 1000


def test_the_environment_says_how_many(tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(saved(MANY, "PNG"))
    for text in ("10100", "", " 20000 "):
        monkeypatch.setenv(files.VARIABLE, text)
        image.read(tmp_path / "a.png")
    monkeypatch.setenv(files.VARIABLE, "10099")
    refused_limits(image.read, tmp_path / "a.png", TOO_LARGE)
    image.read(tmp_path / "a.png", max_pixels=10100)
    for text in ("0", "-5", "many", "1e9", "9" * 30, "1.5"):
        monkeypatch.setenv(files.VARIABLE, text)
        with pytest.raises(ValueError, match=rf"^{files.VARIABLE} is .*: set it to a number of pixels"):
            image.read(tmp_path / "a.png")
    for number, error in ((0, ValueError), (1.5, TypeError), (True, TypeError)):
        with pytest.raises(error, match="max_pixels"):
            image.read(tmp_path / "a.png", max_pixels=number)


def test_texts_beside_the_pixels_are_not_unpacked(tmp_path):
    """Of those of 16 bits only the orientation is read."""
    bomb = zlib.compress(bytes(2**24), 9)
    for kind, data in {"zTXt": b"Comment\0\0" + bomb, "iCCP": b"profile\0\0" + bomb}.items():
        (tmp_path / "a.png").write_bytes(png(4, 4, 16, rows=bytes(4 * 25), **{kind: data}))
        tracemalloc.start()
        try:
            assert image.read(tmp_path / "a.png").pixels.shape == (4, 4, 3)
        except ValueError as error:
            assert "cannot be read as an image" in str(error)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert most < 2**23, kind


def test_source_maps_and_hard_data(tmp_path):
    files = {
        "map.npz": (load_source_map, zipped(source=npy((50_000, 50_000, 2), "<i4"))),
        "map.npy": (load_source_map, npy((50_000, 50_000, 2), "<i4")),
        "table.npy": (read_hard_data, npy((10**9, 3))),
        "table.csv": (lambda path: read_hard_data(path, max_pixels=12_000), b"1,2,3\n" * 2000 + b"1,2,3"),
    }
    for name, (reading, data) in files.items():
        (tmp_path / name).write_bytes(data)
        refused_limits(reading, tmp_path / name, TOO_LARGE, peak=2**23)


def test_the_documented_formats_are_those_that_are_read(tmp_path):
    page = Path(__file__).parents[2] / "docs" / "reference" / "command-line.rst"
    for text in (image.read.__doc__, page.read_text(encoding="utf-8")):
        for name in ("PNG", "JPEG", "TIFF", "BMP", "WebP", "GIF", "TGA", "JPEG 2000", "AVIF", "PBM", "PGM", "PPM"):
            assert name in " ".join(text.split()), name
    for kind in decode.FORMATS:
        (tmp_path / "a").write_bytes(saved(np.full((8, 9, 3), 7, np.uint8), kind))
        assert image.read(tmp_path / "a").pixels.shape[:2] == (8, 9)


def test_how_a_tiff_may_be_compressed(tmp_path):
    values = np.arange(256, dtype=np.uint8).reshape(16, 16)
    for method in (None, "zlib", "lzw", "packbits", "zstd", "lzma"):
        (tmp_path / "a.tif").write_bytes(tiff(values, values, compression=method))
        assert np.array_equal(image.read(tmp_path / "a.tif").pixels, values)
    (tmp_path / "a.tif").write_bytes(tiff(values, compression="jpeg"))
    assert abs(image.read(tmp_path / "a.tif").pixels.astype(int) - values).max() < 9
    data = bytearray((tmp_path / "a.tif").read_bytes())
    struct.pack_into(">HH", data, data.find(b"\xff\xc0") + 5, 60000, 60000)  # many more pixels than the page
    (tmp_path / "a.tif").write_bytes(data)
    refused_limits(image.read, tmp_path / "a.tif", "cannot be read as an image")
    (tmp_path / "a.tif").write_bytes(tiff(values, compression="png"))
    with pytest.raises(ValueError, match="is compressed by the method 34933: save it with Deflate"):
        image.read(tmp_path / "a.tif")
