# SPDX-License-Identifier: BSD-3-Clause
"""Sets of corner tiles for other programs: Tiled, Godot 4, and shaders in GLSL."""

from __future__ import annotations

from collections.abc import Sequence
from json import dumps
from typing import Any
from xml.etree import ElementTree as XML

from numpy.typing import NDArray

COLOURS = ("#7fbf3f", "#e0c060", "#8090a0")
"""Colours by which editors show those of corners."""

CORNERS = ("top_left_corner", "top_right_corner", "bottom_left_corner", "bottom_right_corner")
"""Names of Godot, top left, top right, bottom left and bottom right."""

GLSL = """\
// An endless plane of corner tiles. One unit of `at` is one tile; at.y grows downwards, as rows do.
// `tiles` is the packed picture: repeated both ways, first row first, with mipmaps.
// GLSL 1.30 or ES 3.00.
const int COLOURS = {colours}, SIDE = {side};
const int PLACE[{count}] = int[{count}]({places});

int corner(ivec2 at) {{  // the colour of a corner, at random
    uint h = uint(at.x) * 0x8da6b343u ^ uint(at.y) * 0xd8163841u;
    h = (h ^ (h >> 13)) * 0x5bd1e995u;
    h = (h ^ (h >> 15)) * 0x9e3779b1u;
    return int((h >> 16) % uint(COLOURS));
}}

vec4 cornerTiles(sampler2D tiles, vec2 at) {{
    vec2 cell = floor(at);
    ivec2 c = ivec2(cell);
    int upper = corner(c) * COLOURS + corner(c + ivec2(1, 0));
    int lower = corner(c + ivec2(0, 1)) * COLOURS + corner(c + ivec2(1, 1));
    int place = PLACE[upper * COLOURS * COLOURS + lower];
    vec2 there = vec2(place % SIDE, place / SIDE) + at - cell;
    float side = float(SIDE);
    return textureGrad(tiles, there / side, dFdx(at) / side, dFdy(at) / side);
}}
"""


def glsl(numbers: NDArray[Any]) -> str:
    """Return a function in GLSL that looks up an endless plane; ``numbers`` are those of `corners.numbers`."""
    side, places = len(numbers) ** 2, ", ".join(map(str, numbers.ravel()))
    return GLSL.format(colours=len(numbers), side=side, count=side**2, places=places)


def tiled_set(picture: str, tile: tuple[int, int], names: Sequence[str], grid: NDArray[Any]) -> str:
    """Return a set for Tiled: ``tile`` (rows, cols), ``names`` of terrains, ``grid`` (n, n, 4) of `corners_of`."""
    (rows, cols), side = tile, len(names) ** 2
    size = {"tilewidth": cols, "tileheight": rows, "tilecount": side**2, "columns": side}
    root = _element(None, "tileset", version="1.10", name="-".join(dict.fromkeys(names)), **size)
    _element(root, "image", source=picture, width=side * cols, height=side * rows)
    corners = _element(_element(root, "wangsets"), "wangset", name="corners", type="corner", tile=-1)
    for name, colour in zip(names, COLOURS, strict=False):
        _element(corners, "wangcolor", name=name, color=colour, tile=-1, probability=1)
    for n, (a, b, c, d) in enumerate((grid + 1).reshape(-1, 4).tolist()):
        _element(corners, "wangtile", tileid=n, wangid=f"0,{b},0,{d},0,{c},0,{a}")  # clockwise from the top
    return _text(root)


def tiled_map(tiles: str, tile: tuple[int, int], numbers: NDArray[Any]) -> str:
    """Return a map for Tiled, of the tiles of a file with these numbers (m, n), from 0."""
    size = {"width": numbers.shape[1], "height": numbers.shape[0]}
    how = {"orientation": "orthogonal", "renderorder": "right-down", "infinite": 0}
    root = _element(None, "map", version="1.10", **how, **size, tilewidth=tile[1], tileheight=tile[0])
    _element(root, "tileset", firstgid=1, source=tiles)
    data = _element(_element(root, "layer", id=1, name="plane", **size), "data", encoding="csv")
    data.text = ",\n".join(",".join(map(str, line)) for line in (numbers + 1).tolist())
    return _text(root)


def godot_set(picture: str, tile: tuple[int, int], names: Sequence[str], grid: NDArray[Any]) -> str:
    """Return a TileSet of Godot 4 with a terrain set that matches corners; parameters as those of `tiled_set`."""
    size = f"Vector2i({tile[1]}, {tile[0]})"
    lines = ['[gd_resource type="TileSet" load_steps=3 format=3]', ""]
    lines += [f'[ext_resource type="Texture2D" path={dumps(picture, ensure_ascii=False)} id="1"]', ""]
    lines += ['[sub_resource type="TileSetAtlasSource" id="1"]', 'texture = ExtResource("1")']
    lines += [f"texture_region_size = {size}"]
    for row in range(len(grid)):
        for col, colours in enumerate(grid[row].tolist()):
            values = {"": 0, "/terrain_set": 0, "/terrain": max(sorted(colours), key=colours.count)}
            values |= {f"/terrains_peering_bit/{name}": c for name, c in zip(CORNERS, colours, strict=True)}
            lines += [f"{col}:{row}/0{name} = {value}" for name, value in values.items()]
    lines += ["", "[resource]", f"tile_size = {size}", "terrain_set_0/mode = 1"]
    for n, (name, colour) in enumerate(zip(names, COLOURS, strict=False)):
        red, green, blue = (round(part / 255, 3) for part in bytes.fromhex(colour[1:]))
        lines += [f"terrain_set_0/terrain_{n}/name = {dumps(name, ensure_ascii=False)}"]
        lines += [f"terrain_set_0/terrain_{n}/color = Color({red}, {green}, {blue}, 1)"]
    return "\n".join([*lines, 'sources/0 = SubResource("1")', ""])


def _element(parent: Any, tag: str, **attributes: Any) -> Any:
    texts = {name: str(value) for name, value in attributes.items()}
    return XML.Element(tag, texts) if parent is None else XML.SubElement(parent, tag, texts)


def _text(root: Any) -> str:
    XML.indent(root, " ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + XML.tostring(root, "unicode") + "\n"
