// SPDX-License-Identifier: BSD-3-Clause
// Equation (12): d = sum over neighbours r of ((x_r - y_r)(1 - t_r))^2, each term two fused multiply-adds.

// (x_r - y_r)(1 - t_r), of scalars or vectors: u = 1 - t_r and xu = x_r (1 - t_r). A sum takes it as fma(e, e, d).
#define GAP(y, u, xu) fma(-(y), u, xu)

// a b, rounded, of scalars. Compilers that contract a product and a sum in spite of FP_CONTRACT OFF leave it as it is.
#define PRODUCT(a, b) fma(a, b, 0.0f)
