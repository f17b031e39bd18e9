"""The bones of a person and how they move."""

from dataclasses import dataclass

import numpy as np

from sim.geometry import FloatArray


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
        along = np.asarray(self.parents[1:])
        steps = np.einsum("bij,bj->bi", R_body_rest[along], self.heads[1:] - self.heads[along]).tolist()
        heads = [root_body.tolist()]  # numbers of Python: a sum of two short arrays costs more than of their elements
        for parent, (dx, dy, dz) in zip(self.parents[1:], steps, strict=True):
            x, y, z = heads[parent]
            heads.append([x + dx, y + dy, z + dz])
        matrices = np.zeros((len(self.names), 4, 4))
        matrices[:, 3, 3] = 1.0
        matrices[:, :3, :3] = R_body_rest
        matrices[:, :3, 3] = np.array(heads) - np.einsum("bij,bj->bi", R_body_rest, self.heads)
        return matrices
