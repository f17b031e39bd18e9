"""Posing vertices, and the visibility buffer: the first half of the renderer's inner loops. Compiled by numba.

Homogeneous rasterisation (Olano and Greer, "Triangle scan conversion using 2D homogeneous coordinates", 1997): no
clipping against the view frustum. Pixel (x, y) has the ray r = ((x - cx) / fx, (y - cy) / fy, 1); a surface point is
P = z r with z the metric depth. For a triangle a, b, c in camera space write P = B0 a + B1 b + B2 c. Cramer's rule:

    B0 = z (r . e0) / det,  e0 = b x c;   B1: e1 = c x a;   B2: e2 = a x b;   det = a . (b x c)

* The pixel is inside where the three r . ei / det are >= 0, also with vertices behind the camera.
* B0 + B1 + B2 = 1 gives 1/z = r . (e0 + e1 + e2) / det: affine in x, exact perspective. Larger 1/z is nearer, and a
  cleared buffer is 0, infinitely far.
* det < 0: seen from the front, for counter-clockwise meshes.
* For triangles that cross the near plane, 1/z <= 1/near is a fourth half-plane, affine in x as the others.
* Two triangles at a shared edge compute exactly negated edge functions, hence the same crossing point, and the rule
  "x >= crossing on the left, x < crossing on the right" gives each pixel to one of them.

Why the same bytes everywhere: no fastmath, so LLVM neither reorders sums nor contracts a * b + c into a fused
multiply-add; only + - * / sqrt, floor, ceil and comparisons, which IEEE 754 rounds exactly; no libm, no BLAS. Threads
take bands of rows and no two write the same pixel.
"""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

# error_model="numpy": a division by zero gives inf, as IEEE says, without a test before each division.
KERNEL = {"cache": True, "nogil": True, "error_model": "numpy"}

f32 = np.float32

ROWS = 16
"""Rows of a triangle whose ends are found together."""
SMALL_BOX = f32(4)
"""Triangles whose box is smaller than so many pixels in width and height are drawn pixel by pixel."""
SMALL_MARGIN = f32(0.0005)
"""Pixels."""


@njit(**KERNEL)
def pose_vertices(rest, rest_normals, bones, weights, palette, first, last, attributes):
    """World position and normal (not unit) of vertices first..last-1 by linear blend skinning.

    `attributes` (n, 8): position in the columns 0-2, normal in 3-5. A rigid vertex has one bone of weight 1.
    """
    for i in range(first, last):
        x, y, z = rest[i, 0], rest[i, 1], rest[i, 2]
        nx, ny, nz = rest_normals[i, 0], rest_normals[i, 1], rest_normals[i, 2]
        w0 = weights[i, 0]
        for r in range(3):
            m0 = palette[bones[i, 0], r, 0] * w0
            m1 = palette[bones[i, 0], r, 1] * w0
            m2 = palette[bones[i, 0], r, 2] * w0
            m3 = palette[bones[i, 0], r, 3] * w0
            if w0 != f32(1):
                for k in range(1, 4):
                    w = weights[i, k]
                    if w != f32(0):
                        m0 += palette[bones[i, k], r, 0] * w
                        m1 += palette[bones[i, k], r, 1] * w
                        m2 += palette[bones[i, k], r, 2] * w
                        m3 += palette[bones[i, k], r, 3] * w
            attributes[i, r] = m0 * x + m1 * y + m2 * z + m3
            attributes[i, 3 + r] = m0 * nx + m1 * ny + m2 * nz


@njit(**KERNEL)
def project(attributes, R, t, fx, fy, cx, cy, near, camera):
    """Camera-frame positions and pixels of all vertices.

    R (3, 3) and t (3,) are camera from world. `camera` (n, 6): x, y, z, and u, v, 1/z, which mean
    nothing where z < near.
    """
    for i in range(len(attributes)):
        x, y, z = attributes[i, 0], attributes[i, 1], attributes[i, 2]
        camera[i, 0] = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0]
        camera[i, 1] = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1]
        depth = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2]
        camera[i, 2] = depth
        inverse = f32(1) / (depth if depth > near else near)
        camera[i, 3] = camera[i, 0] * inverse * fx + cx
        camera[i, 4] = camera[i, 1] * inverse * fy + cy
        camera[i, 5] = inverse


@njit(**KERNEL)
def cross(ax, ay, az, bx, by, bz):
    """Cross product, on scalars: an array passed around in a pixel loop costs reference counts."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(**KERNEL)
def narrow(rises, inverse_slope, offset, low, high):
    """The part of the span low <= x < high where slope * x + offset >= 0; `rises` is slope >= 0.

    No branch: whether an edge cuts the span is as good as random. A slope of +0 has the inverse +inf, and leaves all or
    nothing; the crossing that is then not a number (offset 0) compares false and leaves all.
    """
    crossing = -offset * inverse_slope
    low = crossing if rises & (crossing > low) else low
    high = crossing if (not rises) & (crossing < high) else high
    return low, high


@njit(**KERNEL)
def rasterise(
    camera,
    faces,
    face_first,
    face_last,
    fx,
    fy,
    cx,
    cy,
    row_first,
    row_last,
    near,
    inverse_depth,
    triangles,
    coverage,
    bit,
):
    """Nearest front face per pixel among faces face_first..face_last-1, for the rows row_first..row_last-1.

    Edge functions in float64 (they are differences of products), the per-pixel 1/z in float32. Writes `inverse_depth`
    (H, W) and the face's number into `triangles` (H, W), and sets `bit` in `coverage` (H, W) wherever a face lies,
    hidden or not. The last two may be None: a shadow map has no use for them.
    """
    inverse_fx, inverse_fy = 1.0 / fx, 1.0 / fy
    width = inverse_depth.shape[1]
    flat_w = inverse_depth.ravel()
    if triangles is not None:  # numba leaves out what hangs on an argument that is None
        flat_t = triangles.ravel()
    if coverage is not None:
        flat_c = coverage.ravel()
    spans = np.zeros(3 * ROWS)  # by row of a triangle: first pixel, last + 1, and 1/z at the first
    near32, zero, one = f32(near), f32(0), f32(1)
    # The box that can hold a pixel centre, padded by a hundredth of a pixel: the float32 rounding of a projected vertex
    # must not cut what the edge functions would keep.
    pad = f32(0.01)
    low_x, high_x = f32(0) - pad, f32(width - 1) + pad
    low_y, high_y = f32(row_first) - pad, f32(row_last - 1) + pad
    for t in range(face_first, face_last):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        za, zb, zg = camera[i, 2], camera[j, 2], camera[k, 2]
        crosses_near = za < near32 or zb < near32 or zg < near32
        if crosses_near:  # a projected bounding box would be meaningless
            if za < near32 and zb < near32 and zg < near32:
                continue
            y_first, y_last, x_first, x_last = row_first, row_last, 0, width
        else:
            va, vb, vg = camera[i, 4], camera[j, 4], camera[k, 4]
            top, bottom = min(va, vb, vg), max(va, vb, vg)
            ua, ub, ug = camera[i, 3], camera[j, 3], camera[k, 3]
            left, right = min(ua, ub, ug), max(ua, ub, ug)
            if right < low_x or left > high_x or bottom < low_y or top > high_y:
                continue
            is_small = bottom - top < SMALL_BOX and right - left < SMALL_BOX  # whatever the band of rows
            edge_bu, edge_bv, edge_gu, edge_gv = ub - ua, vb - va, ug - ua, vg - va
            doubled = edge_bv * edge_gu - edge_bu * edge_gv
            if is_small and doubled <= zero:  # from behind or edge-on
                continue
            top, left = max(top - pad, f32(row_first)), max(left - pad, f32(0))
            y_first, y_last = int(np.ceil(top)), int(np.floor(min(bottom + pad, f32(row_last - 1)))) + 1
            x_first, x_last = int(np.ceil(left)), int(np.floor(min(right + pad, f32(width - 1)))) + 1
            if y_first >= y_last or x_first >= x_last:  # falls between the pixel centres
                continue
            if is_small:
                # Most triangles of a body. Flat edge functions, and 1/z as a convex sum, affine on the screen. Edges
                # are pushed out by SMALL_MARGIN, so that no crack opens to a neighbour drawn by the exact rule below.
                wa, wb, wg = camera[i, 5], camera[j, 5], camera[k, 5]
                number = np.int32(t)
                margin_b = SMALL_MARGIN * (abs(edge_gu) + abs(edge_gv))
                margin_g = SMALL_MARGIN * (abs(edge_bu) + abs(edge_bv))
                margin_a = SMALL_MARGIN * (abs(edge_gu - edge_bu) + abs(edge_gv - edge_bv))
                scale = one / doubled
                slope_b, slope_g = scale * (wb - wa), scale * (wg - wa)
                low_b, low_g, low_a = -margin_b, -margin_g, -margin_a
                w_low, w_high = min(wa, wb, wg), max(wa, wb, wg)
                for y in range(y_first, y_last):
                    dv, du = f32(y) - va, f32(x_first) - ua
                    weight_b = dv * edge_gu - du * edge_gv
                    weight_g = du * edge_bv - dv * edge_bu
                    n = np.uint64(y * width + x_first)
                    for _ in range(x_first, x_last):
                        if weight_b >= low_b and weight_g >= low_g and doubled - weight_b - weight_g >= low_a:
                            # The margins must not lead out of the range of the corners.
                            w = min(max(wa + weight_b * slope_b + weight_g * slope_g, w_low), w_high)
                            if coverage is not None and bit:
                                flat_c[n] |= bit
                            if w > flat_w[n]:
                                flat_w[n] = w
                                if triangles is not None:
                                    flat_t[n] = number
                        weight_b -= edge_gv
                        weight_g += edge_bv
                        n += np.uint64(1)
                continue

        ax, ay, az = np.float64(camera[i, 0]), np.float64(camera[i, 1]), np.float64(za)
        bx, by, bz = np.float64(camera[j, 0]), np.float64(camera[j, 1]), np.float64(zb)
        gx, gy, gz = np.float64(camera[k, 0]), np.float64(camera[k, 1]), np.float64(zg)
        e0x, e0y, e0z = cross(bx, by, bz, gx, gy, gz)
        det = ax * e0x + ay * e0y + az * e0z
        if det >= 0.0:  # seen from behind, edge-on, or degenerate
            continue
        e1x, e1y, e1z = cross(gx, gy, gz, ax, ay, az)
        e2x, e2y, e2z = cross(ax, ay, az, bx, by, bz)
        inverse_det = 1.0 / det
        wx = (e0x + e1x + e2x) * inverse_det  # 1/z = (wx, wy, wz) . ray
        wy = (e0y + e1y + e2y) * inverse_det
        wz = (e0z + e1z + e2z) * inverse_det
        # det < 0: the sign of the edge functions turns round
        slope0, slope1, slope2 = 0.0 - e0x * inverse_fx, 0.0 - e1x * inverse_fx, 0.0 - e2x * inverse_fx  # never -0
        rises0, rises1, rises2 = slope0 >= 0.0, slope1 >= 0.0, slope2 >= 0.0
        inverse0, inverse1, inverse2 = 1.0 / slope0, 1.0 / slope1, 1.0 / slope2
        w_step = f32(wx * inverse_fx)
        face_number = np.int32(t)

        slope_near, rises_near, inverse_near = 0.0, True, np.inf
        if crosses_near:  # 1/near - 1/z >= 0
            slope_near = 0.0 - wx * inverse_fx
            rises_near, inverse_near = slope_near >= 0.0, 1.0 / slope_near
        for y_block in range(y_first, y_last, ROWS):
            # Of ROWS rows, whether the triangle has as many or not: so the loop becomes vector instructions.
            for r in range(ROWS):
                v = (y_block + r - cy) * inverse_fy
                low, high = narrow(rises0, inverse0, -(e0y * v + e0z) - slope0 * cx, float(x_first), float(x_last))
                low, high = narrow(rises1, inverse1, -(e1y * v + e1z) - slope1 * cx, low, high)
                low, high = narrow(rises2, inverse2, -(e2y * v + e2z) - slope2 * cx, low, high)
                if crosses_near:
                    offset = 1.0 / near - wy * v - wz - slope_near * cx
                    low, high = narrow(rises_near, inverse_near, offset, low, high)
                first = np.ceil(low)
                spans[r], spans[ROWS + r] = first, np.ceil(high)
                spans[2 * ROWS + r] = wx * (first - cx) * inverse_fx + wy * v + wz
            for r in range(min(ROWS, y_last - y_block)):
                if not spans[r] < spans[ROWS + r]:  # one may be infinite
                    continue
                first, last = int(spans[r]), int(spans[ROWS + r])
                w_first = f32(spans[2 * ROWS + r])
                start = np.uint64((y_block + r) * width + first)  # unsigned: no test for negative indices
                if coverage is not None and bit:
                    for x in range(last - first):
                        flat_c[start + np.uint64(x)] |= bit
                for x in range(last - first):  # select instead of branch: this loop vectorises
                    w = w_first + w_step * f32(x)
                    n = start + np.uint64(x)
                    nearer = w > flat_w[n]
                    flat_w[n] = w if nearer else flat_w[n]
                    if triangles is not None:
                        flat_t[n] = face_number if nearer else flat_t[n]
