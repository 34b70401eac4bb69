"""Algorithm 1 of Paget and Longstaff (1998) as plain loops, to the byte: what whole runs of the engine must give.

Nothing here shares code with the package but the random words, whose generator is tested against published vectors,
and the search for a sample's lattice (test_regularity.py). A picture is indexed [channel][row, column], a site is (row,
column), and a place in the sample is (number of the picture, row, column), (-1, -1, -1) for nowhere. Grey levels are
integers, temperatures whole 1/1024. An array without a picture's shape runs over candidates p; ``float32`` stands where
a result is rounded to it. The numbers in the comments are the algorithm's own.
"""

from copy import deepcopy
from itertools import product
from math import exp, floor, hypot, isqrt, log, log2, sqrt
from types import SimpleNamespace

import numpy as np
import plain
from numpy import float32
from plain_multires import within
from plain_numbers import cumulative, exponential, fma, logarithm, minus_gumbel
from plain_sample import NOWHERE, UNKNOWN, between, clamped, completed, lay, material, stand_ins
from plain_schedules import below, schedule, words
from plain_shown import finished, picture

from simdtex import random

LANES = 16  # of a sum of squares
UNIT = 16  # candidates, four of which share their draws
CATEGORIES = 16  # different pixels of a map of categories, at most
EXHAUSTIVE = 64  # candidates of a level that are all evaluated, at most
SUGGESTING = 12  # nearest neighbours that suggest a candidate
ALIKE = 64  # candidates with about the same known values
IN_PHASE, FEW = 128, 16  # candidates of a phase, at most, and on average if its neighbours' are added

DEFAULTS = {
    **{"order": None, "levels": None, "overview": 128, "relaxation": "icm", "bandwidth": 0.15, "coherence": 0.5},
    **{"balance": 0.5, "structure": 2.0, "novelty": 1.0, "finish": None, "xi": -1.0},
    **{"lattice": "auto", "reduction": None},
    **{"free_sweeps": 2, "free_sites": "all", "pixel": "source", "phases": 1, "edges": "auto"},
    **{"schedule": "coloring", "boundary": "torus", "search": "auto", "chance": 4, "coarse_chance": 0},
    **{"categorical": False, "weights": None, "shares": None, "proportions": None},
    **{"data_weight": 16.0, "guide_weight": 10.0, "labels": None, "soft_weight": 1.0},
}
PAPER = {
    **{"relaxation": "icm", "bandwidth": 1.0, "coherence": 0.0, "free_sweeps": 1, "free_sites": "kept", "xi": -8.0},
    **{"edges": "whole", "search": "exact", "overview": 1},
    **{"balance": 0.0, "structure": 0.0, "novelty": 0.0, "finish": 0.0, "lattice": "none", "reduction": 1},
}


def options(pictures, preset="default", **given):
    """All options, with what ``search="auto"`` and ``finish=None`` stand for."""
    o = SimpleNamespace(**DEFAULTS | (PAPER if preset == "paper" else {}) | given)
    if o.search == "auto":
        o.search = "coherent" if (o.relaxation, o.pixel) == ("icm", "source") else "exact"
    if o.finish is None:
        colours = {tuple(pixel) for y in pictures for row in y.tolist() for pixel in row}
        categories = o.categorical or len(colours) <= CATEGORIES
        o.finish = 0 if categories or o.pixel == "density" else 1.5
    if o.pixel == "density":
        o.structure = 0
    if o.order is None:  # the largest up to 18 whose neighbourhood is no larger than a picture
        o.order = min(18, ((min(min(y.shape[:2]) for y in pictures) - 1) // 2 + 1) ** 2 - 1)
    return o


def synthesize(pictures, shape, seed, mask=None, known=None, known_source=None, guide=None, maps=None, **given):
    """Image, source and temperature of every pixel, from a sample (rows, columns, channels) or a list of such.

    ``mask`` is a list too; ``known`` a masked array (rows, columns, channels), ``guide`` a list of pictures (rows,
    columns, channels) and one of the output's size. ``maps`` is a dictionary of "region" (rows, columns), True inside,
    and of "categories" and "images", probabilities (kinds, rows, columns). A source is (row, column), or (row, column,
    picture) of a list.
    """
    one = isinstance(pictures, np.ndarray)
    pictures = [pictures] if one else pictures
    o = options(pictures, **given)
    maps = maps or {}
    sizes = [(pictures, shape, mask, known, known_source, guide)]
    while 2 ** len(sizes) <= (o.reduction or 1):
        sizes.append(halved(*sizes[-1]))
    if o.proportions and "categories" not in maps:
        p = np.array(o.proportions) / sum(o.proportions)
        maps = maps | {"categories": np.broadcast_to(p[:, None, None], (len(p), *shape))}
    asked = shares_asked(maps.get("categories"), o)
    Ys, lattices = [], None
    for y, size, *more in sizes:
        Ys.append(material(y, o, size, *more, maps, lattices))
        Ys[-1].own = Ys[0].own  # as certain at every size
        lattices = Ys[-1].waves and [[half(one) for one in Ys[-1].lattices[0]], half(Ys[-1].lattices[1])]
    sides = [y.shape[:2] for y in pictures]
    if "images" in maps:  # each picture is wanted somewhere, as often as the map says
        told = [plane[~np.isnan(plane)].tolist() for plane in maps["images"]]
        o.shares, sides = [max(0.001, sum(one) / max(1, len(one))) for one in told], [min(sides, key=min)]
    levels = number_of_levels(sides, shape, o)  # 1.
    X = None
    for number in reversed(range(levels)):  # 6.
        k = min(number, len(sizes) - 1)
        Y, size = Ys[k], sizes[k][1]
        if X is None or number < len(sizes) - 1:
            lay(Y, levels - k if X is None else 1, o)
            X = at_random(Y, size, seed) if X is None else twice(X, Y, size)  # 2., 5.
        level = Level(number, levels, Y, size, seed, o, 2**k, k < len(sizes) - 1)  # 3., 4., 6.1
        place_guides(level, X, Y)
        level.penalty, level.asked = penalties(level, X), asked
        cooling = True

        def active(level=level, X=X):
            if cooling:  # noqa: B023 - as it is by then
                return [s for s in level.sites if X.t[level.pixel(s)] > 0]
            kept = o.free_sites == "kept" and len(sizes) == 1
            movable = [s for s in level.sites if not kept or s[0] % 2 == s[1] % 2 == 0]
            return [s for s in movable if level.pixel(s) not in level.held]

        steps = schedule(level, active)
        while any(X.t[level.pixel(s)] > 0 for s in level.sites):  # 6.2
            sweep(level, X, steps)  # 6.3
        cooling = False
        for _ in range(o.free_sweeps if o.free_sites == "all" or 0 == number < levels - 1 else 0):
            sweep(level, X, steps)
    image = finished(Y, X, o) if o.finish else picture(Y, X)
    if known is not None:
        image = np.where(np.ma.getmaskarray(known), image, np.ma.getdata(known)).astype(image.dtype)
    return image, X.source[..., 1:] if one else X.source[..., [1, 2, 0]], X.t / 1024  # 7.


def halved(pictures, shape, mask, known, source, guide):
    """The same at half the size: means of squares of 2x2, known, usable or a gap as all or any of the four are."""

    def mean(array, rows, cols, kind=None):
        """Squares beyond the border have its pixels twice."""
        found = np.zeros((rows, cols, *array.shape[2:]), kind or array.dtype)
        for i, j in np.ndindex(rows, cols):
            four = [array[clamped(2 * i + a, len(array)), clamped(2 * j + b, array.shape[1])] for a, b in SQUARE]
            exact = sum(np.asarray(one, float) / 4 for one in four)
            found[i, j] = np.rint(exact) if array.dtype.kind in "iu" else exact
        return found

    def every(array, rows, cols):
        return mean(array.astype(float), rows, cols) == 1

    gaps = [np.isnan(y).any(-1) if y.dtype.kind == "f" else np.zeros(y.shape[:2], bool) for y in pictures]
    smaller = [(y.shape[0] // 2, y.shape[1] // 2) for y in pictures]
    whole = [mean(completed(*pair), *size) for *pair, size in zip(pictures, gaps, smaller, strict=True)]
    for y, gap, size in zip(whole, gaps, smaller, strict=True):
        if gap.any():
            y[~every(~gap, *size)] = np.nan
    mask = mask and [every(one, *size) for one, size in zip(mask, smaller, strict=True)]
    rows, cols = (-(-side // 2) for side in shape)
    if known is not None:
        missing = ~every(~np.ma.getmaskarray(known), rows, cols)
        known = np.ma.masked_array(mean(np.ma.getdata(known), rows, cols), missing)
        source = source[::2, ::2].copy()
        for s in map(tuple, np.argwhere(source[..., 0] >= 0)):
            n = source[s][2] if len(source[s]) > 2 else 0
            source[s][:2] = [min(at // 2, side - 1) for at, side in zip(source[s][:2], smaller[n], strict=True)]
    if guide is not None:
        row, col = ([min(2 * i + 1, side - 1) for i in range(-(-side // 2))] for side in shape)
        guide = [one[1::2, 1::2] for one in guide[0]], guide[1][np.ix_(row, col)], *guide[2:]
    return whole, (rows, cols), mask, known, source, guide


def half(lattice):
    """A lattice at half the size."""
    return tuple((y / 2, x / 2) for y, x in lattice)


SQUARE = list(product((0, 1), repeat=2))


def twice(X, Y, shape):
    """Twice the size: a pixel of the square of the pixel that the site at or before each had, at temperature 0."""
    found = at_random(Y, shape, 0)
    for s in np.ndindex(*shape):
        if s in Y.given:
            continue
        n, i, j = X.source[s[0] // 2, s[1] // 2].tolist()
        n, i, j = found.source[s] = max(n, 0), 2 * i + s[0] % 2, 2 * j + s[1] % 2
        for c in range(Y.matched):
            found.x[c][s] = Y.planes[n][c][i, j]
        found.t[s] = 0
    return found


def at_random(Y, shape, seed):
    """Every pixel of X one of Y's, at temperature 1; those that are known, at 0."""
    usable = [(n, i, j) for n, one in enumerate(Y.usable) for i, j in np.argwhere(one).tolist()]
    channels = range(len(Y.planes[0]))
    X = SimpleNamespace(x=[np.zeros(shape, int) for _ in channels], source=np.zeros((*shape, 3), np.int32))
    X.t = np.full(shape, 1024)
    for s in np.ndindex(*shape):
        word = words(seed, 0, 0, s[0] * shape[1] + s[1], random.START)
        n, i, j = X.source[s] = usable[below(word, len(usable))]
        for c in channels:
            X.x[c][s] = Y.planes[n][c][i, j]
    for s, (told, place) in Y.given.items():
        for x, value in zip(X.x, told, strict=False):  # not the guides
            x[s] = value
        X.source[s], X.t[s] = place, 0
    for x, guide in zip(X.x[Y.matched :], Y.guides, strict=True):
        x[:] = guide
    return X


def place_guides(level, X, Y):
    """Where a level begins: values of a guide between its sites stand at these."""
    for x, guide in zip(X.x[Y.matched :], Y.guides, strict=True):
        x[:] = guide
        for s, datum in stand_ins(guide != UNKNOWN, level.spacing, level.o.boundary == "torus").items():
            x[s] = guide[datum]


def sweep(level, X, steps):
    """Steps of a schedule until it says that its sweep ends; its penalties are the same, and then settle."""
    old = deepcopy(X)  # what tiles see of one another
    for sites, turn, last in steps:  # 6.2.1
        new = [relaxed(level, X, old, s, turn) for s in sites]  # 6.2.2, in parallel: none sees another
        for s, (values, source, t) in zip(sites, new, strict=True):  # 6.2.3
            for c, value in enumerate(values):
                X.x[c][level.pixel(s)] = value
            X.source[level.pixel(s)] = source
            X.t[level.pixel(s)] = t
        if last:
            level.penalty = (penalties(level, X) + level.penalty) / float32(2)
            charge(level, X)
            return


def relaxed(level, X, old, s, turn):
    """What a site becomes: its grey levels, source and temperature."""
    near = []  # of each neighbour x_r, how certain each of these is, t_r, and where it was taken from
    for r in level.near[s]:
        seen = X if r is None or level.together(s, r) else old
        near.append(None if r is None else look(level, seen, level.pixel(r)))

    numbers, favoured, charged = candidates_of(level, X, s, near, turn)  # 6.2.2.1: equations (6) and (12)
    itself = []
    if level.Y.guides:  # at the site itself these alone count
        x, certain, _, _ = look(level, X, level.pixel(s))
        own = [level.Y.centre] * (len(level.Y.guides) - level.Y.told) + [level.Y.own_known] * level.Y.told
        own = [o if u else 0 for o, u in zip(own, certain[level.Y.matched :], strict=True)]
        itself = [(x, [0] * level.Y.matched + own)]
    d = distances(level, near + itself, numbers)
    d = np.where(favoured, d * float32(1 / (1 + level.o.coherence)), d)
    d = d + level.penalty[numbers]
    if level.Y.waves:
        d = d + apart_in_phase(level, s, numbers)
    if level.between:
        d = d + misfit(level, s, numbers)
    if level.Y.soft:
        d = d + of_kind(level, s, numbers)
    if level.novelty:
        d = d + level.novelty * np.bincount([p for p, _ in charged], [n for _, n in charged], len(d)).astype(float32)

    if level.gibbs:  # 6.2.2.2
        values, p = drawn(level, d, numbers, s, turn)
    elif level.o.pixel == "density":
        values, p = mode(level, d)
    else:
        p = min(zip(d, numbers, strict=True))[1]
        values = level.own[:, p]

    there = [t for _, _, t, _ in filter(None, near)]  # 6.2.2.3: equation (13)
    xi = min(-1, round(level.o.xi * 1024))
    return values, level.places[p], max(0, xi + sum(there)) // max(1, len(there))


def look(level, X, at):
    """Grey levels of a pixel, how certain each of them is, its temperature and its source.

    A pixel is as certain as it is cold, and counts for more where it is from nowhere; a guide is certain everywhere,
    and a variable that is known where others are not counts for more, too.
    """
    Y, t, source = level.Y, int(X.t[at]), tuple(X.source[at].tolist())
    x = [int(plane[at]) for plane in X.x]
    certain = (1024 - t) / 1024 * (Y.hard if Y.own and source == NOWHERE else 1)
    u = [certain] * Y.matched + [1] * (len(Y.guides) - Y.told) + [Y.hard] * Y.told
    return x, [0 if value == UNKNOWN else v for value, v in zip(x, u, strict=True)], t, source


def number_of_levels(samples, shape, o):
    """M: the most at which the sample has enough candidates, and the lattice holds a neighbourhood."""
    radius = isqrt(o.order)

    def enough(levels, least):
        spacing = 2 ** (levels - 1)
        sides = [[n // spacing for n in y] for y in samples]
        return sum(rows * cols for rows, cols in sides) >= least

    smallest = min(n for sides in (*samples, shape) for n in sides)
    most = max(m for m in range(1, 2 + int(log2(smallest))) if m == 1 or enough(m, 1))
    if o.levels is not None:
        assert o.levels <= most
        return o.levels
    levels = 1
    while levels < most and min(shape) > (2 * radius if o.overview >= 32 else 1) * 2**levels:
        if not enough(levels + 1, o.overview if levels > 3 else min(32, o.overview)):
            break
        levels += 1
    return levels


class Level:
    """One level: its lattice, its neighbourhoods, its candidates and the Gaussian of equation (7)."""

    def __init__(self, number, levels, Y, shape, seed, o, reduction=1, arranged=False):
        """Equations (8), (10) and (11) of pictures and an output that are reduced by ``reduction``."""
        self.number, self.spacing, self.width, self.seed, self.o, self.Y = number, 2**number, shape[1], seed, o, Y
        self.spacing //= reduction
        if reduction > 1 and o.edges == "auto":
            self.o = o = SimpleNamespace(**vars(o) | {"edges": "reflect"})
        self.rows, self.cols = plain.grid_size(shape, self.spacing)
        self.sites = list(product(range(self.rows), range(self.cols)))
        torus = o.boundary == "torus"
        self.near = {s: plain.neighbours(*s, o.order, self.rows, self.cols, torus) for s in self.sites}
        self.offsets = plain.offsets(o.order)
        name, _, parameter = o.schedule.partition(":")
        self.tile = tuple(map(int, (parameter or "16x16").split("x"))) if name == "block" else (self.rows, self.cols)

        self.between = self.data_between(torus) if Y.given else {}
        self.held = {(i, j) for i, j in Y.given if i % self.spacing == j % self.spacing == 0}

        self.phased = Y.waves is not None and o.search == "coherent"
        radius, step = isqrt(o.order), 1 if self.phased else max(1, self.spacing // o.phases)
        self.step = step
        self.places = positions(Y, self.spacing, step, o)
        self.number_of = {place: p for p, place in enumerate(self.places)}
        self.at = [(Y.tops[n] + i, j) for n, i, j in self.places]  # in the canvas
        self.lines = [sorted({at[axis] for at in self.at}) for axis in (0, 1)]
        if not Y.clean:
            self.lines = [list(range(0, side, step)) for side in Y.canvas]
        self.blur = radius * self.spacing // step  # candidates from one to the edge of its neighbourhood

        self.planes = Y.planes[0]
        self.own = np.array([[Y.planes[n][c][i, j] for n, i, j in self.places] for c in range(Y.matched)])
        offsets = [*self.offsets, (0, 0)]  # the site itself for the sake of guides
        self.around = np.array([[self.beside(c, offset) for c in range(len(self.planes))] for offset in offsets])

        n, dimensions = len(self.places), Y.matched * (len(self.offsets) + 1)
        best = sqrt(Y.variance) * pow(4 / (n * (2 * dimensions + 1)), 1 / (dimensions + 4))  # (8)
        h = max(o.bandwidth * best, 1e-10)
        self.scale = float32(1 / (2 * h * h))
        self.top = Y.top
        self.reach = min(Y.top, int(h * sqrt(2 * log(2.0**33))))  # beyond which the Gaussian is nothing
        gauss = [exp(-k * k / (2 * h * h)) for k in range(self.reach + 1)]
        self.kernel = np.append(gauss, [0.0] * Y.top).astype(float32)  # by the difference of grey levels
        self.below_step = cumulative([gauss[abs(k)] for k in range(-self.reach, self.reach + 1)])

        coarsest, coherent = number == levels - 1, o.search == "coherent"
        self.gibbs = o.relaxation == "gibbs" or coarsest
        self.all = not coherent or (coarsest and not self.phased) or n <= EXHAUSTIVE
        self.chance = max(o.chance, o.coarse_chance) if number >= 2 else o.chance
        if self.phased:
            self.chance = max(self.chance, IN_PHASE // 4 ** (levels - 1 - number))
            self.of_phase = self.by_phase()

        differing = len(self.offsets) * Y.matched * Y.variance  # two neighbourhoods that have nothing in common
        self.rate = 0 if arranged else o.balance * differing
        self.step_of_charge, self.gain = float32(differing / 1024), 256 if coarsest else 512
        apart = n // (self.spacing // step) ** 2  # candidates that lie the spacing apart
        freedom = min(1.0, 256 / apart, (apart / 128) ** 2) if coarsest else 0.0
        self.novelty = float32(o.novelty * freedom * Y.matched * Y.variance)

    def by_phase(self):
        """The candidates of each phase, and of its neighbours where there are few; some of all where there are none."""
        down, right = self.divisions = [min(255, max(1, round(hypot(*v)))) for v in self.Y.lattices[1][:2]]
        own = [phase(self.Y.lattices[0][n], self.divisions, i, j) for n, i, j in self.places]
        steps = product((-1, 0, 1), repeat=2) if len(own) < FEW * down * right else [(0, 0)]
        found = {f: [] for f in product(range(down), range(right))}
        for a, b in steps:
            for p, (y, x) in enumerate(own):
                found[(y + a) % down, (x + b) % right].append(p)
        some = list(range(0, len(own), -(-len(own) // IN_PHASE)))
        return {f: thinned(those or some) for f, those in found.items()}

    def pixel(self, s):
        """The pixel of X that a site of the level's lattice is."""
        return s[0] * self.spacing, s[1] * self.spacing

    def index(self, s):
        """Its number among the pixels of X, which keys its random words."""
        return s[0] * self.spacing * self.width + s[1] * self.spacing

    def together(self, s, r):
        """Whether two sites are of one tile."""
        return all(a // side == b // side for a, b, side in zip(s, r, self.tile, strict=True))

    def data_between(self, torus):
        """{site: [(datum, pixels from site to datum)]}: the 8 nearest data that no site around them is known for."""
        found, reach, spacing = {}, isqrt(self.o.order), self.spacing
        for r, c in between(self.Y.whole, spacing, torus):
            lines = [range(n // spacing - reach, n // spacing + reach + 2) for n in (r, c)]
            for i, j in product(*lines):
                apart = (r - i * spacing, c - j * spacing)
                site = (i % self.rows, j % self.cols) if torus else (i, j)
                far = (
                    max(map(abs, apart)) > reach * spacing or apart[0] ** 2 + apart[1] ** 2 > self.o.order * spacing**2
                )
                if site in self.near and not far:
                    found.setdefault(site, []).append(((r, c), apart))
        return {site: sorted(near, key=lambda one: one[1][0] ** 2 + one[1][1] ** 2)[:8] for site, near in found.items()}

    def beside(self, c, offset):
        """y_r of every candidate, each picture of the sample being continued by reflection."""
        found = []
        for n, i, j in self.places:
            (rows, cols), there = self.Y.usable[n].shape, (i + offset[0] * self.spacing, j + offset[1] * self.spacing)
            found.append(self.Y.planes[n][c][within(there[0], rows, False), within(there[1], cols, False)])
        return found


def phase(lattice, divisions, i, j):
    """Which of the divisions of a lattice's cell a pixel is in."""
    (a, b), (c, d), (top, left) = lattice
    y, x, area = i - top, j - left, a * d - b * c
    parts = ((y * d - x * c) / area, (x * a - y * b) / area)
    return tuple(floor(part * n) % n for part, n in zip(parts, divisions, strict=True))


def thinned(those):
    """At most IN_PHASE of a list, evenly spaced."""
    kept = min(len(those), IN_PHASE)
    return [those[k * len(those) // kept] for k in range(kept)]


def positions(Y, spacing, step, o):
    """The candidates of a level, picture by picture and row by row."""
    every, whole = [], []
    for n, usable in enumerate(Y.usable):
        inside = set(plain.whole_positions(usable.shape, o.order, spacing, step))
        for i, j in product(range(0, usable.shape[0], step), range(0, usable.shape[1], step)):
            if usable[i, j]:
                every.append((n, i, j))
                whole += [(n, i, j)] * ((i, j) in inside)
    reflect = o.edges == "reflect" or (o.edges == "auto" and (spacing > 1 or len(whole) < 0.75 * len(every)))
    reflect = reflect or (o.edges == "whole" and spacing > 1 and len(whole) < 1000)
    return [place for place in (every if reflect else whole) if sure(Y, place, spacing, o)]


def sure(Y, place, spacing, o):
    """Whether not too many neighbours of a place are unknown; what lies beyond the picture is not."""
    (n, i, j), offsets, unknown = place, plain.offsets(o.order), 0
    for a, b in offsets:
        k, m = i + a * spacing, j + b * spacing
        unknown += 0 <= k < Y.gaps[n].shape[0] and 0 <= m < Y.gaps[n].shape[1] and bool(Y.gaps[n][k, m])
    return unknown <= 0.25 * len(offsets)


def penalties(level, X):
    """What each candidate costs, lambda N C sigma^2 min(4, max(0, u - 1)).

    u is the use of the square around it over its fair share: the square is as wide as the neighbourhood, as far as it
    lies among the candidates, and only pixels with t < 1 use their source.
    """
    used, due = (np.zeros([len(lines) for lines in level.lines], int) for _ in range(2))
    crossing = [tuple(level.lines[axis].index(at[axis]) for axis in (0, 1)) for at in level.at]
    fair = shares(level)
    for at, place in zip(crossing, level.places, strict=True):
        due[at] = fair[place[0]]
    for s in level.sites:
        p = level.number_of.get(tuple(X.source[level.pixel(s)].tolist()))
        if X.t[level.pixel(s)] < 1024 and p is not None:
            used[crossing[p]] += 1
    total, penalty = int(used.sum()), np.zeros(len(crossing), float32)
    for p, (a, b) in enumerate(crossing) if total else []:
        square = (slice(max(0, a - level.blur), a + level.blur + 1), slice(max(0, b - level.blur), b + level.blur + 1))
        u = int(used[square].sum()) * int(due.sum()) / (int(due[square].sum()) * total)
        penalty[p] = float32(level.rate * min(4, max(0, u - 1)))
    return penalty


def shares(level):
    """How much of each candidate of a picture is fair, in whole numbers."""
    wanted, pictures = level.o.shares, [n for n, _, _ in level.places]
    if not wanted or level.Y.clean:
        return [1] * len(level.Y.pictures)
    numbers = [pictures.count(n) for n in range(len(wanted))]
    each = [share / sum(wanted) * len(pictures) / max(1, n) for share, n in zip(wanted, numbers, strict=True)]
    return [round(2**16 * one) for one in each]


def shares_asked(probability, o):
    """Regions of the output: of each pixel its region and what is asked, and the charges of each region's categories.

    With proportions there is one; else pixels with the same probabilities in sixteenths that are connected, but parts
    of fewer than 256 pixels are together. The part of a region that lacks neighbours is another, if it has 256 pixels.
    """
    found = SimpleNamespace(of={}, p={}, bordered=[])
    if probability is None or not (o.proportions or o.soft_weight):
        return found
    rows, cols = probability.shape[1:]
    sites = list(np.ndindex(rows, cols))
    if o.proportions:
        parts = {0: sites}
        found.p = {s: [one / sum(o.proportions) for one in o.proportions] for s in sites}
    else:
        found.p = {s: [float(plane[s]) for plane in probability] for s in sites}
        alike = {s: tuple(round(one * 16) for one in found.p[s]) for s in sites if found.p[s][0] == found.p[s][0]}
        parts = {}
        for s in alike:
            if s in found.of:
                continue
            part, left = [], [s]
            found.of[s] = None
            while left:
                i, j = left.pop()
                part.append((i, j))
                for r in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
                    if r not in found.of and alike.get(r) == alike[s]:
                        found.of[r] = None
                        left.append(r)
            parts.setdefault((alike[s], s if len(part) >= 256 else None), []).extend(part)
    radius = isqrt(o.order) if o.boundary == "open" else 0
    for number, part in enumerate(parts.values()):
        found.of |= dict.fromkeys(part, number)
        near = [s for s in part if min(s[0], rows - 1 - s[0], s[1], cols - 1 - s[1]) < radius]
        found.bordered.append(len(near) >= 256)
    found.charges = [[0] * len(probability) for _ in range(2 * len(parts))]
    return found


def region_of(level, s):
    """The number of a site's region, beyond those of all others if it lacks neighbours; None without one."""
    asked = level.asked
    number = asked.of.get(level.pixel(s))
    apart = number is not None and level.o.boundary == "open" and asked.bordered[number] and None in level.near[s]
    return number + len(asked.bordered) if apart else number


def charge(level, X):
    """After a sweep: a category of which a region has more sites than asked is charged more, in steps."""
    asked = level.asked
    if not asked.of:
        return
    kinds = range(len(asked.charges[0]))
    counts, due, sizes = ([[0] * len(kinds) for _ in asked.charges] for _ in range(3))
    for site in level.sites:
        s, region = level.pixel(site), region_of(level, site)
        if region is None:
            continue
        for k in kinds:
            due[region][k] += asked.p[s][k]
            sizes[region][k] += 1
        n, i, j = X.source[s].tolist()
        if X.t[s] < 1024 and (n, i, j) != NOWHERE:
            counts[region][level.Y.soft[0][1][n][i, j]] += 1
    for region, those in enumerate(counts):
        for k, n in enumerate(those):
            wanted = due[region][k] / max(1, sizes[region][k]) * sum(those)
            excess = (n - wanted) / max(n, wanted, 1) * sum(those) / (sum(those) + 4)
            asked.charges[region][k] += round(level.gain * excess)


def charged_too(level, s, cost):
    """Costs of the categories at a site with the charges of its region; the least of them is 0."""
    region = region_of(level, s)
    if region is None:
        return cost
    charges = [float32(one) * level.step_of_charge for one in level.asked.charges[region]]
    cost = [float32(a) + b for a, b in zip(cost, charges, strict=True)]
    return [one - min(cost) for one in cost]


def candidates_of(level, X, s, near, turn):
    """The numbers of the candidates that a site weighs; which of them continue a neighbour's source; and the number of
    each that does so, once for every such neighbour, and of each that is a neighbour's source, which counts 4 times.
    """
    suggested, charged = [], []
    for k, ((di, dj), r) in enumerate(zip(level.offsets, near, strict=True)):
        if r is None or r[2] == 1024 or r[3] == NOWHERE:  # as nothing has touched it yet
            continue
        n, i, j = r[3]
        one = level.number_of.get((n, i - di * level.spacing, j - dj * level.spacing))
        charged += [(one, 1), (level.number_of.get((n, i, j)), 4)]
        if level.all or k < SUGGESTING:
            suggested.append(one)
    if level.all:
        numbers = list(range(len(level.places)))
        return numbers, [p in suggested for p in numbers], [(p, n) for p, n in charged if p is not None]

    found = list(dict.fromkeys(p for p in suggested if p is not None))
    favoured = len(found)
    found.append(level.number_of.get(tuple(X.source[level.pixel(s)].tolist())))
    found = list(dict.fromkeys(p for p in found if p is not None))
    draws, those = max(level.chance, not found), range(len(level.places))
    if level.phased:
        those = level.of_phase[phase(level.Y.lattices[1], level.divisions, *level.pixel(s))]
    told = [(c, int(X.x[c][level.pixel(s)])) for c in range(-level.Y.told, 0)]
    told = [(c, x) for c, x in told if x != UNKNOWN]
    those = alike(level.around[-1], told) if told else those
    for k in range(draws):
        word = words(level.seed, level.number, turn, level.index(s), random.SEARCH, k // 4)[k % 4]
        found.append(those[word * len(those) >> 32])
    if (level.phased or level.Y.told) and len(those) <= draws:
        found[-draws:] = those
    found = list(dict.fromkeys(found))
    charged = [(found.index(p), n) for p, n in charged if p in found]
    return found, [k < favoured for k in range(len(found))], charged


def alike(own, told):
    """Candidates with about the known values: halves at the median of what varies most among them, down to 64."""
    those = list(range(len(own[0])))
    while len(those) > ALIKE and any(np.ptp(own[c][those]) for c, _ in told):
        c, x = max(told, key=lambda one: np.ptp(own[one[0]][those]))
        y = sorted(own[c][those].tolist())
        middle = max(y[len(y) // 2], y[0] + 1)
        those = [p for p in those if (own[c][p] < middle) == (x < middle)]
    return those


def distances(level, near, numbers):
    """d_p of equation (12) for each candidate, rounded after each term.

    There is a sum for each column, modulo 16, of the square around the neighbourhood, which is gone through row by row;
    a tree adds them up.
    """
    d, offsets = np.zeros((LANES, len(numbers)), float32), [*level.offsets, (0, 0)]
    inside = sorted((k for k, r in enumerate(near) if r is not None), key=lambda k: offsets[k])
    for k in inside:
        x, certain = near[k][:2]
        lane = (offsets[k][1] + isqrt(level.o.order)) % LANES
        for x_r, u, y_r in zip(x, certain, level.around[k], strict=True):
            e = (x_r - y_r[numbers]) * float(u)
            d[lane] = (e * e + d[lane].astype(float)).astype(float32)  # the double is exact
    while len(d) > 1:
        d = d[: len(d) // 2] + d[len(d) // 2 :]
    return d[0]


def apart_in_phase(level, s, numbers):
    """What each candidate costs for its place on the sample's lattice, rounded after each term; half a step is free."""
    of_pictures, of_output, certain, half = level.Y.waves
    free = round(certain**2 * half(level.step))
    d = np.zeros(len(numbers), float32)
    for c, plane in enumerate(of_output):
        for k, p in enumerate(numbers):
            n, i, j = level.places[p]
            e = (int(plane[level.pixel(s)]) - int(of_pictures[n][c][i, j])) * certain
            d[k] = float32(e * e + float(d[k]))  # the double is exact
    return np.maximum(d - float32(free), float32(0))


def misfit(level, s, numbers):
    """How far each candidate is from the data around a site, each compared where it lies, rounded after each term."""
    d = np.zeros(len(numbers), float32)
    for datum, apart in level.between.get(s, []):
        for c, x in enumerate(level.Y.given[datum][0]):
            for k, p in enumerate(numbers if x != UNKNOWN else []):
                n, i, j = level.places[p]
                rows, cols = level.Y.usable[n].shape
                y = level.Y.planes[n][c][within(i + apart[0], rows, False), within(j + apart[1], cols, False)]
                e = (x - int(y)) * level.Y.hard
                d[k] = float32(e * e + float(d[k]))  # the double is exact
    return d


def of_kind(level, s, numbers):
    """What each candidate costs for its category, and its picture, if these are not as probable as they are frequent.

    w N C sigma^2 / 16 (m - ln(p / q)) with the greatest m of the site, in steps of 1/1024; 2^40 if p is 0.
    """
    d, places = np.zeros(len(numbers), float32), [level.places[p] for p in numbers]
    rate = level.o.soft_weight * len(level.offsets) * level.Y.matched * level.Y.variance / 16
    for number, (probability, of_pictures, shares) in enumerate(level.Y.soft):
        p = [float(plane[level.pixel(s)]) for plane in probability]
        p = shares if any(map(np.isnan, p)) else p
        said = [log(one / share) if one else None for one, share in zip(p, shares, strict=True)]
        most = max(one for one in said if one is not None)
        cost = [2.0**40 if one is None else min(2.0**40, rate * round((most - one) * 1024) / 1024) for one in said]
        cost = charged_too(level, s, cost) if number == 0 else cost
        for k, (n, i, j) in enumerate(places):
            d[k] += float32(cost[of_pictures[n][i, j]])
    return d


def weights(level, d):
    """Equation (7): floor(2^40 exp(-(d_p - min d) / 2h^2))."""
    a = (d - d.min()) * level.scale
    return [int(e * 2.0**40) if b < 28 else 0 for e, b in zip(exponential(-np.minimum(a, 28)), a, strict=True)]


def drawn(level, d, numbers, s, turn):
    """The Gibbs sampler: the candidate of least d_p - 2h^2 G_p and, of a density, a step from its grey levels."""
    density = level.o.pixel == "density"
    spread = float32(1) / level.scale
    total = fma(spread, noise(level, numbers, s, turn), d)
    p = min(zip(total, numbers, strict=True))[1]
    values = level.own[:, p].tolist()
    for c, y in enumerate(values if density else []):
        low, whole = mass(level, y)
        u = low + (words(level.seed, level.number, turn, level.index(s), random.DRAW, 1 + c)[0] * whole >> 32)
        step = next(k for k, end in enumerate(level.below_step) if end > u) - level.reach
        values[c] = y + step
    return values, p


def noise(level, numbers, s, turn):
    """-G_p of candidates, less the logarithms of the shares of the kernels around y_p that are legal.

    Candidates of a row that are a neighbour's distance apart are a run, and have their words by sixteens: four sixteens
    share one draw.
    """
    found, drawn = [], {}
    for p in numbers:
        row, col, cols, runs = 0, p, len(level.places), 1
        if level.all:
            row, col = (level.lines[axis].index(level.at[p][axis]) for axis in (0, 1))
            cols = len(level.lines[1])
            runs = min(level.spacing // level.step, cols)
        unit = (row * runs + col % runs) * -(-cols // (runs * UNIT)) + col // runs // UNIT
        attempt = unit // 4 * UNIT + col // runs % UNIT
        if attempt not in drawn:
            drawn[attempt] = words(level.seed, level.number, turn, level.index(s), random.GUMBEL, attempt)
        found.append(drawn[attempt][unit % 4])
    found = minus_gumbel(found)
    for y in level.own[:, numbers] if level.o.pixel == "density" else []:
        found = found - (logarithm([mass(level, y_p)[1] for y_p in y]) - float32(22.1807098))
    return found


def mode(level, d):
    """ICM over grey levels: the first of the most probable ones, a channel's given the others', all of them twice.

    The candidate is the one that most of the density there comes from.
    """
    w, near = weights(level, d), int(d.argmin())
    values = level.own[:, near].tolist()

    def given(p, but):
        found = w[p]
        for c, x in enumerate(values):
            found = found if c == but else int(float32(found) * level.kernel[abs(x - level.own[c, p])])
        return found

    for c in [*range(len(values))] * (2 if len(values) > 1 else 1):
        grey, f = level.own[c].tolist(), np.zeros(level.top + 1, float32)
        for y in sorted(set(grey)):
            weight = float32(sum(given(p, c) for p in range(len(w)) if grey[p] == y))
            f = fma(weight, level.kernel[abs(np.arange(len(f)) - y)], f)
        values[c] = f.tolist().index(max(f))
    share = [given(p, None) for p in range(len(w))]
    return values, share.index(max(share))


def mass(level, y):
    """Where the steps that stay between 0 and top begin in the cumulative Gaussian, and what they come to."""
    ends = [0, *level.below_step]
    low = ends[max(0, level.reach - y)]
    return low, ends[min(2 * level.reach, level.reach + level.top - y) + 1] - low
