# SPDX-License-Identifier: BSD-3-Clause
"""A method over a folder of samples, before and after a change; `study.py --samples` runs it."""

import ast
import time
from dataclasses import fields
from math import log
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tables
from figures import further

import simdtex
from simdtex.io.image import to_display, write
from simdtex.report.sheet import contact_sheet

QUALITY = tuple(field.name for field in fields(simdtex.quality.Quality))
FIGURES = (*QUALITY, "salt", "contrast", "repeats", "own_repeats", "repeats_beyond_own", "seconds")
"""The columns of the table; `repeats_beyond_own` is what an output repeats beyond what its sample does."""

LESS_IS_WORSE = {"effective_share"}
ONE_IS_BEST = {"salt", "contrast"}
AS_PNG = ("uint8", "uint16")


class Result(NamedTuple):
    """A picture and its figures, by name; a figure that it lacks is missing."""

    sample: str
    setting: str
    seed: int
    picture: np.ndarray
    figures: dict


def parsed(text):
    """The options of ``"balance=0,preset=paper"``: numbers, True, False and None as Python has them, else words."""
    options = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, value = part.partition("=")
        if not (equals and name.strip() and value.strip()):
            raise ValueError(f"{part} is no option: give NAME=VALUE,NAME=VALUE")
        try:
            options[name.strip()] = ast.literal_eval(value.strip())
        except (ValueError, SyntaxError):
            options[name.strip()] = value.strip()
    return options


def badness(figure, value):
    """A number that is larger the worse a figure is."""
    if figure in ONE_IS_BEST:
        return abs(log(max(value, 1e-9)))
    return -value if figure in LESS_IS_WORSE else abs(value)


def summary(results):
    """Mean, worst and whose that is, for each figure that there is: {figure: (mean, worst, sample, seed)}."""
    found = {}
    for figure in FIGURES:
        those = [result for result in results if figure in result.figures]
        if those:
            worst = max(those, key=lambda result: badness(figure, result.figures[figure]))
            mean = float(np.mean([result.figures[figure] for result in those]))
            found[figure] = mean, worst.figures[figure], worst.sample, worst.seed
    return found


def file_name(name, seed, dtype="uint8"):
    """What the picture of a sample and a seed is called; the first seed has none in its name."""
    return f"{name}{'' if seed == 1 else f'-seed{seed}'}.{'png' if dtype in AS_PNG else 'tif'}"


def measured(sample, name, setting, seed, picture, source=None, seconds=None):
    """A picture with all of its figures; the seconds are those of its synthesis."""
    quality = vars(simdtex.quality.measure(sample, picture, source)) | further(sample, picture)
    figures = {figure: value for figure, value in quality.items() if value is not None}
    if "repeats" in figures:
        figures["repeats_beyond_own"] = figures["repeats"] - figures["own_repeats"]
    if seconds is not None:
        figures["seconds"] = seconds
    return Result(name, setting, seed, picture, figures)


def made(sample, name, setting, seed, options, machine):
    """A picture of twice the sample's sides."""
    began = time.perf_counter()
    picture, output = simdtex.synthesize(
        sample,
        (2 * sample.shape[0], 2 * sample.shape[1]),
        channel_axis=None if sample.ndim == 2 else -1,
        rng=seed,
        device=machine,
        full_output=True,
        **options,
    )
    return measured(sample, name, setting, seed, picture, output.source, time.perf_counter() - began)


def rows_of(results, sample, columns):
    """The pictures of one sample for a sheet, a seed a row: label, picture, caption."""
    low, high = float(sample.min()), float(sample.max())
    for seed in dict.fromkeys(result.seed for result in results):
        yield results[0].sample, to_display(sample, (low, high)), ""
        for setting in columns:
            one = next(r for r in results if (r.setting, r.seed) == (setting, seed))
            short = {"cover": "coverage", "repeat": "repeats", "salt": "salt"}
            told = [f"{word} {one.figures[figure]:.2f}" for word, figure in short.items() if figure in one.figures]
            yield f"{setting}, seed {seed}", to_display(one.picture, (low, high)), "  ".join(told)


def sheet(path, cells, columns):
    """Write cells of label, picture and caption as a sheet, each picture at 1:1."""
    contact_sheet(
        [(label, picture) for label, picture, _ in cells],
        path,
        columns=columns,
        captions=[caption for *_, caption in cells],
        scale=1,
    )


def study(known, out, options, *, seeds=1, before=None, machine=None):
    """Make and measure a picture of every sample and seed, and write pictures, sheets and the table.

    `known` are the samples by name, `options` those of the method, `before` other options to compare with.
    """
    settings = ["before", "after"] if before is not None else ["after"]
    folders = {"before": out / "before", "after": out}
    for folder in (out / "sheets", *(folders[setting] for setting in settings)):
        folder.mkdir(parents=True, exist_ok=True)
    results, first_seeds = [], []
    for name, sample in known.items():
        own = []
        for seed in range(1, seeds + 1):
            for setting in settings:
                one = made(sample, name, setting, seed, before if setting == "before" else options, machine)
                write(folders[setting] / file_name(name, seed, sample.dtype.name), one.picture)
                own.append(one)
                told = ("plausibility", "coverage", "copying", "repeats", "salt", "contrast", "effective_share")
                shown = [f"{figure} {one.figures[figure]:.2f}" for figure in told if figure in one.figures]
                print(f"{name:16}{setting:8}seed {seed}:", ", ".join(shown), flush=True)
        cells = list(rows_of(own, sample, settings))
        sheet(out / "sheets" / f"{name}.png", cells, 1 + len(settings))
        first_seeds += cells[: 1 + len(settings)]
        results += own
    sheet(out / "sheets.png", first_seeds, 1 + len(settings))
    rows = [
        [*one[:3], *(f"{one.figures[figure]:.4f}" if figure in one.figures else "" for figure in FIGURES)]
        for one in results
    ]
    tables.write(out / "figures.csv", ["sample", "setting", "seed", *FIGURES], rows)
    for setting in settings:
        print(f"\n{setting:20}{'mean':>8}{'worst':>8}")
        for figure, (mean, worst, name, seed) in summary([r for r in results if r.setting == setting]).items():
            print(f"{figure:20}{mean:8.3f}{worst:8.3f}  {name}{f', seed {seed}' if seeds > 1 else ''}")
    return results


def main(options, own):
    """What `study.py --samples` does; `own` are the options that name the method."""
    import samples  # beside this file

    known = samples.folder(options.samples, options.only)
    if options.quick:
        known = {name: sample[: len(sample) // 2, : sample.shape[1] // 2] for name, sample in known.items()}
    machine = simdtex.open_machine(options.device)
    print(f"device: {machine.name}")
    study(
        known,
        Path(options.out),
        own | parsed(options.after),
        seeds=options.seeds or 1,
        before=None if options.before is None else own | parsed(options.before),
        machine=machine,
    )
