"""A scenario is data only: frozen, checked, JSON both ways. `scenarios.world` builds the simulator from it."""

from scenarios.spec.camera import (
    CameraSpec,
    FollowCameraSpec,
    IntrinsicsSpec,
    RobotCameraSpec,
    StopSpec,
    TourCameraSpec,
)
from scenarios.spec.people import (
    Act,
    PeopleSpec,
    PersonSpec,
    PushAct,
    SitAct,
    SitDownAct,
    StandAct,
    StandUpAct,
    TurnAct,
    WalkAct,
    WalkLoopAct,
)
from scenarios.spec.scenario import Scenario, scenario_from_json, with_overrides
from scenarios.spec.sensor import SensorSpec
from scenarios.spec.things import ImpulseSpec, ThingSpec

__all__ = [
    "Act",
    "CameraSpec",
    "FollowCameraSpec",
    "ImpulseSpec",
    "IntrinsicsSpec",
    "PeopleSpec",
    "PersonSpec",
    "PushAct",
    "RobotCameraSpec",
    "Scenario",
    "SensorSpec",
    "SitAct",
    "SitDownAct",
    "StandAct",
    "StandUpAct",
    "StopSpec",
    "ThingSpec",
    "TourCameraSpec",
    "TurnAct",
    "WalkAct",
    "WalkLoopAct",
    "scenario_from_json",
    "with_overrides",
]
