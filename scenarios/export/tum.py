"""The TUM RGB-D folder, with the instance ids beside the images."""

from collections.abc import Mapping

from dotmask.partial_folder import PartialFolder
from dotmask.tum import LIST_HEADER, TumSequenceWriter, ids_png, stamp_text
from scenarios.bridge import intrinsics_from_camera, rgbd_frame_from_sim
from sim.records import SimFrame
from sim.simulator import Simulator


class TumExport:
    """Writes `rgb/`, `depth/`, their lists, `associations.txt`, `groundtruth.txt`, `camera.json` and `instance/`.

    Args:
        folder: to fill.
        simulator: what is rendered.
        facts: what else to note in `camera.json`.
    """

    def __init__(self, folder: PartialFolder, simulator: Simulator, facts: Mapping[str, object]) -> None:
        self._files = folder.files
        self._images = TumSequenceWriter(folder.files, intrinsics_from_camera(simulator.camera), facts)

    def begin(self) -> None:
        """Write the headers."""
        self._images.begin()
        self._files.append("instance.txt", LIST_HEADER)

    def add(self, frame: SimFrame) -> None:
        """Append one frame."""
        self._images.write(rgbd_frame_from_sim(frame), frame.truth.T_world_camera)
        stamp = stamp_text(frame.timestamp_s)
        self._files.write(f"instance/{stamp}.png", ids_png(frame.truth.instance_ids))
        self._files.append("instance.txt", f"{stamp} instance/{stamp}.png\n")

    def finish(self) -> None:
        """Nothing is open."""
