# SPDX-License-Identifier: BSD-3-Clause
"""The tables of inputs: what the public functions and commands take beside the options of a method.

An input is declared once, by `given`, as a field of the dataclass of its job. The declaration gives the parameter of
the public function, its entry in the docstring and its check (`simdtex.driver.public`); what of it identifies a run in
a checkpoint; the option of the command and the reader of its files (`simdtex.cli.options.input_options`,
`simdtex.cli.inputs.read_inputs`); the painter of the live page (`simdtex.live.job`); and the types that editors show
(``docs/stubs.py``). Checks, readers and painters are named here, and found when they are needed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from simdtex.options import UNSET, Choice, Option, Switch, Whole, table

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence

    import numpy as np

    from simdtex.checkpoint import Checkpoint
    from simdtex.io.hard_data import HardData
    from simdtex.machine import Machine
    from simdtex.run import Callback

    ArrayLike = Any  # for the planners, whose call has what a check made of the array


@dataclass(frozen=True)
class Data:
    """Arrays, tables and other values that a check of the job examines; ``says`` is the type, as in a docstring."""

    says: str

    def check(self, name: str, value: Any) -> None:
        """Do nothing."""

    def __str__(self) -> str:
        return self.says


@dataclass(frozen=True)
class Input(Option):
    """The declaration of an input: the fields of an `Option`, whose ``help`` is that of the command line, and others.

    Parameters
    ----------
    doc : str
        The entry in the docstring. By default that of an option.
    positional : bool
        Whether the function takes it without its name; with the default `UNSET` it is required.
    command_only : bool
        Whether only the command has it, which says by it how files are read.
    checker : str
        A key of `simdtex.jobs.inputs.CHECKS`: ``check(name, value, call)`` returns the value, unless it is None, as the
        job takes it. The ``call`` has all inputs by name, the earlier ones as their checks returned them.
    identity : bool or str
        Whether the value identifies a run in a checkpoint, as it is in the call once the job is planned; or a key of
        `simdtex.jobs.inputs.IDENTITIES`: ``identity(call, name)`` returns what does.
    flags : str
        The names on the command line, separated by spaces: by default that of the field. Empty `help`: no option.
    takes : str
        The type of the option, in `simdtex.cli.options.TYPES`. By default that of the values.
    metavar : str, optional
    multiple : bool
        Whether the option may be repeated.
    method : str
        The method that has it, if others of the command have it not.
    reader : str
        ``reader(given, files)`` of `simdtex.cli.inputs` returns the value from what the option was given.
    painter : str
        The method of `simdtex.live.job.Job` that adds the value which is painted on the page, or follows from it.
    """

    doc: str = ""
    positional: bool = False
    command_only: bool = False
    checker: str = ""
    identity: bool | str = True
    flags: str = ""
    takes: str = ""
    metavar: str | None = None
    multiple: bool = False
    method: str = ""
    reader: str = ""
    painter: str = ""

    def named(self, name: str) -> list[str]:
        """Return the names of the option, as `click.option` takes them, of the input of this name."""
        return self.flags.split() or [f"--{name.replace('_', '-')}"]

    def flag(self, name: str) -> str:
        """Return the long name of the option."""
        return next(flag for flag in self.named(name) if flag.startswith("--"))

    def parameter(self, name: str) -> str:
        """Return the name of the option among the parameters of a command."""
        return self.named(name)[-1].removeprefix("--").replace("-", "_")

    def described(self) -> str:
        """Return the entry in the docstring."""
        return self.doc or super().described()


def given(kind: Any, help: str = "", doc: str = "", default: Any = None, **more: Any) -> Any:
    """Return a field that declares an input; the arguments are those of `Input`."""
    return field(default=default, metadata={"option": Input(default, kind, help, doc=doc, **more)})


def needed(kind: Any, help: str = "", doc: str = "", **more: Any) -> Any:
    """Return a field that declares a required input, which needs no name."""
    return given(kind, help, doc, UNSET, positional=True, **more)


DATA, OUTPUTS = "Data and guides", "Further outputs"
RUNS, DEVICE = "Large outputs and interrupted runs", "Device and messages"
"""Groups of options."""

PICTURE = "(rows, cols) or, with `channel_axis`, (rows, cols, channels) array"
PATHS: dict[str, Any] = {"takes": "file", "group": DATA}
TABLES: dict[str, Any] = {"group": DATA, "method": "mrf"}
READING: dict[str, Any] = {**TABLES, "command_only": True}
NUMBERED: dict[str, Any] = {"metavar": "SAMPLE", "reader": "read_number"}


declared: Any = partial(dataclass, init=False, repr=False, eq=False)  # of tables there are no instances


class Planned:
    """What the call of a planner has beside the inputs: ``options`` as given, and what checks and planners add."""

    options: dict[str, Any]
    inputs: Any
    given: Any


@declared
class Watched(Planned):
    """The inputs that all functions share."""

    device: str | Machine | None = given(
        Data("str or Machine"),
        "Run on this device: a part of its name or platform, its index in `simdtex devices`, or `reference`",
        'Part of a device\'s name or platform, an index of ``simdtex devices``, or ``"reference"``. None takes '
        "SIMDTEX_DEVICE, else a GPU, else a CPU.",
        none="SIMDTEX_DEVICE, else a GPU, else a CPU",
        metavar="TEXT",
        group=DEVICE,
        identity=False,
    )
    callback: Callback | None = given(
        Data("callable"),
        doc="Called several times a second with a `simdtex.run.Progress`. An error that it raises ends the run.",
        identity=False,
    )


@declared
class Seeded(Watched):
    """The inputs of functions that draw random numbers."""

    channel_axis: int | None = given(
        Data("int"), doc="The axis of pictures that holds channels; None for grey pictures.", identity=False
    )
    rng: int | np.random.Generator | None = given(
        Data("int or numpy.random.Generator"),
        "Use this seed: the same seed gives the same output on every device",
        "The seed. The same seed gives the same bytes on every device. None draws a random seed.",
        none="a random one, printed",
        flags="--seed",
        takes="integer",
        identity=False,
    )
    checkpoint: str | os.PathLike[str] | Checkpoint | None = given(
        Data("path or simdtex.Checkpoint"),
        "Keep the state of the run in this file; `simdtex resume FILE` continues it",
        "A file that keeps the state of the run. If the file has the state of an interrupted run of the same call, "
        "the run continues from it, to the same bytes. The file is removed when the function returns.",
        takes="new file",
        metavar="FILE",
        group=RUNS,
        identity=False,
    )


@declared
class Common(Seeded):
    """The inputs of functions that return the result of a run."""

    full_output: bool = given(Data("bool"), doc="Return a `simdtex.run.Output` too.", identity=False, default=False)


@declared
class Sampled:
    """The inputs about the sample and what is known of the output."""

    mask: ArrayLike | Sequence[ArrayLike] | None = given(
        Data("(rows, cols) bool array, or a list of such"),
        "Take pixels only from the white parts of this mask, of the sample's size; give one for each sample",
        "True for pixels of the sample that may be taken; all other pixels are still neighbours.",
        identity="arrays",
        flags="--sample-mask",
        multiple=True,
        method="mrf",
        reader="read_masks",
        **PATHS,
    )
    known: ArrayLike | HardData | str | os.PathLike[str] | None = given(
        Data("array of `shape` (and the channel axis), HardData, pandas.DataFrame or path"),
        "Keep these conditioning data: a table of x, y and values (.csv, .tsv, .txt, .dat), a point set of Geo-EAS, or "
        "a picture or a grid whose unknown pixels are transparent or NaN",
        "Conditioning data, values of the output that do not change by a bit: a masked array, floats with NaN "
        "for unknown values, a table of x, y and value (`simdtex.read_hard_data`), its file or a DataFrame. Some "
        "variables (channels) of a pixel may be known and others not.",
        checker="data",
        identity="arrays",
        method="mrf",
        reader="read_known",
        **PATHS,
    )
    columns: Any = given(
        Data(""),
        "Take these columns of the table of --known as x, y, z and value, by name or, without a header, by number; the "
        "variable of a grid is value",
        none="columns with names of axes, as X, Northing, lon; all others are values",
        takes="columns",
        metavar="x=NAME,...",
        **READING,
    )
    categories: Any = given(
        Data(""),
        "Take these numbers for the texts in the table of --known, as sand=1,shale=0",
        takes="categories",
        metavar="NAME=NUMBER,...",
        **READING,
    )
    missing: Any = given(
        Data(""),
        "Take this number in tables and grids as unknown, too; may be repeated",
        none="codes such as -999, outside of the values of the sample",
        takes="number",
        metavar="VALUE",
        multiple=True,
        **READING,
    )


@declared
class Guided:
    """A guide."""

    guide: tuple[Any, Any] | None = given(
        Data("(array, array)"),
        "Take each pixel from places where SAMPLE-GUIDE is like OUTPUT-GUIDE at the pixel: two pictures of labels or "
        "numbers. Give GUIDE0,GUIDE1=OUTPUT-GUIDE for several samples",
        "Two pictures of labels or numbers, (rows, cols) or (rows, cols, G), of the sample's size and of the "
        "output's. A pixel comes from places where the first is like the second at the pixel; NaN in the second means "
        "no guide. With several samples, the first is a list of pictures.",
        identity="arrays",
        takes="pair",
        metavar="SAMPLE-GUIDE=OUTPUT-GUIDE",
        reader="read_guides",
        painter="_guide",
        **TABLES,
    )


@declared
class Lit:
    """How uneven light is treated."""

    light: Literal["keep", "even"] = given(
        Choice(("keep", "even")),
        "Keep the sample's light, or take pixels from the sample in even light",
        "Whether the light of the sample is kept, or made even: a smooth trend of each channel is removed, a quadratic "
        "of row and column. A part that is made in a picture gets the picture's light again. Where a result wraps "
        "around, it has even light.",
        default="keep",
        group="Appearance",
    )


@declared
class Synth(Common, Lit, Guided, Sampled):
    """The inputs of `simdtex.synthesize`."""

    sample: ArrayLike = needed(
        Data(f"{PICTURE}; or a list of such"),
        doc="The texture; any real type, any size that holds a neighbourhood. With ``mrf`` unknown pixels may be NaN "
        "or masked, and there may be several samples of one type, of any sizes.",
        checker="samples",
        identity="arrays",
    )
    shape: tuple[int, int] = needed(
        Data("(int, int)"),
        doc="Rows and columns of the output, each 1 or more; smaller or larger than the sample.",
        checker="rows and columns",
        flags="--size",
        painter="_size",
    )
    method: Literal["mrf", "multires", "pyramid"] = given(
        Choice(("mrf", "multires", "pyramid")),
        "Use Paget and Longstaff's method (mrf), De Bonet's (multires), or Heeger and Bergen's (pyramid)",
        "Paget and Longstaff's nonparametric multiscale Markov random field (1998), Algorithm 1; De Bonet's "
        "multiresolution sampling (1997); or Heeger and Bergen's pyramid matching (1995).",
        default="mrf",
        painter="_method",
    )
    known_source: ArrayLike | None = given(
        Data("(rows, cols, 2) int array"),
        doc="The (row, column) in the sample of known pixels, with several samples (row, column, sample); -1 "
        "for pixels from elsewhere. Known pixels with a position suggest candidates that continue it.",
        identity="arrays",
        method="mrf",
    )


@declared
class Solid(Common):
    """The inputs of `simdtex.synthesize_solid`."""

    sample: ArrayLike = needed(
        Data(PICTURE),
        doc="The texture. It should be isotropic, since every slice of the block looks like it.",
        checker="picture",
    )
    shape: tuple[int, int, int] = needed(
        Data("(int, int, int)"),
        doc="Depth, rows and columns of the block, each 1 or more. It repeats without a seam in every direction.",
        checker="block",
    )


@declared
class Fill(Common):
    """The inputs of `simdtex.fill`."""

    image: ArrayLike = needed(Data(PICTURE), doc="The picture; any real type.", checker="picture with gaps")
    mask: ArrayLike | None = given(
        Data("(rows, cols) bool array"),
        "Fill the white parts of this mask, of the same size",
        "True in the holes. None: the pixels of `image` that are NaN or, in a masked array, masked.",
        none="the parts of PICTURE that are not fully opaque, or NaN; the output then has no alpha",
        positional=True,
        checker="hole",
        takes="file",
        painter="_hole",
    )
    invert: Any = given(Switch(), "Fill all but the white parts of --mask", command_only=True)
    grow: int = given(Whole(0), "Make the holes wider by this many pixels", default=0)
    feather: int = given(
        Whole(0),
        "Blend the filled pixels with the picture up to this many pixels around the holes",
        default=0,
        more="Values without a mean (categories, few different pixels) change half-way instead.",
    )
    light: Literal["keep", "even"] | None = given(
        Choice(("keep", "even")),
        "Take pixels in the light of their place, or in even light, which then gets that of the hole's place",
        "Whether pixels are taken as they are (keep), or without a smooth trend of each channel, a quadratic of row "
        "and column, which is then added at their new place (even).",
        none="even if the picture is smooth for the most part, such as a sky; keep with a reach or finish 0",
        group="Appearance",
    )
    sample: ArrayLike | None = given(
        Data("array of the image's type"),
        "Fill with this texture, not with that around the hole; may be repeated",
        "The texture to fill with, or a list of several. None: the rest of the picture.",
        checker="texture",
        flags="--sample samples",
        takes="file",
        multiple=True,
    )
    reach: int | None = given(
        Whole(1),
        "Fill a hole from the surroundings up to this far away, in pixels",
        more="It has no effect with `sample`.",
        none="128, or twice the hole's longer side",
    )


@declared
class Extend(Common, Lit):
    """The inputs of `simdtex.extend`."""

    image: ArrayLike = needed(
        Data(PICTURE),
        doc="The picture, which is also the sample; any real type.",
        checker="picture",
    )
    left: int = given(Whole(0), "Add this many pixels at the left", default=0)
    right: int = given(Whole(0), "Add this many pixels at the right", default=0)
    top: int = given(Whole(0), "Add this many pixels at the top", default=0)
    bottom: int = given(Whole(0), "Add this many pixels at the bottom", default=0)
    seamless: bool | Literal["x", "y"] = given(
        Data('bool or {"x", "y"}'),
        "Make the output tile: left and right (x), top and bottom (y), or both, like `simdtex tile`",
        "Whether the result wraps around: in both directions, or only left and right (x) or top and bottom (y). If no "
        "pixels are added in such a direction, a band along its edges is replaced.",
        default=False,
        none="both, if no direction is given",
        takes="direction",
        metavar="[x|y|both]",
        painter="_seam",
    )
    band: int | None = given(
        Whole(1),
        "Replace this many pixels along each edge that no pixels are added to, so that the output tiles",
        none="the size of the picture's parts, such as stones or bricks: between an eighth and a fifth of the shorter "
        "side",
    )


@declared
class Classify(Common):
    """The inputs of `simdtex.classify`."""

    image: ArrayLike = needed(
        Data("(rows, cols) or, with `channel_axis`, (rows, cols, bands) array"),
        doc="The picture; any real type, up to 14 bands. Pixels that are NaN or masked get the label 0.",
        checker="picture with gaps",
    )
    textures: Mapping[str, ArrayLike | Sequence[ArrayLike]] | ArrayLike = needed(
        Data("mapping of str to array or list of arrays, or (rows, cols) array of integers"),
        "Learn the class NAME from this sample; give one for each class, NAME=FILE0,FILE1 for several samples. "
        "Transparent pixels are not used",
        "The samples of each class, of the picture's type, by the name of the class. Or training regions of the "
        "picture itself: 1, 2, ... where a pixel is of a class, and 0 elsewhere.",
        flags="--texture textures",
        takes="named",
        metavar="NAME=FILE",
        multiple=True,
        group=DATA,
        reader="read_classes",
        painter="_classes",
    )
    strokes: Any = given(
        Data(""),
        "Learn the classes from strokes with the values 1, 2... in this picture, of the size of PICTURE",
        command_only=True,
        **PATHS,
    )
    masks: Mapping[str, Any] | None = given(
        Data("mapping of str to (rows, cols) bool array or list of arrays"),
        doc="True for pixels of the samples that may be used; a class without masks is used whole.",
        identity=False,
    )
    validation: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None = given(
        Data("mapping of str to array or list of arrays"),
        "Measure with this picture of a class how much the class varies",
        "Further pictures of a class, from which no exemplars are drawn. They measure how much the class varies, which "
        "decides when a pixel is unknown.",
        identity=False,
        takes="named",
        metavar="NAME=FILE",
        multiple=True,
        group=DATA,
        reader="read_classes",
    )


@declared
class Mix(Common):
    """The inputs of `simdtex.mix`."""

    samples: Sequence[ArrayLike] = needed(
        Data("sequence of (rows, cols) or, with `channel_axis`, three-dimensional arrays"),
        doc="One or more, of one type and any sizes. With `channel_axis`, grey ones may have two axes.",
    )
    shape: tuple[int, int] = needed(
        Data("(int, int)"), doc="Rows and columns of the output.", checker="rows and columns"
    )
    palette: int | None = given(
        Data("int"),
        "Take the colours of this sample",
        "The sample, by number from 0, whose decorrelating transform and pixel histogram the output has.",
        none="those of the pattern",
        **NUMBERED,
    )
    pattern: int | None = given(
        Data("int"),
        "Take the pattern of this sample",
        "The sample whose subband histograms are matched.",
        none="the average of all",
        **NUMBERED,
    )
    average: Sequence[float] | None = given(
        Data("sequence of float"),
        "Average the patterns with these weights, one for each sample",
        "A weight for every sample, 0 or more. By default all weights are equal.",
        takes="numbers",
        metavar="W,W,...",
    )
    low: int | None = given(
        Data("int"),
        "Take the low frequencies of this sample, with --high",
        "The sample of the low frequencies.",
        **NUMBERED,
    )
    high: int | None = given(
        Data("int"),
        "Take the high frequencies of this sample, with --low",
        "The sample of the high frequencies.",
        **NUMBERED,
    )
    split: int | None = given(
        Whole(0),
        doc="Number of levels, from the finest on, that are high frequencies; by default half of them.",
    )


SHARED = table(Common)
"""The inputs that most functions share."""

TABLES_OF: dict[str, Any] = {one.__name__.lower(): one for one in (Synth, Solid, Fill, Extend, Classify, Mix)}
"""The tables by job, which has the name of its command."""

MRF = {"mrf": "methods.mrf.options"}

METHODS: dict[str, dict[str, str]] = {
    "synth": {**MRF, "multires": "methods.multires.options", "pyramid": "methods.pyramid.options"},
    "mix": {"pyramid": "methods.pyramid.options"},
    "solid": {"pyramid.solid": "methods.pyramid.solid"},
    "classify": {"classifier": "jobs.classification.options"},
}
"""The methods of a job, and the modules of their options; any other has ``mrf``."""


def options_of(job: str) -> dict[str, Any]:
    """Return the classes of options of a job's methods, by method."""
    return {one: import_module(f"simdtex.{home}").Options for one, home in METHODS.get(job, MRF).items()}


def inputs(job: str) -> dict[str, Input]:
    """Return the inputs of a job by name: those that the function takes without a name first, the shared ones last."""
    found: dict[str, Any] = {**table(TABLES_OF[job])}
    order = sorted(found, key=lambda name: (not found[name].positional, name in SHARED))
    return {name: found[name] for name in order}


def parameter_types(job: str) -> dict[str, str]:
    """Return the types of the parameters of a job's function, in the order of `inputs`."""
    types = {one.name: str(one.type) for one in fields(TABLES_OF[job])}
    return {name: types[name] for name, one in inputs(job).items() if not one.command_only}
