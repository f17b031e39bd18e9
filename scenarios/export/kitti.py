"""The layout of the KITTI odometry benchmark (Geiger et al., CVPR 2012), with depth and instance ids beside it."""

from collections.abc import Iterable, Mapping

import numpy as np

from dotmask.partial_folder import PartialFolder
from dotmask.tum import CAMERA_FILE, camera_json, colour_png, depth_png, ids_png
from scenarios.bridge import intrinsics_from_camera
from sim.records import SimFrame
from sim.simulator import Simulator

DEPTH_PER_METRE = 256.0
"""Scale of KITTI's depth images (Uhrig et al., "Sparsity invariant CNNs", 3DV 2017)."""

SEQUENCE = "sequences/00"


class KittiExport:
    """Writes `sequences/00/{image_2,depth,instance}/NNNNNN.png`, `times.txt`, `calib.txt` and `poses/00.txt`.

    A pose is (3, 4), row by row, and maps points of its camera into the first camera. There is one camera, so that P0
    to P3 are one matrix.

    Args:
        folder: to fill.
        simulator: what is rendered.
        facts: what else to note in `camera.json`.
    """

    def __init__(self, folder: PartialFolder, simulator: Simulator, facts: Mapping[str, object]) -> None:
        self._files, self._camera, self._facts = folder.files, simulator.camera, facts
        # Poses are rounded to a grid, so that the transpose of a rotation is not quite its inverse.
        self._T_first_world = np.linalg.inv(simulator.frame(0).truth.T_world_camera)

    def begin(self) -> None:
        """Write what is the same in all frames."""
        camera = self._camera
        numbers = (camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0)
        lines = [f"P{k}: {_numbers(numbers)}\n" for k in range(4)]
        self._files.write(f"{SEQUENCE}/calib.txt", "".join(lines))
        self._files.write(CAMERA_FILE, camera_json(intrinsics_from_camera(camera), DEPTH_PER_METRE, self._facts))
        self._files.append(f"{SEQUENCE}/times.txt", "")
        self._files.append("poses/00.txt", "")

    def add(self, frame: SimFrame) -> None:
        """Append one frame."""
        name = f"{frame.index:06d}.png"
        self._files.write(f"{SEQUENCE}/image_2/{name}", colour_png(frame.rgb))
        self._files.write(f"{SEQUENCE}/depth/{name}", depth_png(frame.depth_m, DEPTH_PER_METRE))
        self._files.write(f"{SEQUENCE}/instance/{name}", ids_png(frame.truth.instance_ids))
        self._files.append(f"{SEQUENCE}/times.txt", f"{frame.timestamp_s:.6e}\n")
        T_first_camera = np.einsum("ij,jk->ik", self._T_first_world, frame.truth.T_world_camera)
        self._files.append("poses/00.txt", _numbers(T_first_camera[:3].reshape(-1)) + "\n")

    def finish(self) -> None:
        """Nothing is open."""


def _numbers(values: Iterable[float]) -> str:
    """Numbers with ten digits; what is zero but for rounding is printed as zero."""
    return " ".join(f"{round(float(value), 12) + 0.0:.9e}" for value in values)
