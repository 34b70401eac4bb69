# SPDX-License-Identifier: BSD-3-Clause
"""Compare two results of ``simdtex bench``.

    simdtex bench --json before.json
    (change something)
    simdtex bench --json after.json
    python benchmarks/speed.py before.json after.json

Prints, for every case in both, how many times faster it is in the second, by the clock and in units of the peak that
was measured just before it: on a noisy machine only the latter is meaningful, and less than a tenth is not.
"""

import argparse
import json
import sys
from pathlib import Path

from simdtex.bench.run import FORMAT
from simdtex.report.tables import Table, print_table, seconds_text, three_digits


def load(path):
    """The cases of a file by device and name."""
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        if found["format"] == FORMAT:
            return {(d["device"]["name"], case["name"]): case for d in found["devices"] for case in d["cases"]}
    except (OSError, ValueError, KeyError, TypeError):
        pass
    sys.exit(f"{path} holds no results of simdtex bench; give a file that --json wrote")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", help="a file that `simdtex bench --json` wrote")
    parser.add_argument("after", help="another")
    options = parser.parse_args()
    before, after = load(options.before), load(options.after)
    rows = []
    for device, name in (key for key in after if key in before):
        old, new = before[device, name], after[device, name]
        times = old["seconds"] / new["seconds"]
        rows.append(
            {
                "case": name,
                "device": device,
                "before": seconds_text(old["seconds"]),
                "after": seconds_text(new["seconds"]),
                "faster": three_digits(times, " x"),
                "by peak": three_digits(times * old["peak"] / new["peak"], " x"),
            }
        )
    print_table(Table("Seconds before and after", rows))


if __name__ == "__main__":
    main()
