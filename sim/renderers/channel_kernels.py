"""Normals and flow from the visibility buffer. Compiled by numba; rules and notation are those of `kernels`."""

# mypy: ignore-errors
# (numba infers the types of these functions from their arguments; numpy's own annotations do not describe them)

import numpy as np
from numba import njit

from sim.renderers.kernels import KERNEL, cross

f32 = np.float32


@njit(**KERNEL)
def normals(camera, faces, triangles, row_first, row_last, target):
    """Unit normal of each pixel's triangle in the camera frame, (H, W, 3); it points towards the camera.

    The normal of the flat triangle, not the one interpolated for shading: it is the derivative of the depth.
    """
    for y in range(row_first, row_last):
        previous = -1
        nx = ny = nz = f32(0)
        for x in range(triangles.shape[1]):
            t = triangles[y, x]
            if t < 0:
                target[y, x, 0] = target[y, x, 1] = target[y, x, 2] = f32(0)
                continue
            if t != previous:
                previous = t
                i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
                ax, ay, az = np.float64(camera[i, 0]), np.float64(camera[i, 1]), np.float64(camera[i, 2])
                wx, wy, wz = cross(
                    camera[j, 0] - ax,
                    camera[j, 1] - ay,
                    camera[j, 2] - az,
                    camera[k, 0] - ax,
                    camera[k, 1] - ay,
                    camera[k, 2] - az,
                )
                scale = 1.0 / np.sqrt(wx * wx + wy * wy + wz * wz)
                nx, ny, nz = f32(wx * scale), f32(wy * scale), f32(wz * scale)
            target[y, x, 0], target[y, x, 1], target[y, x, 2] = nx, ny, nz


@njit(**KERNEL)
def flow(
    camera,
    now,
    then,
    faces,
    static_faces,
    fx,
    fy,
    cx,
    cy,
    R_world_camera,
    T_then_camera,
    triangles,
    depth,
    row_first,
    row_last,
    optical,
    scene,
):
    """How each pixel's point moves: (H, W, 2) in the image, (H, W, 3) in the world.

    The point keeps its place in its triangle. With its barycentric coordinates Bi it moves by
    d = sum Bi (then_i - now_i) in the world, and lies at T (P + R^T d) in the other camera.

    `now`, `then`: vertices as `kernels.pose_vertices` leaves them; faces before `static_faces` do not move.
    `R_world_camera` (3, 3): axes of this camera; `T_then_camera` (3, 4): this camera's points in the other camera.
    """
    R, T = R_world_camera, T_then_camera
    for y in range(row_first, row_last):
        ray_y = (y - cy) / fy
        for x in range(triangles.shape[1]):
            t = triangles[y, x]
            if t < 0:
                optical[y, x, 0] = optical[y, x, 1] = f32(0)
                scene[y, x, 0] = scene[y, x, 1] = scene[y, x, 2] = f32(0)
                continue
            z = np.float64(depth[y, x])
            ray_x = (x - cx) / fx
            px, py, pz = ray_x * z, ray_y * z, z
            dx = dy = dz = 0.0
            if t >= static_faces:
                i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
                ax, ay, az = np.float64(camera[i, 0]), np.float64(camera[i, 1]), np.float64(camera[i, 2])
                bx, by, bz = np.float64(camera[j, 0]), np.float64(camera[j, 1]), np.float64(camera[j, 2])
                gx, gy, gz = np.float64(camera[k, 0]), np.float64(camera[k, 1]), np.float64(camera[k, 2])
                e1x, e1y, e1z = cross(gx, gy, gz, ax, ay, az)
                e2x, e2y, e2z = cross(ax, ay, az, bx, by, bz)
                scale = z / (bx * e1x + by * e1y + bz * e1z)
                # Rounding must not leave the triangle: the thinner it is, the farther it would lead.
                b1 = min(max((e1x * ray_x + e1y * ray_y + e1z) * scale, 0.0), 1.0)
                b2 = min(max((e2x * ray_x + e2y * ray_y + e2z) * scale, 0.0), 1.0 - b1)
                b0 = 1.0 - b1 - b2
                dx = b0 * (then[i, 0] - now[i, 0]) + b1 * (then[j, 0] - now[j, 0]) + b2 * (then[k, 0] - now[k, 0])
                dy = b0 * (then[i, 1] - now[i, 1]) + b1 * (then[j, 1] - now[j, 1]) + b2 * (then[k, 1] - now[k, 1])
                dz = b0 * (then[i, 2] - now[i, 2]) + b1 * (then[j, 2] - now[j, 2]) + b2 * (then[k, 2] - now[k, 2])
                px += R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
                py += R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
                pz += R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
            scene[y, x, 0], scene[y, x, 1], scene[y, x, 2] = f32(dx), f32(dy), f32(dz)
            qx = T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz + T[0, 3]
            qy = T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz + T[1, 3]
            qz = T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz + T[2, 3]
            if qz > 0.0:
                optical[y, x, 0], optical[y, x, 1] = f32(fx * qx / qz + cx - x), f32(fy * qy / qz + cy - y)
            else:
                optical[y, x, 0] = optical[y, x, 1] = f32(np.nan)
