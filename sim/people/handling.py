"""What people do to things: they push chairs with both hands, and carry cups and boxes.

Every person's motion (`sim.people.motion.PersonMotion`) is a `Handler`. Physics reads from it where the hands are; the
motion of a carried thing follows `T_world_grip`.
"""

from dataclasses import dataclass
from typing import Protocol

from sim.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ChairContact:
    """A time in which a person's hands are at the back of a chair.

    The person stands behind the chair and looks where the chair looks. From `start_s` on the hands, which touch the
    back of the chair's back, move straight ahead; they speed up and slow down smoothly and stand still at `end_s`.

    Attributes:
        chair: name of the chair.
        start_s, end_s: seconds; outside the hands are away from the chair or on their way.
    """

    chair: str
    start_s: float
    end_s: float


class Handler(Protocol):
    """A motion that handles things."""

    @property
    def pushes(self) -> tuple[ChairContact, ...]:
        """All times in which chairs are pushed, in order."""
        ...

    def hands_at(self, time_s: float) -> FloatArray:
        """(2, 3) world, metres: where the left and right palm touch what they push. Defined during `pushes` only.

        Raises:
            MotionError: no chair is pushed at this time.
        """
        ...

    def T_world_grip(self, time_s: float) -> FloatArray:
        """(4, 4) the foot of the carried thing: the centre of its bottom face.

        z is up, -y ahead and +x to the left of the person. A cup stands upright in the right hand, a box lies in both,
        its width along x, its depth along y.

        Raises:
            MotionError: the person carries nothing.
        """
        ...
