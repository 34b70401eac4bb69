"""The add-on, in Blender without a window: what it makes has the bytes of the command, and is in the material."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import run

from simdtex.io import image

ADDON = Path(__file__).resolve().parent.parent / "blender" / "simdtex_blender.py"
BLENDER = shutil.which("blender")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not BLENDER, reason="Blender is not installed")]

SCENE = """
import json, sys
import bpy

addon, program, steps = sys.argv[-3:]
bpy.ops.preferences.addon_install(filepath=addon)
bpy.ops.preferences.addon_enable(module="simdtex_blender")
bpy.context.preferences.addons["simdtex_blender"].preferences.program = program
bpy.ops.mesh.primitive_plane_add()
plane, material = bpy.context.object, bpy.data.materials.new("wall")
plane.data.materials.append(material)
material.use_nodes = True
tree = material.node_tree
shader = tree.nodes["Principled BSDF"]

def texture(name, data=True):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(name)
    node.image.colorspace_settings.name = "Non-Color" if data else "sRGB"
    return node

nodes = [texture("bumps.png"), texture("rough.png"), texture("paint.png", False)]
bumps = tree.nodes.new("ShaderNodeNormalMap")
tree.links.new(nodes[0].outputs[0], bumps.inputs["Color"])
tree.links.new(bumps.outputs[0], shader.inputs["Normal"])
tree.links.new(nodes[1].outputs[0], shader.inputs["Roughness"])
tree.links.new(nodes[2].outputs[0], shader.inputs["Base Color"])
settings = bpy.context.scene.simdtex
settings.more = "--order 8 --device reference"

def shown():
    images = [node.image for node in nodes]
    for one in images:
        if one.packed_file:
            open(one.name.replace(" ", "-") + ".png", "wb").write(one.packed_file.data)
    return [[one.name, one.colorspace_settings.name] for one in images]

found = []
def do(operator):
    try:
        found.append([*operator(), shown()])
    except RuntimeError as error:  # reports of errors
        found.append(str(error))

exec(steps)
print("found", json.dumps(found))
"""


def blender(folder, steps):
    """Run Blender with a plane of three maps in a folder; return what each step returned, and the maps after it."""
    program = Path(sys.executable).with_name("simdtex")
    own = {"BLENDER_USER_SCRIPTS": str(folder / "scripts"), "BLENDER_USER_CONFIG": str(folder / "config")}
    words = ["--background", "--factory-startup", "--python-exit-code", "9", "--python-expr", SCENE, "--"]
    words = [BLENDER, *words, str(ADDON), str(program), steps]
    outcome = subprocess.run(words, cwd=folder, env=os.environ | own, text=True, capture_output=True)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr
    return json.loads(next(line for line in outcome.stdout.splitlines() if line.startswith("found "))[6:])


@pytest.fixture
def wall(tmp_path, monkeypatch):
    """A folder with three maps of 24 x 20 pixels: the paint, its normals with 16 bits, and its roughness."""
    monkeypatch.chdir(tmp_path)
    draw = np.random.default_rng(3)
    kinds = draw.integers(0, 4, (20, 24))
    image.write("paint.png", draw.integers(0, 256, (4, 3), dtype=np.uint8)[kinds])
    image.write("bumps.png", draw.integers(2**15, 2**16, (4, 3), dtype=np.uint16)[kinds])
    image.write("rough.png", draw.integers(0, 256, 4, dtype=np.uint8)[kinds])
    return tmp_path


def made_by_command(verb, kind, *words):
    """Run the command on the maps whose names end in ``kind``; return the paint, the normals and the roughness."""
    Path(verb).mkdir()
    also = [one for name in ("bumps_normal", "rough") for one in ("--also", f"{name[:5]}{kind}.png={verb}/{name}.png")]
    words = [f"paint{kind}.png", "-o", f"{verb}/paint.png", *also, "--order", 8, "--device", "reference", *words]
    assert (outcome := run(verb, *words)).exit_code == 0, outcome.output
    return [image.read(f"{verb}/{name}.png").pixels for name in ("paint", "bumps_normal", "rough")]


def made_in_blender(kind):
    return [image.read(f"{name}{kind}.png").pixels for name in ("paint", "bumps", "rough")]


def test_a_material_tiles_and_grows_with_the_bytes_of_the_command(wall):
    steps = "do(bpy.ops.simdtex.tile); settings.size, settings.seed = 1.5, 7; do(bpy.ops.simdtex.enlarge)"
    tiled, larger = blender(wall, steps)
    names = [["bumps tile", "Non-Color"], ["rough tile", "Non-Color"], ["paint tile", "sRGB"]]
    assert tiled == ["FINISHED", names] and larger[0] == "FINISHED"
    for made, expected in zip(made_in_blender("-tile"), made_by_command("tile", "", "--seed", 1), strict=True):
        assert made.dtype == expected.dtype and np.array_equal(made, expected)
    others = made_by_command("synth", "-tile", "--seed", 7, "--size", "1.5x")
    for made, expected in zip(made_in_blender("-tile-synth"), others, strict=True):
        assert np.array_equal(made, expected)


FACES = """
import bmesh
def select(*wanted):  # faces of a grid of 4 x 4, by column and row from below
    bpy.ops.object.mode_set(mode="EDIT")
    mesh = bmesh.from_edit_mesh(plane.data)
    layer = mesh.loops.layers.uv.active
    for face in mesh.faces:
        x, y = (sum(loop[layer].uv[axis] for loop in face.loops) for axis in (0, 1))
        face.select = (int(x), int(y)) in wanted
bpy.ops.object.mode_set(mode="EDIT")
bpy.ops.mesh.subdivide(number_cuts=3)
"""


def test_selected_faces_are_filled_and_what_cannot_be_done_is_said(wall):
    steps = """
do(bpy.ops.simdtex.fill)
select()
do(bpy.ops.simdtex.fill)
select((1, 0), (2, 0))
settings.grow = 1
do(bpy.ops.simdtex.fill)
settings.more = "--order none"
do(bpy.ops.simdtex.tile)
tree.links.remove(shader.inputs["Base Color"].links[0])
do(bpy.ops.simdtex.tile)
"""
    opaque, nothing, filled, option, unlinked = blender(wall, steps.replace("select()", FACES + "select()", 1))
    assert "erase a part of the picture" in opaque and "no pixel of the picture lies" in nothing
    assert "'none' is not a valid int" in option and "connect the one of the colour" in unlinked
    assert filled == ["FINISHED", [["bumps fill", "Non-Color"], ["rough fill", "Non-Color"], ["paint fill", "sRGB"]]]
    hole = np.zeros((20, 24), np.uint8)
    hole[15:, 6:18] = 255
    image.write("hole.png", hole)
    expected = made_by_command("fill", "", "--seed", 1, "--grow", 1, "--mask", "hole.png")
    for made, one, before in zip(made_in_blender("-fill"), expected, made_in_blender(""), strict=True):
        assert np.array_equal(made, one) and not np.array_equal(made, before)


def test_erased_pixels_of_a_painted_picture_are_filled(wall):
    steps = """
picture = nodes[2].image
values = list(picture.pixels)
values[3:480:4] = [0] * 120  # the lowest five rows
picture.pixels = values
settings.grow = 0
do(bpy.ops.simdtex.fill)
"""
    assert blender(wall, steps)[0][0] == "FINISHED"
    before, made = image.read("paint.png").pixels, image.read("paint-fill.png").pixels
    assert np.array_equal(made[:15], before[:15]) and not np.array_equal(made[15:], before[15:])
    assert not np.array_equal(image.read("rough-fill.png").pixels[15:], image.read("rough.png").pixels[15:])
