# SPDX-License-Identifier: BSD-3-Clause
"""The gallery shows the pictures that an example has written: its `folder` says where."""

import shutil
from pathlib import Path

from sphinx_gallery.scrapers import figure_rst

MOST = 6
"""Pictures of one example; a folder of stages has many more."""


def written(block, block_vars, gallery_conf):
    """What sphinx-gallery calls after each block of an example."""
    folder = block_vars["example_globals"].get("folder")
    found = sorted(Path(folder).glob("*.png"), key=lambda path: path.stat().st_mtime_ns) if folder else []
    shown = []
    for picture, path in zip(found[:MOST], block_vars["image_path_iterator"], strict=False):
        shutil.copyfile(picture, path)
        shown.append((path, picture.name))
    if folder and not shown:
        raise RuntimeError(f"{block_vars['src_file']} wrote no picture into its folder")
    return "\n".join(figure_rst([path], gallery_conf["src_dir"], name) for path, name in shown)
