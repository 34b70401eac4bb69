"""docs/prose.py: words that the pages avoid are found in prose with their lines, and not in code or literals."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "docs"))

import prose

PAGES = {
    "page.rst": ".. autofunction:: begun\n\nTitle\n=====\n\nIt is ``begun`` here\nand :doc:`begun`.\n\n"
    "::\n\n   begun the the\n\n"
    ".. figure:: begun.png\n   :alt: what has\n      begun\n\n   64 x 64 x 64, and the\n   the end.\n",
    "page.md": "# Title\n\n![what has\nbegun](begun.png) the\n\n```console\nbegun the the\n```\n\n\nand the\nthe end\n",
    "page.py": '"""\nTitle\n=====\n\n``begun``\n"""\n\nbegun = "begun"\n\n\n'
    'def f():\n    """\n    It has begun, and\n\n    the\n    the end."""\n',
}


@pytest.mark.parametrize("name", PAGES)
def test_faults_are_found_in_prose_alone(name, tmp_path):
    page = tmp_path / name
    page.write_text(PAGES[name], encoding="utf-8")
    lines = PAGES[name].splitlines()
    found = [fault.removeprefix(f"{page}:").split(": ", 1) for fault in prose.faults(page, prose.checks())]
    assert sorted(message.rpartition("[")[2] for _, message in found) == ["lexical_illusions]", "project]"]
    for line, message in found:
        assert ("begun" if "project" in message else "the") in lines[int(line) - 1]
    (line,) = (int(line) for line, message in found if "project" in message)
    assert lines[line - 1].strip().removesuffix("](begun.png) the") in ("begun", "It has begun, and")


def test_a_clean_page_has_no_fault(tmp_path):
    (tmp_path / "page.rst").write_text("Title\n=====\n\nThe schedule chooses sites.\n", encoding="utf-8")
    assert list(prose.faults(tmp_path / "page.rst", prose.checks())) == []
