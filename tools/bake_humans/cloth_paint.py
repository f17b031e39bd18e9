"""Colours of the clothes as functions of the rest position: cloth patterns, folds, seams, buttons, pockets."""

import numpy as np

from tools.bake_humans.body import Body
from tools.bake_humans.clothes import Tailor
from tools.bake_humans.mesh import Array
from tools.bake_humans.styles import Outfit
from tools.bake_humans.texture import generator, noise

FOLD_LIGHT_M = 0.012
"""Folds are shaded by their slope over this distance, as if lit from above."""


def paint_shirt(p: Array, tailor: Tailor, outfit: Outfit, seed: int) -> Array:
    """Colours (n, 3) of the shirt at p (n, 3)."""
    around, along, is_sleeve = _shirt_coordinates(p, tailor.body)
    image = _pattern(around, along, p, outfit, seed)
    front = (p[:, 1] < -0.02) & ~is_sleeve
    x = p[:, 0]
    if outfit.has_collar:
        image[front & (np.abs(x) < 0.017)] *= 0.93  # button strip
        image[front & (np.abs(np.abs(x) - 0.017) < 0.0016)] *= 0.6
        button = np.hypot(x, ((p[:, 2] / 0.085) % 1 - 0.5) * 0.085)
        image[front & (button < 0.0062)] = (236, 232, 222)
        image[front & (button < 0.0062) & (button > 0.0048)] = (150, 146, 140)
        pocket = _frame(x - 0.085, p[:, 2] - tailor.body.head("Spine1")[2] - 0.01, 0.048, 0.055, 0.0028)
        image[front & pocket] *= 0.62
        # The shadow of the collar.
        image *= 1 - 0.38 * np.clip(1.6 - tailor.rim_distance(p) / 0.042, 0, 1)[:, None]
    else:
        neckline = tailor.rim_distance(p)
        band = neckline < 0.020
        ribs = 0.9 + 0.1 * np.sin(around[band] * 1500)
        image[band] = np.array(outfit.colours[-1], float) * ribs[:, None]
        image[np.abs(neckline - 0.021) < 0.0015] *= 0.65
    cuff = is_sleeve & (along > _sleeve_length(tailor.body) - 0.045)
    image[cuff] *= 0.92
    image[is_sleeve & (np.abs(along - _sleeve_length(tailor.body) + 0.045) < 0.0018)] *= 0.6
    hem = ~is_sleeve & (np.abs(p[:, 2] - tailor.hem_z - 0.022 * np.clip(np.abs(x) / 0.17, 0, 1) ** 3 - 0.018) < 0.0016)
    image[hem] *= 0.68
    armhole = (np.abs(np.abs(x) - _armhole(tailor.body)) < 0.0016) & (_arm_distance(p, tailor.body) < 0.10)
    image[armhole] *= 0.72  # the seam where the sleeve begins
    return image * _shirt_shade(p, tailor, is_sleeve, along, seed)[:, None]


def paint_collar(p: Array, outfit: Outfit, seed: int) -> Array:
    """Colours of the collar: the shirt's pattern with a seam along its edge is too fine to see, so none."""
    around = np.arctan2(p[:, 0], -p[:, 1] - 0.02) * 0.075
    return _pattern(around, p[:, 2], p, outfit, seed) * (1.08 + 0.03 * noise(p, 20, seed, "collar"))[:, None]


def paint_trousers(p: Array, tailor: Tailor, outfit: Outfit, seed: int) -> Array:
    """Colours of the trousers."""
    hips_z, knee_z = tailor.body.head("Hips")[2], tailor.body.head("LeftLeg")[2]
    x = np.abs(p[:, 0])
    grain = generator(seed, "denim grain").normal(size=len(p))
    colour = np.array(outfit.trousers, float)
    if outfit.is_denim:
        twill = np.sin((p[:, 0] + p[:, 2]) * 2 * np.pi / 0.006)
        shade = 1 + 0.10 * noise(p, 4, seed, "denim") + 0.07 * grain + 0.05 * twill
        centre = np.interp(p[:, 2], [knee_z - 0.2, hips_z], [0.15, 0.11])
        worn = np.exp(-(((x - centre) / 0.05) ** 2)) * (p[:, 1] < 0.01)
        worn *= np.exp(-(((p[:, 2] - (knee_z + 0.22)) / 0.2) ** 2)) + 0.7 * np.exp(-(((p[:, 2] - knee_z) / 0.08) ** 2))
        shade = shade * (1 + 0.32 * worn)
    else:
        shade = 1 + 0.05 * noise(p, 6, seed, "cloth") + 0.045 * grain

    def folds(q: Array) -> Array:
        knee = np.exp(-(((q[:, 2] - knee_z) / 0.07) ** 2)) * (0.35 + 0.65 * (q[:, 1] > 0))
        ankle = np.exp(-(((q[:, 2] - tailor.ankle_z) / 0.10) ** 2))
        crotch = np.exp(-(((q[:, 2] - tailor.crotch_z) / 0.08) ** 2) - (q[:, 0] / 0.12) ** 2)
        rings = noise(
            np.c_[0.8 * q[:, 0] + 0.5 * q[:, 2], 0.8 * q[:, 1], 1.2 * q[:, 2]], 11, seed, "leg rings", octaves=2
        )
        rays = noise(np.c_[q[:, 0] * 0.6, q[:, 1] * 0.4, q[:, 2] + 0.6 * np.abs(q[:, 0])], 16, seed, "rays", octaves=2)
        return rings * (0.10 + 0.55 * knee + 0.75 * ankle) + 0.9 * rays * crotch

    slope = folds(p + np.array([0, 0, FOLD_LIGHT_M])) - folds(p)
    image = colour * (shade * (1 - 0.20 * np.clip(slope, -1.2, 1.2)))[:, None]
    side = np.abs(p[:, 1] - tailor.body.head("LeftLeg")[1] - 0.02) < 0.0028
    image[side] *= 0.72 if outfit.is_denim else 0.85
    inner = np.exp(-(((x - 0.02) / 0.03) ** 2)) * (p[:, 2] < tailor.crotch_z + 0.02)
    image *= (1 - 0.35 * inner)[:, None]
    if outfit.is_denim:
        stitch = np.array((172, 126, 70), float)
        image[(p[:, 1] > 0) & _frame(x - 0.088, p[:, 2] - (hips_z - 0.05), 0.058, 0.066, 0.0035)] = stitch
        pocket = (p[:, 1] < 0) & (np.abs(np.hypot(x - 0.17, p[:, 2] - hips_z - 0.02) - 0.09) < 0.0022)
        image[pocket] = stitch
        image[np.abs(p[:, 2] - tailor.ankle_z - 0.02) < 0.002] *= 0.75
    elif outfit.trousers[0] < 100:
        crease = np.abs(x - np.interp(p[:, 2], [tailor.ankle_z, hips_z], [0.2, 0.12])) < 0.003
        image[crease & (p[:, 1] < 0)] *= 1.12
    return image


def paint_shoes(p: Array, tailor: Tailor, outfit: Outfit, seed: int) -> Array:
    """Colours of the shoes: sole, upper, laces."""
    upper = np.array(outfit.shoes, float) * (1 + 0.10 * noise(p, 24, seed, "leather"))[:, None]
    z, toe = p[:, 2], tailor.body.head("LeftToeBase")
    cap = np.abs(p[:, 1] - toe[1] + 0.035) < 0.0022
    upper[cap] *= 0.6
    foot = tailor.body.head("LeftFoot")
    along = np.clip((p[:, 1] - toe[1]) / (foot[1] - toe[1]), -0.5, 1.5)
    middle = foot[0] + (toe[0] - foot[0]) * (1 - along)
    sideways = np.abs(np.abs(p[:, 0]) - middle)
    tongue = (sideways < 0.021) & (along > 0.0) & (along < 0.75) & (z > 0.045)
    upper[tongue] *= 0.75
    lace = tongue & (np.abs(((p[:, 1] / 0.015) % 1) - 0.5) < 0.2)
    upper[lace] = np.clip(np.array(outfit.soles, float) * 0.95, 0, 255)
    welt = z < 0.024
    image = np.where(
        welt[:, None], np.array(outfit.soles, float) * (1 + 0.03 * noise(p, 60, seed, "sole"))[:, None], upper
    )
    image[np.abs(z - 0.024) < 0.0018] *= 0.55
    image[z < 0.002] = (60, 58, 56)
    return image


def _pattern(u: Array, v: Array, p: Array, outfit: Outfit, seed: int) -> Array:
    """The cloth itself at metres u around and v along."""
    colours = [np.array(c, float) for c in outfit.colours]
    image = np.ones((len(u), 3)) * colours[0]
    if outfit.pattern == "plaid":
        period = 0.085
        for t in (u, v):
            for centre, width, strength, colour in (
                (0.0, 0.17, 0.58, colours[1]),
                (0.5, 0.045, 0.6, colours[2]),
                (0.27, 0.02, 0.5, colours[2]),
            ):
                distance = np.abs(((t / period - centre + 0.5) % 1) - 0.5)
                band = strength * np.clip(1.5 - distance / width * 1.5, 0, 1)[:, None]
                image = image * (1 - band) + colour * band
        image *= (1 + 0.05 * np.sin((u + v) * 2 * np.pi / 0.004))[:, None]
    elif outfit.pattern == "gingham":
        checks = ((u / 0.044) % 1 < 0.5).astype(float) + ((v / 0.044) % 1 < 0.5)
        image = image + (colours[1] - image) * np.array([0.0, 0.55, 1.0])[checks.astype(int)][:, None]
    elif outfit.pattern == "oxford":
        image[(u / 0.013) % 1 < 0.18] = colours[1]
        image *= (1 + 0.04 * np.sin((u + v) * 2 * np.pi / 0.003))[:, None]
    elif outfit.pattern == "dots":
        row = np.floor(v / 0.034)
        du, dv = (u / 0.034 + 0.5 * (row % 2)) % 1 - 0.5, v / 0.034 - row - 0.5
        image[np.hypot(du, dv) < 0.24] = colours[1]
    elif outfit.pattern == "knit":
        ribs = np.abs(np.sin(u * np.pi / 0.016)) ** 0.5
        stitch = np.sin((v + 0.004 * np.sin(u * 2 * np.pi / 0.016)) * 2 * np.pi / 0.007)
        image = colours[1] + (colours[0] - colours[1]) * (0.55 * ribs + 0.45 * (0.5 + 0.5 * stitch))[:, None]
        yoke = (v + 0.02) % 0.30 < 0.055
        zigzag = np.abs(((u / 0.03) % 1) - 0.5) * 0.05 + 0.015
        image[yoke & (np.abs((v + 0.02) % 0.30 - zigzag) < 0.009)] = colours[2]
    elif outfit.pattern == "stripe":
        image[(v / 0.044) % 1 < 0.45] = colours[1]
    elif outfit.pattern == "jersey_stripe":
        t = (v + 0.25) % 0.36
        image[(t > 0.10) & (t < 0.145)] = colours[1]
        image[((t > 0.155) & (t < 0.167)) | ((t > 0.078) & (t < 0.09))] = colours[2]
        image *= (1 + 0.05 * np.sin(u * 2 * np.pi / 0.005))[:, None]
    elif outfit.pattern == "floral":
        image = _floral(u, v, image, colours, seed)
    return image * (1 + 0.035 * generator(seed, "cloth grain").normal(size=len(p)))[:, None]


def _floral(u: Array, v: Array, image: Array, colours: list[Array], seed: int) -> Array:
    """Flowers of five petals and leaves, one in each cell of a shifted grid."""
    cell = 0.042
    row = np.floor(v / cell)
    column = np.floor(u / cell + 0.5 * (row % 2))
    rng = generator(seed, "flowers")
    table = rng.uniform(size=(64, 64, 4))
    r, c = row.astype(int) % 64, column.astype(int) % 64
    jitter = table[r, c]
    du = u / cell + 0.5 * (row % 2) - column - 0.5 - 0.25 * (jitter[:, 0] - 0.5)
    dv = v / cell - row - 0.5 - 0.25 * (jitter[:, 1] - 0.5)
    radius = np.hypot(du, dv)
    angle = np.arctan2(dv, du) + 6.28 * jitter[:, 2]
    petal = radius < 0.25 + 0.10 * np.cos(5 * angle) + 0.06 * jitter[:, 3]
    leaf = (np.abs(np.cos(angle)) > 0.93) & (radius < 0.47)
    image[leaf] = colours[2]
    flower = np.where((jitter[:, 3] > 0.4)[:, None], colours[1], colours[3])
    image[petal] = flower[petal]
    image[radius < 0.09] = (colours[0] * 0.8)[None]
    return image


def _shirt_shade(p: Array, tailor: Tailor, is_sleeve: Array, along: Array, seed: int) -> Array:
    """Brightness of folds and hollows."""
    body = tailor.body
    elbow = float(np.linalg.norm(body.head("LeftForeArm") - body.head("LeftArm")))
    waist_z, length = body.head("LowerBack")[2] + 0.03, _sleeve_length(body)

    def folds(q: Array, s: Array) -> Array:
        """Height of the folds; s runs down the sleeve."""
        bend = np.exp(-(((s - elbow) / 0.08) ** 2)) + 0.8 * np.exp(-(((s - length + 0.05) / 0.06) ** 2))
        sleeve = noise(np.c_[q[:, 0] * 0.25, q[:, 1] * 0.5, s], 18, seed, "sleeve rings", octaves=2)
        across = np.abs(q[:, 0])
        drapes = noise(np.c_[q[:, 0] + 0.35 * q[:, 2], 0.5 * q[:, 1], 0.30 * q[:, 2]], 9, seed, "drapes", octaves=2)
        creases = noise(np.c_[0.35 * q[:, 0], 0.5 * q[:, 1], q[:, 2] - 0.5 * across], 13, seed, "creases", octaves=2)
        low = np.exp(-(((q[:, 2] - waist_z) / 0.12) ** 2))
        return np.where(is_sleeve, sleeve * (0.3 + bend), 0.8 * drapes * (0.5 + 0.5 * low) + 0.55 * creases * low)

    step = np.where(is_sleeve, FOLD_LIGHT_M, 0.0)
    towards_light = np.array([0.6, 0, 1.0]) * FOLD_LIGHT_M
    slope = folds(p + towards_light * ~is_sleeve[:, None], along - step) - folds(p, along)
    armpit = body.head("LeftArm") - np.array([0.0, 0.0, 0.10])
    near = np.minimum(np.linalg.norm(p - armpit, axis=1), np.linalg.norm(p - armpit * [-1, 1, 1], axis=1))
    shade: Array = 1 - 0.22 * np.clip(slope, -1.2, 1.2) - 0.22 * np.exp(-((near / 0.06) ** 2))
    return shade * (1 + 0.02 * noise(p, 5, seed, "shade"))


def _armhole(body: Body) -> float:
    return float(body.head("LeftArm")[0]) + 0.005


def _arm_distance(p: Array, body: Body) -> Array:
    """Distance to the line from shoulder over elbow to wrist, of the nearer arm."""
    q = np.abs(p) * [1, 0, 0] + p * [0, 1, 1]
    shoulder, elbow, wrist = (body.head("Left" + b) for b in ("Arm", "ForeArm", "Hand"))
    result = np.full(len(p), np.inf)
    for a, b in ((shoulder, elbow), (elbow, wrist)):
        t = np.clip((q - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)[:, None]
        result = np.minimum(result, np.linalg.norm(q - a - t * (b - a), axis=1))
    return result


def _sleeve_length(body: Body) -> float:
    shoulder, elbow, wrist = (body.head("Left" + b) for b in ("Arm", "ForeArm", "Hand"))
    return float(np.linalg.norm(elbow - shoulder) + np.linalg.norm(wrist - elbow))


def _shirt_coordinates(p: Array, body: Body) -> tuple[Array, Array, Array]:
    """Metres around and along: the trunk as two panels, each arm about its two bones; and which is sleeve."""
    is_sleeve = (np.abs(p[:, 0]) > _armhole(body)) & (_arm_distance(p, body) < 0.10)
    x, y = p[:, 0], p[:, 1] - body.head("LeftArm")[1]
    # Front and back are flat panels that meet in side seams and on the shoulders, as a shirt is cut.
    towards_side = _ramp(np.abs(x), 0.10, 0.17)
    around = np.sign(x) * (np.abs(x) + towards_side * (0.10 - np.abs(y)))
    on_top = _ramp(p[:, 2], body.head("LeftArm")[2] - 0.08, body.head("LeftArm")[2] + 0.04)
    along = p[:, 2] - 0.9 * on_top * np.minimum(np.abs(y), 0.05)
    for side in ("Left", "Right"):
        shoulder, elbow, wrist = (body.head(side + b) for b in ("Arm", "ForeArm", "Hand"))
        own = is_sleeve & (np.sign(p[:, 0]) == np.sign(wrist[0]))
        q = p[own]
        upper_length = np.linalg.norm(elbow - shoulder)
        upper_axis = (elbow - shoulder) / upper_length
        fore_axis = (wrist - elbow) / np.linalg.norm(wrist - elbow)
        # The bend is spread over 8 cm so that the pattern does not break at the elbow.
        bend = np.clip(((q - shoulder) @ upper_axis - upper_length) / 0.08 + 0.5, 0, 1)[:, None]
        level = np.cross(upper_axis, [0.0, 1.0, 0.0])
        level /= np.linalg.norm(level)
        up = np.cross(upper_axis, level)
        r = (q - shoulder) * (1 - bend) + (q - elbow) * bend
        around[own] = np.arctan2(r @ up, r @ level) * 0.055
        bend = bend[:, 0]
        along[own] = (q - shoulder) @ upper_axis * (1 - bend) + ((q - elbow) @ fore_axis + upper_length) * bend
    return around, along, is_sleeve


def _ramp(x: Array, low: float, high: float) -> Array:
    """From 0 at `low` to 1 at `high`."""
    return np.clip((x - low) / (high - low), 0, 1)


def _frame(u: Array, v: Array, half_width: float, half_height: float, thickness: float) -> Array:
    """Outline of a rectangle centred at 0."""
    inside = (np.abs(u) < half_width) & (np.abs(v) < half_height)
    return inside & ((half_width - np.abs(u) < thickness) | (half_height - np.abs(v) < thickness))
