"""PLY files of clouds and meshes: binary, little-endian, float32 metres, colours in bytes.

Source: Turk, The PLY polygon file format, 1994.
"""

import os

import numpy as np
import numpy.typing as npt

from dotmask.atomic_file import write_atomically
from dotmask.records import FloatArray


def write_ply(
    path: str | os.PathLike[str],
    points_m: FloatArray,
    colours: npt.NDArray[np.uint8],
    faces: npt.NDArray[np.int32] | None = None,
) -> None:
    """Write a point cloud, or with `faces` a mesh; an older file stays until the new one is complete.

    Args:
        path: of the file.
        points_m: (N, 3) world, metres.
        colours: (N, 3).
        faces: (M, 3) numbers of points.

    Raises:
        OSError: the folder is missing, not writable or full.
    """
    vertices = np.zeros(len(points_m), [("place", "<f4", 3), ("colour", "u1", 3)])
    vertices["place"], vertices["colour"] = points_m, colours
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(f"property uchar {channel}" for channel in ("red", "green", "blue")),
    ]
    body = vertices.tobytes()
    if faces is not None:
        triangles = np.zeros(len(faces), [("corners", "u1"), ("faces", "<i4", 3)])
        triangles["corners"], triangles["faces"] = 3, faces
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        body += triangles.tobytes()
    write_atomically(path, ("\n".join([*header, "end_header"]) + "\n").encode() + body)
