"""A sample, its guides and what is given of an output as whole grey levels, in plain loops: see `plain_mrf`.

A place is (number of the picture, row, column), and nowhere is (-1, -1, -1). Planes are grey levels of a channel,
[row, column], one for each picture of the sample.
"""

from fractions import Fraction
from itertools import product
from math import cos, floor, isqrt, log2, pi, sin, sqrt
from operator import mul
from types import SimpleNamespace

import numpy as np
import plain
from scipy import ndimage

from simdtex.model.pictures import Pictures
from simdtex.model.regularity import parse_lattice
from simdtex.model.regularity import phases as engine_phases

NOWHERE = (-1, -1, -1)
UNKNOWN = -1


def material(pictures, o, shape, mask=None, known=None, known_source=None, guide=None, maps=None, lattices=None):
    """Y: the pictures, whole where they have gaps, and everything that is matched, as grey levels."""
    gaps = [np.isnan(y).any(-1) if y.dtype.kind == "f" else np.zeros(y.shape[:2], bool) for y in pictures]
    Y = SimpleNamespace(gaps=gaps, pictures=[completed(*pair) for pair in zip(pictures, gaps, strict=True)])
    Y.usable = [~gap & (True if mask is None else mask[n]) for n, gap in enumerate(gaps)]
    Y.clean = len(pictures) == 1 and mask is None and not gaps[0].any()
    Y.eight = pictures[0].dtype in (np.bool_, np.uint8)
    Y.variables = [
        np.concatenate([y[~gap][:, v] for y, gap in zip(Y.pictures, gaps, strict=True)]).tolist()
        for v in range(pictures[0].shape[-1])
    ]
    Y.categories = [sorted(set(v)) if named(o, k) else None for k, v in enumerate(Y.variables)]

    Y.whole = None if known is None else ~np.ma.getmaskarray(known).any(-1)
    partly = None if known is None else ~np.ma.getmaskarray(known) & ~Y.whole[..., None]
    colocated = known is not None and bool(partly.any())
    beside = ([] if guide is None else [labelled(guide, o)]) + [None] * colocated
    N, channels = len(plain.offsets(o.order)), sum(1 if c is None else one_hot(c) for c in Y.categories)
    alone = [c for v, c in enumerate(Y.categories) if colocated and partly[..., v].any()]
    Y.told = sum(1 if c is None else one_hot(c) for c in alone)  # channels of variables known where others are not
    channels += bool(o.structure) + Y.told + sum(channels_of(g) for g in beside if g is not None)
    lattices = lattices or repeated(pictures, o, shape, known, known_source)
    maps = maps or {}
    heavy = max(1, o.data_weight, N / 4) if known is not None or beside or "region" in maps else 1
    Y.own_known = round(4 * sqrt(N * max(1, o.data_weight, N / 4)))  # how certain such a variable is at the site itself
    values = round(heavy * (channels * N + len(beside))) + Y.told * Y.own_known**2
    Y.height = 2 ** min(12, int((33 - log2(values)) / 2)) - 1  # so that every distance is exact in float64

    Y.direct = not o.weights and not any(Y.categories)  # the channels of grey levels are those of the pixels
    owner, Y.levels_of, Y.top, Y.unit = scale(Y, o)
    planes = [Y.levels_of(y) for y in Y.pictures]
    Y.shown, spread = len(planes[0]), variance(planes) * len(planes[0])
    if o.structure:
        more = structure(planes, o.structure, max(Y.top, 1023))
        planes = [[*y, plane] for y, plane in zip(planes, more, strict=True)]
    Y.matched, Y.variance = len(planes[0]), variance(planes)
    Y.guides = []  # what the output is told, with UNKNOWN
    if guide is not None:
        more, told = guide_planes(labelled(guide, o), o, spread, Y.height)
        Y.guides += told
        planes = [[*y, *these] for y, these in zip(planes, more, strict=True)]
    if colocated:
        those = [c for c, v in enumerate(owner) if partly[..., v].any()]
        levels = Y.levels_of(np.ma.getdata(known).astype(pictures[0].dtype))
        Y.guides += [np.where(partly[..., owner[c]], levels[c], UNKNOWN) for c in those]
        planes = [[*y, *(y[c] for c in those)] for y in planes]
    Y.waves = None  # of the pictures and of the output
    if lattices:
        raised = min(sqrt(2 * spread / 4), Y.height / 2)
        Y.lattices = lattices
        own = [phases(one, raised, *y[0].shape) for y, one in zip(planes, lattices[0], strict=True)]
        half = lambda step: apart(lattices[1], step / 2) * raised**2  # noqa: E731
        Y.waves = own, phases(lattices[1], raised, *shape), round(sqrt(5 / 4 * N)), half
    Y.planes = planes

    Y.given = {}  # of sites that are known: grey levels of the matched channels, and where they are from
    for s in [] if known is None else map(tuple, np.argwhere(Y.whole)):
        place = NOWHERE if known_source is None else place_of(known_source[s])
        told = Y.levels_of(np.ma.getdata(known)[s][None, None].astype(pictures[0].dtype))
        told = [int(plane[0, 0]) for plane in told] + [UNKNOWN] * (Y.matched - Y.shown)
        if place != NOWHERE:
            told = [int(plane[place[1:]]) for plane in planes[place[0]][: Y.matched]]
        Y.given[s] = (told, place)
    outside = [] if "region" not in maps else map(tuple, np.argwhere(~maps["region"]))
    Y.outside = {s: ([UNKNOWN] * Y.matched, NOWHERE) for s in outside}  # known, and nothing is compared with them
    Y.whole = np.zeros(shape, bool) if Y.outside and known is None else Y.whole
    Y.given |= Y.outside
    Y.soft = [soft(Y, maps[name], name) for name in ("categories", "images") if name in maps]
    Y.own = bool(Y.guides) or any(place == NOWHERE for _, place in Y.given.values())
    Y.centre, Y.hard = max(1, round(sqrt(N) / 2)), round(8 * sqrt(o.data_weight)) / 8
    return Y


def soft(Y, probability, name):
    """Probabilities of kinds, the kind of each pixel of the pictures, and the share of each among usable pixels."""
    of_pictures = [np.full(y.shape[:2], n) for n, y in enumerate(Y.pictures)]
    if name == "categories":
        lists = [y[..., 0].tolist() for y in Y.pictures]
        of_pictures = [np.array([[Y.categories[0].index(v) for v in row] for row in one]) for one in lists]
    there = [int(k) for of, usable in zip(of_pictures, Y.usable, strict=True) for k in of[usable]]
    counts = [max(1, there.count(k)) for k in range(len(probability))]
    return probability, of_pictures, [n / sum(counts) for n in counts]


def lay(Y, levels, o):
    """Where the pictures lie below one another, with margins, in one canvas: their first rows, its size and width."""
    step = 2 ** (levels - 1)
    margin, top, Y.tops = isqrt(o.order) * step, 0, []
    apart = max(2 * margin, int(2.5 * o.finish))  # no picture is within reach of another
    for y in Y.pictures:
        Y.tops.append(top)
        top += -(-(len(y) + apart) // step) * step
    Y.canvas = (Y.tops[-1] + len(Y.pictures[-1]), max(y.shape[1] for y in Y.pictures))
    Y.pitch = Y.canvas[1] + 2 * margin


def completed(picture, gap):
    """Unknown pixels replaced by the nearest known one; of several equally near, whichever scipy takes."""
    if not gap.any():
        return picture
    row, col = ndimage.distance_transform_edt(gap, return_distances=False, return_indices=True)
    return picture[row, col]


def place_of(entry):
    """A place from a row of a source map: (row, column) or (row, column, picture)."""
    row, col, *number = (int(n) for n in entry)
    return NOWHERE if row < 0 else (*(number or [0]), row, col)


def named(o, variable):
    """Whether a variable's numbers name categories."""
    return o.categorical if isinstance(o.categorical, bool) else variable in o.categorical


def one_hot(names):
    """Channels for so many names: of two, one says which."""
    return 1 if len(names) < 3 else len(names)


def scale(Y, o):
    """The variable of each channel; what makes pixels planes of grey levels; the highest level; 1 of each in pixels."""
    ends = [(min(values), max(values)) for values in Y.variables]
    if Y.direct:
        variables = list(range(len(ends)))
        if Y.eight:
            return variables, lambda y: [plane.astype(int) for plane in np.moveaxis(y, -1, 0)], 255, [1.0] * len(ends)
        common = min(low for low, _ in ends), max(high for _, high in ends)
        unit = float(Fraction(common[1]) - Fraction(common[0])) / Y.height or 1.0
        alike = [unit] * len(ends)
        return (
            variables,
            lambda y: [stretched(plane, common, Y.height) for plane in np.moveaxis(y, -1, 0)],
            Y.height,
            alike,
        )

    spreads, steep, owner = [], [], []  # steep: how high a channel would be of which pixels vary by 1
    for v, (values, categories) in enumerate(zip(Y.variables, Y.categories, strict=True)):
        spreads.append(deviation(stretched(np.array(values), ends[v], Y.height).tolist()))
        differing = 1 - sum(values.count(c) ** 2 for c in categories or []) / len(values) ** 2
        if categories is None:
            steep.append(Y.height / spreads[v] if spreads[v] else 0.0)
        else:  # in two channels, or one, where two pixels differ
            steep.append(sqrt(2 / ((1 if len(categories) == 2 else 2) * differing)) if differing else 0.0)
        owner += [v] * (1 if categories is None else one_hot(categories))
    weights = o.weights or [1.0] * len(steep)
    most = max(w * s for w, s in zip(weights, steep, strict=True))
    by = [w / most * Y.height if most else 0.0 for w in weights]

    def levels(y):
        planes = []
        for v, plane in enumerate(np.moveaxis(y, -1, 0)):
            if Y.categories[v] is None:
                whole, factor = stretched(plane, ends[v], Y.height), by[v] / spreads[v] if spreads[v] else 0.0
                planes.append(np.array([[round(t * factor) for t in row] for row in whole.tolist()]))
            else:
                planes += [(plane == c) * round(by[v] * steep[v]) for c in names(Y.categories[v])]
                planes += [] if len(Y.categories[v]) > 1 else [np.zeros(plane.shape, int)]
        return planes

    units = []  # of variables, which are the channels wherever a finish asks
    for (low, high), spread, factor in zip(ends, spreads, by, strict=True):
        units.append(float(high - low) / Y.height * spread / factor if factor else 0.0)
    return owner, levels, Y.height, units


def names(categories):
    """Those that have a channel: of two, the second."""
    return categories[1:] if len(categories) < 3 else categories


def stretched(plane, ends, top):
    """Numbers as whole ones from 0 to top, those beyond the ends as the ends."""
    least, most = (Fraction(end) for end in ends)
    if least == most:
        return np.zeros(plane.shape, int)
    whole = [round((min(max(Fraction(v), least), most) - least) * top / (most - least)) for v in plane.ravel().tolist()]
    return np.array(whole).reshape(plane.shape)


def deviation(values):
    """Standard deviation of whole numbers."""
    return sqrt((len(values) * sum(v * v for v in values) - sum(values) ** 2) / len(values) ** 2)


def variance(planes):
    """sigma^2 of equation (8): the mean over channels, of all pictures together."""
    greys, total = [[v for y in planes for v in y[c].ravel().tolist()] for c in range(len(planes[0]))], 0.0
    for g in greys:  # Python's own sum of doubles rounds in another way
        total += (len(g) * sum(v * v for v in g) - sum(g) ** 2) / len(g) ** 2
    return total / len(greys)


def structure(pictures, weight, most):
    """The signed distance to the border of bright and dark, from 0 up, with this weight where 0..most holds it."""
    smooth = [[smoothed(plane) for plane in y] for y in pictures]
    by, signed = principal(smooth), []
    for y in smooth:
        tone = sum(w * plane for w, plane in zip(by, y, strict=True))
        bright = tone * 19 * 19 * 21**4 > surroundings(tone)
        signed.append(np.zeros(bright.shape, int))  # in 1/256 of a pixel
        for i, j in np.ndindex(*bright.shape):
            others = np.argwhere(bright != bright[i, j])
            nearest = min([256, *((others - (i, j)) ** 2).sum(1).tolist()])  # 16 pixels at most
            signed[-1][i, j] = (round(sqrt(nearest) * 256) - 128) * (1 if bright[i, j] else -1)
    least = min(int(one.min()) for one in signed)
    signed = [one - least for one in signed]
    spread = sqrt(variance([[one] for one in signed]))
    if not spread:
        return signed
    by = min(weight * sqrt(variance(pictures)) / spread, most / max(int(one.max()) for one in signed))
    return [np.array([[round(v * by) for v in row] for row in one.tolist()]) for one in signed]


def smoothed(plane):
    """256 times a plane that is smoothed by (1 4 6 4 1)/16 along rows and columns."""
    found = np.zeros(plane.shape, int)
    for i, j, a, b in product(*map(range, plane.shape), range(-2, 3), range(-2, 3)):
        weights = (1, 4, 6, 4, 1)[a + 2] * (1, 4, 6, 4, 1)[b + 2]
        found[i, j] += weights * plane[clamped(i + a, len(plane)), clamped(j + b, plane.shape[1])]
    return found


def surroundings(tone):
    """Sums over running means of 19, 21 and 21 pixels, along columns and rows; mirrored beyond the borders."""
    weights = np.convolve(np.convolve([1] * 19, [1] * 21), [1] * 21).tolist()
    for _ in range(2):
        n, found = len(tone), np.zeros(tone.shape, int)
        for i, k in product(range(n), range(59)):
            at = (i + k - 29) % (2 * n)
            found[i] += weights[k] * tone[min(at, 2 * n - 1 - at)]
        tone = found.T
    return tone


def principal(pictures):
    """The first principal component of planes, in whole numbers up to 127: the 4096th power of their covariance."""
    flat = [[v for y in pictures for v in y[c].ravel().tolist()] for c in range(len(pictures[0]))]
    n, each = len(flat[0]), range(len(flat))
    power = [[n * sum(map(mul, flat[a], flat[b])) - sum(flat[a]) * sum(flat[b]) for b in each] for a in each]
    for _ in range(12):
        power = [[sum(power[a][c] * power[c][b] for c in each) for b in each] for a in each]
    longest = max(power, key=lambda row: max(map(abs, row)))
    most = max(map(abs, longest))
    if not most:
        return [1 for _ in each]
    whole = [floor(Fraction(127 * v, most) + Fraction(1, 2)) for v in longest]
    negative = sum(whole) < 0 or (sum(whole) == 0 and next(v for v in whole if v) < 0)
    return [-v if negative else v for v in whole]


def repeated(pictures, o, shape, known, known_source):
    """The lattices of the pictures and of the output, as the engine finds them; None without."""
    vectors = parse_lattice(o.lattice)
    if vectors is None or o.categorical or o.pixel == "density":
        return None
    whole = None if known is None else ~np.ma.getmaskarray(known).any(-1)
    told = None if known is None or not whole.any() else (np.ma.getdata(known), whole, known_source)
    found = engine_phases(Pictures(tuple(pictures), weights=o.weights), shape, o.boundary == "torus", vectors, told)
    return found and found[:2]


def phases(lattice, raised, rows, cols):
    """Cosine and sine of both phases of every pixel on a lattice, as grey levels."""
    (a, b), (c, d), (top, left) = lattice
    planes = [np.zeros((rows, cols), int) for _ in range(4)]
    for i, j in np.ndindex(rows, cols):
        y, x = i - top, j - left
        for k, along in enumerate(((y * d - x * c) / (a * d - b * c), (x * a - y * b) / (a * d - b * c))):
            for plane, wave in zip(planes[2 * k : 2 * k + 2], (cos, sin), strict=True):
                plane[i, j] = round((1 + round(wave(2 * pi * along) * 2**20) / 2**20) * raised)
    return planes


def apart(lattice, pixels):
    """The squared difference of the waves of points so many pixels apart: the mean of one below and one beside."""
    (a, b), (c, d), _ = lattice
    area, total = a * d - b * c, 0
    for along in ((pixels * d) / area, (-pixels * b) / area, (-pixels * c) / area, (pixels * a) / area):
        total += (cos(2 * pi * along) - 1) ** 2 + sin(2 * pi * along) ** 2
    return total / 2


def clamped(i, n):
    """Index i brought to 0 .. n-1: the outermost stands for all beyond."""
    return min(max(i, 0), n - 1)


def labelled(guide, o):
    """The guide's pictures (rows, columns, channels), that of the output, and whether their numbers are labels."""
    of_pictures, output = guide
    labels = o.labels
    if labels is None:
        whole = all(one.dtype.kind in "biu" for one in (*of_pictures, output))
        labels = whole and all(len(set(one.ravel().tolist())) <= 16 for one in of_pictures)
    return of_pictures, output, labels


def channels_of(guide):
    """Channels of grey levels: one for each of three labels or more."""
    of_pictures, output, labels = guide
    if not labels:
        return output.shape[-1]
    return sum(one_hot(labels_of(of_pictures, k)) for k in range(output.shape[-1]))


def labels_of(of_pictures, k):
    """All labels of a channel, in ascending order."""
    return sorted({v for one in of_pictures for v in one[..., k].ravel().tolist()})


def guide_planes(guide, o, spread, top):
    """Planes of the guide for each picture, and for the output; spread is what the pixels' channels vary in all."""
    of_pictures, output, labels = guide
    silent = np.isnan(output).any(-1) if output.dtype.kind == "f" else np.zeros(output.shape[:2], bool)
    planes, told = [[] for _ in of_pictures], []
    for k in range(output.shape[-1]):
        here, asked = [one[..., k] for one in of_pictures], output[..., k]
        if labels:
            found = labels_of(of_pictures, k)
            one = [[(y == name).astype(int) for name in names(found)] for y in here]
            wanted, most = [(asked == name).astype(int) for name in names(found)], 1
            if len(found) == 1:
                one, wanted = [[np.zeros(y.shape, int)] for y in here], [np.zeros(asked.shape, int)]
        else:
            every = [v for y in (*here, asked[~silent]) for v in y.ravel().tolist()]
            ends, most = (min(every), max(every)), top
            one = [[stretched(y, ends, top)] for y in here]
            wanted = [stretched(np.where(silent, ends[0], asked), ends, top)]
        varies = sum(variance([[y[c]] for y in one]) for c in range(len(wanted)))
        height = float(top) if o.guide_weight else 0.0
        if varies:
            height = min(sqrt(o.guide_weight * spread / output.shape[-1] / varies) * most, top)

        def raised(plane, height=height, most=most):
            return np.array([[round(v * (height / most)) for v in row] for row in plane.tolist()])

        for mine, y in zip(planes, one, strict=True):
            mine += [raised(plane) for plane in y]
        told += [np.where(silent, UNKNOWN, raised(plane)) for plane in wanted]
    return planes, told


def between(known, spacing, torus):
    """The known pixels between the sites of a lattice, where none of the up to four sites around is known."""

    def around(i, axis):
        """The one or two lattice lines around a line."""
        lines = len(range(0, known.shape[axis], spacing))
        those = {i // spacing, -(-i // spacing)}
        return {k % lines if torus else min(k, lines - 1) for k in those}

    return [
        (i, j)
        for i, j in map(tuple, np.argwhere(known).tolist())
        if (i % spacing or j % spacing)
        and not any(known[a * spacing, b * spacing] for a in around(i, 0) for b in around(j, 1))
    ]


def stand_ins(known, spacing, torus):
    """{site: datum}: pixels of a level's lattice that stand for known ones between them.

    A datum goes to the nearest row and column of the lattice, halves down the picture and to the right, unless one of
    the up to four sites around it is known itself; of several the nearest, and of those the first, row by row.
    """
    shape, found = known.shape, {}

    def nearest(i, axis):
        """The lattice line that a line goes to, and the distance to it."""
        lines = len(range(0, shape[axis], spacing))
        to = (i + spacing // 2) // spacing
        if torus:
            return to % lines, abs(min(to * spacing, shape[axis]) - i)  # a torus ends where it begins again
        to = min(to, lines - 1)
        return to, abs(to * spacing - i)

    for i, j in between(known, spacing, torus):
        (row, down), (col, right) = nearest(i, 0), nearest(j, 1)
        site = (row * spacing, col * spacing)
        found[site] = min(found.get(site, (np.inf,)), (down**2 + right**2, i, j))
    return {site: (i, j) for site, (_, i, j) in found.items()}
