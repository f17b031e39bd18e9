"""The sums over all matches of the pose's least squares. Compiled by numba."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

from math import sqrt

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def normal_equations(T_camera_world, p_world, x, y, depth_m, inverse_sigma, fx, fy, huber, nearest_m):
    """Hessian (6, 6) and gradient (6,) of the Huber loss at a pose, and the sum (6, 6) of squares of the gradients.

    Three residuals a match: u and v with one common weight, and depth. The twist is a rotation w, then a translation t,
    from the left: with `Y = T X`, `dY = w x Y + t`. So for a residual with gradient g over Y, the derivative is
    `Y x g` over w and g over t. Everything is added in the order of the matches, so that the sums have the same bits
    for any number of threads.

    Args:
        T_camera_world: (4, 4).
        p_world: (N, 3) metres.
        x: (N,) where the points are seen, and
        y: (N,) likewise: pixels of the reference width, from the principal point.
        depth_m: (N,) measured.
        inverse_sigma: (N,) of the depth, 1/m.
        fx: focal length, pixels of the reference width.
        fy: likewise.
        huber: residuals up to here count in full: pixels of the reference width, and standard deviations of depth.
        nearest_m: points nearer than this to the image plane are projected as if they were so far.
    """
    T = T_camera_world
    hessian, gradient, spread = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    J, one = np.empty((3, 6)), np.empty(6)
    for n in range(len(p_world)):
        X, Y, Z = p_world[n, 0], p_world[n, 1], p_world[n, 2]
        px = T[0, 0] * X + T[0, 1] * Y + T[0, 2] * Z + T[0, 3]
        py = T[1, 0] * X + T[1, 1] * Y + T[1, 2] * Z + T[1, 3]
        pz = T[2, 0] * X + T[2, 1] * Y + T[2, 2] * Z + T[2, 3]
        inverse_z = 1.0 / max(pz, nearest_m)
        a, b, c = fx * inverse_z, fy * inverse_z, inverse_sigma[n]
        r_u, r_v, r_z = a * px - x[n], b * py - y[n], (pz - depth_m[n]) * c
        w_uv, w_z = huber / max(sqrt(r_u * r_u + r_v * r_v), huber), huber / max(abs(r_z), huber)
        g_u, g_v = -a * px * inverse_z, -b * py * inverse_z
        J[0, 0], J[0, 1], J[0, 2], J[0, 3], J[0, 4], J[0, 5] = py * g_u, pz * a - px * g_u, -py * a, a, 0.0, g_u
        J[1, 0], J[1, 1], J[1, 2], J[1, 3], J[1, 4], J[1, 5] = py * g_v - pz * b, -px * g_v, px * b, 0.0, b, g_v
        J[2, 0], J[2, 1], J[2, 2], J[2, 3], J[2, 4], J[2, 5] = py * c, -px * c, 0.0, 0.0, 0.0, c
        for i in range(6):
            one[i] = w_uv * (J[0, i] * r_u + J[1, i] * r_v) + w_z * J[2, i] * r_z
            gradient[i] += one[i]
            for j in range(i + 1):
                hessian[i, j] += w_uv * (J[0, i] * J[0, j] + J[1, i] * J[1, j]) + w_z * J[2, i] * J[2, j]
                spread[i, j] += one[i] * one[j]
    for i in range(6):
        for j in range(i):
            hessian[j, i], spread[j, i] = hessian[i, j], spread[i, j]
    return hessian, gradient, spread
