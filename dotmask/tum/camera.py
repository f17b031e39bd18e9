"""The camera of a recorded sequence: published, from a file, or from the `camera.json` of a rendered folder."""

import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from dotmask.errors import SequenceFolderError
from dotmask.records import Intrinsics
from dotmask.tum.text_lines import PathLike

DEPTH_PER_METRE = 5000.0
MAX_DEPTH_M = np.iinfo(np.uint16).max / DEPTH_PER_METRE
"""13.107 m, the furthest depth that 16 bits hold."""

CAMERA_FILE = "camera.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedCamera:
    """A camera as it was calibrated.

    Attributes:
        intrinsics: of colour and depth, which are registered.
        distortion: k1, k2, p1, p2, k3 of the lens as OpenCV defines them; all 0 where the images are free of it.
        source: the name of a published camera, or the file that told it.
    """

    intrinsics: Intrinsics
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    source: str


def _kinect(name: str, fx: float, fy: float, cx: float, cy: float, *distortion: float) -> RecordedCamera:
    intrinsics = Intrinsics(width=640, height=480, fx=fx, fy=fy, cx=cx, cy=cy)
    k1, k2, p1, p2, k3 = distortion
    return RecordedCamera(intrinsics=intrinsics, distortion=(k1, k2, p1, p2, k3), source=name)


PUBLISHED: Mapping[str, RecordedCamera] = {
    "fr1": _kinect("fr1", 517.3, 516.5, 318.6, 255.3, 0.2624, -0.9531, -0.0054, 0.0026, 1.1633),
    "fr2": _kinect("fr2", 520.9, 521.0, 325.1, 249.7, 0.2312, -0.7849, -0.0033, -0.0001, 0.9172),
    "fr3": _kinect("fr3", 535.4, 539.2, 320.1, 247.6, 0.0, 0.0, 0.0, 0.0, 0.0),
}
"""The colour cameras of the benchmark's page, "Intrinsic Camera Calibration of the Kinect". The images of fr3 were
freed of distortion before they were published; the page's scales of depth are in the images already."""

_NAME = re.compile(r"(?:freiburg|(?<![a-z0-9])fr)([123])(?![0-9])", re.IGNORECASE)


def find_camera(folder: PathLike, name: str | None = None, file: PathLike | None = None) -> RecordedCamera:
    """The camera of a sequence folder: the one that is given, else `camera.json`, else by the folder's name.

    Args:
        folder: of the sequence; `rgbd_dataset_freiburg3_walking_xyz` and `fr3_walking_xyz` are camera fr3.
        name: of a published camera.
        file: what `read_camera` reads.

    Raises:
        SequenceFolderError: both are given, no such camera, the file cannot be read, or nothing tells the camera.
    """
    if name is not None and file is not None:
        raise SequenceFolderError("give a camera by name or by file, not both")
    if name is not None:
        if name not in PUBLISHED:
            raise SequenceFolderError(f"unknown camera '{name}'; known: {', '.join(PUBLISHED)}, or give its intrinsics")
        return PUBLISHED[name]
    if file is not None:
        return read_camera(file)
    root = Path(folder)
    if (root / CAMERA_FILE).exists():
        return read_camera(root / CAMERA_FILE)
    found = _NAME.search(Path(os.path.abspath(root)).name)
    if found is None:
        raise SequenceFolderError(
            f"{root}: neither {CAMERA_FILE} nor the name of the folder tells the camera; give --camera "
            f"{', '.join(PUBLISHED)} or --intrinsics FILE"
        )
    return PUBLISHED[f"fr{found.group(1)}"]


def read_camera(path: PathLike) -> RecordedCamera:
    """A camera from a JSON file with `width`, `height`, `fx`, `fy`, `cx`, `cy` in pixels, as `camera_json` writes it.

    `distortion`, a list of k1, k2, p1, p2 and k3, may be missing: none.

    Raises:
        SequenceFolderError: the file is missing, is not such a file, or tells another scale of depth.
    """
    try:
        values = json.loads(Path(path).read_text(encoding="utf-8"))
        scale = float(values.get("depth_per_metre", DEPTH_PER_METRE))
        k1, k2, p1, p2, k3 = (float(k) for k in values.get("distortion", [0] * 5))
        intrinsics = Intrinsics(
            width=int(values["width"]),
            height=int(values["height"]),
            **{name: float(values[name]) for name in ("fx", "fy", "cx", "cy")},
        )
    except FileNotFoundError as error:
        raise SequenceFolderError(f"{path}: no such file") from error
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise SequenceFolderError(
            f"{path}: cannot be read ({error!r}); it must hold width, height, fx, fy, cx and cy"
        ) from error
    if scale != DEPTH_PER_METRE:
        raise SequenceFolderError(f"{path}: depth_per_metre is {scale:g}; only {DEPTH_PER_METRE:g} is known")
    if not np.isfinite([intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy, k1, k2, p1, p2, k3]).all():
        raise SequenceFolderError(f"{path}: holds a number that is not finite")
    return RecordedCamera(intrinsics=intrinsics, distortion=(k1, k2, p1, p2, k3), source=str(path))


def camera_json(intrinsics: Intrinsics, depth_per_metre: float | None, facts: Mapping[str, object]) -> str:
    """The content of `camera.json`: intrinsics, the scale of the depth images (None without such) and other facts."""
    return json.dumps({**asdict(intrinsics), "depth_per_metre": depth_per_metre, **facts}, indent=2) + "\n"
