"""The bones of a person and how they move."""

from dataclasses import dataclass

import numpy as np

from sim.geometry import FloatArray
from sim.people import kernels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Skeleton:
    """The bones of one person at rest, in the body frame: z up, facing -y, +x is the person's left, soles at z = 0.

    Attributes:
        names: of the bones, the root first, parents before children.
        parents: index of each bone's parent, -1 for the root.
        heads: (B, 3) metres, the rest position of the joint at which each bone begins.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    heads: FloatArray

    def index(self, name: str) -> int:
        """The number of the bone `name`.

        Raises:
            ValueError: no bone has this name.
        """
        return self.names.index(name)

    def offset(self, R_body_rest: FloatArray, name: str) -> FloatArray:
        """(3,) metres from the head of the root bone to the head of the bone `name`, for turned bones (B, 3, 3)."""
        total = np.zeros(3)
        bone = self.index(name)
        while bone:
            parent = self.parents[bone]
            total += R_body_rest[parent] @ (self.heads[bone] - self.heads[parent])
            bone = parent
        return total

    def palette(self, R_body_rest: FloatArray, root_body: FloatArray) -> FloatArray:
        """Forward kinematics: skinning matrices (B, 4, 4) that map rest vertices into the body frame.

        Args:
            R_body_rest: (B, 3, 3) how far each bone has turned from its rest orientation, seen from the body frame.
            root_body: (3,) metres, where the head of the root bone is.

        Joints neither stretch nor slip: the head of a bone moves with its parent.
        """
        return np.asarray(kernels.forward_kinematics(np.array(self.parents), self.heads, R_body_rest, root_body))
