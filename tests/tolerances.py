"""Every tolerance of the tests, in one place, each with its reason.

What is not here is compared byte for byte.
"""

EXP32 = 2.5e-7
"""Relative error of exp32 against float64: the bound that kernels/common/exp.h states. A polynomial of degree 6 on
|r| <= log(2) / 2 (about 1.2e-7 with its coefficients and steps rounded to float32) after a reduction in two parts."""

LOG32 = 1.2e-6
"""Absolute error of log32 from 2**-33 to 2**24 against float64: the bound that kernels/common/log.h states. The size of
the result is below 23, where a float32 is rounded by half of 2**-19, about 1e-6."""

GUMBEL = 2e-6
"""Absolute error of the noise of a draw, of at most 23, against float64: two logarithms, the second of a number whose
relative error is about 3e-7. The odds of two candidates are off by twice that."""

LCPDF = 1e-5
"""Absolute error of a probability of `simdtex.lcpdf` against equations (6) to (8) and (12) in float64, as its docstring
states. Distances and their product with 1 / 2h^2 are float32 (24 bits), so an exponent of up to 28 is off by up to
28 * 2**-23 or so, and weights below 2**-40 of the largest are 0; sums over up to 4096 levels add little."""

SIGNIFICANCE = 1e-4
"""Of every chi-square test of a draw. Seeds are fixed, so a test that passes keeps passing; over all of them a correct
sampler would have failed one in a few hundred choices of the seeds."""

CONTRAST = 1e-12
"""Relative error of plain float64 expressions of a few operations against each other."""

TAP = 0.5 + 1e-9
"""Of a tap of the filter bank, in its units of 2**-14, against the float64 formula: it is the closest integer. The
rest is for what another libm rounds otherwise. The centre makes up for the others, so what is exact is the sum, 0."""

HALF = 0.5 + 1e-6
"""Of an integer against the float64 that it is the closest to. The rest is for float64 itself, at up to 2**30."""

GAIN = 0.005
"""Of a value with contrast compressed, before it is rounded: up to 180, from a logarithm that is off by 1.2e-6 of 0.18
or more, an exponential and four float32 roundings."""

UNIT32 = 2.0**-24
"""Relative error of one float32 rounding: n products and sums in a row are off by about n of these at most."""


RECONSTRUCTION = {1: 0.0035, 2: 0.015, 4: 0.012, 6: 0.032}
"""What a steerable pyramid loses of white noise on an even torus, rms relative to its standard deviation, by number of
orientations. The filters are small and invert only nearly: 0.0031, 0.0142, 0.0114 and 0.0301 are the most of
seventeen pictures and 1 to 3 levels; those with an odd side are folded."""


DECORRELATED = 1e-4
"""Of the variances of decorrelated channels against 1; and of their covariances against 0, times the lesser of the two
deviations over the largest. Coefficients of axes are whole multiples of 2**-14, off by 3e-5: 6.7e-5 is the most."""

DIRECTION = 5e-3
"""Of a coefficient of the decorrelating transform against a plain singular value decomposition, relative to the
largest. Roundings to 2**-14 turn axes, and deviations of a few units are rounded: 2.5e-3 is the most of 3000
pictures."""


PLAIN_TEXTURE = {0: 0.999, 1: 0.99, 2: 0.95, 5: 0.6}
"""Share of pixels that are those of Match-texture in float64, by iterations. Ours are rounded at every step, which may
change the order of two values that nearly agree; 0.9997, 0.998, 0.965 and 0.71 are the least of eleven runs."""

SEAM = 0.1
"""Of the gradient across the seam of a torus over that inside, against 1, for the mean of six pictures of some 96
pixels a side: one of them may be off by 0.15."""


HALVES = 0.15
"""Difference of the means of two halves of 64 x 64 pixels, in standard deviations, averaged over four pictures: 0.059
is the most of up and down, left and right."""

KEPT = 0.99
"""Correlation with the sample of what is made with the sample as start, which already has all histograms: 0.9966."""

SPREAD = {"channels": 0.02, "decorrelate": 0.1}
"""Relative error of a channel's standard deviation. Decorrelated channels are matched one by one and may come out a bit
correlated, which shows once they are turned back: 0.063 of a striped picture of 32 x 32."""

SLICE_PIXELS = {"together": (0.45, 0.85), "each": (0.06, 0.13), "paper": (0.13, 0.25), "oblique": (0.22, 0.6)}
"""Wasserstein distance of a slice's pixels from the sample's, in its standard deviations, the mean of a family's and
the largest, of blocks of 32 a side. Slices that are matched together may be darker than each other: 0.37 and 0.72 are
the most of gravel and grass. Matched each, 0.042 and 0.092; each and averaged, 0.10 and 0.18. Nothing matches oblique
ones, which have the more freedom the smaller they are: 0.16 and 0.53, of 40 a side."""

SLICE_SUBBANDS = {"together": 0.09, "each": 0.12, "paper": 0.14, "oblique": 0.13, "oblique high": 0.36}
"""The same of a family's subbands, all slices together, the largest: 0.066, 0.089, 0.113, 0.094 and 0.298 are the most;
of noise it is 2.4."""


SOLID_SEAM = 0.15
"""As SEAM, for a block of 32 a side, whose faces are small: 0.19 is the most of one, 0.055 of the mean of six."""

PALETTE = 0.01
"""Of the means of a mixture's channels against those of its palette, in standard deviations, and, twice that, of
their covariances relative to the largest: channels are matched one by one and may come out a bit correlated, 0.0023."""

MIXED_BANDS = 0.2
"""As SLICE_SUBBANDS, of a mixture of low and high frequencies, whose pixels and subbands come from different pictures:
0.162 is the most."""
