# SPDX-License-Identifier: BSD-3-Clause
"""Decoding of picture files: each format by a library that preserves its values."""

from __future__ import annotations

import io
import re
from contextlib import suppress
from math import prod
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
import PIL.ExifTags
import PIL.Image
from numpy.typing import NDArray

from simdtex.io import rasters
from simdtex.io.files import Refused, check_array, check_beside, check_size, needs, quiet, read_npy

Array = NDArray[Any]

FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "GIF", "PPM", "JPEG2000", "AVIF", "TGA")
"""The only Pillow readers in use, since some others start programs, for example the one of PostScript."""

_NAMED = {
    rb".{128}DICM": "a DICOM picture: convert it to NRRD, for example with 3D Slicer",
    rb"8BPS": "a Photoshop document (PSD): export it as PNG or TIFF",
    rb"gimp xcf": "a document of GIMP (XCF): export it as PNG or TIFF",
    rb"\x00\x00\x01\x00.\x00": "an icon (ICO): export it as PNG",
    rb"DDS ": "a texture of DirectX (DDS): export it as PNG or TIFF",
    rb".{4}JXL |\xff\x0a": "a JPEG XL picture: save it as PNG or TIFF",
    rb".{4}ftypavi": "an AVIF picture, which this Pillow lacks: save it as PNG",
    rb"#\?R": "a Radiance picture (HDR): save it as OpenEXR or TIFF",
    rb"%PDF|%!PS|[^\x00]*<svg": "a drawing (PDF, PostScript, SVG): export it as PNG",
    rb".{8}CR|.{4}ftypcrx|FUJIFILMCCD-RAW|IIR[OS]|IIU\x00|FOVb": "a camera's raw file: develop it to TIFF",
    rb".{344}n[+i]1": "a NIfTI volume: convert it to NRRD, for example with 3D Slicer",
    rb"NRRD|ObjectType|# vtk|\s*(<\?xml[^>]*>\s*)?<VTKFile": "a volume (NRRD, MHA, VTK): simdtex simulate reads it",
    rb"\x89HDF|CDF": "a NetCDF or HDF5 file: simdtex simulate reads it",
    rb"PK\x03\x04": "an archive (ZIP, .npz, .xlsx): unpack it; simdtex simulate reads .npz and, as known, .xlsx",
}
"""Patterns of the first bytes of other formats, and what the message says of them."""

ORIENTATION, DESCRIPTION = 0x0112, 0x010E
"""The EXIF and TIFF tags of the orientation and of the description."""

_KEPT = (DESCRIPTION, 0x010F, 0x0110, 0x0131, 0x0132, 0x013B, 0x8298)
"""EXIF tags that are kept in addition to exposure and place: description, camera, software, date, author, rights."""

_OF_FILE = (0xA002, 0xA003, 0xA005)
"""EXIF tags that belong to one file: width, height, and the position of a directory."""

_PNM = re.compile(rb"P([2356])" + 3 * rb"(?:\s|#[^\r\n]*[\r\n])+(\d{1,9})" + rb"\s")
"""The header of PGM and PPM: the kind, the width, the height and the largest value."""

_HEIF = re.compile(rb".{4}ftyp(hei[cxms]|hev[cxms]|mif1|msf1)(?!.{4}(.{4}){0,9}avif)", re.DOTALL)
"""The first bytes of HEIC, whose brands are not those of AVIF."""

_COMPRESSIONS = frozenset((1, 2, 3, 4, 5, 8, 32773, 32946, 34925, 50000))
"""TIFF compressions whose decoders stop at the end of a page: none, CCITT, LZW, Deflate, PackBits, LZMA, Zstandard."""

_PILLOW = Lock()


class Metadata(NamedTuple):
    """The data of a picture file other than its pixels.

    Attributes
    ----------
    profile : bytes, optional
        The ICC profile, which defines the colours of values.
    dpi : (float, float), optional
        Pixels per inch, across and down.
    exif : bytes, optional
        Camera, exposure, date, place, author and rights; without orientation, size and preview.
    more : bool
        Whether the file has further frames or pages, which are not read.
    geo : Georeference, optional
        Where the pixels of a raster lie, and its number for unknown values.
    palette : bytes, optional
        Red, green and blue of each index of a palette, if the pixels are indices.
    white : int, optional
        The value of white if it is not full scale: the maximum in the header of a PGM or PPM.
    ascending : bool
        Whether the picture is of a grid, so that an ``.npy`` of it begins with the smallest y.
    plain : bool
        Whether the file says that none of its channels is alpha, also if there are two or four of them.
    """

    profile: bytes | None = None
    dpi: tuple[float, float] | None = None
    exif: bytes | None = None
    more: bool = False
    geo: rasters.Georeference | None = None
    palette: bytes | None = None
    white: int | None = None
    ascending: bool = False
    plain: bool = False

    def at(self, other: Metadata | None = None) -> Metadata:
        """Return the metadata of a picture with such values at the place of another, or at none."""
        if other and other.geo:
            geo = self.geo or other.geo.place()
            return self._replace(geo=other.geo._replace(nodata=geo.nodata, about=geo.about))
        return self._replace(geo=self.geo and self.geo.values())


NOTHING = Metadata()
"""The metadata of a file that has only pixels."""

NUMPY = b"\x93NUMPY"
"""How an ``.npy`` begins."""


class _Stored(NamedTuple):
    """Pixels as they are stored, whether the last channel is alpha, and the orientation of the file."""

    pixels: Array
    alpha: bool = False
    orientation: int = 1
    metadata: Metadata = NOTHING


def decode(data: bytes, most: int, *, palette: bool = False, opaque: bool = False) -> tuple[Array, Metadata]:
    """Decode a picture of at most ``most`` pixels; an opaque alpha channel is removed unless ``opaque``."""
    with quiet():
        try:
            stored = _read(data, most, palette)
        except Exception as error:
            if not isinstance(error, PIL.UnidentifiedImageError) and data[128:132] != b"DICM":
                raise  # DICOM may have the header of a TIFF before its own, and be one, or not
            named = (words for pattern, words in _NAMED.items() if re.match(pattern, data[:1024], re.DOTALL))
            kinds = "PNG, JPEG, TIFF, BMP, WebP, GIF, TGA, JPEG 2000, AVIF, HEIC, OpenEXR, PPM or .npy"
            raise Refused(f"is {next(named, f'not an image: give a {kinds} file')}") from None
    return _finished(stored.pixels, stored.orientation, stored.alpha and not opaque), stored.metadata


def _read(data: bytes, most: int, palette: bool) -> _Stored:
    if data.startswith(NUMPY):
        return _Stored(read_npy(io.BytesIO(data), len(data), most))
    if header := _PNM.match(data):
        return _read_pnm(data, header, most)
    tiff = data[:4] in rasters.TIFF and data[8:10] != b"CR"
    if data[:5].lower() == b"ncols" or (tiff and rasters.is_raster(io.BytesIO(data))):
        pixels, geo = rasters.read_raster(data, most)
        alpha = geo.alpha and pixels.ndim == 3 and pixels.shape[2] == len(geo.about["colorinterp"])
        metadata = Metadata(geo=geo, plain=not alpha)
        if pixels.dtype == np.uint8 and (colours := geo.about.get("colours")):
            table = np.array([colours.get(k, (0, 0, 0))[:3] for k in range(256)], np.uint8)
            metadata = metadata._replace(palette=table.tobytes())
        return _Stored(pixels, alpha, metadata=metadata)
    if tiff:
        return _read_tiff(data, most, palette)
    if data.startswith(b"\x76\x2f\x31\x01"):
        return _read_exr(data, most)
    return _read_pillow(data, most, palette)


def _opened(data: bytes, most: int, page: int = 0) -> PIL.Image.Image:
    """Return the picture, with only its header read, if it is within the limits."""
    if _HEIF.match(data):
        needs("pillow_heif", "pictures", "a HEIC picture")
        from pillow_heif import HeifImageFile

        picture: PIL.Image.Image = HeifImageFile(io.BytesIO(data))  # type: ignore[no-untyped-call]
    else:
        with _PILLOW:  # Pillow has its own limit for the whole process
            before, PIL.Image.MAX_IMAGE_PIXELS = PIL.Image.MAX_IMAGE_PIXELS, None
            try:
                picture = PIL.Image.open(io.BytesIO(data), formats=FORMATS)
            finally:
                PIL.Image.MAX_IMAGE_PIXELS = before
    if page:
        picture.seek(page)
    itemsize = 4 if picture.mode in ("F", "I") else 1
    check_array((picture.height, picture.width, len(picture.getbands())), itemsize, most)
    return picture


def _read_pnm(data: bytes, header: re.Match[bytes], most: int) -> _Stored:
    """Return decoded PGM or PPM, text or binary; Pillow changes values unless the maximum is 255 or 65535."""
    kind, width, height, largest = (int(word) for word in header.groups())
    if not 0 < largest < 65536:
        raise ValueError(f"its largest value is {largest}, not 1 to 65535")
    shape = (height, width, 3) if kind in (3, 6) else (height, width)
    dtype = np.dtype(np.uint8 if largest < 256 else ">u2")
    check_array(shape, dtype.itemsize, most)
    if kind > 3:
        pixels = np.frombuffer(data, dtype, prod(shape), header.end())
    else:
        text = re.sub(rb"#[^\r\n]*", b"", data[header.end() :])
        values = np.fromstring(text.decode("ascii"), np.int64, sep=" ")  # with a count NumPy 2.4 makes up what lacks
        pixels = values[: prod(shape)]
    if pixels.size < prod(shape):
        raise ValueError("it ends before its last pixel")
    if pixels.max(initial=0) > largest or pixels.min(initial=0) < 0:
        raise ValueError(f"it has a value that is not 0 to {largest}")
    return _Stored(pixels.reshape(shape).astype(dtype), metadata=Metadata(white=largest))


def _read_pillow(data: bytes, most: int, palette: bool, page: int = 0) -> _Stored:
    with _opened(data, most, page) as picture:
        bits = _bits(picture.format, data)
        if bits > 8:  # of which Pillow keeps 8
            import imagecodecs  # loaded only for pictures that need it

            check_size(0, 2 * prod(picture.size) * len(picture.getbands()), most)
            decoders = {"PNG": imagecodecs.png_decode, "AVIF": imagecodecs.avif_decode}
            pixels: Array = decoders.get(picture.format or "", imagecodecs.jpeg2k_decode)(data)
            alpha = pixels.ndim == 3 and pixels.shape[2] in (2, 4)
            return _Stored(_full_scale(pixels, bits), alpha, *_metadata(picture))
        picture.load()
        if picture.mode == "L" and bits < 8 and isinstance(grey := picture.info.get("transparency"), int):
            picture.info["transparency"] = grey * (255 // (2**bits - 1))  # Pillow scales pixels only
        transparent, colours = picture.has_transparency_data, None
        if palette and picture.mode == "P":
            colours = bytes(picture.getpalette() or ())
            picture.putpalette(bytes(np.arange(256, dtype=np.uint8).repeat(3)))  # whose colours are the indices
        if colours is not None or picture.mode in ("1", "L"):
            mode = "LA" if transparent else "L"
        elif picture.mode in ("LA", "F", "I") or picture.mode.startswith("I;"):
            mode = picture.mode
        else:
            mode = "RGBA" if transparent else "RGB"
        pixels = np.asarray(_in_rgb(picture) if picture.mode == "CMYK" else picture.convert(mode))
        orientation, metadata = _metadata(picture)
    return _Stored(pixels, mode in ("LA", "RGBA"), orientation, metadata._replace(palette=colours))


def _bits(kind: str | None, data: bytes) -> int:
    """Return the bits of a value of PNG, JPEG 2000 or AVIF, by its first bytes; of others 8."""
    if kind == "PNG":
        return data[24]
    if kind == "JPEG2000" and (at := data.find(b"\xff\x4f\xff\x51")) >= 0:
        return (data[at + 42] & 127) + 1
    if kind == "AVIF" and (at := data.find(b"av1C")) >= 0:
        return 12 if data[at + 6] & 32 else 10 if data[at + 6] & 64 else 8
    return 8


def _full_scale(pixels: Array, bits: int) -> Array:
    """Return values of so many bits with the largest of them as the largest of 8, 16 or 32 bits."""
    if pixels.dtype == bool:
        return pixels * np.uint8(255)
    if pixels.dtype.kind != "u" or bits >= 8 * pixels.dtype.itemsize:
        return pixels
    scaled: Array = np.rint(pixels * (np.iinfo(pixels.dtype).max / (2**bits - 1)))
    return scaled.astype(pixels.dtype)


def _metadata(picture: PIL.Image.Image) -> tuple[int, Metadata]:
    """Return the orientation of a picture of Pillow, and the metadata of its file."""
    orientation, exif, more, profile = 1, None, False, picture.info.get("icc_profile")
    with suppress(Exception):  # a damaged second frame does not invalidate the first
        more = picture.format != "MPO" and getattr(picture, "is_animated", False)  # MPO is a JPEG with previews
    with suppress(Exception):  # nor is damaged EXIF
        whole = picture.getexif()
        orientation = int(whole.get(ORIENTATION, 1))
        exif = _exif(whole)
    dpi = _dpi(picture.info.get("dpi"), orientation)
    return orientation, Metadata(None if picture.mode in ("CMYK", "LAB") else profile, dpi, exif, more)


def _exif(whole: PIL.Image.Exif) -> bytes | None:
    """Return the part of the EXIF data that is kept."""
    kept = PIL.Image.Exif()
    for tag in _KEPT:
        if tag in whole:  # a text in any encoding, which Pillow reads as Latin-1, but writes as ASCII
            kept[tag] = whole[tag].encode("latin-1") if isinstance(whole[tag], str) else whole[tag]
    for ifd in (PIL.ExifTags.IFD.Exif, PIL.ExifTags.IFD.GPSInfo):
        if values := {tag: value for tag, value in whole.get_ifd(ifd).items() if tag not in _OF_FILE}:
            kept[ifd] = values
    return kept.tobytes() if kept else None


def _dpi(stored: Any, orientation: int) -> tuple[float, float] | None:
    """Return pixels per inch across and down of an upright picture, or None if they are not numbers above 0."""
    across, down = map(float, stored or (0, 0))
    if not (0 < across < np.inf and 0 < down < np.inf):
        return None
    return (down, across) if orientation > 4 else (across, down)


def _in_rgb(picture: PIL.Image.Image) -> PIL.Image.Image:
    """Return a CMYK picture in sRGB, by its colour profile if that can be used."""
    if data := picture.info.get("icc_profile"):
        from PIL import ImageCms

        with suppress(ImageCms.PyCMSError, OSError):
            profile, srgb = ImageCms.ImageCmsProfile(io.BytesIO(data)), ImageCms.createProfile("sRGB")
            if converted := ImageCms.profileToProfile(picture, profile, srgb, outputMode="RGB"):
                return converted
    return picture.convert("RGB")


def _read_exr(data: bytes, most: int) -> _Stored:
    needs("OpenEXR", "pictures", "an OpenEXR picture")
    import OpenEXR

    head = OpenEXR.File(io.BytesIO(data), header_only=True)
    (left, top), (right, bottom) = head.header()["dataWindow"]
    names = {channel.name for channel in head.header()["channels"]}
    check_array((int(bottom) - top + 1, int(right) - left + 1, len(names)), 4, most)
    order = [name for name in "RGBYA" if name in names] if len(names) > 1 else list(names)
    if len(head.parts) > 1 or len(order) < len(names) or "".join(order) not in (*names, "RGB", "RGBA", "YA"):
        raise Refused(f"has {len(head.parts)} parts and channels {', '.join(sorted(names))}: save R, G and B, or one")
    channels = OpenEXR.File(io.BytesIO(data), separate_channels=True).channels()
    pixels = np.stack([channels[name].pixels for name in order], -1)
    if len(order) == 1:
        return _Stored(pixels[..., 0])
    return _Stored(_divided(pixels), alpha=True) if "A" in order else _Stored(pixels)


def _pictures(tiff: Any) -> list[Any]:
    """Return the series of a TIFF that are not masks or previews; none if a page after the first is damaged."""
    with suppress(Exception):
        shown = [each for each in tiff.series if not (each.keyframe.is_reduced or each.keyframe.is_mask)] or tiff.series
        return shown if tiff.is_imagej == (shown[0].kind == "imagej") else []
    return []


def _read_tiff(data: bytes, most: int, palette: bool) -> _Stored:
    import tifffile

    with rasters.open_tiff(io.BytesIO(data)) as tiff:
        page, more = tiff.pages.first, tiff.pages.is_multipage
        if pictures := _pictures(tiff):
            page = pictures[0].keyframe
            more = len(pictures) > 1 or prod(pictures[0].shape) > prod(page.shape)
        if not isinstance(page, tifffile.TiffPage):
            raise ValueError("it has no pictures")
        _check_page(page, len(data), most)
        kind, compression = int(page.photometric), int(page.compression)
        orientation = int(page.tags.valueof(ORIENTATION, 1))
        metadata = Metadata(page.iccprofile, more=more)
        with suppress(Exception):  # a damaged resolution does not invalidate the picture
            told = 282 in page.tags and int(page.resolutionunit) in (2, 3)  # per inch or centimetre
            metadata = metadata._replace(dpi=_dpi(page.get_resolution("inch") if told else None, orientation))
        with suppress(Exception):
            exif = PIL.Image.Exif()
            exif.load(data)
            if tiff.is_imagej or tiff.is_ome or tiff.is_shaped:  # programs that describe the axes of a stack
                exif.pop(DESCRIPTION, None)
            metadata = metadata._replace(exif=_exif(exif))
        if kind in (32803, 34892):  # a colour for each pixel, or linear
            raise Refused("is a camera's raw file: develop it to TIFF")
        if kind > 2 or compression in (6, 7):
            # JPEG, palettes, and print and video colours, which Pillow converts to RGB
            stored = _read_pillow(data, most, palette, page.index if len(page.treeindex) == 1 else 0)
            profile, colours = stored.metadata.profile, stored.metadata.palette
            return stored._replace(metadata=metadata._replace(profile=profile, palette=colours))
        _check_compression(compression)
        pixels = page.asarray()
        if pixels.size == 0:
            raise ValueError("it has no pixels")
        if not set(page.axes) <= set("YXS"):
            raise ValueError(f"its axes are {page.axes}, not rows, columns and channels")
        pixels = pixels.transpose([page.axes.index(axis) for axis in "YXS" if axis in page.axes])
        extra = int(page.extrasamples[-1]) if page.extrasamples else 0  # 1: premultiplied alpha, 2: alpha
        metadata = metadata._replace(plain=extra not in (1, 2))
    return _Stored(_shown(page, pixels), extra in (1, 2), orientation, metadata)


def is_stack(path: Any) -> bool:
    """Return whether a TIFF has layers, or several variables as pages."""
    with quiet(), rasters.open_tiff(path) as tiff:
        if not (pictures := _pictures(tiff)):
            return bool(tiff.pages.is_multipage or tiff.is_imagej)
        return not set(pictures[0].axes) <= set("YXS")


def read_stack(path: Any, most: int) -> tuple[dict[str, Array], tuple[tuple[float, ...], tuple[float, ...]]]:
    """Return a TIFF's stack as ``"value"`` (layers, rows, cols, variables), and the origin and size of its cells."""
    with rasters.open_tiff(path) as tiff:
        if not (pictures := _pictures(tiff)):
            raise ValueError("a page is damaged, or of another size or type, or it ends before its last layer")
        series, page, axes = pictures[0], pictures[0].keyframe, pictures[0].axes
        check_beside(path, (layer.parent.filehandle.path for layer in series.pages if layer.parent is not tiff))
        if len(pictures) > 1 or any(layer.aspage().hash != page.hash for layer in series.pages if layer is not page):
            raise Refused("has pages of several sizes or types: save a stack of pages of one")
        layers, variables = ("".join(axis for axis in axes if axis in kind) for kind in ("ZIQ", "CS"))
        if len(layers) > 1 or sorted(layers + variables + "YX") != sorted(axes):
            raise Refused(f"has the axes {axes}: save a stack of layers (Z), rows (Y), columns (X) and channels (C)")
        for layer in series.pages:
            _check_page(layer, tiff.filehandle.size, most)
        check_size(prod(series.shape), prod(series.shape) * page.dtype.itemsize, most)
        if int(page.photometric) > 3 or (int(page.photometric) == 3 and variables):
            raise Refused("has print or video colours: save it as RGB")
        _check_compression(int(page.compression))
        values = series.asarray()
        cell, about = (1.0, 1.0, 1.0), tiff.imagej_metadata or {}
        if str(about.get("unit", "pixel")).rstrip("s") not in ("", "pixel") and min(page.resolution) > 0:
            cell = (1 / page.resolution[0], 1 / page.resolution[1], abs(float(about.get("spacing", 1))) or 1.0)
    values = values.reshape(series.shape).transpose([axes.index(axis) for axis in f"{layers}YX{variables}"])
    values = values.reshape(*(values.shape[:3] if layers else (1, *values.shape[:2])), -1)
    return {"value": values if int(page.photometric) == 3 else _shown(page, values)}, ((0.0,) * 3, cell)


def _shown(page: Any, pixels: Array) -> Array:
    """Return pixels of a TIFF at full scale, with black 0, and colours that are not multiplied by alpha."""
    pixels = _full_scale(pixels, page.bitspersample)
    if int(page.photometric) == 0:  # white is zero
        pixels = 1 - pixels if pixels.dtype.kind == "f" else ~pixels
    premultiplied = page.extrasamples and int(page.extrasamples[-1]) == 1
    return _divided(pixels) if premultiplied and pixels.ndim > 2 else pixels


def _divided(pixels: Array) -> Array:
    """Return pixels with their colours divided by alpha, by which they were multiplied; 0 where alpha is 0."""
    full = 1.0 if pixels.dtype.kind == "f" else float(np.iinfo(pixels.dtype).max)
    alpha = pixels[..., -1:].astype(np.float64)
    colours = pixels[..., :-1] * np.divide(full, alpha, out=np.zeros_like(alpha), where=alpha > 0)
    if pixels.dtype.kind != "f":
        colours = np.rint(np.clip(colours, 0, full))
    return np.concatenate([colours.astype(pixels.dtype), pixels[..., -1:]], -1)


def _check_page(page: Any, length: int, most: int) -> None:
    """Raise if a TIFF page, or one of its tiles or strips, exceeds the limits or the length of the file."""
    first = page.keyframe
    size = prod(first.shape) * (first.dtype.itemsize if first.dtype else 8)
    check_size(first.imagewidth * first.imagelength * first.imagedepth, size, most)
    if first.is_tiled:
        check_size(first.tilewidth * first.tilelength, 0, most)
    ends = zip(page.dataoffsets, page.databytecounts, strict=True)
    if any(offset + count > length for offset, count in ends):
        raise ValueError("it ends before its last pixel")


def _check_compression(method: int) -> None:
    if method not in _COMPRESSIONS:
        raise Refused(f"is compressed by the method {method}: save it with Deflate or uncompressed")


def _finished(pixels: Array, orientation: int, alpha: bool) -> Array:
    """Return the pixels upright, without the last channel if it is alpha and opaque everywhere."""
    if alpha:
        opaque = 1 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max
        if (pixels[..., -1] == opaque).all():
            pixels = pixels[..., 0] if pixels.shape[-1] == 2 else pixels[..., :-1]
    # the eight values of the EXIF and TIFF tag 274
    if orientation in (5, 6, 7, 8):
        pixels = pixels.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return pixels[:, ::-1] if orientation in (2, 3, 6, 7) else pixels


def native(pixels: Array) -> Array:
    """Return contiguous pixels in the machine's byte order."""
    return np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("="))
