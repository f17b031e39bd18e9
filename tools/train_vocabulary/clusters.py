"""A tree of binary centres by k-majority (Grana et al., 2013), level by level."""

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]

ITERATIONS = 10


def k_majority(descriptors: Bytes, k: int, rng: np.random.Generator) -> tuple[npt.NDArray[np.intp], Bytes]:
    """Label (N,) of each of the descriptors (N, 32), and the centres (k, 32).

    Each bit of a centre is what most of its members have. The first centres are drawn one after the other, each with
    odds that rise with its squared distance to those before (k-means++). A centre that loses all members takes the
    descriptor that is furthest from its own.
    """
    centres = np.empty((k, 32), np.uint8)
    nearest = np.full(len(descriptors), 256, np.int64)
    for j in range(k):
        odds = nearest.astype(np.float64) ** 2
        at = rng.choice(len(descriptors), p=odds / odds.sum()) if odds.sum() > 0 else rng.integers(len(descriptors))
        centres[j] = descriptors[at]
        nearest = np.minimum(nearest, _distances(descriptors, centres[j : j + 1])[:, 0])
    for _ in range(ITERATIONS):
        distances = _distances(descriptors, centres)
        labels = distances.argmin(axis=1)
        own = distances[np.arange(len(labels)), labels]
        before = centres.copy()
        for j in range(k):
            members = descriptors[labels == j]
            if len(members):
                bits = np.unpackbits(members, axis=1).sum(axis=0, dtype=np.int64)
                centres[j] = np.packbits(2 * bits > len(members))
            else:
                furthest = int(own.argmax())
                centres[j], own[furthest] = descriptors[furthest], 0
        if np.array_equal(before, centres):
            break
    return _distances(descriptors, centres).argmin(axis=1), centres


def tree(descriptors: Bytes, branches: int, depth: int, rng: np.random.Generator) -> list[Bytes]:
    """The centres of each level, (branches^(level + 1), 32), in the order that `Vocabulary` states."""
    groups, levels = [descriptors], []
    for _ in range(depth):
        centres, members = [], []
        for group in groups:
            if len(group) < branches:
                # Too few to divide; the children repeat what there is.
                filled = group if len(group) else np.zeros((1, 32), np.uint8)
                centres.append(filled[np.arange(branches) % len(filled)])
                members += [group] + [group[:0]] * (branches - 1)
                continue
            labels, found = k_majority(group, branches, rng)
            centres.append(found)
            members += [group[labels == j] for j in range(branches)]
        levels.append(np.concatenate(centres))
        groups = members
    return levels


def _distances(descriptors: Bytes, centres: Bytes) -> npt.NDArray[np.int64]:
    """(N, K) differing bits."""
    a, b = np.ascontiguousarray(descriptors).view(np.uint64), np.ascontiguousarray(centres).view(np.uint64)
    distances = np.empty((len(a), len(b)), np.int64)
    for j, centre in enumerate(b):
        distances[:, j] = np.bitwise_count(a ^ centre).sum(axis=1, dtype=np.int64)
    return distances
