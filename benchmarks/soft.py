# SPDX-License-Identifier: BSD-3-Clause
"""How frequent channels are where soft data say how probable they are, for some weights of the soft data.

    python benchmarks/soft.py [--weights 0,0.5,1,2] [--number 12] [--size 120] [--device TEXT]

The training image is that of the pages on simulation. Probabilities of channels rise from 0.02 at the left to 0.98 at
the right; a line gives the shares in six strips, the means over the realisations. Weight 0 is a run without soft data.
"""

import argparse

import numpy as np

import simdtex
from simdtex.experiments.ensemble import channels

STRIPS = 6


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", default="0,0.5,1,2")
    parser.add_argument("--number", type=int, default=12, help="realisations")
    parser.add_argument("--size", type=int, default=120, help="rows and columns")
    parser.add_argument("--device")
    options = parser.parse_args()
    training, _ = channels()
    shape = (options.size, options.size)
    wanted = np.broadcast_to(np.linspace(0.02, 0.98, options.size), shape)

    def line(label, shares):
        parts = np.array_split(shares, STRIPS)
        print(f"{label:12}" + "".join(f"{part.mean():6.2f}" for part in parts))

    line("asked", wanted[0])
    for weight in map(float, options.weights.split(",")):
        soft = {"probabilities": np.stack([1 - wanted, wanted]), "soft_weight": weight} if weight else {}
        made = simdtex.simulate(
            training, options.number, shape=shape, categorical=True, rng=1, device=options.device, **soft
        )
        line(f"weight {weight:g}", made.values.mean((0, 1)))


if __name__ == "__main__":
    main()
