"""Garments: cut from the body model's auxiliary "tights" surface and pushed out along its normals.

All cuts run along planes or smooth fields through the triangles, so hems are straight whatever the mesh.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tools.bake_humans.body import Body
from tools.bake_humans.mesh import (
    Array,
    Mesh,
    border_edges,
    clip,
    compact,
    fold_hems,
    join,
    largest_component,
    simplify,
    smooth,
    subdivide,
    unit,
    vertex_normals,
    weld,
)
from tools.bake_humans.texture import noise

FAR = 0.05
"""Value of a cut's field where that cut does not apply."""
FACES = {"shirt": 2150, "trousers": 1600, "shoes": 1150}
SOLE_EDGE_M = 0.013
"""Below this height the foot surface becomes the flat underside of the shoe."""
HANDS = ("Hand", "Thumb", "Finger")


class Tailor:
    """The tights of one body, and the heights at which they are cut.

    Attributes:
        neck_z, hem_z, ankle_z: neckline at the back, lower edge of the shirt, lower edge of the trousers.
    """

    def __init__(self, body: Body, seed: int) -> None:
        self.body = body
        self.seed = seed
        tights = subdivide(compact(Mesh(body.vertices, body.faces["tights"], body.weights)))
        vertices = smooth(tights.vertices, tights.faces, 3)
        # Smoothed normals: cloth spans the hollows of the body.
        outward = unit(smooth(vertex_normals(vertices, tights.faces), tights.faces, 8))
        self.tights = Mesh(vertices, tights.faces, np.c_[tights.weights, outward])
        self.neck_z = float(body.head("Neck")[2]) + 0.030
        self.hem_z = float(body.head("Hips")[2]) - 0.085
        self.ankle_z = float(body.head("LeftFoot")[2]) - 0.020
        self.crotch_z = float(body.head("Hips")[2]) - 0.13

    def arm(self, weights: Array) -> Array:
        """Share of arm and hand in the weights."""
        return self.body.share(weights, "Arm", *HANDS)

    def neckline(self, vertices: Array) -> Array:
        """Height above the neckline, which is lower in front than behind."""
        neck = self.body.head("Neck")
        return vertices[:, 2] - (self.neck_z + 0.50 * np.clip(vertices[:, 1] - neck[1], -0.10, 0.03))

    def shirt(self) -> Mesh:
        """Long sleeves, worn over the trousers."""
        body = self.body

        def neck(v: Array, w: Array) -> Array:
            return np.where(self.arm(w) > 0.3, FAR, -self.neckline(v))

        def hem(v: Array, w: Array) -> Array:
            sides = 0.022 * np.clip(np.abs(v[:, 0]) / 0.17, 0, 1) ** 3  # rises a little at the side seams
            return np.where(self.arm(w) > 0.3, FAR, v[:, 2] - self.hem_z - sides)

        def cuffs(v: Array, w: Array) -> Array:
            result = np.full(len(v), FAR)
            for side in ("Left", "Right"):
                elbow, wrist = body.head(side + "ForeArm"), body.head(side + "Hand")
                axis = (wrist - elbow) / np.linalg.norm(wrist - elbow)
                own = (self.arm(w) > 0.3) & (np.sign(v[:, 0]) == np.sign(wrist[0]))
                result[own] = 0.004 - (v[own] - wrist) @ axis
            return result

        mesh = largest_component(clip(clip(clip(self.tights, hem), neck), cuffs))
        v, w = mesh.vertices, mesh.weights
        trunk = 1 - np.clip(self.arm(w) * 2, 0, 1)
        waist_z = body.head("LowerBack")[2] + 0.04
        coarse, fine = noise(v, 4, self.seed, "shirt"), noise(v * [1, 1, 0.55], 9, self.seed, "shirt folds")
        flare = 0.014 * np.clip((waist_z - v[:, 2]) / 0.2, 0, 1) * trunk
        near_neck = np.clip(-self.neckline(v) / 0.05, 0, 1)
        self._rim = cKDTree(v[self._neck_rim(mesh)])
        offset = 0.005 + near_neck * (0.009 + 0.0025 * coarse + 0.0025 * fine) + flare
        # Near a hem the cloth moves across the cut only, so that the hem stays straight.
        push = mesh.weights[:, -3:].copy()
        near_hem = trunk * np.clip(1.5 - (v[:, 2] - self.hem_z) / 0.05, 0, 1)
        push[:, 2] *= 1 - near_hem
        for side in ("Left", "Right"):
            elbow, wrist = body.head(side + "ForeArm"), body.head(side + "Hand")
            axis = (wrist - elbow) / np.linalg.norm(wrist - elbow)
            own = (1 - trunk) * (np.sign(v[:, 0]) == np.sign(wrist[0]))
            near_cuff = own * np.clip(1.5 + ((v - wrist) @ axis) / 0.05, 0, 1)
            push -= (near_cuff * (push @ axis))[:, None] * axis
        return self._finish("shirt", mesh, push * offset[:, None], hem_depth=0.024)

    def trousers(self) -> Mesh:
        """From under the shirt to the shoes."""

        def upper(v: Array, w: Array) -> Array:
            return self.hem_z + 0.07 - v[:, 2]

        def lower(v: Array, w: Array) -> Array:
            return v[:, 2] - self.ankle_z

        legs = self.tights.faces[(self.arm(self.tights.weights) < 0.3)[self.tights.faces].all(1)]
        mesh = largest_component(clip(clip(Mesh(self.tights.vertices, legs, self.tights.weights), upper), lower))
        v = mesh.vertices
        low = np.clip((self.crotch_z - v[:, 2]) / 0.6, 0, 1)
        coarse, fine = noise(v, 4, self.seed, "legs"), noise(v * [1, 1, 1.6], 8, self.seed, "leg folds")
        offset = 0.005 + (0.016 + 0.002 * coarse + 0.002 * fine) * np.sqrt(low)
        push = mesh.weights[:, -3:].copy()
        push[:, 2] *= np.clip((v[:, 2] - self.ankle_z) / 0.05 - 0.5, 0, 1)
        return self._finish("trousers", mesh, push * offset[:, None], hem_depth=0.026)

    def shoes(self) -> Mesh:
        """Both, with a flat sole on z = 0."""
        top = self.ankle_z + 0.045

        def low(v: Array, w: Array) -> Array:
            return top - v[:, 2]

        foot = clip(self.tights, low)
        v, normal = foot.vertices, foot.weights[:, -3:]
        sole = np.clip((0.030 - v[:, 2]) / 0.02, 0, 1)
        pushed = Mesh(v + normal * (0.007 + 0.004 * sole)[:, None], foot.faces, foot.weights[:, :-3])
        # Cut along the edge of the sole, press flat what is under it: a sharp edge all around.
        upper = clip(pushed, lambda v, _: v[:, 2] - SOLE_EDGE_M)
        under = clip(pushed, lambda v, _: SOLE_EDGE_M - v[:, 2])
        height = upper.vertices[:, 2]
        stretched = np.maximum(height - SOLE_EDGE_M, 0) * 0.03 / (0.03 - SOLE_EDGE_M)
        upper.vertices[:, 2] = np.where(height < 0.03, stretched, height)
        under.vertices[:, 2] = 0.0
        shoes = simplify(weld(join(upper, under)), FACES["shoes"])[0]
        is_under = (shoes.vertices[shoes.faces, 2] == 0).all(1)
        upper, under = (compact(replace(shoes, faces=shoes.faces[part])) for part in (~is_under, is_under))
        top_only = border_edges(upper.faces)
        top_only = top_only[(upper.vertices[top_only, 2] > 0.03).all(1)]
        return join(fold_hems(upper, 0.010, top_only), under)

    def collar(self, shirt: Mesh) -> Mesh:
        """A folded collar around the shirt's neckline: a strip that stands up inside and falls over outside."""
        rim = self._neck_rim(shirt)
        centre = shirt.vertices[rim].mean(0)
        offset = shirt.vertices[rim] - centre
        order = np.argsort(np.arctan2(offset[:, 0], -offset[:, 1]), kind="stable")
        rim, offset = rim[order], offset[order]
        angle = np.arctan2(offset[:, 0], -offset[:, 1])  # 0 in front, growing to the person's left
        gap = 0.21
        theta = np.linspace(gap, 2 * np.pi - gap, 41)
        around = np.r_[angle - 2 * np.pi, angle, angle + 2 * np.pi]
        wrapped = np.where(theta > np.pi, theta - 2 * np.pi, theta)
        tripled = np.tile(shirt.vertices[rim], (3, 1))
        base = np.stack([np.interp(wrapped, around, tripled[:, k]) for k in range(3)], 1)
        weights = np.stack(
            [np.interp(wrapped, around, np.tile(shirt.weights[rim, k], 3)) for k in range(shirt.weights.shape[1])], 1
        )
        for _ in range(6):  # the rim's own points are uneven
            base[1:-1] = 0.25 * base[:-2] + 0.5 * base[1:-1] + 0.25 * base[2:]
        front = np.clip(np.cos(theta), 0, 1)  # 1 in front, 0 from the ears backwards
        radial = base - centre
        radial[:, 2] = 0
        radial = unit(radial)
        edge = 1 - np.clip((np.minimum(theta, 2 * np.pi - theta) - gap) / 0.55, 0, 1)
        up = np.array([0.0, 0.0, 1.0])
        stand, fall = 0.030 - 0.010 * front, 0.042 + 0.016 * front
        point = 0.034 * edge  # the tips
        tilt = 0.34 * stand
        rows = [
            base - up * 0.008 - radial * 0.004,
            base + up * stand[:, None] - radial * (tilt + 0.002)[:, None],
            base + up * (stand + 0.003)[:, None] - radial * (tilt - 0.001)[:, None],
            base + up * (stand - 0.004)[:, None] + radial * 0.004,
            base + up * (stand - 0.5 * fall)[:, None] + radial * (0.007 + 0.05 * fall)[:, None],
            base + up * (stand - fall - 0.4 * point)[:, None] + radial * (0.010 + 0.14 * fall)[:, None],
        ]
        n = len(theta)
        vertices = np.concatenate(rows)
        i = np.arange(n - 1)
        faces = []
        for r in range(len(rows) - 1):
            a, b = r * n + i, r * n + i + 1
            # Seen from outside, theta grows to the right of the viewer; the strip turns over at the fold.
            faces += [np.c_[a, b + n, b], np.c_[a, a + n, b + n]]
        return Mesh(vertices, np.concatenate(faces), np.tile(weights, (len(rows), 1)))

    def rim_distance(self, p: Array) -> Array:
        """Metres from p (n, 3) to the shirt's neckline."""
        return np.asarray(self._rim.query(p)[0])

    def _neck_rim(self, shirt: Mesh) -> Array:
        """Indices of the border vertices at the neckline."""
        rim = np.unique(border_edges(shirt.faces))
        rim = rim[self.arm(shirt.weights[rim]) < 0.3]
        return rim[np.abs(self.neckline(shirt.vertices[rim])) < 0.03]

    def _finish(self, name: str, mesh: Mesh, push: Array, hem_depth: float) -> Mesh:
        done = simplify(Mesh(mesh.vertices + push, mesh.faces, mesh.weights[:, :-3]), FACES[name])[0]
        return fold_hems(done, hem_depth)
