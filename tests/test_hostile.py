"""Files that name other files or themselves, callbacks that change inputs, signals at any moment."""

import os
import struct
from copy import deepcopy

import h5py
import numpy as np
import pytest
import rasterio
import rasterio.shutil
from runs import RUNS, digest, outcome

from simdtex.io import grids, image, rasters, volume

PRIVATE = np.arange(32 * 40, dtype=np.uint8).reshape(32, 40)


def virtual(file, name):
    layout = h5py.VirtualLayout((32, 40), "u1")
    layout[:] = h5py.VirtualSource(name, "own", (32, 40))
    file.create_virtual_dataset("v", layout)
    file["own"] = PRIVATE


HDF5 = {
    "storage": lambda f: f.create_group("a").create_dataset("v", (32, 40), "u1", external=[("../p.bin", 0, 1280)]),
    "link": lambda f: f.update({"v": h5py.ExternalLink("../p.h5", "/v")}),
    "linked group": lambda f: f.update({"g": h5py.ExternalLink("../p.h5", "/"), "v": h5py.SoftLink("/g/v")}),
    "virtual": lambda f: virtual(f, "../p.h5"),
}
VRT = """<VRTDataset rasterXSize="40" rasterYSize="32">
<Metadata><MDI key="INTERNAL_MASK_FLAGS_1">2</MDI></Metadata>
<VRTRasterBand dataType="Byte" band="1" subClass="VRTRawRasterBand">
<SourceFilename relativetoVRT="1">../p.bin</SourceFilename><LineOffset>40</LineOffset></VRTRasterBand></VRTDataset>"""


def raster(path, driver):
    about = {"height": 32, "width": 40, "count": 1, "dtype": "uint8", "transform": rasterio.Affine(1, 0, 5, 0, -1, 40)}
    with rasterio.open(f"{path}.tif", "w", driver="GTiff", **about) as made:
        made.write(PRIVATE, 1)
    rasterio.shutil.copy(f"{path}.tif", path, driver=driver)
    return path


@pytest.fixture
def shared(tmp_path):
    """A folder for a file, beside private ones."""
    (tmp_path / "p.bin").write_bytes(PRIVATE.tobytes())
    with h5py.File(tmp_path / "p.h5", "w") as file:
        file["v"] = PRIVATE
    (tmp_path / "shared").mkdir()
    return tmp_path / "shared"


def test_hdf5_takes_nothing_from_another_file(shared):
    for make in HDF5.values():
        with h5py.File(shared / "a.h5", "w") as file:
            make(file)
        with pytest.raises(ValueError, match=r"a\.h5 takes \S+ from another file: save all values in one file"):
            grids.read_grid(shared / "a.h5")
    with h5py.File(shared / "a.h5", "w") as file:
        virtual(file, ".")
        file["g/loop"] = file["/"]
    np.testing.assert_array_equal(grids.read_grid(shared / "a.h5").values["v"][0], PRIVATE)


def test_a_raster_takes_nothing_from_another_folder(shared):
    for driver, name, beside in (("EHdr", "a.bil", ".hdr"), ("ILWIS", "a.mpr", ".mp#")):
        path = raster(shared / name, driver)
        np.testing.assert_array_equal(rasters.read_raster(path, 10**6)[0], PRIVATE)
        own = path.with_suffix(beside)
        os.replace(own, shared.parent / own.name)
        own.symlink_to(shared.parent / own.name)
        with pytest.raises(ValueError, match=r"refers to .* in another folder: save all values in one file"):
            grids.read_grid(path)


def test_neither_a_mask_nor_a_list_of_maps_takes_a_raster_elsewhere(shared):
    path = raster(shared / "a.asc", "AAIGrid")
    (shared / "a.asc.msk").write_text(VRT)
    with pytest.raises(ValueError, match=r"refers to .*p\.bin in another folder"):
        grids.read_grid(path)
    raster(shared.parent / "p.mpr", "ILWIS")
    header = "[Ilwis]\nType=MapList\n[MapList]\nMaps=1\nSize=32 40\nGeoRef=none\nMap0="
    (shared / "b.mpr").write_text(f"{header}{shared.parent / 'p.mpr'}\n")
    with pytest.raises(ValueError, match="is a list of maps of ILWIS"):
        grids.read_grid(shared / "b.mpr")


def tiff(after, more=()):
    """A TIFF with a directory for each number, that of the next one; None is the end."""
    tags = [(256, 4, 1, 8), (257, 4, 1, 8), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1), (273, 4, 1, 8)]
    tags = sorted([*tags, (277, 3, 1, 1), (278, 4, 1, 8), (279, 4, 1, 64), *more])
    body, begin = struct.pack("<H", len(tags)) + b"".join(struct.pack("<HHII", *tag) for tag in tags), 72
    places = [begin + n * (len(body) + 4) for n in range(len(after))] + [0]
    directories = b"".join(body + struct.pack("<I", places[-1 if n is None else n]) for n in after)
    return b"II*\0" + struct.pack("<I", begin) + bytes(range(64)) + directories


CIRCLES = [tiff([0]), tiff([1, 0]), tiff([*range(1, 300), 100]), tiff([None], [(330, 4, 2**17, 8)])]
CIRCLES += [tiff([*range(1, 2**16 + 1), None])]
"""Itself, the one before, one in a long row, many copies, and very many."""


def test_directories_of_a_tiff_are_counted(tmp_path):
    path = tmp_path / "a.tif"
    for data in CIRCLES:
        path.write_bytes(data)
        assert grids.kind_of(path) is None and not volume.is_volume(path)
        for read in (image.read, volume.read):
            with pytest.raises(ValueError, match="has more than 65536 pages, or a page twice"):
                read(path)
    path.write_bytes(tiff([1, 2, None]))
    assert image.read(path).pixels.shape == (8, 8) and volume.is_volume(path)


def overwrite(value):
    if isinstance(value, np.ndarray):
        np.ma.getdata(value)[...] = value.flat[0]
    for one in value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else ():
        overwrite(one)


@pytest.mark.parametrize("name", sorted({run.function: name for name, run in RUNS.items()}.values()))
def test_a_callback_that_overwrites_all_inputs_changes_nothing(name, monkeypatch):
    run, called = RUNS[name], []
    given = deepcopy(run.inputs())

    def callback(progress):
        called.append(overwrite(given))

    monkeypatch.setitem(RUNS, name, run._replace(inputs=lambda: given))
    made = digest(outcome(name, callback=callback)[0])
    monkeypatch.setitem(RUNS, name, run)
    assert called and made == digest(outcome(name)[0])
