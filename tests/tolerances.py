"""Every tolerance of the tests, in one place, each with its reason. What is not here is compared byte for byte."""

EXP32 = 2.5e-7
"""Relative error of exp32: the bound of kernels/common/exp.h, of a polynomial of degree 6 in float32."""

LOG32 = 1.2e-6
"""Absolute error of log32 from 2**-33 to 2**24: the bound of kernels/common/log.h, of results below 23."""

GUMBEL = 2e-6
"""Absolute error of the noise of a draw, of at most 23: two logarithms."""

LCPDF = 1e-5
"""Absolute error of a probability of `simdtex.lcpdf`, as its docstring states: distances are float32, so an exponent of
up to 28 is off by 28 * 2**-23, and weights below 2**-40 of the largest are 0."""

SIGNIFICANCE = 1e-4
"""Of every chi-square test of a draw: over all of them a correct sampler fails for one in a few hundred seeds."""

CONTRAST = 1e-12
"""Relative error of plain float64 expressions of a few operations against each other."""

TAP = 0.5 + 1e-9
"""Of a tap of the filter bank, in its units of 2**-14: the closest integer. The rest is for another libm."""

HALF = 0.5 + 1e-6
"""Of an integer against the float64 that it is the closest to. The rest is for float64 itself, at up to 2**30."""

GAIN = 0.005
"""Of a value of up to 180 with contrast compressed: a logarithm off by 1.2e-6 of 0.18 or more, and an exponential."""

UNIT32 = 2.0**-24
"""Relative error of one float32 rounding: n products and sums in a row are off by about n of these at most."""

RECONSTRUCTION = {1: 0.0035, 2: 0.015, 4: 0.012, 6: 0.032}
"""What a steerable pyramid loses of white noise, rms in standard deviations, by orientations: the filters invert only
nearly, and 0.0031, 0.0142, 0.0114 and 0.0301 are the most of seventeen pictures."""

DECORRELATED = 1e-4
"""Of the variances of decorrelated channels against 1, and of covariances against 0: axes are multiples of 2**-14, and
6.7e-5 is the most."""

DIRECTION = 5e-3
"""Of a coefficient of the decorrelating transform, relative to the largest: 2.5e-3 is the most of 3000 pictures."""

PLAIN_TEXTURE = {0: 0.999, 1: 0.99, 2: 0.95, 5: 0.6}
"""Share of pixels that are those of Match-texture in float64, by iterations; ours are rounded at every step. 0.9997,
0.998, 0.965 and 0.71 are the least of eleven runs."""

SEAM = 0.1
"""Of the gradient across the seam of a torus over that inside, against 1, for the mean of six pictures."""

HALVES = 0.15
"""Difference of the means of two halves, in standard deviations, averaged over four pictures: 0.059 is the most."""

KEPT = 0.99
"""Correlation with the sample of what is made with the sample as start: 0.9966."""

SPREAD = {"channels": 0.02, "decorrelate": 0.1}
"""Relative error of a channel's standard deviation. Decorrelated channels may come out a bit correlated: 0.063."""

SLICE_PIXELS = {"together": (0.45, 0.85), "each": (0.06, 0.13), "paper": (0.13, 0.25), "oblique": (0.22, 0.6)}
"""Wasserstein distance of a slice's pixels from the sample's, in its standard deviations, the mean of a family and the
largest: (0.37, 0.72), (0.042, 0.092), (0.10, 0.18) and (0.16, 0.53) are the most of gravel and grass."""

SLICE_SUBBANDS = {"together": 0.09, "each": 0.12, "paper": 0.14, "oblique": 0.13, "oblique high": 0.36}
"""The same of a family's subbands, the largest: 0.066, 0.089, 0.113, 0.094 and 0.298 are the most; of noise 2.4."""

SOLID_SEAM = 0.15
"""As SEAM, for a block of 32 a side, whose faces are small: 0.055 of the mean of six."""

PALETTE = 0.01
"""Of the means of a mixture's channels against those of its palette, in standard deviations, and, twice that, of
their covariances relative to the largest: 0.0023."""

MIXED_BANDS = 0.2
"""As SLICE_SUBBANDS, of a mixture of low and high frequencies of different pictures: 0.162 is the most."""
