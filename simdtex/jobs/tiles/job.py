# SPDX-License-Identifier: BSD-3-Clause
"""`synthesize` for outputs of any size, `resume`, and `plan`."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from simdtex.checkpoint import check_version, warn
from simdtex.declared import Lit
from simdtex.driver import check_shape, drive
from simdtex.inputs import Inputs, check_inputs
from simdtex.io.files import Damaged, NotWritten, atomic_folder, exclusive
from simdtex.jobs.tiles.layout import Layout, Maps, further, planned
from simdtex.machine import Machine, memory
from simdtex.machine.reference import Reference
from simdtex.methods.mrf import Options
from simdtex.methods.mrf.plan import Plan
from simdtex.methods.mrf.plan import plan as planned_run
from simdtex.model.light import in_light, unevenness
from simdtex.model.source_map import apply_source_map
from simdtex.options import require, resolve, table
from simdtex.random import as_seed
from simdtex.run import Callback, Output

if TYPE_CHECKING:
    from collections.abc import Iterator

    from distributed import Client

TILES = 2048
"""Sites to the side of a tile by default."""

TAKEN = ("image", "source", "checksums", "work")
"""Reserved names in a store, which no map may have."""

PathLike = str | os.PathLike[str]

Ended = Callable[[list[Any], Any, Output, Any], object]
"""A function of the samples, the image, the rest of the output, and the ``command`` that the store keeps."""


def synthesize(
    sample: ArrayLike,
    shape: tuple[int, int],
    store: PathLike,
    *,
    tiles: int = TILES,
    workers: int | str | Client | None = None,
    source_map: bool = False,
    maps: dict[str, Any] | None = None,
    channel_axis: int | None = None,
    mask: ArrayLike | Sequence[ArrayLike] | None = None,
    known: ArrayLike | None = None,
    known_source: ArrayLike | None = None,
    guide: tuple[Any, Any] | None = None,
    light: str = "keep",
    rng: int | np.random.Generator | None = None,
    device: str | Machine | None = None,
    callback: Callback | None = None,
    note: Callable[[str], None] | None = None,
    ended: Ended | None = None,
    command: Any = None,
    **options: Any,
) -> Any:
    """Synthesise an output larger than one machine, with the bytes of `simdtex.synthesize` with ``method="mrf"``.

    Parameters
    ----------
    sample : (rows, cols) or, with `channel_axis`, (rows, cols, channels) array; or a list of such
        As in `simdtex.synthesize`.
    shape : (int, int)
        Rows and columns of the output.
    store : path
        Folder of the Zarr store to make, which every worker can reach. `resume` continues an interrupted run.
    tiles : int
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
    mask, known, known_source, guide, light, rng
        As in `simdtex.synthesize`. This process copies known values and guides into the store.
    device : str, optional
        As in `simdtex.synthesize`, on every worker.
    callback : callable, optional
        Called with a `simdtex.run.Progress` after every tile.
    note : callable, optional
        Receives a sentence while the run waits for workers. None: a warning.
    ended : callable, optional
        ``ended(samples, image, output, command)`` is called when the output is written. ``samples`` are a list; the
        image, and the source map of the `simdtex.run.Output`, are arrays of the store; slicing reads a part. If it
        raises an error, the run is not finished, and `resume` calls it again.
    command : optional
        Texts, numbers, lists and dicts that the store keeps for ``ended``.
    **options
        Options of the method, see `simdtex.methods.mrf.Options`; only schedules that relax a window like the whole.

    Returns
    -------
    dask.array.Array, (rows, cols[, channels])
        The array ``image`` of the store, read on demand; `channel_axis` is the axis of its channels.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.
    DeviceError
        One worker after another ends at the same tile.

    Notes
    -----
    A tile relaxes in a window that is larger by the reach of a sweep, so the cost is that of `simdtex.synthesize` plus
    the redundant work in `plan`. The memory of a worker is that in `plan`, for any size of output.
    """
    size = check_shape(shape)
    inputs = check_inputs(sample, size, channel_axis, mask, known, known_source, guide)
    run, seed = _plan(inputs, size, options, light), as_seed(rng)
    layout, more = planned(run, seed, tiles), _maps(maps or {}, run)
    require("distributed", "zarr", "dask", "distributed")
    from simdtex.jobs.tiles.cluster import check_workers, connected
    from simdtex.jobs.tiles.store import Store

    check_workers(workers, device)
    if workers is None or isinstance(workers, int):
        memory.require_host(layout.memory * (workers or 1), "give smaller tiles or fewer workers")
    with connected(workers) as client:
        with _made(store) as temporary:
            channels = channel_axis is not None
            about = {"command": command, "light": light}
            Store.create(temporary, run, seed, layout, channels=channels, source=source_map, maps=more, **about)
        how: dict[str, Any] = {"device": device, "callback": callback, "note": note, "ended": ended}
        return resume(store, workers=client, channel_axis=channel_axis, **how)


def resume(
    store: PathLike,
    *,
    workers: int | str | Client | None = None,
    channel_axis: int | None = -1,
    device: str | Machine | None = None,
    callback: Callback | None = None,
    note: Callable[[str], None] | None = None,
    ended: Ended | None = None,
) -> Any:
    """Resume an interrupted output, and return it; the bytes are those of a run without an interruption.

    Parameters
    ----------
    store : path
        As in `synthesize`.
    workers, device, callback, note, ended
        As in `synthesize`; they may differ from those of the first run.
    channel_axis : int, optional
        The axis of the channels of the result, if it has any.

    Returns
    -------
    dask.array.Array, (rows, cols[, channels])
        As in `synthesize`; also if the output is already finished.

    Raises
    ------
    ValueError
        There is no such store, it has another version, another process is using it, or a part of it is damaged; the
        message names the remedy.
    """
    opened = _opened(store)
    from simdtex.jobs.tiles.cluster import across, check_workers, connected, here
    from simdtex.jobs.tiles.turns import Tiles

    check_workers(workers, device)
    with exclusive(store):
        if opened.finished:
            with _mending(opened):
                opened.check()
        else:
            with connected(workers) as client:
                each = here(opened, device) if client is None else across(client, opened, device, note or warn)
                with _mending(opened):
                    image, output = drive(Tiles(opened, each), Reference(), opened.about["seed"], callback)
                    for name in ("device", "device_seconds"):  # of the leading process
                        del output.statistics[name]
                    pixels = opened.work.plan.sample.pictures.pixels[0]
                    output.statistics["light"] = {"light": opened.about["light"], **unevenness(pixels)}
                    if ended:
                        ended(opened.samples(), image, output, opened.about["command"])
                    opened.finish(opened.work)
        opened.clean()
    return _array(opened.where, channel_axis)


def finished(store: PathLike) -> bool:
    """Return whether an output is complete; raise ValueError if the store holds none, as `resume` does."""
    return bool(_opened(store).finished)


def plan(
    sample: ArrayLike,
    shape: tuple[int, int],
    *,
    tiles: int = TILES,
    channel_axis: int | None = None,
    source_map: bool = False,
    maps: dict[str, Any] | None = None,
    light: str = "keep",
    **options: Any,
) -> Layout:
    """Return the layout of an output in tiles, and the memory and disk that it needs.

    Parameters
    ----------
    sample, shape, tiles, channel_axis, source_map, maps, light, **options
        As in `synthesize`; the options may include ``mask``, ``known``, ``known_source`` and ``guide``.

    Returns
    -------
    simdtex.jobs.tiles.Layout
        Tiles, halos and redundant work of each level, and bytes of memory and of disk.
    """
    size = check_shape(shape)
    given = {name: options.pop(name, None) for name in ("mask", "known", "known_source", "guide")}
    run = _plan(check_inputs(sample, size, channel_axis, **given), size, options, light)
    return planned(run, 0, tiles, further(run, source_map, _maps(maps or {}, run)))


def _plan(inputs: Inputs, size: tuple[int, int], options: dict[str, Any], light: str) -> Plan:
    table(Lit)["light"].check("light", light)
    chosen = resolve(Options, "synth", options)
    if not isinstance(chosen.schedule, str):
        raise TypeError("workers know schedules by their names; give schedule the name of one")
    sample, _ = in_light(inputs.pictures, light, chosen.categorical)
    return planned_run(sample, size, chosen, inputs.given, inputs.guide)


def _maps(maps: dict[str, Any], plan: Plan) -> Maps:
    """Return further maps as lists, with one map for each picture of the sample; raise if they do not fit."""
    found, sizes = {}, [picture.shape[:2] for picture in plan.sample.pictures.pixels]
    if maps and plan.given is not None:
        raise ValueError("the maps have no values for known pixels, which are not from the sample; leave the maps out")
    for name, given in maps.items():
        if not name.isidentifier() or name in TAKEN:
            raise ValueError(f"{name!r} is no name of a map; give a word other than {', '.join(TAKEN)}")
        last = np.array([[(rows - 1, cols - 1, k) for k, (rows, cols) in enumerate(sizes)]])
        if len(sizes) == 1:
            last, given = last[..., :2], given[0] if isinstance(given, (list, tuple)) else given
        apply_source_map(last, given, sizes if len(sizes) > 1 else sizes[0])
        found[name] = [np.asarray(one) for one in (given if len(sizes) > 1 else [given])]
    return found


@contextmanager
def _made(store: PathLike) -> Iterator[str]:
    """Yield a path for making a store, so that it exists completely or not at all."""
    path = Path(store)
    if path.exists():
        raise ValueError(f"{path} is there already; give another name, or continue with: simdtex resume {path}")
    if not path.parent.is_dir():
        raise ValueError(f"the folder {path.parent} does not exist; make it first")
    with atomic_folder(path) as temporary:
        yield str(temporary)


def _opened(path: PathLike) -> Any:
    """Return the store at a path; raise ValueError unless this version can continue it."""
    require("distributed", "zarr", "dask", "distributed")
    from simdtex.jobs.tiles.store import FORMAT, Store

    where = os.path.abspath(path)
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
        about = store.about
    check_version(where, about, FORMAT)
    return store


@contextmanager
def _mending(store: Any) -> Iterator[None]:
    """Raise an error that names the remedy if a part of a store is damaged or cannot be written.

    The store has then returned to a turn that does not need the damaged part.
    """
    try:
        yield
    except NotWritten as error:
        raise ValueError(f"{error}, and continue with: simdtex resume {store.where}") from None
    except Damaged as error:
        where, part = store.where, str(error)
        if not os.path.exists(os.path.join(where, "zarr.json")):
            raise ValueError(
                f"{where} was removed or moved while the run went on; put it back, or begin anew"
            ) from None
        wrong, again = f"{part} of {where} is missing or damaged", store.back(part)
        if again is None:
            raise ValueError(f"{wrong}, and nothing makes it again; remove the store and begin anew") from None
        raise ValueError(f"{wrong}; {again} with: simdtex resume {where}") from None


def _array(where: str, channel_axis: int | None) -> Any:
    dask: Any = import_module("dask.array")
    image = dask.from_zarr(where, component="image")
    return image if channel_axis is None or image.ndim == 2 else dask.moveaxis(image, -1, channel_axis)
