# SPDX-License-Identifier: BSD-3-Clause
"""Blender add-on: make the maps of a material tile, make them larger, or fill the selected faces, with simdtex.

In Blender choose Edit > Preferences > Add-ons > Install, and this file. It runs the program ``simdtex``, which
``pip install simdtex`` installs; Blender's own Python needs no package.
"""

import math
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from array import array
from pathlib import Path

import bmesh
import bpy

bl_info = {
    "name": "simdtex",
    "author": "The simdtex developers",
    "version": (0, 2, 0),
    "blender": (3, 4, 0),
    "location": "Sidebar of the 3D viewport and of the image editor",
    "description": "Makes materials tile, makes them larger, and fills parts of them, from their own texture",
    "category": "Material",
}

TICK = 0.2  # seconds between two looks at a run


class Preferences(bpy.types.AddonPreferences):
    bl_idname = __name__
    program: bpy.props.StringProperty(
        name="Program", subtype="FILE_PATH", description="The program simdtex. Empty: the one on the search path"
    )

    def draw(self, context):
        self.layout.prop(self, "program")


class Settings(bpy.types.PropertyGroup):
    size: bpy.props.FloatProperty(
        name="Size", default=2, min=0.1, max=16, description="The sides of the larger maps, as a multiple of those now"
    )
    grow: bpy.props.IntProperty(
        name="Grow", default=2, min=0, subtype="PIXEL", description="Widen the part to fill by this many pixels"
    )
    seed: bpy.props.IntProperty(name="Seed", default=1, min=0, description="Another seed makes another result")
    more: bpy.props.StringProperty(
        name="Options", description="Other options of the command, such as: --order 32 --structure 4"
    )


def program():
    """Return the path of the program simdtex; raise a ValueError if there is none."""
    asked = bpy.context.preferences.addons[__name__].preferences.program
    found = shutil.which(bpy.path.abspath(asked) if asked else "simdtex")
    if not found:
        raise ValueError("the program simdtex was not found: install it, or give its path in the add-on's preferences")
    return found


def textures(tree):
    """Yield the nodes of a tree that have a picture, those of its groups too."""
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree:
            yield from textures(node.node_tree)
        elif node.type == "TEX_IMAGE" and node.image:
            yield node


def before(socket, seen=()):
    """Yield the nodes whose values reach an input, the nearest first."""
    for link in socket.links:
        if link.from_node not in seen:
            yield link.from_node
            for other in link.from_node.inputs:
                yield from before(other, (*seen, link.from_node))


class Maps:
    """The names of the maps to arrange, and of the material whose nodes have them.

    ``images`` begins with the map that decides the arrangement: what reaches Base Color, in an image editor without
    a material that has its picture, that picture alone. Names and no references: undo makes references invalid.
    """

    def __init__(self, context):
        material = context.object.active_material if context.object else None
        nodes = list(textures(material.node_tree)) if material and material.use_nodes else []
        self.material, self.normals = material.name if nodes else None, set()
        if context.area and context.area.type == "IMAGE_EDITOR":
            shown = context.space_data.image
            if not shown:
                raise ValueError("the image editor shows no picture")
            if not any(node.image == shown for node in nodes):
                self.material, self.images = None, [shown.name]
                return
        if not nodes:
            raise ValueError("the object has no material with pictures: select one that has")
        tops = [node.inputs["Base Color"] for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"]
        lead = [node.image for top in tops for node in before(top) if node in nodes]
        lead += [node.image for node in nodes] if len({node.image for node in nodes}) == 1 else []
        if not lead:
            raise ValueError(f"no picture of {material.name} reaches Base Color: connect the one of the colour to it")
        self.images = list(dict.fromkeys(image.name for image in (lead[0], *(node.image for node in nodes))))
        for node in material.node_tree.nodes:
            if node.type == "NORMAL_MAP":
                self.normals |= {one.image.name for one in before(node.inputs["Color"]) if one in nodes}

    def put(self, made):
        """Show other pictures, by the name of the one that they replace, in the material and in image editors."""
        material = bpy.data.materials.get(self.material or "")
        for node in textures(material.node_tree) if material else ():
            if node.image.name in made:
                node.image = made[node.image.name]
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                space = area.spaces.active
                if area.type == "IMAGE_EDITOR" and space.image and space.image.name in made:
                    space.image = made[space.image.name]


def pixels(image):
    """Return the values of a picture: red, green, blue and alpha of each pixel, the lowest row first."""
    values = array("f", bytes(4 * len(image.pixels)))
    image.pixels.foreach_get(values)
    return values


def export(image, stem):
    """Write a picture, as it is in its file if it was not painted on; return the path, of ``stem`` and a suffix."""
    if image.source not in ("FILE", "GENERATED"):
        raise ValueError(f"{image.name} is not one still picture: save the part that is wanted as a picture of its own")
    suffix = Path(image.filepath_raw).suffix.lower() or ".png"
    path = stem.with_name(stem.name + suffix)
    if image.source == "FILE" and not image.is_dirty:
        if image.packed_file:
            path.write_bytes(image.packed_file.data)
            return path
        there = bpy.path.abspath(image.filepath, library=image.library)
        if not os.path.isfile(there):
            raise ValueError(f"{there}, the file of {image.name}, is missing")
        return Path(shutil.copyfile(there, path))
    path = stem.with_name(stem.name + (".exr" if image.is_float else ".png"))
    copy = bpy.data.images.new(image.name, *image.size, alpha=True, float_buffer=image.is_float)
    try:
        copy.colorspace_settings.name, copy.alpha_mode = image.colorspace_settings.name, image.alpha_mode
        copy.pixels.foreach_set(pixels(image))
        copy.filepath_raw, copy.file_format = str(path), "OPEN_EXR" if image.is_float else "PNG"
        copy.save()
    finally:
        bpy.data.images.remove(copy)
    return path


def spans(corners):
    """Yield (row, first, after) of the pixels whose middles lie in a polygon; corners are in pixels, the origin below.

    Rows and columns beyond the picture are counted on, since coordinates of textures repeat.
    """
    heights = [y for _, y in corners]
    for row in range(math.ceil(min(heights) - 0.5), math.ceil(max(heights) - 0.5)):
        middle, cuts = row + 0.5, []
        for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
            if (y0 <= middle) != (y1 <= middle):
                cuts.append(x0 + (middle - y0) / (y1 - y0) * (x1 - x0))
        cuts.sort()
        for left, right in zip(cuts[::2], cuts[1::2], strict=True):
            yield row, math.ceil(left - 0.5), math.ceil(right - 0.5)


def selection(context, image):
    """Return what is selected of a picture as rows of bytes, the highest first: 255 in faces selected in Edit Mode.

    None stands for the pixels that are not opaque. Raises a ValueError where neither says anything.
    """
    width, height = image.size
    rows = [bytearray(width) for _ in range(height)]
    for thing in context.objects_in_mode_unique_data if context.mode == "EDIT_MESH" else ():
        mesh = bmesh.from_edit_mesh(thing.data)
        layer = mesh.loops.layers.uv.active
        for face in mesh.faces if layer else ():
            if face.select:
                corners = [(loop[layer].uv.x * width, loop[layer].uv.y * height) for loop in face.loops]
                for row, first, after in spans(corners):
                    for column in range(first, min(after, first + width)):
                        rows[height - 1 - row % height][column % width] = 255
    if any(map(any, rows)):
        return rows
    if context.mode == "EDIT_MESH":
        raise ValueError("no pixel of the picture lies in a selected face: select faces that have it")
    if image.channels == 4 and min(pixels(image)[3::4]) < 1:
        return None
    raise ValueError("nothing is selected: select faces in Edit Mode, or erase a part of the picture")


class Run:
    """A run of ``simdtex`` on maps in a temporary folder, beside Blender."""

    def __init__(self, context, verb):
        settings, self.verb = context.scene.simdtex, verb
        self.maps, self.folder = Maps(context), Path(tempfile.mkdtemp(prefix="simdtex-"))
        try:
            options = {"tile": [], "synth": ["--size", f"{settings.size:g}x"], "fill": ["--grow", str(settings.grow)]}
            lead = bpy.data.images[self.maps.images[0]]
            if verb == "fill" and (rows := selection(context, lead)):
                head = b"P5 %d %d 255\n" % tuple(lead.size)
                (self.folder / "mask.pgm").write_bytes(head + b"".join(rows))
                options["fill"] += ["--mask", "mask.pgm"]
            self.files, command = {}, [program(), verb]
            for index, name in enumerate(self.maps.images):
                stem = f"{index}_normal" if name in self.maps.normals else str(index)
                path = export(bpy.data.images[name], self.folder / stem)
                lossy = path.suffix in (".jpg", ".jpeg", ".webp", ".gif", ".bmp", ".tga", ".jp2")
                self.files[name] = out = path.with_name(f"out{stem}{'.png' if lossy else path.suffix}")
                command += ["--also", f"{path.name}={out.name}"] if index else [path.name, "-o", out.name]
            command += [*options[verb], "--seed", str(settings.seed), *shlex.split(settings.more)]
            self.said = self.folder / "said.txt"
            with open(self.said, "wb") as said:
                window = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # which Windows would open
                self.process = subprocess.Popen(
                    command, cwd=self.folder, stdin=subprocess.DEVNULL, stdout=said, stderr=said, creationflags=window
                )
        except BaseException:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise

    def fraction(self):
        """Return how much of the run is done, from 0 to 1."""
        done = re.findall(r"^(\d+)%,", self.said.read_text("utf-8", "replace"), re.MULTILINE)
        return int(done[-1]) / 100 if done else 0.0

    def cancel(self):
        """End the run; nothing in Blender has changed."""
        self.process.send_signal(signal.SIGINT if sys.platform != "win32" else signal.SIGTERM)
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)

    def finish(self):
        """Put what the run made, packed into the file, in the place of the maps; return what it said."""
        try:
            failed = self.process.wait()
            said = self.said.read_text("utf-8", "replace").strip()
            if failed:
                raise ValueError(said.rpartition("Error: ")[2] or "simdtex failed")
            made = {}
            for name, path in self.files.items():
                old = bpy.data.images.get(name)
                if old is None:
                    raise ValueError(f"{name} was removed while simdtex ran")
                new = bpy.data.images.load(str(path))
                new.name = f"{Path(name).stem} {self.verb}"
                if not old.is_float or old.source == "FILE":  # else its file is of linear values
                    new.colorspace_settings.name = old.colorspace_settings.name
                new.alpha_mode = old.alpha_mode
                new.pack()
                new.filepath_raw = f"//textures/{new.name}{path.suffix}"  # where Blender would unpack it
                made[name] = new
            self.maps.put(made)
            return f"{', '.join(made)}: {said.splitlines()[-1].partition(': ')[2]}"
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)


class Operation:
    """What the three operators share: a run beside Blender that Esc cancels, or one that a script waits for."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (Blender reads it)
    run, done = None, 0.0  # one at a time

    @classmethod
    def poll(cls, context):
        return Operation.run is None

    def execute(self, context):
        return self.end(self.begin(context))

    def begin(self, context):
        try:
            return Run(context, self.verb)
        except (ValueError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))

    def end(self, run):
        try:
            if run is None:
                return {"CANCELLED"}
            self.report({"INFO"}, run.finish())
            return {"FINISHED"}
        except (ValueError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}

    def invoke(self, context, event):
        Operation.run, Operation.done = self.begin(context), 0.0
        if not Operation.run:
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("simdtex runs. Esc: cancel")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            return self.stop(context)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        Operation.done = Operation.run.fraction()
        for area in context.screen.areas:
            area.tag_redraw()
        return {"PASS_THROUGH"} if Operation.run.process.poll() is None else self.stop(context, finished=True)

    def stop(self, context, finished=False):
        run, Operation.run = Operation.run, None
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)
        if finished:
            return self.end(run)
        run.cancel()
        self.report({"INFO"}, "simdtex was cancelled; nothing has changed")
        return {"CANCELLED"}

    def cancel(self, context):
        self.stop(context)  # Blender closes


class Tile(Operation, bpy.types.Operator):
    """Replace a band along the edges of all maps, so that they tile"""

    bl_idname, bl_label, verb = "simdtex.tile", "Make It Tile", "tile"


class Enlarge(Operation, bpy.types.Operator):
    """Make larger maps of the same texture, in a new layout that tiles. Scale the mapping by the inverse"""

    bl_idname, bl_label, verb = "simdtex.enlarge", "Make It Larger", "synth"


class Fill(Operation, bpy.types.Operator):
    """Fill the faces selected in Edit Mode, or the erased pixels, with the texture around them, in all maps"""

    bl_idname, bl_label, verb = "simdtex.fill", "Fill the Selection", "fill"


class Panel:
    bl_label, bl_category, bl_region_type = "simdtex", "simdtex", "UI"

    def draw(self, context):
        layout, settings = self.layout, context.scene.simdtex
        layout.use_property_split = True
        if Operation.run:
            text = f"{Operation.done:.0%}; Esc cancels"
            bar = getattr(layout, "progress", None)  # from Blender 4.0 on
            bar(factor=Operation.done, text=text) if bar else layout.label(text=text)
            return
        try:
            maps = Maps(context)
        except ValueError as error:
            layout.label(text=str(error), icon="INFO")
            return
        what = f"{maps.material}, {len(maps.images)} maps" if maps.material else maps.images[0]
        layout.label(text=what, icon="MATERIAL" if maps.material else "IMAGE_DATA")
        layout.prop(settings, "seed")
        layout.prop(settings, "more")
        layout.operator("simdtex.tile")
        layout.prop(settings, "size")
        layout.operator("simdtex.enlarge")
        layout.prop(settings, "grow")
        layout.operator("simdtex.fill")


class ViewPanel(Panel, bpy.types.Panel):
    bl_idname, bl_space_type = "SIMDTEX_PT_view", "VIEW_3D"


class ImagePanel(Panel, bpy.types.Panel):
    bl_idname, bl_space_type = "SIMDTEX_PT_image", "IMAGE_EDITOR"


CLASSES = (Preferences, Settings, Tile, Enlarge, Fill, ViewPanel, ImagePanel)


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    bpy.types.Scene.simdtex = bpy.props.PointerProperty(type=Settings)


def unregister():
    del bpy.types.Scene.simdtex
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
