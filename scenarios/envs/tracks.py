"""Tracks as arrays of a fixed size."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from dotmask.records import Track
from scenarios.oracle import CLASSES

FARTHEST_M, FASTEST_M_S = 100.0, 100.0


def tracks_space(rows: int) -> spaces.Dict:
    """The space of `tracks_observation`."""
    return spaces.Dict(
        {
            "valid": spaces.MultiBinary(rows),
            "position": spaces.Box(-FARTHEST_M, FARTHEST_M, (rows, 3), np.float32),
            "velocity": spaces.Box(-FASTEST_M_S, FASTEST_M_S, (rows, 3), np.float32),
            "moving": spaces.MultiBinary(rows),
            "class": spaces.Box(-1, len(CLASSES) - 1, (rows,), np.int8),
            "id": spaces.Box(-1, 2**31 - 1, (rows,), np.int32),
        }
    )


def tracks_observation(tracks: Sequence[Track], rows: int) -> dict[str, Any]:
    """The first `rows` tracks in the order of their ids, the oldest first; what is in no row is not `valid`.

    Returns:
        `valid` (N,) 0 or 1; `position` (N, 3) metres and `velocity` (N, 3) metres per second in the world, 0 where not
        valid; `moving` (N,) 0 or 1; `class` (N,) index into the oracle's classes, `id` (N,), both -1 where not valid.
    """
    told: dict[str, Any] = {
        "valid": np.zeros(rows, np.int8),
        "position": np.zeros((rows, 3), np.float32),
        "velocity": np.zeros((rows, 3), np.float32),
        "moving": np.zeros(rows, np.int8),
        "class": np.full(rows, -1, np.int8),
        "id": np.full(rows, -1, np.int32),
    }
    for row, track in enumerate(sorted(tracks, key=lambda track: track.track_id)[:rows]):
        told["valid"][row] = 1
        told["position"][row] = np.clip(track.position_world, -FARTHEST_M, FARTHEST_M)
        told["velocity"][row] = np.clip(track.velocity_world, -FASTEST_M_S, FASTEST_M_S)
        told["moving"][row] = track.verdict is not None and track.verdict.is_moving
        told["class"][row] = CLASSES.index(track.class_name)
        told["id"][row] = track.track_id
    return told
