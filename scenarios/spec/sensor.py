"""The camera's errors."""

from typing import Annotated, Literal

from pydantic import Field

from scenarios.spec.base import Spec
from sim.sensor.failures import FailureKind


class SensorFailureSpec(Spec):
    """What the sensor fails to deliver for a while.

    Attributes:
        kind: "black" colour images, "no_depth" in the depth images, or frames that are "missing".
        first: number of the first frame that fails; frame 0 never does.
        frames: how many fail.
    """

    kind: FailureKind
    first: Annotated[int, Field(ge=1)]
    frames: Annotated[int, Field(ge=1)] = 1


class SensorSpec(Spec):
    """Which camera measures, and which of its errors act.

    Attributes:
        model: the parameter set, see `sim.sensor.parameters`; "ideal" measures exactly what is there.
        motion_errors: whether exposure time, rolling shutter, the delay between colour and depth, dropped frames and
            jittered stamps act as well. They take several renders a frame, so they are off unless asked for.
        failures: what the sensor fails to deliver for a while.
    """

    model: Literal["ideal", "kinect_v1", "realsense_d435"] = "kinect_v1"
    motion_errors: bool = False
    failures: tuple[SensorFailureSpec, ...] = ()
