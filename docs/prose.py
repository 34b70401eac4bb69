# SPDX-License-Identifier: BSD-3-Clause
"""Check the prose of the pages: `python docs/prose.py [FILE ...]`, which `make prose` and `make docs` run.

proselint finds clichés, repeated words, misspellings and the like; docs/prose.txt adds words that the project avoids.
Code, commands and literals are not checked.
"""

import re
import sys
from pathlib import Path

from proselint.checks import __register__ as general
from proselint.registry.checks import Check, engine, types
from pygments.lexers import MarkdownLexer, PythonLexer, RstLexer
from pygments.token import Generic, Name, String, Text

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PAGES = [*HERE.rglob("*.rst"), ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("examples/*.py")]
BUILT = {"_build", "gallery", "generated"}
# These rules give false alarms here: on sizes (64 x 64), options (``color``), terms (multiply-adds).
OFF = (
    "dates_times",
    "misc.phrasal_adjectives",
    "misc.preferred_forms",
    "restricted",
    "spelling.consistency",
    "typography",
    "uncomparables",
    "weasel_words",
)


def only(text, lexer, kinds):
    """Replace words by dots unless their token is of one of these kinds; every place stays the same."""
    tokens = lexer.get_tokens(text)
    return "".join(word if any(kind in k for k in kinds) else re.sub(r"\S", "·", word) for kind, word in tokens)


def prose(path):
    """Return the text of a page, or of the docstrings of a script, without code."""
    text, plain = path.read_text("utf-8"), {"stripnl": False, "ensurenl": False}
    lexer = (MarkdownLexer if path.suffix == ".md" else RstLexer)(handlecodeblocks=False, **plain)
    if path.suffix == ".py":
        text = only(text, PythonLexer(**plain), [String.Doc, Text]).replace('"""', "   ")
    path_or_name, directive, empty = r"\S*[./]\w\S*", r"^·· ·+ \S+$", r"^(?=\n)"
    text = only(text, lexer, [Text, Generic, Name.Tag])
    return re.sub(rf"{path_or_name}|{directive}|\d|{empty}", "·", text, flags=re.MULTILINE)


def checks():
    """Return the rules of proselint without those that are off, and the words of docs/prose.txt as one more rule."""
    lines = [line.split(": ", 1) for line in (HERE / "prose.txt").read_text("utf-8").splitlines() if line[:1] != "#"]
    words = types.PreferredForms({word.replace(" ", r"\s+"): instead for word, instead in lines})
    return [rule for rule in general if not rule.path.startswith(OFF)] + [
        Check(words, engine.Fancy(), path="project", message="'{1}': write {0}.")
    ]


def faults(path, rules):
    """Yield a line for each fault of a page."""
    text = "\n" + prose(path) + "\n"  # rules look at both sides of a word
    for rule in rules:
        for found in rule.check_with_flags(text):
            line, message = text.count("\n", 0, found.span[0] + 1), " ".join(found.message.split())
            yield f"{path}:{line}: {message} [{rule.path}]"


def main():
    pages = [Path(name) for name in sys.argv[1:]] or sorted(path for path in PAGES if not BUILT & set(path.parts))
    rules = checks()
    found = [fault for path in pages for fault in faults(path, rules)]
    print("\n".join(found) or f"{len(pages)} pages: proselint and docs/prose.txt find no fault.")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
