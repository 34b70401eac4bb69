# SPDX-License-Identifier: BSD-3-Clause
"""Command lines and files drawn from a seed: valid ones, unusual ones and nonsense."""

import re
from dataclasses import dataclass, field
from functools import cache

import click

from fuzz import corpus
from simdtex.cli import load
from simdtex.methods import classifier, mrf, multires, pyramid
from simdtex.options import table

RUNS = {
    "synth": "synth L.png -o out.png --size 14x13 --order 1 --levels 2 --xi -6 --source-map where.npz",
    "multires": "synth RGB.png -o out.png --size 14x13 --method multires",
    "pyramid": "synth RGB.png -o out.png --size 14x13 --method pyramid --iterations 2",
    "fill": "fill L.png -o out.png --mask hole.png --order 1 --levels 1",
    "extend": "extend L.png -o out.png --right 3 --order 1",
    "mix": "mix L.png L.tif -o out.png --size 14x13 --iterations 2",
    "solid": "solid L.png -o out.npz --size 6 --iterations 2",
    "simulate": "simulate L.png -o out.npz --size 14x13 -n 3 --order 1 --jobs 1",
    "classify": "classify L.png -o out.png --texture a=L.png --texture b=L.tif",
}
"""A valid run of every method and of every function that keeps a checkpoint."""

COMMANDS = {
    **{"synth": 48, "fill": 12, "tile": 5, "extend": 6, "maspar": 2, "simulate": 8, "estimate": 3, "classify": 4},
    **{"solid": 8, "mix": 8, "resume": 0.5, "schedules": 0.1, "devices": 0.1, "demo": 0.05, "bench": 0.05},
    **{"": 0.2, "nothing": 0.1},
}
"""Weight of each command; reports and their plots take long, so commands that always write one are rare."""

WHOLE = (0, -1, 2**31 - 1, 2**31, 2**32, 2**63, 2**64, 10**30, -(2**31), -(2**63) - 1, "", "nan", "1.5", "x", "0x10")
REAL = (0, -1, -0.0, "nan", "inf", "-inf", 1e308, -1e308, 1e-320, 5e-324, 2**31, 2**63, "1e999", "", "x", "1,5", 1e-30)
TEXT = ("", " ", "x", "-", "--", "nan", "\u00d7", "\U0001f4a9", "a" * 5000, "\n", "%s", "{0}", "../x", "\udc80", "0")
SIZES = (
    *("0x0", "", "x", "5", "1x1", "2x9", "100000x100000", "46341x46341", "1e3x4", "-4x4", "4x", "999999999999x1"),
    *("3x3x3", "2x", "150%", "0.01x", "1e9%"),
)

MODEST = {
    "order": (1, 2, 4),
    **dict.fromkeys(("levels", "orientations", "iterations", "free_sweeps", "split"), (1, 2, 4)),
    **dict.fromkeys(("chance", "coarse_chance", "overview"), (0, 1, 4, 64)),
    **dict.fromkeys(("left", "right", "top", "bottom", "band", "reach"), (0, 1, 3)),
    **dict.fromkeys(("burn_in", "number", "jobs", "first"), (0, 1, 2)),
    **{"seeds": (2, 3), "sweeps": (2, 3), "seed": (0, 1, 2**63), "exemplars": (16, 40), "tiles": (8, 12, 16)},
    **{"coupling": (0.5, 2), "xi": (-1, -0.5, -5)},
}
"""Values that make sense on pictures of ten pixels a side; other numbers are small ones."""

METHODS = {
    **{"mrf": mrf.Options, "multires": multires.Options, "pyramid": pyramid.Options},
    "classifier": classifier.Options,
}

CHOICES = {
    "array": ("4x4", "maspar-mp1-1k", "2x3:hierarchical"),
    "schedule": ("coloring", "luby", "checkerboard", "synchronous", "random-subset:0.5", "raster", "block:2x2"),
    "names": ("coloring", "luby,raster", "block:2x2", "random-scan"),
    "solids": ("turns", "average"),
    "slices": ("together", "each"),
    "blend": ("histograms", "quantiles"),
    "pixels": ("palette", "pattern"),
    "preset": ("default", "paper"),
    "alpha": ("0", "0.3", "auto"),
    "start": ("up", "random"),
}
"""Valid words of options that are not a `simdtex.options.Choice` of a method."""

LONG = ("free_sweeps", "iterations", "sweeps", "burn_in", "number", "seeds")
"""Counts of steps done one after another: a very large number is valid and would take for ever, so no try gives one."""

OTHERS = ("workers",)
"""Options that start processes or ask the network."""

DEEP = {"synth": 0.6, "schedules": 0.7, "demo": 0.2, "bench": 0.0}
"""Share of tries with options that make sense alone."""

OUTPUTS = {
    "solid": ("out.npz", "out.npy", "out.nrrd", "out.tif", "out", "out.png", "out.xyz"),
    **dict.fromkeys(
        ("simulate", "estimate"), ("out.zarr", "out.nc", "out.npz", "out.gslib", "out.sgems", "out.png", "out")
    ),
    **dict.fromkeys(("schedules", "demo"), ("out",)),
    "": ("out.npy", "out.tif", "out.png", "out.webp", "out.jpg", "out.bmp", "out.xyz"),
}

NEEDED = {
    "maspar": (0.9, "--array 4x4|8x8|3x5|16x16"),
    "schedules": (1, "--seeds 1 --schedule coloring --order 1"),
    "bench": (1, "--json no/such/file.json"),  # else it measures for minutes
}
"""Options that a command is given in a share of the tries, so that it takes no longer than others."""

METHOD_OF = {"solid": "pyramid", "mix": "pyramid", "classify": "classifier"}
"""The method of commands that have one of their own."""


@dataclass
class Try:
    """A command line and its files.

    ``args`` of ``simdtex``; ``files`` name -> bytes, in the folder it runs in; ``kind`` what is unusual about it;
    ``old`` names of files that are there and may be replaced; ``interrupt`` seconds after which it gets a Ctrl-C.
    """

    args: list[str]
    files: dict[str, bytes] = field(default_factory=dict)
    kind: str = "plain"
    old: list[str] = field(default_factory=list)
    interrupt: float | None = None


@cache
def everything():
    """The files of the corpus, for splices."""
    return [data for files in corpus.build().values() for data in files.values() if len(data) < 10**5]


class Maker:
    """Makes command lines and their files."""

    def __init__(self, rng):
        self.rng, self.files, self.kinds = rng, {}, set()

    def make(self):
        rng = self.rng
        name = rng.choices(list(COMMANDS), list(COMMANDS.values()))[0]
        if name in ("", "nothing"):
            return Try([word for word in (name, *rng.choices(TEXT, k=rng.randrange(3))) if word], kind="no command")
        args = [name, *self.line(load(name), name)]
        if rng.random() < 0.03:
            args.insert(rng.randrange(len(args) + 1), rng.choice((*TEXT, "--help", "-o", "--nothing", "-q", "--size")))
            self.kinds.add("odd words")
        interrupt = rng.uniform(0.0005, 0.08) if rng.random() < 0.02 else None
        if interrupt:
            self.kinds.add("interrupted")
        old = []
        if not interrupt and rng.random() < 0.1:
            old = [word for word in args if word in ("out.png", "out.npy", "out.npz", "out.tif")]
            self.files |= dict.fromkeys(old, b"old")
        return Try(args, self.files, ", ".join(sorted(self.kinds)) or "plain", old, interrupt)

    # -- words of a command ---------------------------------------------------------------------------------------

    def line(self, command, name):
        """Arguments and options of a command."""
        rng, words = self.rng, []
        deep = rng.random() < DEEP.get(name, 0.5)
        method = rng.choices(("mrf", "multires", "pyramid"), (3, 4, 3))[0] if name == "synth" else None
        fitting = rng.random() < 0.9  # only options of the method
        size = self.size(name, rng.random() < (0.97 if deep else 0.85))
        options = []
        for parameter in command.params:
            if isinstance(parameter, click.Argument):
                few = (3, 3, 1) if name == "mix" else (8, 1, 1)
                count = rng.choices((1, 2, 3), few)[0] if parameter.nargs < 0 else 1
                role = "grid" if name in ("simulate", "estimate") and rng.random() < 0.3 else "picture"
                words += [self.file(role) for _ in range(count)]
            else:
                options.append(parameter)
        samples = words[:]
        words += ["-o", self.output(name)] if name not in ("devices", "bench", "resume") else []
        if any("--size" in option.opts for option in options) and (name != "extend" or rng.random() < 0.3):
            words += ["--size", size]
        if method and rng.random() < 0.03:
            method = "mrf"  # as without the option
        else:
            words += ["--method", method] if method else []
        words += ["-q"] if rng.random() < 0.8 else []
        if name == "fill" and rng.random() < 0.9:
            words += ["--mask", self.file("mask")]
        if name == "extend" and "--size" not in words:
            words += [rng.choice(("--left", "--right", "--top", "--bottom", "--band")), rng.choice("123")]
        share, needed = NEEDED.get(name, (1, ""))
        if share == 1 or rng.random() < share:
            words += [rng.choice(word.split("|")) if "|" in word else word for word in needed.split()]
        if name in ("simulate", "synth", "fill", "extend", "tile", "maspar") and method in (None, "mrf"):
            words += ["--order", rng.choice("1124")]
        if name == "classify" and rng.random() < 0.9:
            words += ["--texture", f"a={samples[0] if rng.random() < 0.5 else self.file('picture')}"]
        words += ["--number", rng.choice("1112")] if name == "simulate" else []
        if name in ("solid", "mix") or method == "pyramid":
            words += ["--iterations", "1"]
        taken = {"-o", "--output", "--size", "--method", "-q", "--quiet", "--help", "--mask", "--device"}
        usual = [option for option in options if not taken & set(option.opts) and option.name not in OTHERS]
        if method and fitting:
            usual = [option for option in usual if _of_method(option, method)]
        self.method = METHOD_OF.get(name, method or "mrf")
        if fitting:
            useless = ("profile", *(("source_map", "also") if self.method == "pyramid" else ()))
            usual = [option for option in usual if option.name not in useless]
        for option in rng.sample(usual, min(len(usual), rng.choice((0, 0, 1, 1, 2, 3, 5)))):
            words += self.option(option, samples, name, deep and rng.random() < 0.9)
        if "--tiles" in words and rng.random() < 0.9:
            words[words.index("-o") + 1] = "out.zarr"
        if rng.random() < 0.02 and name != "devices":
            words += ["--device", rng.choice(("reference", "0", "7", "nothing", "", "numpy", "-1"))]
            self.kinds.add("device")
        return words

    def option(self, option, samples, command, modest):
        rng, name, word = self.rng, option.name or "", option.opts[-1]
        if option.is_flag:
            return [rng.choice([*option.opts, *option.secondary_opts])]
        kind = option.type.name
        if isinstance(option.type, click.Path):
            return [word, self.path(name, command)]
        if not modest:
            self.kinds.add("options")
        if kind == "integer":
            values = MODEST.get(name, (0, 1, 3)) if modest else WHOLE
            if not modest and name in LONG:
                values = tuple(v for v in WHOLE if not (isinstance(v, int) and 10 < v < 2**31))
            return [word, str(rng.choice(values))]
        if kind == "float":
            values = MODEST.get(name, (0, 0.25, 1, 2)) if modest else REAL
            if not modest and name == "xi":
                values = tuple(v for v in REAL if not isinstance(v, float) or v >= 0 or v < -1)
            return [word, str(rng.choice(values))]
        return [word, self.text(option, name, samples, modest)]

    def text(self, option, name, samples, modest):
        rng, metavar = self.rng, option.metavar or ""
        if not modest and rng.random() < 0.7:
            return rng.choice(TEXT)
        if metavar == "NAME=FILE":
            return f"{rng.choice('abc')}={rng.choice((samples[0], self.file('picture')))}"
        if "=" in metavar:
            guide = self.file("picture" if name == "also" else "mask")
            out = self.file("mask") if name == "guide" else rng.choice(("map.png", "map.npy", "map.tif"))
            return ",".join([guide] * rng.choice((1, len(samples)))) + "=" + out
        if metavar.startswith("SAMPLE") and samples:
            return rng.choice((samples[0], "1", "2", "0"))
        if "," in metavar or name in ("alphas", "betas"):
            return ",".join(
                str(rng.choice((0, 1, 2, 0.5) if modest else REAL)) for _ in range(rng.choice((1, 1, 2, 3)))
            )
        if ("x" in metavar.lower() and "HEIGHT" in metavar) or "COLS" in metavar:
            return rng.choice(("4x4", "2x8", *SIZES))
        declared = table(METHODS[self.method]).get(name)
        valid = getattr(declared and declared.kind, "valid", None) or CHOICES.get(name)
        return rng.choice(valid or re.findall(r"[a-z][a-z-]+", option.help or "") or TEXT)

    def size(self, name, modest):
        rng = self.rng
        if not modest:
            self.kinds.add("options")
            return rng.choice(SIZES)
        if name == "demo":
            return rng.choice(SIZES)
        if name == "solid":
            return rng.choice(("4", "5x6x7", "1x8x8"))
        low = {"extend": 6, "schedules": 9}.get(name, 1 if rng.random() < 0.2 else 5)
        return f"{rng.randint(low, max(12, low))}x{rng.randint(low, max(12, low))}"

    # -- files ----------------------------------------------------------------------------------------------------

    def path(self, name, command):
        """A file or a folder for an option that takes one."""
        rng = self.rng
        if name in ("stages", "report", "checkpoint"):
            return rng.choice(("pages", "a/b", "out.png") if rng.random() < 0.3 else ("pages",))
        if name in ("source_map", "picture", "json", "plot", "confidence"):
            return rng.choice(("map.npz", "map.npy", "map.png", "out.png", "view.png"))
        role = {"sample_mask": "mask", "strokes": "mask", "truth": "mask", "known": "table"}.get(name, "picture")
        if name == "start" and command == "solid":
            role = "volume"
        if name == "known" and rng.random() < 0.4:
            role = "picture"
        return self.file(role)

    def output(self, name):
        rng = self.rng
        names = OUTPUTS.get(name, OUTPUTS[""])
        if rng.random() < 0.85:
            return names[0] if rng.random() < 0.5 else rng.choice(names)
        if self.files and rng.random() < 0.2:
            self.kinds.add("output is input")
            return rng.choice(list(self.files))
        return rng.choice((*names, "no/such/out.png", ".", "", "out.png/", "a" * 300 + ".png", "OUT.PNG"))

    def file(self, role):
        """Make a file of a role, usually a valid one, and return its name."""
        rng = self.rng
        files = corpus.build()[role]
        if role == "picture" and rng.random() < 0.6:
            name = rng.choice(("L.png", "RGB.png", "L.tif", "uint8.npy", "labels.npy"))
        else:
            name = rng.choice(list(files))
        data = files[name]
        chance = rng.random()
        if chance < 0.2:
            data = corpus.mutated(rng, data, everything())
            self.kinds.add("broken files")
        elif chance < 0.22:
            data = rng.choice(everything())
            self.kinds.add("wrong files")
        elif chance < 0.235:
            self.kinds.add("no file")
            return rng.choice(("none.png", "", ".", "/dev/null", "a/none.npy", "none.npz", "none.csv", "none.nrrd"))
        while name in self.files and self.files[name] != data:
            name = f"{rng.randrange(100)}-{name}"
        self.files[name] = data
        return name


def _of_method(option, method):
    """Return whether an option of ``synth`` is one of a method, as its help says."""
    group = getattr(option, "group", "")
    if group.startswith("Method "):
        return group.startswith(f"Method {method}:")
    head = (option.help or "").partition(":")[0] if ":" in (option.help or "") else ""
    named = [
        one for one in ("mrf", "multires", "pyramid") if one in head.split(", ") or f"{one}:" in (option.help or "")
    ]
    return not named or method in named
