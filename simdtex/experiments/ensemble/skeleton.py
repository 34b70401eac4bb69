# SPDX-License-Identifier: BSD-3-Clause
"""The skeleton of a figure as a graph of arms, and how arms that are no more than bumps are taken off it."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Mask = NDArray[np.bool_]
Tip = tuple[int, int]

ALL = np.ones((3, 3), bool)


@dataclass
class Arm:
    """A line of the skeleton: its length, its pixels, half-widths along it, its junctions, and its free ends.

    Half-widths are the sum over the pixels and the largest.
    """

    length: float
    pixels: int
    half_widths: float
    largest: float
    junctions: list[int]
    tips: list[Tip] = field(default_factory=list)


@dataclass
class Graph:
    """Arms by number, the half-width at each junction, and the arms that meet there; rings are none."""

    arms: dict[int, Arm]
    half_width: dict[int, float]
    meeting: dict[int, list[int]]


def graph(lines: Mask, distance: NDArray[np.float64]) -> Graph:
    """Take a skeleton apart into arms, which end free or at junctions.

    Parameters
    ----------
    lines : bool array, (rows, cols)
        The skeleton, one pixel wide, False along the border.
    distance : float array, (rows, cols)
        Of each pixel to the ground: the half-width of the figure at its skeleton, pixels.

    Returns
    -------
    Graph
    """
    around = ndimage.convolve(lines.astype(np.uint8), ALL.astype(np.uint8), mode="constant")
    crossing = lines & (around > 3)  # itself and three more
    nodes, node_count = ndimage.label(crossing, structure=ALL)
    labels, count = ndimage.label(lines & ~crossing, structure=ALL)
    numbers = np.arange(1, count + 1)
    lengths = _lengths(labels, count)
    sizes, sums = np.bincount(labels.ravel()), np.bincount(labels.ravel(), weights=distance.ravel())
    widest, at_nodes = _largest(distance, labels, count), _largest(distance, nodes, node_count)
    arms = {int(n): Arm(float(lengths[n]), int(sizes[n]), float(sums[n]), float(widest[n]), []) for n in numbers}
    half_width = {node: float(at_nodes[node]) for node in range(1, node_count + 1)}
    meeting: dict[int, list[int]] = {node: [] for node in half_width}
    for row, col in np.argwhere((labels > 0) & (around == 2)):
        arms[int(labels[row, col])].tips.append((int(row), int(col)))
    for number, touched in _contacts(labels, nodes).items():
        arm = arms[number]
        arm.junctions = sorted(set(touched))[: 2 - len(arm.tips)]  # one for each end that is not free
        if len(arm.junctions) + len(arm.tips) < 2:
            del arms[number]  # a corner of a thick crossing, or a ring with one junction
            continue
        for node in arm.junctions:
            meeting[node].append(number)
    return Graph(arms, half_width, meeting)


def _largest(values: NDArray[np.float64], labels: NDArray[np.int32], count: int) -> NDArray[np.float64]:
    """The largest value of each label; that of 0 is not asked for."""
    found = np.zeros(count + 1)
    marked = labels > 0
    np.maximum.at(found, labels[marked], values[marked])
    return found


def _lengths(labels: NDArray[np.int32], count: int) -> NDArray[np.float64]:
    """Length of each line, pixels: 1 for a step along an axis, the root of 2 for one across."""
    found = np.zeros(count + 1)
    along = [(labels[1:], labels[:-1]), (labels[:, 1:], labels[:, :-1])]
    for first, second in along:
        found += np.bincount(first[(first > 0) & (second > 0)], minlength=count + 1)
    # a step across counts only where there is no way around the corner
    upper, lower = labels[:-1], labels[1:]
    for first, second, corners in (
        (upper[:, :-1], lower[:, 1:], (upper[:, 1:], lower[:, :-1])),
        (upper[:, 1:], lower[:, :-1], (upper[:, :-1], lower[:, 1:])),
    ):
        step = (first > 0) & (second > 0) & (corners[0] == 0) & (corners[1] == 0)
        found += np.sqrt(2.0) * np.bincount(first[step], minlength=count + 1)
    return found


def _contacts(labels: NDArray[np.int32], nodes: NDArray[np.int32]) -> dict[int, list[int]]:
    """For each arm the junctions that its pixels touch."""
    largest = ndimage.maximum_filter(nodes, footprint=ALL, mode="constant")
    # a pixel may touch two junctions: the one of the largest number, and that of the smallest
    smallest = ndimage.minimum_filter(np.where(nodes > 0, nodes, nodes.max() + 1), footprint=ALL, mode="nearest")
    found: dict[int, list[int]] = {}
    for row, col in np.argwhere((labels > 0) & (largest > 0)):
        touched = {int(largest[row, col]), int(smallest[row, col])}
        found.setdefault(int(labels[row, col]), []).extend(sorted(touched))
    return found


def prune(skeleton: Graph, usual: float) -> None:
    """Take off, in place, the arms that end free and are no more than bumps, shortest first.

    An arm stays if it reaches further than a width beyond the bank of the figure at its junction: its own mean width,
    or the usual one if that is larger. Where two arms are left at a junction they become one, so that a line is not
    worn away by the bumps along it.

    Parameters
    ----------
    skeleton : Graph
    usual : float
        Half of the usual width, pixels.
    """
    for node, here in list(skeleton.meeting.items()):  # corners of lines that are no junctions
        if _is_passed(here):
            _joined(skeleton, node)
    queue: list[tuple[float, int]] = []

    def ask(number: int) -> None:
        arm = skeleton.arms[number]
        if len(arm.tips) == 1 and len(arm.junctions) == 1:
            heapq.heappush(queue, (arm.length, number))

    for number in skeleton.arms:
        ask(number)
    while queue:
        length, number = heapq.heappop(queue)
        arm = skeleton.arms.get(number)
        if arm is None or arm.length != length or len(arm.junctions) != 1 or len(arm.tips) != 1:
            continue  # it has changed since
        node = arm.junctions[0]
        if length > skeleton.half_width[node] + 2.0 * max(arm.half_widths / arm.pixels, usual):
            continue
        del skeleton.arms[number]
        skeleton.meeting[node].remove(number)
        left = skeleton.meeting[node]
        if _is_passed(left):
            ask(_joined(skeleton, node))


def _is_passed(here: list[int]) -> bool:
    """Whether two arms and no more meet."""
    return len(here) == 2 and here[0] != here[1]


def _joined(skeleton: Graph, node: int) -> int:
    """Make one arm of the two that meet at a junction; its number."""
    first, second = skeleton.meeting.pop(node)
    one, two = skeleton.arms[first], skeleton.arms.pop(second)
    one.junctions.remove(node)
    two.junctions.remove(node)
    one.length += two.length + 1.0  # the junction's pixel
    one.pixels += two.pixels + 1
    one.half_widths += two.half_widths + skeleton.half_width[node]
    one.largest = max(one.largest, two.largest, skeleton.half_width[node])
    one.tips += two.tips
    for other in two.junctions:
        here = skeleton.meeting[other]
        here[here.index(second)] = first
    one.junctions += two.junctions
    return first
