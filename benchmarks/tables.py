# SPDX-License-Identifier: BSD-3-Clause
"""Tables of the benchmarks, as files and on the terminal."""

import csv

from simdtex.report.tables import Table, print_table


def write(path, header, rows):
    """Write a table as CSV, and make the folder that it lies in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def show(title, header, rows):
    """Print a table."""
    print_table(Table(title, [dict(zip(header, map(str, row), strict=True)) for row in rows]))
