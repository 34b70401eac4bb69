"""Commands in this process, and what they leave in the current folder."""

import os
from pathlib import Path

from click.testing import CliRunner

from simdtex.commands import main
from simdtex.io import image


def run(*words):
    """Run a command, whose words may be paths and numbers."""
    return CliRunner().invoke(main, [str(word) for word in words])


def names(folder="."):
    """The names of all that is in a folder and below it."""
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*"))


def contents():
    """All that is in the current folder and below it: of a file its bytes, of a link where it leads."""
    return {
        str(path): os.readlink(path) if path.is_symlink() else path.is_file() and path.read_bytes()
        for path in Path().rglob("*")
    }


def pixels(*path):
    return image.read(os.path.join(*path)).pixels


def refused(words, *line):
    """A command ends with these words in one sentence, and changes nothing in the current folder."""
    before = contents()
    done = run(*line)
    assert done.exit_code == 2, (line, done.output, done.exception)
    assert words in done.output and len(done.output.strip().splitlines()) == 1, (line, done.output)
    assert contents() == before
