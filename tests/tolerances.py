"""Every tolerance of the tests, in one place, each with its reason.

What is not here is compared byte for byte.
"""

EXP32 = 2.5e-7
"""Relative error of exp32 against float64: the bound that kernels/common/exp.h states. A polynomial of degree 6 on
|r| <= log(2) / 2 (about 1.2e-7 with its coefficients and steps rounded to float32) after a reduction in two parts."""

LCPDF = 1e-5
"""Absolute error of a probability of `simdtex.lcpdf` against equations (6) to (8) and (12) in float64, as its docstring
states. Distances and their product with 1 / 2h^2 are float32 (24 bits), so an exponent of up to 28 is off by up to
28 * 2**-23 or so, and weights below 2**-40 of the largest are 0; sums over up to 4096 levels add little."""

NEAR_TIE = 1e-5
"""Relative gap between the two highest densities below which ICM may take either mode: its densities carry the float32
rounding of LCPDF."""

SIGNIFICANCE = 1e-4
"""Of every chi-square test of a draw. Seeds are fixed, so a test that passes keeps passing; over all of them a correct
sampler would have failed one in a few hundred choices of the seeds."""

CONTRAST = 1e-12
"""Relative error of plain float64 expressions of a few operations against each other."""

TAP = 0.5 + 1e-9
"""Of a tap of the filter bank, in its units of 2**-14, against the float64 formula: it is the closest whole number. The
rest is for what another libm rounds otherwise. The centre makes up for the others, so what is exact is the sum, 0."""

HALF = 0.5 + 1e-6
"""Of a whole number against the float64 that it is the closest to. The rest is for float64 itself, at up to 2**30."""

UNIT32 = 2.0**-24
"""Relative error of one float32 rounding: n products and sums in a row are off by about n of these at most."""

PYRTOOLS = 1e-4
"""Of a steerable pyramid's subband against that of pyrtools, relative to its largest value. Its taps and
sums are float64; ours are float32, and rounded to whole numbers at every level, of pictures of +-2**20: 1e-5 seen."""

RECONSTRUCTION = {1: 0.0035, 2: 0.015, 4: 0.0115, 6: 0.03}
"""What a steerable pyramid loses of white noise on an even torus, rms relative to its standard deviation, by number of
orientations. The filters are small and invert only nearly: 0.0030, 0.0140, 0.0111 and 0.0285 are the most of nine
pictures and 1 to 3 levels."""

PARSEVAL = {1: 0.001, 2: 0.003, 4: 0.002, 6: 0.007}
"""Relative error of the sum of squares of a steerable pyramid of white noise, by orientations, for the same reason:
0.0005, 0.0026, 0.0013 and 0.0058 are the most of the same pictures."""

ODD_TORUS = 0.1
"""As RECONSTRUCTION, for a torus of 65 x 97 pixels: at the seam, even rows and columns meet even ones where they are
halved. 0.0873 is the most of four pictures, 1 to 3 levels and every bank."""

DECORRELATED = 2e-3
"""Of the covariance of decorrelated channels against the unit matrix, times the ratio of the deviations it joins: axes
are whole multiples of 2**-14, each coefficient off by 3e-5 at most, and there are five; 6e-4 is the most seen."""

DIRECTION = 2e-2
"""Of a coefficient of the decorrelating transform against a plain singular value decomposition, relative to the largest.
Roundings of 2**-15 turn axes, whose variances differ by 2 % of the largest at least, by less than this."""
