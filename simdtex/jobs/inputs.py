# SPDX-License-Identifier: BSD-3-Clause
"""The inputs of a job, each checked once, where it enters the Python API; and what all public functions share."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial, wraps
from inspect import Parameter, Signature, cleandoc
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from simdtex.checkpoint import Checkpointing
from simdtex.declared import Input, inputs, options_of, parameter_types
from simdtex.driver import Plan, check_shape, check_sides, drive, execute
from simdtex.inputs import as_known, check_mask, check_picture, check_samples, kept
from simdtex.io.image import check_sample
from simdtex.machine import Machine
from simdtex.maspar import observers
from simdtex.model.light import Relit
from simdtex.model.pictures import Pictures, check_alike
from simdtex.options import UNSET, entries, lists, option_parameters
from simdtex.run import Callback, Output, Progress

RAISES = """\
Raises
------
ValueError, TypeError
    An argument is invalid; the message names the remedy.
"""

OUTPUT = """\
output : simdtex.run.Output
    Only with ``full_output=True``.
"""

SHARED = ("rng", "device", "callback", "checkpoint", "options")
"""The inputs of a job that are not copied; a schedule among the options may tell its owner what it saw."""

ABSENT = SimpleNamespace(channel_axis=None, rng=None, full_output=False, checkpoint=None, mask=None, known_source=None)
"""The values of inputs that a job does not have."""


class Work(NamedTuple):
    """What the function of a job does, once its inputs are checked.

    ``run`` is a plan, or a function that drives several in turn; ``options`` are those of the method; ``axis`` is the
    channel axis of the returned picture; and ``finish(picture, output)`` returns what the function returns instead.
    ``light`` is for the statistics, and ``relit`` puts the light back into pictures of the run.
    """

    run: Plan | Callable[[Machine, int, Callback | None, Checkpointing], tuple[NDArray[Any], Output]]
    options: Any
    axis: int | None
    finish: Callable[[Any, Output], Any] | None = None
    light: dict[str, Any] | None = None
    relit: Relit | None = None

    def lit(
        self, machine: Machine, seed: int, callback: Callback | None, checkpointing: Checkpointing
    ) -> tuple[NDArray[Any], Output]:
        """Run the job; its pictures have the light of the picture that they continue."""
        run: Any = (
            self.run
            if callable(self.run)
            else partial(drive, self.run, others=observers(vars(self.options).get("array")))
        )
        relit, seen = self.relit, callback
        if relit and callback:

            def seen(progress: Progress) -> Any:
                return callback(replace(progress, image=lambda: relit(progress.image(), progress.level)))

        made, output = run(machine, seed, seen, checkpointing)
        if self.light:
            output.statistics["light"] = self.light
        if relit is None:
            return made, output
        stages = [replace(stage, image=relit(stage.image, stage.level)) for stage in output.stages]
        return relit(made), replace(output, stages=stages)


def public(job: str, without: str = "") -> Callable[[Callable[[Any], Work]], Any]:
    """Return a decorator that makes the public function of a job from a function that plans it.

    ``plan(call)`` gets all inputs of `simdtex.declared` by name, as their checks return them, and ``options``, those of
    the job's methods, but for the one `without`, as they were given. The public function has these parameters, and its
    docstring describes them; it opens the device and the checkpoint, runs the `Work` and returns the result. Its
    attribute ``prepare``, with the same parameters, returns the call and the work.
    """
    own = {name: one for name, one in inputs(job).items() if not one.command_only}
    methods = [*options_of(job).values()]
    written = Signature(
        [
            *(_parameter(name, own[name], type_) for name, type_ in parameter_types(job).items()),
            *[Parameter("options", Parameter.VAR_KEYWORD, annotation="Any")] * bool(methods),
        ]
    )

    def decorate(plan: Callable[[Any], Work]) -> Any:
        def prepare(*args: Any, **given: Any) -> tuple[Any, Work]:
            bound = written.bind(*args, **given)
            bound.apply_defaults()
            if bound.arguments.get("callback") is not None:
                bound.arguments |= {name: kept(one) for name, one in bound.arguments.items() if name not in SHARED}
            call = SimpleNamespace(**{**vars(ABSENT), **bound.arguments})
            for name, one in own.items():
                value = getattr(call, name)
                one.check(name, value)
                if one.checker and value is not None:
                    setattr(call, name, CHECKS[one.checker](name, value, call))
            return call, plan(call)

        @wraps(plan)
        def function(*args: Any, **given: Any) -> Any:
            call, work = prepare(*args, **given)

            def identity() -> dict[str, Any]:
                found = {name: IDENTITIES[one.identity](call, name) for name, one in own.items() if one.identity}
                return found | {"options": work.options}

            shared = (work.axis, call.rng, call.device, call.callback, bool(work.finish or call.full_output))
            made: Any = execute(plan.__name__, work.lit, identity, *shared, call.checkpoint)
            return work.finish(*made) if work.finish else made

        if plan.__doc__:
            function.__doc__ = _described(plan.__doc__, own, methods)
        vars(function).update(__signature__=written, prepare=prepare)
        return lists(option_parameters(job, *methods, without=without))(function)

    return decorate


def _described(doc: str, own: dict[str, Input], methods: list[Any]) -> str:
    """Return the docstring of a public function from one without the sections Parameters and Raises."""
    about, returns, *notes = re.split(r"^(?=\w+\n---)", cleandoc(doc), flags=re.MULTILINE)
    alone = {name for name, one in own.items() if one.method and len(methods) > 1}  # of one of several methods
    told = {name: replace(one, doc=f"``{one.method}``: {one.doc}") for name, one in own.items() if name in alone}
    tables = ", ".join(f"`{one.__module__.removesuffix('.options')}.{one.__qualname__}`" for one in methods)
    options = f"**options\n    Those of the method, see {tables}.\n" if methods else ""
    output = OUTPUT if "full_output" in own and "\noutput :" not in returns else ""
    return about + "\n".join(
        [f"{entries(own | told)}\n{options}", f"{returns.rstrip()}\n{output}", RAISES, "".join(notes)]
    )


def _parameter(name: str, one: Input, type_: str) -> Parameter:
    kind = Parameter.POSITIONAL_OR_KEYWORD if one.positional else Parameter.KEYWORD_ONLY
    return Parameter(name, kind, default=Parameter.empty if one.default is UNSET else one.default, annotation=type_)


# The arrays of a job


# The checks and identities that declarations name


def _texture(name: str, value: Any, call: Any) -> Pictures:
    """Return samples that are like the picture and not from it."""
    found = check_samples(value, call.channel_axis)
    check_alike("the sample", found.pixels[0], "the picture", call.image[0])
    return found


CHECKS: dict[str, Callable[[str, Any, Any], Any]] = {
    "samples": lambda name, value, call: check_samples(value, call.channel_axis, call.mask),
    "texture": _texture,
    "picture": lambda name, value, call: check_sample(value, call.channel_axis),
    "picture with gaps": lambda name, value, call: check_picture(value, call.channel_axis),
    "hole": lambda name, value, call: check_mask(value, call.image[0].shape[:2]),
    "rows and columns": lambda name, value, call: check_shape(value),
    "tile": lambda name, value, call: check_shape(value if np.ndim(value) else (value, value), 16),
    "block": lambda name, value, call: check_sides(value, ("depth", "rows", "columns")),
    "data": lambda name, value, call: as_known(value, name, call.sample if name == "known" else None),
}
"""The checks that declarations name; see `simdtex.declared.Input`."""

IDENTITIES: dict[bool | str, Callable[[Any, str], Any]] = {
    True: getattr,
    "arrays": lambda call, name: call.inputs.identity(name),
}
"""What identifies a run, of inputs that the plan has placed in ``call.inputs``."""
