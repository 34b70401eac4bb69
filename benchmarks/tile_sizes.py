"""Redundant work and memory of tiles, by their side, as CSV: docs/tiles/sizes.csv.

python benchmarks/tile_sizes.py [--size 32768]
"""

import argparse
import csv
import sys

from skimage import data

from simdtex import distributed


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=32768)
    size = parser.parse_args().size
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(["side of a tile", "tiles", "redundant work, torus, %", "redundant work, open, %", "memory, MiB"])
    colour = data.astronaut()[:128, :128]
    for side in (256, 512, 1024, 2048, 4096, 8192):
        plans = [
            distributed.plan(colour, (size, size), tiles=side, boundary=boundary, channel_axis=-1)
            for boundary in ("torus", "open")
        ]
        wastes = [f"{100 * plan.levels[0].redundant:.0f}" for plan in plans]
        writer.writerow([side, plans[0].levels[0].count, *wastes, f"{plans[0].memory / 2**20:.0f}"])


if __name__ == "__main__":
    main()
