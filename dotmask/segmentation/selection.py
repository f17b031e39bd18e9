"""Which detections go on into the method."""

from itertools import pairwise

from dotmask.profiles import Profile
from dotmask.records import Detections


def select_detections(detections: Detections, profile: Profile) -> Detections:
    """The objects of interest with a score of at least the threshold, at most m of them, best first.

    Source: paper, Experimental Setup (p and m).
    """
    names = {model.name for model in profile.classes}
    wanted = [i for i, name in enumerate(detections.class_names) if name in names]
    return select_best(detections if len(wanted) == len(detections) else detections.select(wanted), profile)


def select_best(detections: Detections, profile: Profile) -> Detections:
    """The detections of any class with a score of at least the threshold, at most m of them, best first.

    Equal scores are ordered by their boxes, classes and masks, so the answer does not depend on the order in which a
    segmenter lists its detections.
    """
    scores, boxes = detections.scores.tolist(), detections.boxes_px.tolist()
    wanted = [i for i in range(len(detections)) if scores[i] >= profile.score_threshold]
    ranks = {i: (-scores[i], boxes[i], detections.class_names[i]) for i in wanted}
    best = sorted(wanted, key=ranks.__getitem__)
    if any(ranks[a] == ranks[b] for a, b in pairwise(best)):
        best = sorted(wanted, key=lambda i: (ranks[i], detections.masks[i].tobytes()))
    best = best[: profile.max_observations]
    return detections if best == list(range(len(detections))) else detections.select(best)
