# SPDX-License-Identifier: BSD-3-Clause
"""How Sphinx builds the documentation: `make docs`. Nothing is fetched while it builds, or while a page is read."""

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
    "ignore_pattern": "volume_of_a_reservoir",  # docs/readers/geoscience.rst shows it
    "run_stale_examples": True,
    "image_scrapers": ("pictures.named",),
    "reset_modules": (),
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

(HERE / "generated").mkdir(exist_ok=True)

# concepts/why.rst plays a recorded session of the live page; a page that is opened as a file cannot load a module.
(HERE / "generated" / "live").mkdir(exist_ok=True)
(HERE / "generated" / "live" / "live.js").write_text(
    script().replace("export default", "window.simdtexLive ="), encoding="utf-8"
)
(HERE / "generated" / "live" / "live.css").write_text(style(), encoding="utf-8")

# The page of measurements shows each table and all the pictures that benchmarks/study.py has written.
for study in ("mrf", "multires", "pyramid"):
    results = [f".. csv-table::\n   :file: ../study/{study}.csv\n   :header-rows: 1\n"]
    for picture in sorted((HERE / "study").glob(f"{study}-*.png")):
        caption = picture.stem.removeprefix(f"{study}-")
        results.append(f".. figure:: /study/{picture.name}\n   :alt: {picture.stem}\n\n   {caption}\n")
    (HERE / "generated" / f"study-{study}.txt").write_text("\n".join(results), encoding="utf-8")
