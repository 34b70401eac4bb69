# SPDX-License-Identifier: BSD-3-Clause
"""`TileStore`: outputs of any size in tiles, by any number of workers, with the bytes of an output without tiles."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simdtex.checkpoint import check_version, warn
from simdtex.driver import Device, Seed, drive
from simdtex.io.files import Damaged, NotWritten, atomic_folder, exclusive
from simdtex.jobs.tiles.layout import Maps, Outputs, TileLayout, TilePlan, planned
from simdtex.machine import memory
from simdtex.machine.reference import Reference
from simdtex.methods.mrf.plan import MrfPlan
from simdtex.model.source_map import apply_source_map
from simdtex.options import require
from simdtex.random import as_seed
from simdtex.run import Callback, Output

if TYPE_CHECKING:
    from distributed import Client

TAKEN = ("image", "source", "checksums", "work")
"""Reserved names in a store, which no map may have."""


@dataclass(frozen=True, eq=False)
class TileStore:
    """A Zarr store in which `simdtex.synthesize` makes an output larger than one machine, tile by tile.

    The bytes are those of an output without tiles. Only the method ``mrf``, with a schedule that relaxes a window like
    the whole.

    Parameters
    ----------
    path : path
        Folder of the store, which every worker can reach.
    side : int
        Sites on a side of a tile. The size determines the memory of a worker, and not the result.
    workers : int, str or distributed.Client, optional
        The workers that make the tiles: a number of processes on this machine, which share its cores; the address of a
        Dask scheduler; or a client. Each worker opens its own device. None: this process makes the tiles one by one.
    source_map : bool
        Also write ``source``, for every output pixel the (row, column[, picture]) of the sample pixel it is from.
    maps : dict, optional
        Further maps of the material, of the sample's size, which are written in the same arrangement into arrays of
        these names. With several samples a list of maps for each name, as in
        `simdtex.model.source_map.apply_source_map`.
    note : callable, optional
        Receives a sentence while the run waits for workers; by default a warning.
    ended : callable, optional
        ``ended(samples, image, output, command)`` is called when the output is written. ``samples`` are a list; the
        image, and the source map of the `simdtex.run.Output`, are arrays of the store; slicing reads a part. If it
        raises an error, the run is not finished, and `resume` calls it again.
    command : optional
        Texts, numbers, lists and dicts that the store keeps for ``ended``.

    Notes
    -----
    A tile relaxes in a window that is larger by the reach of a sweep, so the cost is that of an output without tiles
    plus the redundant work in `layout`. The memory of a worker is that in `layout`, for any size of output.
    """

    path: str | os.PathLike[str]
    side: int = 2048
    workers: int | str | Client | None = None
    source_map: bool = False
    maps: dict[str, Any] | None = None
    note: Callable[[str], None] = warn
    ended: Callable[[list[Any], Any, Output, Any], object] | None = None
    command: Any = None

    def layout(self, job: Any) -> TileLayout:
        """Return the tiles of a job of `plan_synthesis`, and the memory and disk they need; nothing is written."""
        return self.plan(job, 0).layout

    def plan(self, job: Any, rng: Seed) -> TilePlan:
        """Return the plan of a job in tiles."""
        if job.method != "mrf":
            raise ValueError(f"the method {job.method} needs the whole output at once; give mrf, or make no tiles")
        plan = job.plan()
        outputs = Outputs(job.channel_axis is not None, self.source_map, _maps(self.maps or {}, plan))
        return planned(plan, as_seed(rng), self.side, outputs)

    def make(self, job: Any, tiles: TilePlan, device: Device = None, callback: Callback | None = None) -> Any:
        """Make the output of a job, whose `plan` is ``tiles``, and return it as `resume` does."""
        require("distributed", "zarr", "dask", "distributed")
        from simdtex.jobs.tiles.cluster import check_workers, connected
        from simdtex.jobs.tiles.store import Store

        check_workers(self.workers, device)
        if self.workers is None or isinstance(self.workers, int):
            memory.require_host(tiles.layout.memory * (self.workers or 1), "give smaller tiles or fewer workers")
        path = Path(self.path)
        if path.exists():
            raise ValueError(f"{path} is there already; give another name, or continue with: simdtex resume {path}")
        if not path.parent.is_dir():
            raise ValueError(f"the folder {path.parent} does not exist; make it first")
        with connected(self.workers) as client:
            with atomic_folder(path) as new:
                Store.create(str(new), tiles, command=self.command, light=job.light.about)
            return replace(self, workers=client).resume(device, callback, channel_axis=job.channel_axis)

    def resume(self, device: Device = None, callback: Callback | None = None, *, channel_axis: int | None = -1) -> Any:
        """Resume an interrupted output, and return it; the bytes are those of a run without an interruption.

        Parameters
        ----------
        device : str, optional
            As in `simdtex.synthesize`, on every worker; it may differ from that of the first run, as may ``workers``,
            ``note`` and ``ended``. Everything else is what the store keeps.
        callback : callable, optional
            Called with a `simdtex.run.Progress` after every tile.
        channel_axis : int, optional
            The axis of the channels of the result, if it has any.

        Returns
        -------
        dask.array.Array, (rows, cols[, channels])
            The array ``image`` of the store, read on demand; also if the output is already finished.

        Raises
        ------
        ValueError
            There is no such store, it has another version, another process is using it, or a part of it is damaged;
            the message names the remedy.
        DeviceError
            One worker after another ends at the same tile.
        """
        store = self._opened()
        from simdtex.jobs.tiles.cluster import across, check_workers, connected, here
        from simdtex.jobs.tiles.turns import Turns

        check_workers(self.workers, device)
        with exclusive(self.path):
            if store.finished:
                with _mending(store):
                    store.check()
            else:
                with connected(self.workers) as client, _mending(store):
                    each = here(store, device) if client is None else across(client, store, device, self.note)
                    about = store.about
                    image, output = drive(Turns(store, each), Reference(), about["seed"], callback)
                    for name in ("device", "device_seconds"):  # of the leading process
                        del output.statistics[name]
                    output.statistics["light"] = about["light"]
                    if self.ended:
                        self.ended(store.samples(), image, output, about["command"])
                    store.finish()
            store.clean()
        dask: Any = import_module("dask.array")
        image = dask.from_zarr(store.where, component="image")
        return image if channel_axis is None or image.ndim == 2 else dask.moveaxis(image, -1, channel_axis)

    @property
    def finished(self) -> bool:
        """Whether the output is complete; raises ValueError if the store holds none, as `resume` does."""
        return bool(self._opened().finished)

    def _opened(self) -> Any:
        """Return the store; raise ValueError unless this version can continue it."""
        require("distributed", "zarr", "dask", "distributed")
        from simdtex.jobs.tiles.store import FORMAT, Store

        where = os.path.abspath(self.path)
        if not os.path.isdir(where):
            raise ValueError(f"{where} is no Zarr store; give one that simdtex has begun")
        try:
            store = Store(where)
        except Damaged:
            raise ValueError(f"{where} is no Zarr store, or its zarr.json is damaged; give another one") from None
        if store.finished:
            return store
        if not os.path.isdir(os.path.join(where, "work")):
            raise ValueError(f"{where} is no output in tiles; give one that simdtex has begun")
        with _mending(store):
            check_version(where, store.about, FORMAT)
        return store


def _maps(maps: dict[str, Any], plan: MrfPlan) -> Maps:
    """Return further maps as lists, with one map for each picture of the sample; raise if they do not fit."""
    listed, sizes = {}, [picture.shape[:2] for picture in plan.sample.pictures.pixels]
    if maps and plan.given is not None:
        raise ValueError("the maps have no values for known pixels, which are not from the sample; leave the maps out")
    for name, given in maps.items():
        if not name.isidentifier() or name in TAKEN:
            raise ValueError(f"{name!r} is no name of a map; give a word other than {', '.join(TAKEN)}")
        last = np.array([[(rows - 1, cols - 1, k) for k, (rows, cols) in enumerate(sizes)]])
        if len(sizes) == 1:
            last, given = last[..., :2], given[0] if isinstance(given, (list, tuple)) else given
        apply_source_map(last, given, sizes if len(sizes) > 1 else sizes[0])
        listed[name] = [np.asarray(picture) for picture in (given if len(sizes) > 1 else [given])]
    return listed


@contextmanager
def _mending(store: Any) -> Iterator[None]:
    """Raise an error that names the remedy if a part of a store, which has gone back, is damaged or not written."""
    try:
        yield
    except NotWritten as error:
        raise ValueError(f"{error}, and continue with: simdtex resume {store.where}") from None
    except Damaged as error:
        where, part = store.where, str(error)
        if not os.path.exists(os.path.join(where, "zarr.json")):
            gone = f"{where} was removed or moved while the run went on"
            raise ValueError(f"{gone}; put it back, or begin anew") from None
        wrong, again = f"{part} of {where} is missing or damaged", store.back(part)
        if again is None:
            raise ValueError(f"{wrong}, and nothing makes it again; remove the store and begin anew") from None
        raise ValueError(f"{wrong}; {again} with: simdtex resume {where}") from None
