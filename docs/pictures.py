# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of the pages for readers and of the page of wishes, and what the page for researchers prints.

    python docs/pictures.py [NAME...]

Samples are pictures that scikit-image carries, or drawn here; seeds are fixed. Each function writes the picture of its
name; without names all are written.
"""

import argparse
import base64
import io
import json
import re
import runpy
import sys
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import PIL.Image
from skimage import data
from skimage.transform import downscale_local_mean, resize

import simdtex
from simdtex.figures.sheet import contact_sheet, magnified
from simdtex.io.image import write
from simdtex.jobs.tilesets.corners import numbers, plane
from simdtex.jobs.tilesets.files import glsl
from simdtex.maspar import report as schedules
from simdtex.model.display import source_colours, temperature_colours
from simdtex.model.lattice import Grid
from simdtex.model.source_map import apply_source_map

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "benchmarks"))
from channels import channels  # noqa: E402

SHAPE = (256, 256)


def gravel(side=128):
    return data.gravel()[:side, :side]


def brick(side=128):
    return data.brick()[:side, :side]


def mosaic(side=120, period=20):
    """Light tiles in dark joints, every one a little different."""
    row, col = np.indices((side, side))
    tone = np.random.default_rng(1).integers(150, 230, (side // period + 1, side // period + 1))
    joint = (row % period < 3) | (col % period < 3)
    grain = np.random.default_rng(2).integers(-8, 9, (side, side))
    return (np.where(joint, 60, tone[row // period, col // period]) + grain).astype(np.uint8)


# ---------------------------------------------------------------- wishes: before and after


def balance():
    tissue = data.immunohistochemistry()[76:172, 126:222]
    found = [simdtex.synthesize(tissue, SHAPE, channel_axis=-1, balance=b, rng=1) for b in (0, 0.5)]
    return [("the sample", tissue), ("balance 0", found[0]), ("balance 0.5, the default", found[1])]


def novelty():
    pictures = []
    for value in (0, 2):
        picture, output = simdtex.synthesize(gravel(), SHAPE, novelty=value, rng=3, full_output=True)
        pictures += [(f"novelty {value}", picture), ("where it is from", source_colours(output.source, (128, 128)))]
    return pictures


def structure():
    found = [simdtex.synthesize(brick(), SHAPE, structure=value, rng=1) for value in (0, 2)]
    return [("the sample", brick()), ("structure 0", found[0]), ("structure 2, the default", found[1])]


def order():
    found = [simdtex.synthesize(brick(), SHAPE, order=value, rng=2) for value in (4, 18, 32)]
    return [("order 4", found[0]), ("order 18, the default", found[1]), ("order 32", found[2])]


def period():
    sample = mosaic()
    wrapped = simdtex.synthesize(sample, (190, 190), rng=1)
    free = simdtex.synthesize(sample, (190, 190), boundary="open", rng=1)
    fitting = simdtex.synthesize(sample, (200, 200), rng=1)
    return [("190 x 190, torus", wrapped), ("190 x 190, open", free), ("200 x 200, torus", fitting)]


def finish():
    wood = data.coffee()[266:362, 486:582]
    found = [simdtex.synthesize(wood, SHAPE, channel_axis=-1, finish=value, rng=2) for value in (0, 1.5, 4)]
    labels = ("finish 0", "finish 1.5, the default", "finish 4")
    return [(label, magnified(picture[110:196, 30:116], 3)) for label, picture in zip(labels, found, strict=True)]


def tile():
    photo = data.gravel()[100:228, 100:228]
    seamless = simdtex.extend(photo, seamless=True, rng=1)
    return [
        (label, np.tile(one, (2, 2))) for label, one in (("as it is, 2 x 2", photo), ("--seamless, 2 x 2", seamless))
    ]


def hole():
    picture, missing = brick(192), np.zeros((192, 192), bool)
    missing[70:110, 60:120] = True
    found = [(f"seed {seed}", simdtex.fill(picture, missing, search="exact", rng=seed)) for seed in (1, 2, 3)]
    return [("the hole", np.where(missing, 255, picture).astype(np.uint8)), *found]


def some():
    """A sample with something in it that is not to come again."""
    sample = gravel().copy()
    row, col = np.indices(sample.shape)
    coin = np.hypot(row - 90, col - 40) < 18
    sample[coin] = 235
    mask = np.hypot(row - 90, col - 40) > 19
    whole, part = (simdtex.synthesize(sample, SHAPE, mask=m, rng=1) for m in (None, mask))
    return [("the sample", sample), ("all of it", whole), ("with a sample mask", part)]


def proportions():
    training = channels((160, 160), 1)
    found = [
        simdtex.synthesize(training, (192, 192), categorical=True, boundary="open", proportions=p, rng=1)
        for p in (None, (0.5, 0.5))
    ]
    return [
        (f"{label}: {picture.mean():.0%} channel", picture * 255)
        for label, picture in zip(
            ("training image", "as it comes", "proportions 0.5,0.5"), (training, *found), strict=True
        )
    ]


def shares():
    pair = [brick(96)[:, :96], gravel(96)]
    found = [simdtex.synthesize(pair, SHAPE, shares=s, rng=1) for s in ((3, 1), (1, 3))]
    return [("shares 3,1", found[0]), ("shares 1,3", found[1])]


def methods():
    names = ("mrf", "multires", "pyramid")
    grain = downscale_local_mean(data.gravel(), (4, 4)).astype(np.uint8)
    return [
        *((name, simdtex.synthesize(gravel(), (160, 160), method=name, rng=1)) for name in names),
        *((name, simdtex.synthesize(grain, (160, 160), method=name, rng=1)) for name in names),
    ]


def alpha():
    found = [simdtex.synthesize(gravel(), SHAPE, method="multires", alpha=a, rng=1) for a in (0, 0.3, 1)]
    return [("alpha 0", found[0]), ("alpha 0.3", found[1]), ("alpha 1", found[2])]


def paper():
    grass = data.grass()[:96, :96]
    found = [simdtex.synthesize(grass, (192, 192), rng=1, **more) for more in ({"preset": "paper", "order": 18}, {})]
    return [("the sample", grass), ("preset paper, order 18", found[0]), ("the defaults", found[1])]


# ---------------------------------------------------------------- pages for readers


def materials():
    photo = data.gravel()[100:228, 100:228]
    seamless = simdtex.extend(photo, seamless=True, rng=1)
    more = simdtex.synthesize(photo, SHAPE, rng=1)
    return [("seamless, 3 x 3", np.tile(seamless, (3, 3))), ("more of it", more)]


def maps():
    photo = data.gravel()[100:228, 100:228]
    height = photo / 255  # bright is high
    down, right = np.gradient(8 * height)
    normal = np.stack([-right, down, np.ones_like(height)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    more, output = simdtex.synthesize(photo, (200, 200), rng=1, full_output=True)
    same = apply_source_map(output.source, np.round((normal + 1) / 2 * 255).astype(np.uint8), photo.shape)
    return [
        ("the texture", more),
        ("its normals", same),
        ("where it is from", source_colours(output.source, photo.shape)),
    ]


def geoscience():
    training = channels(SHAPE, 1)
    hidden = channels(SHAPE, 7)
    hard = np.ma.masked_all(hidden.shape, np.uint8)
    wells = np.random.default_rng(1).choice(hidden.size, 60, replace=False)
    hard.flat[wells] = hidden.flat[wells]
    maps = simdtex.simulate(training, 20, known=hard, categorical=True, rng=1).values
    return [
        ("what nobody knows", hidden * 255),
        ("realisation 0", maps[0] * 255),
        ("realisation 1", maps[1] * 255),
        ("share of channel in 20", temperature_colours(maps.mean(axis=0))),
    ]


def research():
    """Run the blocks of the page for researchers from top to bottom, and keep what three of them print."""
    page = (HERE / "readers" / "research.rst").read_text(encoding="utf-8")
    names = {"__name__": "research"}
    for block in re.findall(r"^\.\. code-block:: python\n\n((?:(?:   .*)?\n)+)", page, re.MULTILINE):
        with redirect_stdout(io.StringIO()) as told:
            exec(compile(re.sub(r"^   ", "", block, flags=re.MULTILINE), "research.rst", "exec"), names)
        for mark, name in (
            ("multiply-adds", "research-cost"),
            ("sigma", "research-ising"),
            ("exact", "research-draw"),
        ):
            if mark in told.getvalue():
                (HERE / "readers" / f"{name}.txt").write_text(told.getvalue(), encoding="utf-8")
                print(told.getvalue(), end="")


def address(kind, file):
    """A picture as an address, which WebGL takes also from a page that is opened as a file."""
    return f"data:image/{kind};base64,{base64.b64encode(file.getvalue()).decode()}"


def light():
    """Make a material of 2048 pixels from one of 512; keep both at a quarter of their size for relight.js."""
    height = resize(gravel(128), (512, 512), order=3, mode="reflect")  # stones of 60 pixels
    down, right = np.gradient(40 * height)
    normal = np.stack([-right, -down, np.ones_like(height)], axis=-1) / 2 + 0.5
    colour = height[..., None] ** 0.5 * (1, 0.85, 0.7)
    both = [np.round(255 * one.clip(0, 1)).astype(np.uint8) for one in (colour, normal)]
    more, output = simdtex.synthesize(both[0], (2048, 2048), rng=1, channel_axis=-1, full_output=True)
    after = [more, apply_source_map(output.source, both[1], height.shape)]
    maps = []
    for pictures, copies in ((both, 4), (after, 1)):
        addresses = []
        for one in pictures:
            small = downscale_local_mean(one, (4, 4, 1)).round().astype(np.uint8)
            PIL.Image.fromarray(small).save(file := io.BytesIO(), "WEBP", quality=75)
            addresses.append(address("webp", file))
        maps.append([*addresses, copies])
    (HERE / "_static" / "material.js").write_text(f"window.material = {json.dumps(maps)};\n", encoding="utf-8")


def reservoir():
    """Run the example of a volume, and keep its sheet."""
    made = runpy.run_path(str(HERE.parent / "examples" / "volume_of_a_reservoir.py"))
    path = HERE / "readers" / "reservoir.png"
    made["figure"].savefig(path, dpi=110)
    with PIL.Image.open(path) as sheet:
        sheet.convert("RGB").quantize(64).save(path, optimize=True)


def array():
    """A frame of the film of schedules of the array, for gingham, and the pictures that they make."""
    names, frame = ("coloring", "checkerboard", "synchronous", "raster"), 57
    sample = runpy.run_path(str(HERE.parent / "benchmarks" / "drawings.py"))["gingham"]()
    pictures = {
        name: schedules.develop(sample, (64, 64), name, channel_axis=None, order=18, rng=1, device=None)
        for name in names
    }
    shown = {name: schedules.steps(name, Grid.of((64, 64)), 18, 1) for name in names}
    with PIL.Image.open(io.BytesIO(schedules.film(shown, pictures))) as film:
        film.seek(frame)
        film.convert("RGB").save(HERE / "_static" / "array.png", optimize=True)


def house():
    """The rooms of the package: how often each imports from those above it, and its lines beside its budget."""
    sys.path.insert(0, str(HERE.parent / "tests"))
    import test_house as rules
    from matplotlib.figure import Figure

    names = [" ".join(room).replace("jobs.", "").replace("methods.", "") for room in rules.ROOMS]
    names[-1] = "the top"
    knows, lines = np.zeros((len(names), len(names)), int), np.zeros(len(names), int)
    for path in rules.MODULES:
        here = rules.room(rules.dotted(path))
        lines[here] += len(path.read_text(encoding="utf-8").splitlines())
        for other in rules.imports(path):
            knows[here, rules.room(other)] += 1
    figure = Figure((8, 5.6), layout="constrained")
    table, bars = figure.subplots(1, 2, sharey=True, width_ratios=(3, 1))
    table.imshow(np.ma.masked_equal(np.log1p(knows), 0), cmap="Blues", aspect="auto")
    table.set_xticks(range(len(names)), names, rotation=90)
    table.set_yticks(range(len(names)), names)
    for (row, col), count in np.ndenumerate(knows):
        if count:
            table.text(col, row, count, ha="center", va="center", fontsize=6, color="k" if count < 20 else "w")
    bars.barh(range(len(names)), list(rules.ROOMS.values()), color="#dde5ee")
    bars.barh(range(len(names)), lines, height=0.5, color="#3c5c82")
    bars.set_xlabel("lines, and the budget")
    figure.savefig(HERE / "_static" / "house.png", dpi=110)


def tileset():
    """Planes of two sets, and beside them the packed picture and the shader of the page."""
    halves = [downscale_local_mean(picture[:256, :256], (2, 2)) for picture in (data.gravel(), data.grass())]
    sample, grass = (np.round(half).astype(np.uint8) for half in halves)
    PIL.Image.fromarray(simdtex.tileset(sample, 64, rng=1)).save(file := io.BytesIO(), "PNG", optimize=True)
    (HERE / "_static" / "tiles.js").write_text(f'window.tiles = "{address("png", file)}";\n', encoding="utf-8")
    (HERE / "readers" / "tiles.glsl").write_text(glsl(numbers(2)), encoding="utf-8")
    corners = np.random.default_rng(1).integers(0, 2, (9, 9))
    samples = (("gravel", sample), ("grass and gravel", [grass, sample]))
    return [(f"{name}, 8 x 8 tiles", plane(simdtex.tileset(those, 48, rng=1), corners)) for name, those in samples]


WISHES = (
    *(balance, novelty, structure, order, period, finish, tile, hole, some),
    *(proportions, shares, methods, alpha, paper),
)
READERS = (materials, maps, geoscience, tileset)
RUN = {"research": research, "reservoir": reservoir, "light": light, "array": array, "house": house}


def main():
    known = {
        make.__name__: (folder, make) for folder, some in (("wishes", WISHES), ("readers", READERS)) for make in some
    }
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join([*known, *RUN]))
    for name in parser.parse_args().names or [*known, *RUN]:
        if name in RUN:
            RUN[name]()
            continue
        folder, make = known[name]
        path = HERE / folder / f"{name}.png"
        pictures = make()
        columns = {"novelty": 2, "methods": 3}.get(name, len(pictures))
        sheet = contact_sheet(pictures, columns=columns, scale=1)
        write(path, sheet if np.ptp(sheet, axis=2).any() else sheet[..., 0])
        print(f"{path.relative_to(HERE.parent)}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
