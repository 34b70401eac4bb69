"""Algorithm 1 of Paget and Longstaff (1998) as plain loops, to the byte: what whole runs of the engine must give.

Nothing here shares code with the package but the random words, whose generator is tested against published vectors. A
picture is indexed [channel][row, column], and a place is (row, column). Grey levels are integers, temperatures
whole 1/1024. An array without a picture's shape runs over candidates p; ``float32`` stands where a result is rounded
to it. The numbers in the comments are the algorithm's own.
"""

from copy import deepcopy
from fractions import Fraction
from itertools import accumulate, product
from math import ceil, exp, isqrt, log, log2, sqrt
from types import SimpleNamespace

import numpy as np
import plain
from numpy import float32
from plain_multires import within
from plain_schedules import below, schedule, words

from simdtex import random

ALL_IN_LANES = False
"""Whether sums are in lanes also where all candidates are weighed. They are not; True shows that a test can tell."""

LANES = 16
CATEGORIES = 16  # different pixels of a map of categories, at most
MOST_KEPT = 1024  # candidates of a level that knows novelty, at most
COMPARED = 1024  # candidates of which each is compared with all, at most

DEFAULTS = {
    **{"order": 18, "levels": None, "overview": 128, "relaxation": "icm", "bandwidth": 0.15, "coherence": 0.5},
    **{"balance": 0.5, "structure": 2.0, "novelty": 1.0, "finish": None, "xi": -1.0},
    **{"free_sweeps": 2, "pixel": "source", "phases": "decimated", "edges": "auto", "coarsest": "gibbs"},
    **{"schedule": "coloring", "boundary": "torus", "search": "auto", "suggesting": 12, "similar": 0, "chance": 4},
    "exhaustive": 64,
}
PAPER = {
    **{"relaxation": "gibbs", "bandwidth": 1.0, "coherence": 0.0, "free_sweeps": 0, "pixel": "density"},
    **{"edges": "whole", "coarsest": "same", "search": "exact", "overview": 64},
    **{"balance": 0.0, "structure": 0.0, "novelty": 0.0, "finish": 0.0},
}


def options(pixels, preset="default", **given):
    """All options, with what ``search="auto"`` and ``finish=None`` stand for."""
    o = SimpleNamespace(**DEFAULTS | (PAPER if preset == "paper" else {}) | given)
    if o.search == "auto":
        o.search = "coherent" if (o.relaxation, o.pixel) == ("icm", "source") else "exact"
    if o.finish is None:
        categories = len({tuple(pixel) for row in pixels.tolist() for pixel in row}) <= CATEGORIES
        o.finish = 0 if categories or o.pixel == "density" else 1.5
    if o.pixel == "density":
        o.structure = 0
    return o


def synthesize(pixels, shape, seed, **given):
    """Image, source (row, column) and temperature of every pixel, from a sample (rows, columns, channels)."""
    o = options(pixels, **given)
    y, top, unit = grey_levels(pixels, o)
    levels = number_of_levels(pixels.shape[:2], shape, o)  # 1.
    X, level = at_random(y, shape, seed), None  # 2., 5.
    for number in reversed(range(levels)):  # 6.
        level = Level(number, levels, y, top, shape, seed, o, level)  # 3., 4., 6.1
        level.price = prices(level, X)
        cooling = True

        def active(level=level):
            return [s for s in level.sites if not cooling or X.t[level.pixel(s)] > 0]  # noqa: B023 - as it is by then

        steps = schedule(level, active)
        while any(X.t[level.pixel(s)] > 0 for s in level.sites):  # 6.2
            sweep(level, X, steps)  # 6.3
        cooling = False
        for _ in range(o.free_sweeps):
            sweep(level, X, steps)
    image = finished(pixels, y, unit, X, o) if o.finish else picture(pixels, y, unit, X)
    return image, X.source, X.t / 1024  # 7.


def sweep(level, X, steps):
    """Steps of a schedule until it says that its sweep ends; prices are the same for all of them, and then settle."""
    old = deepcopy(X)  # what tiles see of one another
    for sites, turn, last in steps:  # 6.2.1
        new = [relaxed(level, X, old, s, turn) for s in sites]  # 6.2.2, in parallel: none sees another
        for s, (values, source, t) in zip(sites, new, strict=True):  # 6.2.3
            for c, value in enumerate(values):
                X.x[c][level.pixel(s)] = value
            X.source[level.pixel(s)] = source
            X.t[level.pixel(s)] = t
        if last:
            level.price = (prices(level, X) + level.price) / float32(2)
            return


def relaxed(level, X, old, s, turn):
    """What a site becomes: its grey levels, source and temperature."""
    near = []  # of each neighbour x_r, t_r and where it was taken from
    for r in level.near[s]:
        seen = X if r is None or level.together(s, r) else old
        at = None if r is None else level.pixel(r)
        near.append(None if r is None else ([int(x[at]) for x in seen.x], int(seen.t[at]), tuple(seen.source[at])))

    numbers, favoured, charged = candidates_of(level, X, s, near, turn)  # 6.2.2.1: equations (6) and (12)
    d = distances(level, near, numbers, level.lanes)
    d = np.where(favoured, d * float32(1 / (1 + level.o.coherence)), d)
    d = d + level.price[numbers]
    for p, times in charged if level.novelty else []:  # neighbour by neighbour; the numbers are all candidates
        d[p] += float32(times) * level.novelty

    if level.gibbs:  # 6.2.2.2
        values, p = drawn(level, d, numbers, s, turn)
    elif level.o.pixel == "source":
        p = min(zip(d, numbers, strict=True))[1]
        values = level.own[:, p]
    elif len(level.own) == 1 and level.eight_bit:
        values, p = mode(level, d, numbers)
    else:
        values, p = mode_of_vectors(level, d, numbers)

    there = [t for _, t, _ in filter(None, near)]  # 6.2.2.3: equation (13)
    xi = min(-1, round(level.o.xi * 1024))
    return values, level.places[p], max(0, xi + sum(there)) // max(1, len(there))


# -- the sample and the levels --------------------------------------------------------------------------------


def grey_levels(pixels, o):
    """Y as whole grey levels from 0 to top, the structure channel last; and what 1 of them is in pixels."""
    planes = np.moveaxis(pixels, -1, 0)
    y, top, unit = ([plane.astype(int) for plane in planes], 255, 1.0)
    if pixels.dtype != np.uint8:
        y, top, unit = stretched(pixels, planes, (len(planes) + (o.structure > 0)) * len(plain.offsets(o.order)))
    if o.structure:
        y.append(structure(y, o.structure, max(top, 1023)))
    return y, top, unit


def stretched(pixels, planes, values):
    """The same of pixels of other types than 8 bits."""
    top = 2 ** min(12, int((33 - log2(values)) / 2)) - 1  # so that every distance is exact in float64
    least, most = (Fraction(bound.item()) for bound in (pixels.min(), pixels.max()))
    exact = [[[round((Fraction(v) - least) * top / (most - least)) for v in row] for row in y] for y in planes.tolist()]
    return [np.array(plane) for plane in exact], top, float(most - least) / top


def variance(y):
    """sigma^2 of equation (8): the mean over channels."""
    greys, total = [plane.ravel().tolist() for plane in y], 0.0
    for g in greys:  # Python's own sum of doubles rounds in another way
        total += (len(g) * sum(v * v for v in g) - sum(g) ** 2) / len(g) ** 2
    return total / len(greys)


def structure(y, weight, most):
    """The signed distance to the edges of the sample, from 0 up, with this weight where that leaves 0..most alone."""
    rows, cols = y[0].shape
    slope = np.zeros((rows, cols), int)
    for plane in y:
        smooth = np.zeros((rows, cols), int)
        for i, j, a, b in product(range(rows), range(cols), range(-2, 3), range(-2, 3)):
            weights = (1, 4, 6, 4, 1)[a + 2] * (1, 4, 6, 4, 1)[b + 2]
            smooth[i, j] += weights * plane[clamped(i + a, rows), clamped(j + b, cols)]
        for i, j in product(range(rows), range(cols)):
            down = smooth[clamped(i + 1, rows), j] - smooth[clamped(i - 1, rows), j]
            right = smooth[i, clamped(j + 1, cols)] - smooth[i, clamped(j - 1, cols)]
            slope[i, j] += down**2 + right**2
    edge = slope > sorted(slope.ravel())[int(0.85 * (slope.size - 1))]
    signed = np.zeros((rows, cols), int)  # in 1/256 of a pixel
    for i, j in product(range(rows), range(cols)):
        others = np.argwhere(edge != edge[i, j])
        nearest = min([256, *((others - (i, j)) ** 2).sum(1).tolist()])  # 16 pixels at most
        signed[i, j] = round(sqrt(nearest) * 256) * (-1 if edge[i, j] else 1)
    signed -= signed.min()
    spread = sqrt(variance([signed]))
    if not spread:
        return signed
    scale = min(weight * sqrt(variance(y)) / spread, most / int(signed.max()))
    return np.array([[round(v * scale) for v in row] for row in signed.tolist()])


def clamped(i, n):
    """Index i brought to 0 .. n-1: the outermost stands for all beyond."""
    return min(max(i, 0), n - 1)


def at_random(y, shape, seed):
    """Every pixel of X one of Y's, at temperature 1."""
    rows, cols = y[0].shape
    source = np.zeros((*shape, 2), np.int32)
    for i, j in np.ndindex(*shape):
        source[i, j] = divmod(below(words(seed, 0, 0, i * shape[1] + j, random.START), rows * cols), cols)
    x = [plane[source[..., 0], source[..., 1]] for plane in y]
    return SimpleNamespace(x=x, source=source, t=np.full(shape, 1024))


def number_of_levels(sample, shape, o):
    """M: the most at which the sample has enough candidates, and the lattice holds a neighbourhood."""
    radius = isqrt(o.order)

    def enough(levels, least):
        spacing = 2 ** (levels - 1)
        step = 1 if o.phases == "all" else spacing
        rows, cols = (max(0, n - (2 * radius * spacing if o.edges == "whole" else 0)) // step for n in sample)
        return rows * cols >= least

    most = max(m for m in range(1, 2 + int(log2(min(*sample, *shape)))) if m == 1 or enough(m, 1))
    if o.levels is not None:
        assert o.levels <= most
        return o.levels
    levels = 1
    while levels < most and enough(levels + 1, o.overview) and min(shape) > 2 * radius * 2**levels:
        levels += 1
    return levels


class Level:
    """One level: its lattice, its neighbourhoods, its candidates and the Gaussian of equation (7)."""

    def __init__(self, number, levels, y, top, shape, seed, o, above=None):
        """Equations (8), (10) and (11); ``above`` is the next coarser level."""
        self.number, self.spacing, self.width, self.seed, self.o = number, 2**number, shape[1], seed, o
        self.rows, self.cols = plain.grid_size(shape, self.spacing)
        self.sites = list(product(range(self.rows), range(self.cols)))
        torus = o.boundary == "torus"
        self.near = {s: plain.neighbours(*s, o.order, self.rows, self.cols, torus) for s in self.sites}
        self.offsets = plain.offsets(o.order)
        name, _, parameter = o.schedule.partition(":")
        self.tile = tuple(map(int, (parameter or "16x16").split("x"))) if name == "block" else (self.rows, self.cols)

        self.places = positions(y[0].shape, self.spacing, o)
        self.number_of = {place: p for p, place in enumerate(self.places)}
        self.own = np.array([[plane[p] for p in self.places] for plane in y])
        self.around = np.array([[self.beside(plane, offset) for plane in y] for offset in self.offsets])

        radius, step = isqrt(o.order), 1 if o.phases == "all" else self.spacing
        self.step, self.above, self.found = step, above, None
        self.pitch = y[0].shape[1] + 2 * radius * 2 ** (levels - 1)  # of the sample with its margin
        self.lattice = tuple(len({place[axis] for place in self.places}) for axis in (0, 1))
        self.blur = radius * self.spacing // step  # candidates from one to the edge of its neighbourhood

        n, dimensions = len(self.places), len(y) * (len(self.offsets) + 1)
        best = sqrt(variance(y)) * pow(4 / (n * (2 * dimensions + 1)), 1 / (dimensions + 4))  # (8)
        h = max(o.bandwidth * best, 1e-10)
        self.scale = float32(1 / (2 * h * h))
        self.top, self.eight_bit = top, top == 255
        self.reach = min(top, int(h * sqrt(2 * log(2.0**33))))  # beyond which the Gaussian is nothing
        gauss = [exp(-k * k / (2 * h * h)) for k in range(self.reach + 1)]
        self.gauss = np.array(gauss, float32)
        self.below_step = cumulative([gauss[abs(k)] for k in range(-self.reach, self.reach + 1)])

        coarsest, coherent = number == levels - 1, o.search == "coherent"
        self.gibbs = o.relaxation == "gibbs" or (coarsest and o.coarsest == "gibbs")
        self.all = not coherent or coarsest or n <= o.exhaustive
        self.lanes = LANES if ALL_IN_LANES or not self.all else 1
        self.similar = similar(self) if not self.all and o.similar else None

        self.rate = o.balance * len(self.offsets) * len(y) * variance(y)
        anew = coarsest and n <= MOST_KEPT and (self.gibbs or o.pixel == "source")
        self.novelty = float32(o.novelty * min(1.0, 256 / n) * len(y) * variance(y) if anew else 0)

    def pixel(self, s):
        """The pixel of X that a site of the level's lattice is."""
        return s[0] * self.spacing, s[1] * self.spacing

    def index(self, s):
        """Its number among the pixels of X, which keys its random words."""
        return s[0] * self.spacing * self.width + s[1] * self.spacing

    def together(self, s, r):
        """Whether two sites are of one tile."""
        return all(a // side == b // side for a, b, side in zip(s, r, self.tile, strict=True))

    def beside(self, plane, offset):
        """y_r of every candidate, the sample being continued by reflection."""
        rows, cols = plane.shape
        there = [(i + offset[0] * self.spacing, j + offset[1] * self.spacing) for i, j in self.places]
        return [plane[within(i, rows, False), within(j, cols, False)] for i, j in there]


def positions(shape, spacing, o):
    """The candidates of a level, row by row."""
    step = 1 if o.phases == "all" else spacing
    every = list(product(range(0, shape[0], step), range(0, shape[1], step)))
    whole = plain.whole_positions(shape, o.order, spacing, step)
    reflect = o.edges == "reflect" or (o.edges == "auto" and (spacing > 1 or len(whole) < 0.75 * len(every)))
    return every if reflect else whole


def similar(level):
    """For each candidate the K most similar others, nearest neighbourhood first; itself where there are too few."""
    if level.found is None:
        everyone = range(len(level.places))
        if len(everyone) <= COMPARED:
            level.found = [most_similar(level, p, everyone) for p in everyone]
        else:
            level.found = approximately_similar(level)
    return level.found


def approximately_similar(level):
    """The same of many candidates: who is like p lies to it as who is like one of p's kin lies to that."""
    everyone, k = range(len(level.places)), level.o.similar
    at = [i * level.pitch + j for i, j in level.places]  # pixels of the sample with its margin
    number_at = {pixel: p for p, pixel in enumerate(at)}

    def moves(table, at):
        return [[at[q] - at[p] for q in row] for p, row in enumerate(table)]

    if level.above is None:
        drawn = [[words(0, 0, 0, p, random.SEARCH, n // 4)[n % 4] * len(at) >> 32 for n in range(k)] for p in everyone]
        kin, moved, rounds = list(everyone), moves(drawn, at), 6
    else:
        above = level.above
        lines = [sorted({place[axis] for place in above.places}) for axis in (0, 1)]
        before = [
            tuple(max([line for line in lines[axis] if line <= place[axis]] or lines[axis][:1]) for axis in (0, 1))
            for place in level.places
        ]
        kin = [above.number_of[place] for place in before]
        moved, rounds = moves(similar(above), [i * level.pitch + j for i, j in above.places]), 2
    for _ in range(rounds):
        found = []
        for p in everyone:
            around = [at[p] + (a * level.pitch + b) * level.step for a in (-1, 0, 1) for b in (-1, 0, 1)]
            those = [kin[number_at[pixel]] for pixel in around if pixel in number_at]
            there = {at[p] + move for row in those for move in moved[row]}
            found.append(most_similar(level, p, sorted(number_at[pixel] for pixel in there & number_at.keys())))
        kin, moved = list(everyone), moves(found, at)
    return found


def most_similar(level, p, numbers):
    """The K of these most similar to p, but for those next to it; the lowest number where several are as near."""
    (i, j), near = level.places[p], level.step
    others = [q for q in numbers if max(abs(level.places[q][0] - i), abs(level.places[q][1] - j)) > near]
    here = [([y[p] for y in planes], 0, None) for planes in level.around]
    d = distances(level, here, others, LANES)
    nearest = [q for _, q in sorted(zip(d, others, strict=True))][: level.o.similar]
    return nearest + [p] * (level.o.similar - len(nearest))


def prices(level, X):
    """What each candidate costs, lambda N C sigma^2 min(4, max(0, u - 1)).

    u is the use of the square around it over its fair share: the square is as wide as the neighbourhood, as far as it
    lies among the candidates, and only pixels with t < 1 use their source.
    """
    used = np.zeros(len(level.places), int)
    for s in level.sites:
        p = level.number_of.get(tuple(X.source[level.pixel(s)]))
        if X.t[level.pixel(s)] < 1024 and p is not None:
            used[p] += 1
    total, used = int(used.sum()), used.reshape(level.lattice)
    price = np.zeros(level.lattice, float32)
    for a, b in np.ndindex(*level.lattice) if total else []:
        square = used[max(0, a - level.blur) : a + level.blur + 1, max(0, b - level.blur) : b + level.blur + 1]
        u = int(square.sum()) * used.size / (square.size * total)
        price[a, b] = float32(level.rate * min(4, max(0, u - 1)))
    return price.ravel()


# -- 6.2.2.1: what a site weighs ------------------------------------------------------------------------------


def candidates_of(level, X, s, near, turn):
    """The numbers of the candidates that a site weighs; which of them continue a neighbour's source; and the number of
    each that does so, once for every such neighbour, and of each that is a neighbour's source, which counts 4 times.
    """
    o = level.o
    suggested, charged = [], []
    for (di, dj), r in list(zip(level.offsets, near, strict=True))[: None if level.all else o.suggesting]:
        if r is None or r[1] == 1024:  # as nothing has touched it yet
            continue
        i, j = r[2]
        suggested.append(level.number_of.get((i - di * level.spacing, j - dj * level.spacing)))
        charged += [(suggested[-1], 1), (level.number_of.get((i, j)), 4)]
    if level.all:
        numbers = list(range(len(level.places)))
        return numbers, [p in suggested for p in numbers], [(p, n) for p, n in charged if p is not None]

    found = list(dict.fromkeys(p for p in suggested if p is not None))
    favoured = len(found)
    found.append(level.number_of.get(tuple(X.source[level.pixel(s)])))
    found = list(dict.fromkeys(p for p in found if p is not None))
    if level.similar:
        found += [like for p in found for like in level.similar[p]]
    for k in range(max(o.chance, not found)):
        word = words(level.seed, level.number, turn, level.index(s), random.SEARCH, k // 4)[k % 4]
        found.append(word * len(level.places) >> 32)
    found = list(dict.fromkeys(found))
    return found, [k < favoured for k in range(len(found))], []


def distances(level, near, numbers, lanes):
    """d_p of equation (12) for each candidate, rounded after each term.

    In lanes there is a sum for each column, modulo 16, of the square around the neighbourhood, which is gone through
    row by row; a tree adds them up.
    """
    d = np.zeros((lanes, len(numbers)), float32)
    inside = [k for k, r in enumerate(near) if r is not None]
    if lanes > 1:
        inside.sort(key=lambda k: level.offsets[k])
    for k in inside:
        x, t, _ = near[k]
        lane = (level.offsets[k][1] + isqrt(level.o.order)) % lanes
        for x_r, y_r in zip(x, level.around[k], strict=True):
            e = (x_r - y_r[numbers]) * ((1024 - t) / 1024)
            d[lane] = (e * e + d[lane].astype(float)).astype(float32)  # the double is exact
    while len(d) > 1:
        d = d[: len(d) // 2] + d[len(d) // 2 :]
    return d[0]


def weights(level, d):
    """Equation (7): floor(2^40 exp(-(d_p - min d) / 2h^2))."""
    a = (d - d.min()) * level.scale
    return [int(e * 2.0**40) if b < 28 else 0 for e, b in zip(exponential(-np.minimum(a, 28)), a, strict=True)]


# -- 6.2.2.2: what a site becomes -----------------------------------------------------------------------------


def drawn(level, d, numbers, s, turn):
    """The Gibbs sampler: a candidate by its weight and, of a density, a step from its grey levels."""
    density = level.o.pixel == "density"
    w = weights(level, d)
    for y in level.own if density else []:
        w = [max(1, w_p * mass(level, y[p])[1] >> 32) if w_p else 0 for w_p, p in zip(w, numbers, strict=True)]
    target = below(words(level.seed, level.number, turn, level.index(s), random.DRAW), sum(w))
    p = next(p for k, p in enumerate(numbers) if sum(w[: k + 1]) > target)
    values = level.own[:, p].tolist()
    for c, y in enumerate(values if density else []):
        low, whole = mass(level, y)
        u = low + (words(level.seed, level.number, turn, level.index(s), random.DRAW, 1 + c)[0] * whole >> 32)
        step = next(k for k, end in enumerate(level.below_step) if end > u) - level.reach
        values[c] = y + step
    return values, p


def mass(level, y):
    """Where the steps that stay between 0 and top begin in the cumulative Gaussian, and what they come to."""
    ends = [0, *level.below_step]
    low = ends[max(0, level.reach - y)]
    return low, ends[min(2 * level.reach, level.reach + level.top - y) + 1] - low


def mode(level, d, numbers):
    """The grey level at which equation (6) is largest, and the candidate that counts most there."""
    w, grey = weights(level, d), level.own[0][numbers]
    f, x = np.zeros(256, float32), np.arange(256)
    for v in sorted({y for y, w_p in zip(grey.tolist(), w, strict=True) if w_p}):
        total = sum(w_p for y, w_p in zip(grey, w, strict=True) if y == v)
        reached = abs(x - v) <= level.reach
        f[reached] = fma(nearest(Fraction(total)), level.gauss[abs(x - v)[reached]], f[reached])
    best = int(f.argmax())
    gaps = abs(grey - best)
    shares = [
        nearest(Fraction(w_p)) * level.gauss[gap] if w_p and gap <= level.reach else -1
        for w_p, gap in zip(w, gaps, strict=True)
    ]
    return [best], numbers[int(np.argmax(shares))]


def mode_of_vectors(level, d, numbers):
    """The candidate among the 16 heaviest at whose vector equation (6) is largest."""
    w = weights(level, d)
    heavy = [k for k, w_p in enumerate(w) if w_p]
    heaviest = sorted(heavy, key=lambda k: -w[k])[:16]
    y = level.own[:, numbers]
    density = np.zeros(len(heaviest), float32)
    for k in heavy:
        gap = np.zeros(len(heaviest), float32)
        for plane in y:
            gap = ((plane[k] - plane[heaviest]) ** 2 + gap.astype(float)).astype(float32)
        a = gap * level.scale
        more = fma(nearest(Fraction(w[k])), exponential(-np.minimum(a, 28)), density)
        density = np.where(a < 28, more, density)
    p = numbers[heaviest[int(np.argmax(density))]]
    return level.own[:, p], p


def picture(pixels, y, unit, X):
    """Each pixel that of its source, moved by what the grey level differs."""
    image = np.zeros((*X.t.shape, pixels.shape[-1]), pixels.dtype)
    for i, j, c in np.ndindex(image.shape):
        place = tuple(X.source[i, j])
        image[i, j, c] = moved(pixels, (*place, c), int(X.x[c][i, j] - y[c][place]), unit)
    return image


def finished(pixels, y, unit, X, o):
    """Each pixel the weighted mean of what its neighbours' sources say of it: Y[p_r + s - r], r up to 2.5 sd from s.

    Weights are whole 1/1024. The mean is rounded, halves up, to a grey level of 8 bits and to 1/8 of one of others.
    """
    (rows, cols), (height, width), radius = X.t.shape, y[0].shape, ceil(2.5 * o.finish)
    image = np.zeros((rows, cols, pixels.shape[-1]), pixels.dtype)
    fine = 1 if pixels.dtype == np.uint8 else 8
    for i, j in np.ndindex(rows, cols):
        own, total, sums = tuple(X.source[i, j].tolist()), 0, [0] * pixels.shape[-1]
        for a, b in product(range(-radius, radius + 1), repeat=2):
            r = ((i + a) % rows, (j + b) % cols) if o.boundary == "torus" else (i + a, j + b)
            far, outside = a * a + b * b > (2.5 * o.finish) ** 2, not (0 <= r[0] < rows and 0 <= r[1] < cols)
            if far or outside or (r == (i, j) and (a, b) != (0, 0)):
                continue
            k, m = X.source[r].tolist()
            if 0 <= k - a < height and 0 <= m - b < width:
                weight = round(1024 * exp(-(a * a + b * b) / (2 * o.finish**2)))
                total += weight
                for c in range(pixels.shape[-1]):  # not the structure channel
                    sums[c] += weight * int(y[c][k - a, m - b] - y[c][own])
        for c in range(pixels.shape[-1]):
            step = (2 * fine * sums[c] + total) // (2 * total)
            image[i, j, c] = moved(pixels, (*own, c), step, unit / fine)
    return image


def moved(pixels, at, step, unit):
    """A value of the sample moved by so many steps, within the legal range."""
    low, high = (0, 255) if pixels.dtype == np.uint8 else (pixels.min().item(), pixels.max().item())
    own = pixels[at].item()
    value = own + step * unit if pixels.dtype.kind == "f" else round(own + step * unit)
    return min(max(value, low), high) if step else own


# -- numbers --------------------------------------------------------------------------------------------------


def cumulative(terms):
    """Sums of the first terms over the sum of all, in 2^-32."""
    sums = list(accumulate(terms))
    return [*(min(2**32 - 1, round(s / sums[-1] * 2**32)) for s in sums[:-1]), 2**32 - 1]


def nearest(exact):
    """The float32 nearest to a fraction, ties to the even one."""
    close = float32(float(exact))
    around = [close, np.nextafter(close, float32(-np.inf)), np.nextafter(close, float32(np.inf))]
    return min(around, key=lambda x: abs(Fraction(float(x)) - exact))  # the first of equals: a tie is exact above


def fma(a, b, c):
    """A * b + c, rounded once to float32."""
    a, b, c = np.broadcast_arrays(*(np.atleast_1d(np.asarray(x, float)) for x in (a, b, c)))
    double = a * b + c
    low, high = (np.nextafter(double, end).astype(float32) for end in (-np.inf, np.inf))
    for k in np.flatnonzero(low != high):  # too close to the middle for the double to tell
        high[k] = nearest(Fraction(a[k]) * Fraction(b[k]) + Fraction(c[k]))
    return high


def exponential(x):
    """exp(x) of float32, as the polynomial that the devices' exponential is; x from -28 to 0."""
    x = np.atleast_1d(x)
    k = np.rint(x * float32(1.44269502))
    r = fma(k, float32(-0.693145752), x)
    r = fma(k, float32(-1.42860677e-6), r)
    p = float32(1.38888892e-3)
    for coefficient in (8.33333377e-3, 4.16666679e-2, 1.66666672e-1, 0.5, 1.0, 1.0):
        p = fma(p, r, float32(coefficient))
    return np.ldexp(p.astype(float), k.astype(int))
