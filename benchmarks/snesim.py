# SPDX-License-Identifier: BSD-3-Clause
"""SNESIM, to compare with: runs the program mps_snesim_tree of MPSlib (PyPI: scikit-mps) through its files."""

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

TEMPLATE = (8, 8, 3)  # cells along x, y and, in volumes, z
PARAMETERS = """Number of realizations # {n}
Random Seed # {seed}
Number of multiple grids # 3
Min Node count # 0
Maximum number of conditional data # 25
Search template size X # {template[0]}
Search template size Y # {template[1]}
Search template size Z # {template[2]}
Simulation grid size X # {size[0]}
Simulation grid size Y # {size[1]}
Simulation grid size Z # {size[2]}
Origin X # 0
Origin Y # 0
Origin Z # 0
Cell size X # 1
Cell size Y # 1
Cell size Z # 1
Training image # ti.dat
Output folder # .
Shuffle simulation grid path # 1 0
Shuffle training image path # 1
Hard data # hard.dat
Hard data search radius # 1
Soft data categories # 0;1
Soft data # none.dat
Number of threads # 1
Debug mode # -1
Mask # none.dat
Entropy # 0
Estimation # 0
"""


def simulate(program, training, n, shape, known, seed):
    """Return realisations (n, *shape) of a map or a volume, given a masked array of data or None."""
    size = (*shape[::-1], 1)[:3]  # x varies fastest in GSLIB, as the last axis of an array does
    template = (*TEMPLATE[: len(shape)], 1)[:3]
    with TemporaryDirectory() as name:
        folder = Path(name)
        _write(folder / "ti.dat", " ".join(map(str, (*training.shape[::-1], 1)[:3])), ["facies"], training.ravel())
        if known is not None:
            at = np.nonzero(~known.mask)
            places = (*at[::-1], np.zeros_like(at[0]))[:3]
            _write(folder / "hard.dat", "wells", ["x", "y", "z", "facies"], np.stack([*places, known.data[at]], 1))
        (folder / "mps.txt").write_text(PARAMETERS.format(n=n, seed=seed, size=size, template=template))
        command = [Path(program).resolve(), "mps.txt"]
        subprocess.run(command, cwd=folder, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        made = [np.loadtxt(folder / f"ti.dat_sg_{k}.gslib", skiprows=3).reshape(shape) for k in range(n)]
    made = np.array(made).astype(training.dtype)
    if known is not None and (made[:, ~known.mask] != known.compressed()).any():
        raise ValueError("SNESIM misses data: its axes or its program are others")
    return made


def _write(path, title, names, rows):
    np.savetxt(path, rows, "%g", header="\n".join([title, str(len(names)), *names]), comments="")
