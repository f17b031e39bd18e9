"""Faults of what is said about a mask: its class, its score, its place in the list."""

from dataclasses import replace

import numpy as np

from scenarios.faults.found import Dice, Found
from scenarios.oracle import CLASSES
from scenarios.spec import ClassFlipsSpec, OrderSpec, ScoresSpec


def class_flips(found: Found, spec: ClassFlipsSpec, dice: Dice) -> Found:
    """One of the other classes, each as likely as the others."""
    if spec.probability == 0:
        return found
    class_names = []
    for name, class_name in zip(found.names, found.detections.class_names, strict=True):
        generator = dice.throw("class flips", name)
        if generator.random() < spec.probability:
            others = [other for other in CLASSES if other != class_name]
            class_name = others[generator.integers(len(others))]
        class_names.append(class_name)
    return replace(found, detections=replace(found.detections, class_names=tuple(class_names)))


def scores(found: Found, spec: ScoresSpec, dice: Dice) -> Found:
    """Every score drawn anew, so that their order says nothing."""
    if spec == ScoresSpec():
        return found
    drawn = [dice.throw("scores", name).uniform(spec.lowest, spec.highest) for name in found.names]
    return replace(found, detections=replace(found.detections, scores=np.array(drawn, np.float64)))


def order(found: Found, spec: OrderSpec, dice: Dice) -> Found:
    """A permutation, all of them as likely as each other."""
    if not spec.is_shuffled:
        return found
    place = [dice.throw("order", name).random() for name in found.names]
    return found.select(sorted(range(len(place)), key=place.__getitem__))
