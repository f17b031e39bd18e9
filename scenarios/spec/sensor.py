"""The camera's errors."""

from typing import Literal

from scenarios.spec.base import Spec


class SensorSpec(Spec):
    """Which camera measures, and which of its errors act.

    Attributes:
        model: the parameter set, see `sim.sensor.parameters`; "ideal" measures exactly what is there.
        motion_errors: whether exposure time, rolling shutter, the delay between colour and depth, dropped frames and
            jittered stamps act as well. They take several renders a frame, so they are off unless asked for.
    """

    model: Literal["ideal", "kinect_v1", "realsense_d435"] = "kinect_v1"
    motion_errors: bool = False
