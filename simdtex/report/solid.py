# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a solid texture on one sheet: a cube, a cube without an octant, a sphere, and its middle slices.

Directions are (z, y, x) as the axes of a block: x to the right, y down and z away from the viewer of its first slice.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from math import ceil, cos, radians, sin

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates

from simdtex.io.image import check_writable, to_display
from simdtex.report.sheet import LEAST_SIDE, MOST_SIDE, contact_sheet, fitted, magnified, rgb

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]
PathLike = str | os.PathLike[str]
Hits = tuple[NDArray[np.bool_], Floats, Floats]
"""Whether each ray meets the body; of those that do, the points and the outward normals there."""

YAW, PITCH = radians(40.0), radians(28.0)  # angles of the camera to the right of the first slice, and above it
AHEAD = np.array([cos(YAW) * cos(PITCH), sin(PITCH), -sin(YAW) * cos(PITCH)])
TOWARDS = -np.sign(AHEAD)  # the octant nearest to the camera
RIGHT = np.array([sin(YAW), 0.0, cos(YAW)])
DOWN = np.array([-sin(PITCH) * cos(YAW), cos(PITCH), sin(PITCH) * sin(YAW)])
LIGHT = np.array([-0.55, -0.80, 0.24])  # towards the lamp: above, before the first slice, a little to the right
AMBIENT, LAMP = 0.46, 0.60  # of the light
BACKGROUND = 243.0  # a light neutral grey
MARGIN = 0.04  # of a cell, around the cube
SAMPLES = 2  # rays in a pixel, each way
SIZES = range(LEAST_SIDE, MOST_SIDE + 1)  # sizes that a sheet shows unchanged


def view(volume: ArrayLike, path: PathLike | None = None, size: int = 360) -> Picture:
    """Return pictures of a solid texture as a block of stone, on one sheet.

    Parameters
    ----------
    volume : array_like, (depth, rows, cols) or (depth, rows, cols, channels)
        Types other than uint8 are stretched over their own range. Of three channels or more the first three are shown
        as colours, else the first as grey. The block is taken to repeat itself in every direction.
    path : path, optional
        A file for the sheet; the suffix names the format.
    size : int
        Pixels of each side of a body's picture, 96 to 1024.

    Returns
    -------
    ndarray of uint8, (rows, cols, 3)
        A cube seen from above and from the right of its first slice, the same without its nearest octant, a sphere
        out of the repeated block, in one scale; then the middle x-y, x-z and y-z slices.

    Raises
    ------
    ValueError
        The volume has another number of axes or is empty, `size` is out of range, or `path` cannot be written.
    """
    block = np.asarray(volume)
    if block.ndim not in (3, 4) or block.size == 0:
        raise ValueError(
            f"the volume has the shape {block.shape}: give (depth, rows, cols) or (depth, rows, cols, channels)"
        )
    if size not in SIZES:
        raise ValueError(f"size is {size}: give {SIZES[0]} to {SIZES[-1]} pixels")
    if path is not None:
        check_writable(path, np.uint8, 3)  # before the work
    block = block[..., np.newaxis] if block.ndim == 3 else block
    block = to_display(block[..., : 3 if block.shape[3] >= 3 else 1])
    half = np.array(block.shape[:3]) / 2
    extent = max(float(half @ np.abs(RIGHT)), float(half @ np.abs(DOWN)))
    step = 2 * (1 + MARGIN) * extent / size  # voxels of a pixel
    bodies: list[tuple[str, Callable[[Floats], Hits]]] = [
        ("cube", lambda rays: _cube(rays, half)),
        ("cube without an octant", lambda rays: _cube_without_octant(rays, half)),
        ("sphere", lambda rays: _sphere(rays, extent)),
    ]
    pictures = [(name, _rendered(block, body, size, step)) for name, body in bodies]
    z, y, x = (n // 2 for n in block.shape[:3])
    slices = {
        f"x-y slice, z = {z}": block[z],
        f"x-z slice, y = {y}": block[:, y],
        f"y-z slice, x = {x}": block[:, :, x],
    }
    longest = max(block.shape[:3])
    for name, picture in slices.items():  # all by the whole factor that fits the longest side
        small = fitted(rgb(picture), -(-max(picture.shape[:2]) // -(-longest // size)))
        pictures.append((name, magnified(small, max(1, size // longest))))
    return contact_sheet(pictures, path, columns=3, scale=1)


def _rendered(block: Picture, body: Callable[[Floats], Hits], size: int, step: float) -> Picture:
    """Return a body cut out of a block, seen from a corner in parallel rays, `step` voxels of the block to a pixel."""
    samples = max(SAMPLES, min(4, ceil(step)))
    place = ((np.arange(size * samples) + 0.5) / samples - size / 2) * step
    rays = place[:, np.newaxis, np.newaxis] * DOWN + place[:, np.newaxis] * RIGHT
    hit, points, normals = body(rays)
    # half a voxel below the surface, so that a plane face shows the voxels of one slice
    where = (points - normals / 2 + np.array(block.shape[:3]) / 2 - 0.5).T
    light = AMBIENT + LAMP * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, None)
    picture = np.full((*hit.shape, block.shape[3]), BACKGROUND)
    for channel in range(block.shape[3]):
        found = map_coordinates(block[..., channel], where, output=np.float64, order=1, mode="grid-wrap")
        picture[hit, channel] = np.minimum(found * light, 255)
    picture = picture.reshape(size, samples, size, samples, -1).mean((1, 3))
    return np.asarray(np.rint(picture), np.uint8)


def _cube(rays: Floats, half: Floats) -> Hits:
    """Return where rays enter a box around the origin."""
    faces = (-half - rays) / AHEAD, (half - rays) / AHEAD
    near, far = np.minimum(*faces), np.maximum(*faces)
    enter = near.max(-1)
    hit = enter < far.min(-1)
    normals = np.eye(3)[near[hit].argmax(-1)] * TOWARDS
    return hit, rays[hit] + enter[hit][:, np.newaxis] * AHEAD, normals


def _cube_without_octant(rays: Floats, half: Floats) -> Hits:
    """Return the same for a box without its nearest octant: rays that enter there end on one of its inner faces."""
    hit, points, normals = _cube(rays, half)
    inside = (points * TOWARDS > 0).all(-1)
    far = -points[inside] / AHEAD
    points[inside] += far.min(-1)[:, np.newaxis] * AHEAD
    normals[inside] = np.eye(3)[far.argmin(-1)] * TOWARDS
    return hit, points, normals


def _sphere(rays: Floats, radius: float) -> Hits:
    """Return where rays meet a sphere around the origin; the rays start in the plane through it."""
    depth = radius**2 - (rays**2).sum(-1)
    hit = depth > 0
    points = rays[hit] - np.sqrt(depth[hit])[:, np.newaxis] * AHEAD
    return hit, points, points / radius
