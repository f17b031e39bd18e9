"""The camera of a scenario and its path."""

from typing import Annotated, Literal

from pydantic import Field

from scenarios.spec.base import Metres2, Metres3, NotNegative, Positive, Spec


class IntrinsicsSpec(Spec):
    """What every camera has.

    Attributes:
        width, height: pixels.
        fx, fy, cx, cy: intrinsics in pixels at that size; the defaults are the fr3 camera of the TUM benchmark.
        exposure_ev: in stops: one more makes the image twice as bright, up to the soft limit near white.
    """

    width: Annotated[int, Field(ge=32, le=4096)] = 640
    height: Annotated[int, Field(ge=24, le=4096)] = 480
    fx: Positive = 535.4
    fy: Positive = 539.2
    cx: float = 320.1
    cy: float = 247.6
    exposure_ev: Annotated[float, Field(ge=-4, le=4)] = 0.0


class CameraSpec(IntrinsicsSpec):
    """A camera that is held by hand around one place.

    Attributes:
        path: the shape of the motion.
        position_m: nominal position of the camera in the world.
        heading_deg: nominal viewing direction about z; 0 looks along +x, 90 along +y.
        tilt_deg: nominal tilt; positive looks down.
        amplitude: factor on the path's size; 1 is like the TUM sequence fr3/walking of that name.
        translation: a further factor on its displacements, while its turns stay.
        speed: factor on the path's speed; 1 is like the TUM sequence fr3/walking of that name.
        trajectory: a recorded trajectory file in TUM format that replaces `path`, turned about z and moved so that
            its mean position and heading are the nominal ones.
    """

    path: Literal["static", "xyz", "rpy", "halfsphere"] = "xyz"
    position_m: Metres3 = (0.0, -2.3, 1.4)
    heading_deg: float = 90.0
    tilt_deg: Annotated[float, Field(ge=-80, le=80)] = 8.0
    amplitude: NotNegative = 1.0
    translation: NotNegative = 1.0
    speed: Positive = 1.0
    trajectory: str | None = None


class StopSpec(Spec):
    """Where the camera is at one time of a tour.

    Attributes:
        time_s: when.
        position_m: of the camera in the world.
        look_at_m: what it looks at.
        roll_deg: about the viewing direction, clockwise as seen from behind the camera; 0 is upright.
    """

    time_s: NotNegative
    position_m: Metres3
    look_at_m: Metres3
    roll_deg: float = 0.0


class TourCameraSpec(IntrinsicsSpec):
    """A camera that is carried by hand from stop to stop, without stopping; at the end it goes back the same way.

    Attributes:
        stops: the first at time 0; positions between them lie on a smooth curve.
        amplitude: factor on the shake of the hand.
        speed: factor on the speed of the tour.
    """

    path: Literal["tour"] = "tour"
    stops: Annotated[tuple[StopSpec, ...], Field(min_length=2)]
    amplitude: NotNegative = 1.0
    speed: Positive = 1.0


class RobotCameraSpec(IntrinsicsSpec):
    """A camera on a wheeled robot that drives through waypoints and looks ahead; at the end it backs up the same way.

    Attributes:
        waypoints_m: floor positions; the way between them is a smooth curve.
        speed_m_s: of the robot.
        height_m: of the camera above the floor.
        tilt_deg: of the camera; positive looks down.
        amplitude: factor on the tremble of the wheels.
        speed: factor on the speed of everything that the robot does.
    """

    path: Literal["robot"] = "robot"
    waypoints_m: Annotated[tuple[Metres2, ...], Field(min_length=2)]
    speed_m_s: Positive = 0.4
    height_m: Annotated[float, Field(ge=0.1, le=2)] = 0.8
    tilt_deg: Annotated[float, Field(ge=-80, le=80)] = 0.0
    amplitude: NotNegative = 1.0
    speed: Positive = 1.0


class FollowCameraSpec(IntrinsicsSpec):
    """A camera on a wheeled robot that drives behind a person, on the person's own way and at the person's own speed.

    In the counterfactual variants the camera moves as if the person walked.

    Attributes:
        person: name of whom it follows.
        distance_m: how far behind, along the way.
        height_m: of the camera above the floor.
        gaze_m: height above the floor, at the person, that it looks at.
        amplitude: factor on the tremble of the wheels.
    """

    path: Literal["follow"] = "follow"
    person: str
    distance_m: Annotated[float, Field(ge=0.5, le=10)] = 2.0
    height_m: Annotated[float, Field(ge=0.1, le=2)] = 0.8
    gaze_m: Annotated[float, Field(ge=0, le=2)] = 0.95
    amplitude: NotNegative = 1.0


Camera = Annotated[
    CameraSpec | TourCameraSpec | RobotCameraSpec | FollowCameraSpec,
    Field(discriminator="path"),
]
