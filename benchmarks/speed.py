# SPDX-License-Identifier: BSD-3-Clause
"""The cases of ``simdtex bench`` for regressions: compares the results of two runs.

    simdtex bench --json before.json
    (change something)
    simdtex bench --json after.json
    python benchmarks/speed.py before.json after.json

Prints, for every case that both have, how many times faster it is now, by the clock and in units of the peak that each
run measured: where the machine is noisy, only the latter says much, and less than a tenth says little even so.
"""

import argparse
import sys

from rich.console import Console
from rich.table import Table

from simdtex.bench.results import compared, load
from simdtex.report.bench import times
from simdtex.report.tables import seconds_text


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", help="a file that `simdtex bench --json` wrote")
    parser.add_argument("after", help="another")
    options = parser.parse_args()
    try:
        found = compared(load(options.before), load(options.after))
    except (OSError, ValueError) as error:
        sys.exit(str(error))
    table = Table()
    for name in ("device", "case", "before", "after", "faster", "by peak"):
        table.add_column(name, justify="left" if name in ("device", "case") else "right", no_wrap=True)
    for row in found:
        seconds = (seconds_text(row[name]) for name in ("before", "after"))
        table.add_row(row["device"], row["case"], *seconds, times(row["times"]), times(row["by_peak"]))
    Console(width=None if sys.stdout.isatty() else 200).print(table)


if __name__ == "__main__":
    main()
