# SPDX-License-Identifier: BSD-3-Clause
"""How Sphinx builds the documentation: `make docs`. Nothing is fetched while it builds."""

import csv
from pathlib import Path

import simdtex

HERE = Path(__file__).parent

project = "simdtex"
author = "The simdtex developers"
copyright = author
release = simdtex.__version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.mathjax", "numpydoc"]
exclude_patterns = ["_build", "generated"]
default_role = "py:obj"
html_theme = "furo"
html_title = f"simdtex {release}"
html_static_path = ["_static"]

autodoc_typehints = "none"  # the docstrings give types, shapes and units
autodoc_member_order = "bysource"
numpydoc_show_class_members = False

# The page of the study shows the table and all the pictures that benchmarks/study.py has written.
table = (HERE / "study" / "table.csv").read_text(encoding="utf-8").splitlines()
results = [".. csv-table::\n   :file: ../study/table.csv\n   :header-rows: 1\n"] if len(table) > 1 else []
results += [
    f".. figure:: /study/{picture.name}\n   :alt: {picture.stem}\n\n   {picture.stem.replace('-', ' ')}\n"
    for picture in sorted((HERE / "study").glob("*.png"))
]
(HERE / "generated").mkdir(exist_ok=True)
(HERE / "generated" / "study.txt").write_text("\n".join(results) or "None yet.\n", encoding="utf-8")

# The page of the schedules shows a few columns of what benchmarks/schedules.py has written.
COLUMNS = {
    "schedule": ("schedule", "{}", 1, ""),
    "keeps (14)": ("(14)", "{}", 1, ""),
    "steps": ("steps", "{:,.0f}", 1, ""),
    "relaxations per site": ("relaxations per site", "{:.1f}", 1, ""),
    "seconds": ("seconds", "{:.1f}", 1, ""),
    "model seconds": ("MP-1, hours", "{:.1f}", 1 / 3600, ""),
    "changed free": ("changed", "{:.2f} %", 100, ""),
    "oscillation free": ("flip back", "{:.2f} %", 100, "{:.2f}"),
    "plausibility": ("plausibility", "{:.2f}", 1, "{:.2f}"),
    "coverage": ("coverage", "{:.2f}", 1, "{:.2f}"),
    "histogram distance": ("histogram", "{:.2f}", 1, "{:.2f}"),
    "copying": ("copying", "{:.2f}", 1, "{:.2f}"),
}


def cell(row, name):
    _, form, factor, spread = COLUMNS[name]
    if name in ("schedule", "keeps (14)"):
        return row[name]
    text = form.format(float(row[name]) * factor)
    return f"{text} ± {spread.format(float(row[f'{name} +-']) * factor)}" if spread else text


with open(HERE / "study" / "schedules.csv", encoding="utf-8", newline="") as file:
    rows = list(csv.DictReader(file))
tables = []
for sample in dict.fromkeys(row["sample"] for row in rows):
    lines = [",".join(f'"{cell(row, name)}"' for name in COLUMNS) for row in rows if row["sample"] == sample]
    header = ", ".join(f'"{heading}"' for heading, *_ in COLUMNS.values())
    table = [f".. csv-table:: {sample}", f"   :header: {header}", "", *(f"   {line}" for line in lines), "", ""]
    tables.append("\n".join(table))
(HERE / "generated" / "schedules.txt").write_text("\n".join(tables), encoding="utf-8")
