"""The border between the simulator and the method: a SimFrame is split, and the method gets no truth."""

from dotmask.records import Intrinsics, RgbdFrame
from sim.records import CameraModel, SimFrame


def intrinsics_from_camera(camera: CameraModel) -> Intrinsics:
    """The method's record of the simulator's camera."""
    return Intrinsics(width=camera.width, height=camera.height, fx=camera.fx, fy=camera.fy, cx=camera.cx, cy=camera.cy)


def rgbd_frame_from_sim(frame: SimFrame) -> RgbdFrame:
    """What the method may see of a simulated frame: the sensor's images, the stamp and the intrinsics."""
    return RgbdFrame(
        index=frame.index,
        timestamp_s=frame.timestamp_s,
        rgb=frame.rgb,
        depth_m=frame.depth_m,
        intrinsics=intrinsics_from_camera(frame.camera),
    )
