# SPDX-License-Identifier: BSD-3-Clause
"""Command lines and files drawn at random: valid ones, unusual ones and nonsense."""

import re
from dataclasses import dataclass, field
from functools import cache

import click

from fuzz import corpus
from simdtex.commands import load
from simdtex.jobs.classification import options as classifier
from simdtex.methods import mrf
from simdtex.methods.multires import options as multires
from simdtex.methods.pyramid import options as pyramid
from simdtex.options import table

LINES = {
    "synth": (20, "synth PICTURE -o OUT --size SIZE --order 1 --levels 2"),
    "multires": (16, "synth PICTURE -o OUT --size SIZE --method multires"),
    "pyramid": (12, "synth PICTURE -o OUT --size SIZE --method pyramid --iterations 1"),
    "fill": (12, "fill PICTURE -o OUT --mask MASK --order 1"),
    "extend": (6, "extend PICTURE -o OUT --right 3 --order 1"),
    "mix": (8, "mix PICTURE PICTURE -o OUT --size SIZE --iterations 1"),
    "solid": (8, "solid PICTURE -o BLOCK --size SIDE --iterations 1"),
    "simulate": (8, "simulate PICTURE -o MAPS --size SIZE --number 2 --order 1 --jobs 1"),
    "classify": (4, "classify PICTURE -o OUT --texture a=PICTURE --texture b=PICTURE"),
    "tile": (5, "tile PICTURE -o OUT --order 1"),
    "tileset": (2, "tileset PICTURE -o tiles --size 16x17 --order 1 --levels 1"),
    "maspar": (2, "maspar PICTURE -o OUT --size SIZE --order 1 --array 4x4"),
    "estimate": (3, "estimate GRID -o MAPS --size SIZE --known TABLE"),
    "schedules": (0.1, "schedules PICTURE -o out --size 9x9 --seeds 1 --schedule coloring --order 1"),
    "resume": (0.5, "resume PICTURE"),
    "devices": (0.1, "devices"),
    "bench": (0.05, "bench --json no/such/file.json"),  # else it measures for minutes
    "nothing": (0.3, "nothing"),
}
"""Weight and command line of each job; words in capitals are drawn, or are those of `PLAIN`."""

PLAIN = {
    **{"PICTURE": "L.png", "MASK": "hole.png", "GRID": "grid.gslib", "TABLE": "known.csv"},
    **{"OUT": "out.png", "BLOCK": "out.npz", "MAPS": "out.npz", "SIZE": "14x13", "SIDE": "6"},
}
RUNS = {
    name: [re.sub(r"[A-Z]{3,}", lambda found: PLAIN[found[0]], word) for word in line.split()]
    for name, (_, line) in LINES.items()
}
"""The valid command line of each job."""

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
    "light": ("keep", "even"),
}
"""Valid words of options that are not a `simdtex.options.Choice` of a method."""

LONG = ("free_sweeps", "iterations", "sweeps", "burn_in", "number", "seeds")
"""Counts of steps done one after another: a very large number is valid and would take for ever, so no try gives one."""

OTHERS = ("workers",)
"""Options that start processes or ask the network."""

OUTPUTS = {
    "BLOCK": ("out.npz", "out.npy", "out.nrrd", "out.tif", "out", "out.png", "out.xyz"),
    "MAPS": ("out.zarr", "out.nc", "out.npz", "out.gslib", "out.sgems", "out.png", "out"),
    "OUT": ("out.npy", "out.tif", "out.png", "out.webp", "out.jpg", "out.bmp", "out.xyz"),
}

METHOD_OF = {
    "solid": "pyramid",
    "mix": "pyramid",
    "classify": "classifier",
    "multires": "multires",
    "pyramid": "pyramid",
}
"""The method of jobs whose method is not ``mrf``."""


@dataclass
class Try:
    """A command line and its files.

    ``args`` of ``simdtex``; ``files`` name -> bytes, in the folder it runs in; ``kind`` what is unusual about it;
    ``old`` names of files that are there and may be replaced.
    """

    args: list[str]
    files: dict[str, bytes] = field(default_factory=dict)
    kind: str = "plain"
    old: list[str] = field(default_factory=list)


@cache
def everything():
    """The files of the corpus, for splices."""
    return [data for files in corpus.build().values() for data in files.values() if len(data) < 10**5]


class Maker:
    """Makes command lines and their files."""

    def __init__(self, rng):
        self.rng, self.files, self.kinds, self.job = rng, {}, set(), ""

    def make(self):
        """Return a try."""
        rng = self.rng
        self.job = rng.choices(list(LINES), [weight for weight, _ in LINES.values()])[0]
        words = [re.sub(r"[A-Z]{3,}", self.drawn, word) for word in LINES[self.job][1].split()]
        args = [*words, *self.options(words), *(["-q"] if rng.random() < 0.8 else [])]
        if rng.random() < 0.05:
            args[rng.randrange(len(args))] = rng.choice((*TEXT, "--help", "-o", "--nothing", "-q", "--size"))
            self.kinds.add("odd words")
        there = [word for word in args if word in ("out.png", "out.npy", "out.npz", "out.tif")]
        old = there if rng.random() < 0.1 else []
        self.files |= dict.fromkeys(old, b"old")
        return Try(args, self.files, ", ".join(sorted(self.kinds)) or "plain", old)

    def drawn(self, found):
        """A word in place of one in capitals."""
        rng, what = self.rng, found[0]
        if what in OUTPUTS:
            return self.output(OUTPUTS[what])
        if what in ("SIZE", "SIDE"):
            if rng.random() < 0.1:
                self.kinds.add("options")
                return rng.choice(SIZES)
            return rng.choice(("4", "5x6x7")) if what == "SIDE" else f"{rng.randint(1, 12)}x{rng.randint(5, 12)}"
        return self.file(what.lower())

    def options(self, words):
        """Some options of a command with their values."""
        rng, command = self.rng, words[0]
        if command == "nothing":
            return rng.choices(TEXT, k=rng.randrange(3))
        samples = [word for word in words[1:3] if word in self.files]
        taken = {"-o", "--output", "--size", "--method", "-q", "--quiet", "--help", "--mask", "--device"}
        usual = [option for option in load(command).params if isinstance(option, click.Option)]
        usual = [option for option in usual if not taken & set(option.opts) and option.name not in OTHERS]
        if command == "synth" and rng.random() < 0.9:
            method = METHOD_OF.get(self.job, "mrf")
            usual = [option for option in usual if method in (getattr(option, "methods", None) or (method,))]
        found, modest = [], rng.random() < 0.5
        for option in rng.sample(usual, min(len(usual), rng.choice((0, 0, 1, 1, 2, 3, 5)))):
            found += self.option(option, samples, modest and rng.random() < 0.9)
        if "--tiles" in found and rng.random() < 0.9:
            words[words.index("-o") + 1] = "out.zarr"
        if rng.random() < 0.02 and command != "devices":
            found += ["--device", rng.choice(("reference", "0", "7", "nothing", "", "numpy", "-1"))]
            self.kinds.add("device")
        return found

    def option(self, option, samples, modest):
        """An option with a value, of those that make sense or of any."""
        rng, name, word = self.rng, option.name or "", option.opts[-1]
        if option.is_flag:
            return [rng.choice([*option.opts, *option.secondary_opts])]
        if isinstance(option.type, click.Path):
            return [word, self.path(name)]
        if not modest:
            self.kinds.add("options")
        if option.type.name not in ("integer", "float"):
            return [word, self.text(option, name, samples, modest)]
        whole = option.type.name == "integer"
        values = MODEST.get(name, (0, 1, 3) if whole else (0, 0.25, 1, 2)) if modest else WHOLE if whole else REAL
        if not modest and name in LONG:
            values = tuple(v for v in WHOLE if not (isinstance(v, int) and 10 < v < 2**31))
        elif not modest and name == "xi":
            values = tuple(v for v in REAL if not isinstance(v, float) or v >= 0 or v < -1)
        return [word, str(rng.choice(values))]

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
        declared = table(METHODS[METHOD_OF.get(self.job, "mrf")]).get(name)
        valid = getattr(declared and declared.kind, "valid", None) or CHOICES.get(name)
        return rng.choice(valid or re.findall(r"[a-z][a-z-]+", option.help or "") or TEXT)

    def path(self, name):
        """A file or a folder for an option that takes one."""
        rng = self.rng
        if name in ("stages", "report", "checkpoint"):
            return rng.choice(("pages", "pages", "a/b", "out.png"))
        if name in ("source_map", "picture", "json", "plot", "confidence"):
            return rng.choice(("map.npz", "map.npy", "map.png", "out.png", "view.png"))
        role = {"sample_mask": "mask", "strokes": "mask", "truth": "mask", "known": "table"}.get(name, "picture")
        if name == "start" and self.job == "solid":
            role = "volume"
        return self.file("picture" if name == "known" and rng.random() < 0.4 else role)

    def output(self, names):
        """A name of an output."""
        rng = self.rng
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
