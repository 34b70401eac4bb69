# SPDX-License-Identifier: BSD-3-Clause
"""What `simulate` and `estimate` return: arrays of xarray whose ``plot()`` draws maps as reports do.

They are subclasses because an accessor cannot be registered over ``plot``. Only the call of xarray's own accessor
differs, so that ``made.plot.hist()`` and ``made.plot(x="x")`` stay what they are in xarray.
"""

from __future__ import annotations

from typing import Any

import xarray as xr
from xarray.core.utils import UncachedAccessor
from xarray.plot.accessor import DataArrayPlotAccessor, DatasetPlotAccessor


class _ArrayPlot(DataArrayPlotAccessor):
    def __call__(self, **keywords: Any) -> Any:  # type: ignore[override]
        """Return a figure of the first ``number`` realisations, by default 8; xarray draws all else."""
        own = keywords.keys() <= {"number"} and "realisation" in self._da.coords and {"y", "x"} <= set(self._da.dims)
        return _draw(self._da, **keywords) if own else super().__call__(**keywords)


class _DatasetPlot(DatasetPlotAccessor):
    def __call__(self, **keywords: Any) -> Any:
        """Return a figure of the maps, or of the first ``number`` realisations or largest categories, by default 8."""
        return _draw(self._ds, **keywords)


def _draw(made: Any, **keywords: Any) -> Any:
    from simdtex.model.show import draw  # loads pyplot, which only figures need

    return draw(made, **keywords)


class Realisations(xr.DataArray):  # type: ignore[no-untyped-call]
    """An array of realisations."""

    __slots__ = ()
    plot = UncachedAccessor(_ArrayPlot)


class Results(xr.Dataset):  # type: ignore[no-untyped-call]
    """A dataset of an estimate, or of realisations and their source maps."""

    __slots__ = ()
    plot = UncachedAccessor(_DatasetPlot)


def described(training: Any) -> dict[str, str]:
    """Return the attributes ``long_name`` and ``units`` of a training image of xarray, if it has them."""
    if not hasattr(training, "coords"):
        return {}
    found = {"long_name": training.attrs.get("long_name", training.name), "units": training.attrs.get("units")}
    return {name: str(value) for name, value in found.items() if value}
