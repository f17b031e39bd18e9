"""RTAB-Map's parameters: two sets by name, and changes to them, checked against what RTAB-Map knows."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from dotmask.errors import SlamError
from dotmask.slam.rtabmap.library import Core, Parameter

FIXED = {
    "Mem/GenerateIds": "false",
    "Odom/Strategy": "0",
    "RGBD/Enabled": "true",
    "RGBD/OptimizeFromGraphEnd": "false",
    "Rtabmap/StartNewMapOnLoopClosure": "true",
}
"""What the back end is built on, so what cannot be changed: nodes carry our numbers, odometry is frame to map (the
bridge keeps images for no longer), the oldest node holds the map in the world, and a new map is kept only when a loop
closure has joined it to the old one."""

BASE = {
    "Odom/ResetCountdown": "15",
    "RGBD/AngularUpdate": "0",
    "RGBD/LinearUpdate": "0",
    "Rtabmap/DetectionRate": "2",
}
"""Where both sets differ from RTAB-Map's own values: odometry starts anew after 15 lost frames (never, by itself),
every mapped frame is a node, and two frames a second are mapped (one, by itself)."""

SETS: dict[str, dict[str, str]] = {
    "default": {},
    "refined": {"Vis/MaxFeatures": "2000", "Vis/PnPRefineIterations": "5"},
}
"""`default`: RTAB-Map as it comes. `refined`: its PnP is refined on the inliers, of twice as many features."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RtabmapSettings:
    """How RTAB-Map is run.

    Attributes:
        parameters: RTAB-Map's, by name; what is not in it has RTAB-Map's own value.
        timeout_s: longest time for one answer; a process that takes longer is ended.
    """

    parameters: Mapping[str, str]
    timeout_s: float = 120.0

    @property
    def mapping_period_s(self) -> float:
        """Least time from one node of the map to the next; 0: every frame.

        RTAB-Map's core leaves its parameter `Rtabmap/DetectionRate` (Hz) to whoever calls it.
        """
        rate_hz = float(self.parameters["Rtabmap/DetectionRate"])
        return 1.0 / rate_hz if rate_hz > 0 else 0.0

    @property
    def restart_after(self) -> int:
        """Lost frames in a row after which odometry starts anew; 0: never.

        `Odom/ResetCountdown` is counted by the back end, since RTAB-Map starts anew from the last pose, as if the
        camera had not moved while it was lost.
        """
        return int(self.parameters["Odom/ResetCountdown"])

    @property
    def handed_over(self) -> dict[str, str]:
        """The parameters that RTAB-Map is given."""
        return {**self.parameters, "Odom/ResetCountdown": "0"}


def rtabmap_settings(set_name: str, changes: Iterable[str], known: Core) -> RtabmapSettings:
    """The settings that a command line asks for.

    Args:
        set_name: of `SETS`.
        changes: texts `NAME=VALUE`.
        known: what RTAB-Map knows.

    Raises:
        SlamError: no such set or parameter, with near matches; a value of another type; a parameter that is fixed.
    """
    if set_name not in SETS:
        raise SlamError(f"unknown parameter set '{set_name}' of RTAB-Map. Known: {', '.join(SETS)}")
    parameters = {**BASE, **SETS[set_name]}
    for text in changes:
        name, sign, value = (part.strip() for part in text.partition("="))
        if not sign or not name:
            raise SlamError(f"--slam-set {text}: expected NAME=VALUE, for example Vis/MinInliers=12")
        if name in FIXED:
            raise SlamError(f"--slam-set {text}: {name} must stay {FIXED[name]}, the back end is built on it")
        if name not in known.parameters:
            raise _unknown(name, known)
        if not _fits(value, known.parameters[name]):
            raise SlamError(f"--slam-set {text}: {name} takes a value of type {known.parameters[name].type}")
        parameters[name] = value
    return RtabmapSettings(parameters=dict(sorted({**parameters, **FIXED}.items())))


def _unknown(name: str, known: Core) -> SlamError:
    """The error for a name that does not exist: near matches of the whole, or of the part after the group."""
    by_end = {full.partition("/")[2]: full for full in known.parameters}
    near = difflib.get_close_matches(name, known.parameters, n=3, cutoff=0.7)
    ends = difflib.get_close_matches(name.rpartition("/")[2], by_end, n=3, cutoff=0.8)
    hints = list(dict.fromkeys([*near, *(by_end[end] for end in ends)]))[:3]
    hint = f" Did you mean {' or '.join(hints)}?" if hints else ""
    return SlamError(f"RTAB-Map {known.version} knows no parameter '{name}'.{hint}")


def _fits(value: str, parameter: Parameter) -> bool:
    try:
        match parameter.type:
            case "bool":
                return value in ("true", "false")
            case "int" | "unsigned int":
                return int(value) >= 0 or parameter.type == "int"
            case "float" | "double":
                return abs(float(value)) < float("inf")
    except ValueError:
        return False
    return True
