"""Which sites relax together, step 6.2.1 of Algorithm 1, as plain loops; and the random words of a whole run.

Nothing here shares code with the package but the numbers of purposes. A level (`plain_mrf.Level`) has ``sites``, (row,
column) of its own lattice row by row; ``near``, the neighbours of each, None where there is none; ``number``, ``seed``,
``rows``, ``cols``, ``tile`` and the options ``o``.
"""

from itertools import count
from math import isqrt

import plain
from plain_numbers import philox

from simdtex import random


def words(seed, level, turn, index, purpose, attempt=0):
    """Four random words of 32 bits; a place has 48 bits, of which the upper 16 stand with level and purpose."""
    index = int(index)
    counter = [index & 0xFFFFFFFF, int(turn), index >> 32 << 16 | level << 8 | purpose, int(attempt)]
    return philox(counter, (seed & 0xFFFFFFFF, seed >> 32))


def below(word, n):
    """0 .. n - 1 from the 64 bits of two words."""
    return ((word[1] << 32 | word[0]) * n) >> 64


def schedule(level, active):
    """Steps without end: the sites that relax together, the key of their random words, and whether a sweep ends."""
    name, _, parameter = level.o.schedule.partition(":")
    group = {
        "coloring": lambda s: colors[s],
        "coloring-fixed": lambda s: colors[s],
        "checkerboard": lambda s: sum(s) % 2,
        "synchronous": lambda s: 0,
        "raster": lambda s: s,
        "block": lambda s: (s[0] % level.tile[0], s[1] % level.tile[1]),
    }
    colors = coloring(level) if name.startswith("coloring") else None
    if name in group:
        return in_groups(level, active, {s: group[name](s) for s in level.sites}, shuffled=name == "coloring")
    key = level.seed, level.number

    def subset(wanting, step):
        share = float(parameter or 0.5)
        return [s for s in wanting if words(*key, step, place_of(level, s), random.SCHEDULE)[0] < share * 2**32]

    def single(wanting, step):
        return [wanting[below(words(*key, step, 0, random.SCHEDULE), len(wanting))]]

    def independent(wanting, step):
        """A maximal set without neighbours, the site with the largest word first."""
        rank = {s: (words(*key, step, place_of(level, s), random.SCHEDULE)[0], s) for s in wanting}
        chosen = set()
        for s in sorted(wanting, key=rank.get, reverse=True):
            if not chosen & set(level.near[s]):
                chosen.add(s)
        return sorted(chosen)

    return at_every_step(active, {"random-subset": subset, "random-scan": single, "luby": independent}[name])


def in_groups(level, active, group, shuffled):
    """One group a step, in its order or, in each sweep, another; a sweep goes by what was active when it began."""
    groups = sorted(set(group.values()))
    for turn in count(1):
        wanted, order = set(active()), groups
        if shuffled:
            key = {g: words(level.seed, level.number, turn, g, random.SCHEDULE)[0] for g in groups}
            order = sorted(groups, key=key.get)
        steps = [[s for s in level.sites if group[s] == g and s in wanted] for g in order]
        steps = [step for step in steps if step] or [[]]  # an empty sweep is one step of nobody
        for step in steps:
            yield step, turn, step is steps[-1]


def at_every_step(active, choose):
    """A choice among what is active now; a sweep is as many relaxations as sites were active when it began."""
    left = 0
    for turn in count(1):
        wanting = active()
        left = left or len(wanting)
        chosen = choose(wanting, turn) if wanting else []
        left = max(0, left - len(chosen)) if wanting else 0
        yield chosen, turn, not left


def place_of(level, s):
    """A site's number in the level's own lattice."""
    return s[0] * level.cols + s[1]


def coloring(level):
    """The fewest colours that a lattice of sites gives; along the seam of a torus greedily, or a lattice that fits."""
    best = sublattice(level.o.order)
    colors = by_lattice(level, best)
    bare = [s for s in level.sites if colors[s] is None]
    rank = {s: (words(level.seed, 0, 0, place_of(level, s), random.COLOR)[0], s) for s in bare}
    for s in sorted(bare, key=rank.get, reverse=True):
        taken = {colors[r] for r in level.near[s] if r is not None}
        colors[s] = next(color for color in count() if color not in taken)
    used = len(set(colors.values()))
    if level.o.boundary == "torus" and used > best[0] * best[2]:
        seamless = sublattice(level.o.order, level.rows, level.cols, used)
        colors = by_lattice(level, seamless) if seamless else colors
    numbers = sorted(set(colors.values()))
    return {s: numbers.index(color) for s, color in colors.items()}


def by_lattice(level, basis):
    """The coset of each site; none where an earlier site of the same is a neighbour across the seam."""
    a, b, c = basis
    coset = {(i, j): (i - j // c * b) % a * c + j % c for i, j in level.sites}
    clash = {s for s in level.sites for r in level.near[s] if r is not None and r < s and coset[r] == coset[s]}
    return {s: None if s in clash else coset[s] for s in level.sites}


def sublattice(order, rows=None, cols=None, most=None):
    """(a, b, c): the sites n (a, 0) + m (b, c), as dense as can be with no two of them neighbours, or None."""
    for size in range(1, (most or (isqrt(order) + 1) ** 2) + 1):
        for c in (c for c in range(1, size + 1) if size % c == 0):
            a = size // c
            for b in range(a):
                fits = rows is None or (rows % a, cols % c, cols // c * b % a) == (0, 0, 0)
                if fits and not any(j % c == 0 and (i - j // c * b) % a == 0 for i, j in plain.offsets(order)):
                    return a, b, c
    return None
