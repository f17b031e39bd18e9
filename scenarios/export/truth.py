"""What every exported folder states beside the images: the objects, the keypoints, and what was rendered."""

import math
from typing import Any

from dotmask.partial_folder import GrowingFiles
from dotmask.tum import pose_columns, stamp_text
from scenarios.export.coco_names import SKELETON
from scenarios.export.json_list import JsonList
from scenarios.spec import Scenario
from sim.people.keypoints import KEYPOINT_NAMES
from sim.records import KeypointsTruth, ObjectTruth, SimFrame

OBJECTS_FILE, KEYPOINTS_FILE, SCENARIO_FILE = "objects.csv", "keypoints.json", "scenario.json"

OBJECT_COLUMNS = (
    "timestamp_s", "name", "instance_id", "class_name",
    "tx", "ty", "tz", "qx", "qy", "qz", "qw",
    "centre_x_m", "centre_y_m", "centre_z_m", "velocity_x_m_s", "velocity_y_m_s", "velocity_z_m_s",
    "surface_speed_m_s", "is_moving", "visible_pixels", "occlusion", "is_truncated",
)  # fmt: skip


class TruthFiles:
    """Writes `objects.csv`, `keypoints.json` and `scenario.json`.

    Args:
        files: of the folder.
        scenario: what is rendered.
    """

    def __init__(self, files: GrowingFiles, scenario: Scenario) -> None:
        self._files, self._scenario = files, scenario
        self._keypoints = JsonList(
            files,
            KEYPOINTS_FILE,
            {"keypoints": list(KEYPOINT_NAMES), "skeleton": [list(pair) for pair in SKELETON]},
            "frames",
        )

    def begin(self) -> None:
        """Write the headers."""
        self._files.write(SCENARIO_FILE, self._scenario.to_json())
        self._files.append(OBJECTS_FILE, ",".join(OBJECT_COLUMNS) + "\n")
        self._keypoints.begin()

    def add(self, frame: SimFrame) -> None:
        """Append the truth of one frame."""
        rows = (",".join(_row(frame.timestamp_s, actor)) + "\n" for actor in frame.truth.objects)
        self._files.append(OBJECTS_FILE, "".join(rows))
        people = [
            {"name": actor.name, "instance_id": actor.instance_id, **_keypoints(actor.keypoints)}
            for actor in frame.truth.objects
            if actor.keypoints is not None
        ]
        self._keypoints.add({"timestamp_s": round(frame.timestamp_s, 6), "people": people})

    def finish(self) -> None:
        """Close the files."""
        self._keypoints.finish()


def decimal(value: float, digits: int = 6) -> str:
    """A number with so many digits, and never a negative zero."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def _row(time_s: float, actor: ObjectTruth) -> list[str]:
    pose = pose_columns(actor.T_world_object)
    return [
        stamp_text(time_s),
        actor.name,
        str(actor.instance_id),
        actor.class_name,
        *(decimal(x) for x in pose[:3]),
        *(decimal(x, 9) for x in pose[3:]),
        *(decimal(x) for x in (*actor.centre_world, *actor.velocity_world, actor.surface_speed_m_s)),
        str(int(actor.is_moving)),
        str(actor.visible_pixels),
        decimal(actor.occlusion),
        str(int(actor.is_truncated)),
    ]


def _keypoints(truth: KeypointsTruth) -> dict[str, Any]:
    return {
        "world_m": [[round(float(x), 6) + 0.0 for x in point] for point in truth.world_m],
        "pixels": [
            None if math.isnan(u) else [round(float(u), 3) + 0.0, round(float(v), 3) + 0.0] for u, v in truth.pixels
        ],
        "visibility": [int(v) for v in truth.visibility],
    }
