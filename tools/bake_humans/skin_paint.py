"""Colours of the skin as functions of the rest position: lips, lids, brows, beard, scalp."""

import numpy as np

from tools.bake_humans.body import Body
from tools.bake_humans.hair import above_hairline
from tools.bake_humans.keypoints import nose_tip
from tools.bake_humans.mesh import Array
from tools.bake_humans.styles import Style
from tools.bake_humans.texture import generator, noise


def paint_skin(p: Array, hollow: Array, lips: Array, body: Body, style: Style) -> Array:
    """Colours of the skin at p (n, 3), given how hollow the surface is and how much of a lip (0..1)."""
    seed, eye = style.seed, body.eye()
    grain = generator(seed, "skin grain").normal(size=len(p))
    hair = np.array(style.hair, float)
    image = np.array(style.skin, float) * (1 + 0.025 * noise(p, 12, seed, "skin") + 0.015 * grain)[:, None]
    is_head = p[:, 2] > body.head("Neck")[2]
    front = is_head & (p[:, 1] < eye[1] + 0.06)
    x, z = np.abs(p[:, 0]), p[:, 2] - eye[2]

    def glow(du: Array, dv: Array, width: float, height: float) -> Array:
        return np.exp(-((du / width) ** 2) - (dv / height) ** 2)

    red = 0.10 * glow(x - 0.044, z + 0.042, 0.020, 0.020) * front + 0.12 * glow(x, z + 0.045, 0.014, 0.014) * front
    red += 0.08 * is_head * np.exp(-(((x - 0.078) / 0.012) ** 2)) + 0.05 * ~is_head
    image *= 1 - red[:, None] * [0.15, 0.9, 0.9]
    image *= 1 - 0.20 * (glow(x - eye[0], z - 0.006, 0.022, 0.012) * front)[:, None] * [0.7, 0.9, 0.9]
    image *= 1 - np.clip(0.55 * hollow, -0.10, 0.60)[:, None] * [0.75, 1.0, 1.05]

    mouth = (lips * front)[:, None] * 0.8
    image = image * (1 - mouth) + np.array(style.lips, float) * (1 - 0.25 * np.clip(hollow, 0, 1))[:, None] * mouth

    # The rim of the lids: skin that almost touches the eyeball. Dark above (lashes), faint below.
    centre = np.where(p[:, :1] > 0, eye, eye * [-1, 1, 1])
    gap = np.linalg.norm(p - centre, axis=1) - body.eye_radius()
    lid = np.clip(1.2 - gap / style.lash_m, 0, 1) * front
    lash = lid * np.where(p[:, 2] > centre[:, 2] - 0.001, 0.85, 0.35)
    image = image * (1 - lash[:, None]) + np.array((34, 24, 20.0)) * lash[:, None]

    brow_x = (x - eye[0] - 0.004) / 0.024
    arch = 0.0185 + 0.0035 * (1 - brow_x**2) + 0.0010 * brow_x
    thick = style.brow_m * (1 - 0.35 * np.clip(brow_x, -1, 1))
    strokes = 0.85 + 0.16 * noise(p * [1.0, 1, 1.6], 60, seed, "brows", octaves=1)
    brow = np.clip(1.4 - np.abs(z - arch) / thick, 0, 1) * np.clip((1.05 - np.abs(brow_x)) * 6, 0, 1) * front
    brow = np.clip(brow * strokes, 0, 0.88)[:, None]
    image = image * (1 - brow) + hair * 0.75 * brow

    if style.beard:
        under_nose = nose_tip(body)[2] - eye[2] - 0.018
        jaw = np.exp(-(((z - under_nose + 0.046) / 0.036) ** 2)) * np.clip((eye[1] + 0.085 - p[:, 1]) / 0.03, 0, 1)
        burns = np.clip(1 - np.abs(p[:, 1] - eye[1] - 0.062) / 0.012, 0, 1) * (z < -0.01) * (z > -0.10)
        moustache = glow(x, z - under_nose, 0.024, 0.007) * front
        amount = np.clip(1.3 * jaw + 0.9 * moustache + style.beard * burns, 0, 1) * is_head * (1 - lips)
        amount = amount * np.clip((p[:, 2] - body.head("Neck1")[2] + 0.005) / 0.03, 0, 1)
        bristle = 1 + 0.25 * grain + 0.25 * noise(p, 90, seed, "beard", octaves=1)
        amount = np.clip(style.beard * amount * bristle, 0, 0.92)[:, None]
        image = image * (1 - amount) + (0.25 * image + 0.6 * hair) * amount

    root = above_hairline(p, body, style) + 0.003 * noise(p, 55, seed, "hairline", octaves=2)
    scalp = np.clip(root / 0.010, 0, 1) * is_head
    ear = (x > 0.070) & (z > -0.06) & (z < 0.022) & (p[:, 1] > eye[1] + 0.055) & (p[:, 1] < eye[1] + 0.115)
    scalp = (scalp * ~ear)[:, None]
    image = image * (1 - scalp) + hair * (0.8 + 0.15 * noise(p * [3, 1, 1], 40, seed, "scalp"))[:, None] * scalp

    return image
