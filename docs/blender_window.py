# SPDX-License-Identifier: BSD-3-Clause
"""The picture of docs/from/blender.rst: Blender's viewport with gravel that the add-on made tile, laid out 3 x 3.

xvfb-run -a -s "-screen 0 1400x900x24" python docs/blender_window.py
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import PIL.Image
from skimage import data

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "from" / "blender.png"

SCENE = """
import bpy, sys

addon, program, out = sys.argv[-3:]
bpy.ops.preferences.addon_install(filepath=addon)
bpy.ops.preferences.addon_enable(module="simdtex_blender")
preferences = bpy.context.preferences
preferences.view.show_splash = False
preferences.addons["simdtex_blender"].preferences.program = program
for thing in list(bpy.data.objects):
    bpy.data.objects.remove(thing)
bpy.ops.mesh.primitive_plane_add(size=4)
plane, material = bpy.context.object, bpy.data.materials.new("gravel")
plane.data.materials.append(material)
for corner in plane.data.uv_layers.active.data:
    corner.uv *= 3
material.use_nodes = True
tree = material.node_tree
shader = tree.nodes["Principled BSDF"]
for name, socket in (("gravel_albedo", "Base Color"), ("gravel_roughness", "Roughness")):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(name + ".png")
    tree.links.new(node.outputs[0], shader.inputs[socket])
bpy.ops.simdtex.tile()
window = bpy.context.window_manager.windows[0]
area = next(one for one in window.screen.areas if one.type == "VIEW_3D")
space = area.spaces.active
space.show_region_ui, space.shading.type, space.overlay.show_floor = True, "MATERIAL", False
space.overlay.show_axis_x = space.overlay.show_axis_y = space.overlay.show_extras = False
space.overlay.show_outline_selected = space.overlay.show_object_origins = False
region = next(one for one in area.regions if one.type == "UI")
looks = 0

def look():
    global looks
    looks += 1
    if looks == 2:  # the tab of the add-on
        space.region_3d.view_distance = 5.5
        at = region.x + region.width - 12, region.y + region.height - 170
        window.event_simulate("MOUSEMOVE", "NOTHING", x=at[0], y=at[1])
        window.event_simulate("LEFTMOUSE", "PRESS", x=at[0], y=at[1])
        window.event_simulate("LEFTMOUSE", "RELEASE", x=at[0], y=at[1])
    if looks == 12:
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.screen.screenshot_area(filepath=out)
        bpy.ops.wm.quit_blender()
    return 0.5

bpy.app.timers.register(look, first_interval=1)
"""


def main():
    gravel = data.gravel()[:256, :256]
    with tempfile.TemporaryDirectory() as folder:
        tinted = gravel[..., None] / 255 * (230, 200, 170)
        PIL.Image.fromarray(tinted.astype(np.uint8)).save(Path(folder) / "gravel_albedo.png")
        PIL.Image.fromarray(255 - gravel // 2).save(Path(folder) / "gravel_roughness.png")
        words = ["blender", "--factory-startup", "--enable-event-simulate", "--python-expr", SCENE, "--"]
        given = [ROOT / "blender" / "simdtex_blender.py", Path(sys.executable).with_name("simdtex"), OUT]
        subprocess.run([*words, *map(str, given)], cwd=folder, check=True, timeout=120)
    with PIL.Image.open(OUT) as picture:
        picture.convert("RGB").quantize(128).save(OUT, optimize=True)


if __name__ == "__main__":
    main()
