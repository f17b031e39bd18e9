"""Errors of loop closures against poses whose relation is known."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dotmask.evaluation.loops import loop_errors
from dotmask.geometry import inverse
from dotmask.records import FloatArray, LoopClosure, LoopKind


def pose(angle_rad: float, *position: float) -> FloatArray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.0, 0.0, angle_rad]).as_matrix()
    T[:3, 3] = position
    return T


TRUTH = {0: pose(0.3, 1.0, 2.0, 0.5), 40: pose(-1.2, 0.0, 1.0, 0.7), 90: pose(2.0, 3.0, 0.0, 0.6)}


def closed(later: int, earlier: int, error: FloatArray) -> LoopClosure:
    T_from_to = inverse(TRUTH[later]) @ TRUTH[earlier] @ error
    return LoopClosure(from_index=later, to_index=earlier, T_from_to=T_from_to, kind=LoopKind.GLOBAL)


def test_without_loops_nothing_is_measured() -> None:
    assert loop_errors([], TRUTH) is None


def test_errors_are_those_put_in() -> None:
    loops = [
        closed(40, 0, np.eye(4)),
        closed(90, 0, pose(0.02, 0.03, 0.0, 0.04)),
        closed(90, 40, pose(0.0, 0.0, 0.2, 0.0)),
    ]
    errors = loop_errors(loops, TRUTH)
    assert errors is not None
    assert (errors.count, errors.false_count) == (3, 1)
    assert errors.trans_error_m == pytest.approx((0.0 + 0.05 + 0.2) / 3)
    assert errors.trans_error_max_m == pytest.approx(0.2)
    assert errors.rot_error_rad == pytest.approx(0.02 / 3)


def test_a_loop_leads_back_in_time() -> None:
    with pytest.raises(ValueError, match="back in time"):
        LoopClosure(from_index=3, to_index=3, T_from_to=np.eye(4), kind=LoopKind.GLOBAL)
