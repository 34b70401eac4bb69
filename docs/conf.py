# SPDX-License-Identifier: BSD-3-Clause
"""How Sphinx builds the documentation: `make docs`. Nothing is fetched while it builds."""

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
