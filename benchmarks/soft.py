# SPDX-License-Identifier: BSD-3-Clause
"""How frequent channels are where soft data say how probable they are, for some weights of the soft data.

    python benchmarks/soft.py [--weights 0,0.5,1,2] [--number 12] [--size 120] [--device TEXT]

The training image is that of the pages on simulation. Probabilities of channels rise from 0.02 at the left to 0.98 at
the right; a line gives the shares in six strips, the means over the realisations. Weight 0 is a run without soft data.
"""

import common
import numpy as np

import simdtex
from simdtex.experiments.ensemble import channels

STRIPS = 6


def line(label, shares):
    print(f"{label:12}" + "".join(f"{part.mean():6.2f}" for part in np.array_split(shares, STRIPS)))


@common.command
def main(weights="0,0.5,1,2", number=12, size=120, device=None):
    wanted = np.broadcast_to(np.linspace(0.02, 0.98, size), (size, size))
    given = {"shape": wanted.shape, "categorical": True, "rng": 1, "device": device}
    line("asked", wanted[0])
    for weight in map(float, weights.split(",")):
        soft = {"probabilities": np.stack([1 - wanted, wanted]), "soft_weight": weight} if weight else {}
        line(f"weight {weight:g}", simdtex.simulate(channels()[0], number, **given, **soft).values.mean((0, 1)))


if __name__ == "__main__":
    main()
