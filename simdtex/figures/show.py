# SPDX-License-Identifier: BSD-3-Clause
"""Figures for a notebook, a window or a file: of pictures, of realisations, and of estimates.

`simulate` and `estimate` return arrays of xarray whose ``plot()`` draws maps as reports do. They are subclasses because
an accessor cannot be registered over ``plot``. Only the call of xarray's own accessor differs, so that
``made.plot.hist()`` and ``made.plot(x="x")`` stay what they are in xarray.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from xarray.core.utils import UncachedAccessor
from xarray.plot.accessor import DataArrayPlotAccessor, DatasetPlotAccessor

from simdtex.io.image import as_array, pixels_of, to_display
from simdtex.io.rasters import axis_place
from simdtex.model.display import category_colours
from simdtex.options import require, whole

try:
    import matplotlib.pyplot as plt
    from matplotlib.backend_bases import FigureManagerBase
    from matplotlib.colorbar import Colorbar
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
except ModuleNotFoundError:
    require("reports", "matplotlib")
    raise

ACROSS, MAP_INCHES = 4, 2.6
"""The most maps in a row, and the longer side of a map, inches."""

ENLARGED_SIDE, GAP = 256, 24
"""The side up to which pictures are enlarged by a whole factor, and the space around them, pixels."""


class Shown(Figure):
    """A figure that a notebook draws once: as the value of a cell or, if it is not, at the end of the cell."""

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        """Return nothing, so that IPython draws the figure, after those that pyplot has to draw before it."""
        figures = [plt.figure(num) for num in plt.get_fignums()] if "inline" in plt.get_backend() else []
        while self in figures:
            from IPython.display import display  # installed with this backend

            plt.close(figure := figures.pop(0))
            if figure is not self:
                display(figure)  # type: ignore[no-untyped-call]
        return {}


def new_figure(width: float, height: float, **keywords: Any) -> Figure:
    """Return an empty figure of ``width`` x ``height`` inches; pyplot keeps it if a window or a notebook draws it."""
    figure = plt.figure(figsize=(width, height), facecolor="white", FigureClass=Shown, **keywords)
    if type(figure.canvas.manager) is FigureManagerBase and "inline" not in plt.get_backend():
        plt.close(figure)
    return figure


def show(
    *pictures: ArrayLike, tiled: bool = False, titles: Sequence[str] = (), channel_axis: int | None = None
) -> Figure:
    """Return a figure of pictures side by side, which notebooks draw, and ``matplotlib.pyplot.show()`` in a window.

    Parameters
    ----------
    *pictures : (rows, cols) or (rows, cols, 3 or 4) array
        Pictures of any real type, or solids with a first axis of layers, of which the middle one is drawn. uint8 is
        drawn as it is, all else from the picture's smallest value, black, to its largest, white; NaN is white. Channels
        past the third are not drawn. Or one result of `simulate` or `estimate`, as its ``plot()`` draws it.
    tiled : bool
        Draw 3 x 3 copies of each picture edge to edge, so that seams and repeats show.
    titles : sequence of str, optional
        A title for each picture.
    channel_axis : int, optional
        The axis of channels. None: the last of three or four axes if its length is 3 or 4, else none.

    Returns
    -------
    matplotlib.figure.Figure
        A pixel of a picture is a square of one or more pixels of the figure.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Examples
    --------
    >>> from skimage import data
    >>> import simdtex
    >>> simdtex.show(data.brick()[:64, :64], titles=["brick"]).savefig("brick.png")
    """
    made: Any = pictures[0] if len(pictures) == 1 else None
    if hasattr(made, "data_vars") or "realisation" in getattr(made, "coords", ()):
        return draw(made)
    if not pictures or len(titles or pictures) != len(pictures):
        raise ValueError(f"there are {len(pictures)} pictures and {len(titles)} titles; give as many of both")
    shown = [_pixels(picture, channel_axis) for picture in pictures]
    if tiled:
        shown = [np.tile(pixels, (3, 3, 1)) for pixels in shown]
    scale = max(1, ENLARGED_SIDE // max(max(pixels.shape[:2]) for pixels in shown))
    sides = [(scale * len(pixels), scale * pixels.shape[1]) for pixels in shown]
    high, wide = GAP + max(rows for rows, _ in sides) + GAP, GAP + sum(cols + GAP for _, cols in sides)
    figure, left = new_figure(wide / plt.rcParams["figure.dpi"], high / plt.rcParams["figure.dpi"]), GAP
    for pixels, (rows, cols), title in zip(shown, sides, titles or [""] * len(shown), strict=True):
        axes = figure.add_axes((left / wide, 1 - (GAP + rows) / high, cols / wide, rows / high), title=title)
        axes.imshow(pixels, interpolation="nearest")
        axes.set_axis_off()
        left += cols + GAP
    return figure


def _pixels(picture: Any, channel_axis: int | None) -> NDArray[np.uint8]:
    """Return a picture, or the middle layer of a solid, for display: (rows, cols, 3)."""
    array = as_array("the picture", picture)
    if channel_axis is not None:
        array = np.moveaxis(array, channel_axis, -1)
    if array.ndim == 4 or (array.ndim == 3 and channel_axis is None and array.shape[-1] not in (3, 4)):
        array = array[len(array) // 2]
    pixels = np.atleast_3d(pixels_of("the picture", array))
    shown = to_display(np.nan_to_num(pixels, nan=np.fmax.reduce(pixels, None)))
    return shown[..., :3] if shown.shape[2] > 2 else shown[..., [0, 0, 0]]


def draw(made: Any, number: int = 8) -> Figure:
    """Return a figure of the first ``number`` realisations, or of the ``number`` largest categories of an estimate."""
    whole("number", number, 1)
    maps = getattr(made, "data_vars", {})
    if "simulation" in maps:
        return draw(made["simulation"], number)
    if "frequency" in maps:
        axes = (figure := new_figure(4, 4, layout="constrained")).subplots()
        axes.plot((0, 1), (0, 1), "k:", made["probability"], made["frequency"], "o-")
        axes.set(xlabel="probability", ylabel="frequency", aspect=1)
        return figure
    if "probability" in maps:
        names, shares = made["category"].values, made["probability"].values.mean((1, 2))
        most = np.sort(np.argsort(-shares, kind="stable")[:number])
        titles = [f"category {names[k]}, share {100 * shares[k]:.0f} %" for k in most]
        how = [{"vmin": 0, "vmax": 1}] * len(most) + [{"vmin": 0, "vmax": np.log2(max(2, len(names))), "cmap": "magma"}]
        planes = [*made["probability"].values[most], made["entropy"].values]
        return _figure(made, [*titles, "entropy, bits"], planes, how)[0]
    if "variance" in maps:
        both = [made[name] for name in ("mean", "variance")]
        return _figure(made, [_label(values) for values in both], [values.values for values in both], [{}, {}])[0]
    if "realisation" in made.coords and not maps and {"y", "x"} <= set(made.dims):
        return _realisations(made, number)
    raise ValueError("there are no realisations and no estimate to draw; use plot.imshow of xarray")


def _realisations(made: Any, count: int) -> Figure:
    kinds, note = json.loads(made.attrs.get("options", "{}")).get("categorical"), ""
    made = made if "realisation" in made.dims else made.expand_dims("realisation")
    if "variable" in made.dims:
        made, note = made.isel(variable=0), ", variable 0"
    made = made.transpose("realisation", ..., "y", "x")
    inside = made.coords["region"].values if "region" in made.coords else True
    values = np.ma.masked_array(made.values, ~(made.notnull().values & inside))
    names, counts = np.unique(values.compressed(), return_counts=True)
    if not len(names):
        raise ValueError("no realisation has a value here; select cells inside the region")
    how: dict[str, Any] = {"vmin": names[0], "vmax": names[-1]}
    categorical = kinds is True or (isinstance(kinds, list) and 0 in kinds)
    if categorical:
        values = np.ma.masked_array(np.searchsorted(names, made.values), values.mask)
        colours = ListedColormap(category_colours(len(names)) / 255)
        how = {"cmap": colours, "vmin": -0.5, "vmax": len(names) - 0.5, "interpolation_stage": "rgba"}
    if "z" in made.dims:
        middle = made.sizes["z"] // 2
        values, note = values[:, middle], f"{note}, z = {made.z.values[middle]:g}"
    titles = [f"realisation {k}{note}" for k in made.realisation.values[:count]]
    figure, bar = _figure(made, titles, values[:count], how)
    bar.set_label("" if categorical else _label(made))
    if categorical:
        shares = [f"{name}: {share:.0f} %" for name, share in zip(names, 100 * counts / counts.sum(), strict=True)]
        bar.set_ticks(range(len(names)), labels=shares)
    return figure


def _label(values: Any) -> str:
    units = values.attrs.get("units")
    return f"{values.attrs.get('long_name', values.name)}{f', {units}' if units else ''}"


def _figure(made: Any, titles: Sequence[str], planes: Any, how: Any) -> tuple[Figure, Colorbar]:
    """Return a figure of maps, (maps, y, x), and the last colour bar: one for all, or of each map if ``how`` is a list.

    North, the largest y, is at the top, as in reports; coordinates on the ground have labels.
    """
    ground, rows, cols = "cell_y" in made.attrs, made.sizes["y"], made.sizes["x"]
    (left, wide), (low, high) = axis_place(made, "x"), axis_place(made, "y")
    extent = (left - wide / 2, left + wide * (cols - 0.5), low - high / 2, low + high * (rows - 0.5))
    down = -(-len(titles) // ACROSS)
    across = -(-len(titles) // down)
    inches = MAP_INCHES / max(rows * high, cols * wide)
    size = (across * (inches * cols * wide + 0.8) + 1, down * (inches * rows * high + 0.7))
    figure = new_figure(*size, layout="compressed")
    grid = figure.subplots(down, across, squeeze=False).ravel()
    # smaller maps have a pixel for each cell
    smooth = "antialiased" if max(rows, cols) > 100 * MAP_INCHES else "nearest"
    where = {"origin": "lower", "extent": extent, "interpolation": smooth}
    for n, (axes, title) in enumerate(zip(grid, titles, strict=False)):
        colours = how if isinstance(how, dict) else how[n]
        image = axes.imshow(planes[n], **where, **colours)
        axes.set_title(title, fontsize=10)
        axes.set(xlabel=_label(made["x"]) if ground else "", ylabel=_label(made["y"]) if ground else "")
        if colours is not how:
            bar = figure.colorbar(image, ax=axes)
    for axes in grid[len(titles) :]:
        axes.set_axis_off()
    return figure, figure.colorbar(image, ax=list(grid)) if colours is how else bar


class _ArrayPlot(DataArrayPlotAccessor):
    def __call__(self, **keywords: Any) -> Any:  # type: ignore[override]
        """Return a figure of the first ``number`` realisations, by default 8; xarray draws all else."""
        ours = keywords.keys() <= {"number"} and "realisation" in self._da.coords and {"y", "x"} <= set(self._da.dims)
        return draw(self._da, **keywords) if ours else super().__call__(**keywords)


class _DatasetPlot(DatasetPlotAccessor):
    def __call__(self, **keywords: Any) -> Any:
        """Return a figure of the maps, or of the first ``number`` realisations or largest categories, by default 8."""
        return draw(self._ds, **keywords)


class Realisations(xr.DataArray):  # type: ignore[no-untyped-call]
    """An array of realisations."""

    __slots__ = ()
    plot = UncachedAccessor(_ArrayPlot)


class Results(xr.Dataset):  # type: ignore[no-untyped-call]
    """A dataset of an estimate, of realisations and their source maps, or of reliability."""

    __slots__ = ()
    plot = UncachedAccessor(_DatasetPlot)


def described(training: Any, known: Any = None) -> dict[str, str]:
    """Return the attributes ``long_name`` and ``units`` of a training image of xarray, or the name of one variable."""
    names: Any = getattr(known, "names", ())  # of a table
    texts = {"long_name": names[0] if len(names) == 1 else "", "units": ""}
    if hasattr(training, "coords"):
        attributes = {"long_name": training.attrs.get("long_name", training.name), "units": training.attrs.get("units")}
        texts |= {name: value for name, value in attributes.items() if value}
    return {name: str(value) for name, value in texts.items() if value}
