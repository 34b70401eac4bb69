# SPDX-License-Identifier: BSD-3-Clause
"""How Sphinx builds the documentation: `make docs`. Nothing is fetched while it builds, or while a page is read."""

import csv
import json
import re
import sys
from pathlib import Path

import simdtex
from simdtex.live import script, style

HERE = Path(__file__).parent

project = "simdtex"
author = "The simdtex developers"
copyright = author
release = simdtex.__version__

sys.path.insert(0, str(HERE / "extensions"))
extensions = ["sphinx.ext.autodoc", "numpydoc", "sphinx_gallery.gen_gallery", "formulas", "names", "options"]
exclude_patterns = ["_build", "generated", "extensions"]
default_role = "py:obj"
nitpicky = True
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"simdtex {release}"
html_static_path = ["_static", "generated/live"]
html_css_files = ["simdtex.css"]

# The gallery is examples/*.py, all of which run at every build; one that fails is an error of the build.
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "run_stale_examples": True,
    "image_scrapers": ("pictures.written",),
    "reset_modules": (),
    "notebook_extensions": set(),  # the scripts read a command line, which a notebook has not
    "download_all_examples": False,
    "write_computation_times": False,
    "show_signature": False,
    "remove_config_comments": True,
}

# External links are asked for by `make links` alone.
linkcheck_timeout = 20
linkcheck_workers = 2

autodoc_typehints = "none"  # the docstrings give types, shapes and units
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

# The page of the study shows each method's table and all the pictures that benchmarks/study.py has written:
# name of the result -> table, beginning of the pictures' names.
STUDIES = {
    "study": ("mrf.csv", "mrf-"),
    "study-exact": ("exact.csv", "exact-"),
    "study-multires": ("multires.csv", "multires-"),
    "study-pyramid": ("pyramid.csv", "pyramid-"),
}
(HERE / "generated").mkdir(exist_ok=True)

# concepts/why.rst plays a recorded session of the live page; a page that is opened as a file cannot load a module.
(HERE / "generated" / "live").mkdir(exist_ok=True)
(HERE / "generated" / "live" / "live.js").write_text(
    script().replace("export default", "window.simdtexLive ="), encoding="utf-8"
)
(HERE / "generated" / "live" / "live.css").write_text(style(), encoding="utf-8")

for result, (figures, prefix) in STUDIES.items():
    others = tuple(other for _, other in STUDIES.values() if len(other) > len(prefix))
    results = [f".. csv-table::\n   :file: ../study/{figures}\n   :header-rows: 1\n"]
    for picture in sorted((HERE / "study").glob(f"{prefix}*.png")):
        if not picture.name.startswith(others):
            caption = picture.stem.removeprefix(prefix)
            results.append(f".. figure:: /study/{picture.name}\n   :alt: {picture.stem}\n\n   {caption}\n")
    (HERE / "generated" / f"{result}.txt").write_text("\n".join(results), encoding="utf-8")

# The page of the schedules shows a few columns of what benchmarks/schedules.py has written: heading, form, factor.
COST = {
    "keeps (14)": ("keeps (14)", "{}", None),
    "steps": ("steps", "{:,.0f}", 1),
    "relaxations per site": ("relaxations per site", "{:.1f}", 1),
    "seconds": ("seconds, wall", "{:.1f}", 1),
    "device seconds": ("seconds, device", "{:.1f}", 1),
    "model seconds": ("MP-1, hours", "{:.1f}", 1 / 3600),
}
RESULT = {
    "oscillation cooling": ("flip back, cooling, %", "{:.2f} ± {:.2f}", 100),
    "oscillation free": ("flip back, free, %", "{:.2f} ± {:.2f}", 100),
    "plausibility": ("plausibility", "{:.2f} ± {:.2f}", 1),
    "coverage": ("coverage", "{:.2f} ± {:.2f}", 1),
    "histogram distance": ("histogram", "{:.2f} ± {:.2f}", 1),
    "copying": ("copying", "{:.2f} ± {:.2f}", 1),
}


def cell(row, name, form, factor):
    if factor is None:
        return row[name]
    return form.format(float(row[name]) * factor, float(row[f"{name} +-"]) * factor)


def table(caption, rows, columns):
    header = ", ".join(f'"{heading}"' for heading, *_ in columns.values())
    lines = [
        ", ".join(f'"{text}"' for text in (row["schedule"], *(cell(row, name, *c[1:]) for name, c in columns.items())))
        for row in rows
    ]
    return "\n   ".join([f".. csv-table:: {caption}", f':header: "schedule", {header}', "", *lines]) + "\n\n"


with open(HERE / "study" / "schedules.csv", encoding="utf-8", newline="") as file:
    found = list(csv.DictReader(file))
by_sample = {
    name: [row for row in found if row["sample"] == name] for name in dict.fromkeys(r["sample"] for r in found)
}
tables = [table("What it takes: brick", by_sample["brick"], COST)]
tables += [table(name.capitalize(), rows, RESULT) for name, rows in by_sample.items()]
(HERE / "generated" / "schedules.txt").write_text("\n".join(tables), encoding="utf-8")

# The first page shows the comparison of README.md: its table, and the notes below it.
readme = (HERE.parent / "README.md").read_text(encoding="utf-8")
part = re.search(r"^## Comparison.*?\n\n(.*?)^## ", readme, re.MULTILINE | re.DOTALL)[1]
part = re.sub(r"`([^`]+)`", r"``\1``", part)
part = re.sub(r"\[([^]]+)\]\(docs/([^)]+)\.rst\)", r":doc:`\1 </\2>`", part)
rows = [re.split(r" *\| *", line.strip("| ")) for line in part.splitlines() if line.startswith("| ")]
lines = [".. list-table::", "   :header-rows: 1", ""]
lines += [f"   {'  -' if column else '* -'} {text}" for row in rows for column, text in enumerate(row)]
notes = [line for line in part.splitlines() if not line.startswith("|")]
(HERE / "generated" / "comparison.txt").write_text("\n".join([*lines, *notes]) + "\n", encoding="utf-8")

# The page on testing shows the record of `make fuzz RECORD=--record`.
with open(HERE / "fuzzing.json", encoding="utf-8") as file:
    fuzzed = json.load(file)
counts = {
    "tries": f"{fuzzed['tries']:,}",
    "seconds": f"{fuzzed['seconds']:,.0f}",
    "seed": fuzzed["seed"],
    "ended with exit code 0": f"{fuzzed['codes'].get('0', 0):,}",
    "ended with exit code 2 and a sentence": f"{fuzzed['codes'].get('2', 0):,}",
    "ended by Ctrl-C": f"{fuzzed['codes'].get('130', 0):,}",
    "slowest try, seconds": fuzzed["slowest"],
    "most memory of a try, MiB": f"{fuzzed['largest'] / 2**20:.0f}",
    "different faults": len(fuzzed["faults"]),
}
rows = [f'"{name}", "{value}"' for name, value in counts.items()]
rows += [f'"tries with {name}", "{count:,}"' for name, count in fuzzed["kinds"].items() if name != "plain"]
rows += [f'"fault: {fault["kind"]}", "{fault["tries"]}"' for fault in fuzzed["faults"]]
body = "\n   ".join([".. csv-table::", ':header: "what", "how many"', "", *rows])
(HERE / "generated" / "fuzzing.txt").write_text(body + "\n", encoding="utf-8")
