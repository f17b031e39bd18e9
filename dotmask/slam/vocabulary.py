"""Visual words: what binary descriptors are alike (Galvez-Lopez & Tardos, T-RO 2012).

A tree divides the space of descriptors: each node has the same number of children, each with a centre, and a
descriptor goes to the nearest one, level by level. The leaves are the words. The words of an image, weighted by how
much each of them tells, are compared in place of its descriptors.
"""

import functools
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from dotmask.assets import asset_file, asset_places
from dotmask.errors import VocabularyError
from dotmask.records import checked
from dotmask.slam.features import Descriptors

WordIds = npt.NDArray[np.intp]
Weights = npt.NDArray[np.float32]

FILE = "slam/vocabulary.npz"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BagOfWords:
    """What an image shows, as words.

    Attributes:
        words: (M,) indices of the words that occur, rising.
        weights: (M,) float32, share of each word's term frequency times inverse document frequency; they sum to 1, or
            the bag is empty.
    """

    words: WordIds
    weights: Weights

    def similarity(self, other: "BagOfWords") -> float:
        """Share of the weight that both have, 0 to 1: `1 - |v - w|_1 / 2`."""
        _, mine, others = np.intersect1d(self.words, other.words, assume_unique=True, return_indices=True)
        return float(np.minimum(self.weights[mine], other.weights[others]).sum())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vocabulary:
    """A tree of binary centres.

    Attributes:
        levels: per level (number of nodes, 32) uint8; the children of node n are the nodes `n b` to `n b + b - 1` of
            the next level, with b the number of children, `len(levels[0])`.
        idf: (W,) float32, `ln(images / images with the word)` of each of the `len(levels[-1])` words.
    """

    levels: tuple[Descriptors, ...]
    idf: Weights

    def __post_init__(self) -> None:
        """Check that the levels make a tree and that every word has a weight."""
        branches = len(self.levels[0]) if self.levels else 0
        if branches < 2:
            raise ValueError("vocabulary: expected at least one level of at least two nodes")
        levels = tuple(
            checked(nodes, f"level {depth}", (branches ** (depth + 1), 32), np.uint8)
            for depth, nodes in enumerate(self.levels)
        )
        object.__setattr__(self, "levels", levels)
        object.__setattr__(self, "idf", checked(self.idf, "idf", (len(levels[-1]),), np.float32))

    def __len__(self) -> int:
        """The number of words."""
        return len(self.idf)

    def words_of(self, descriptors: Descriptors) -> WordIds:
        """The word of each descriptor (N, 32): (N,). Among centres of one distance, the first."""
        branches = len(self.levels[0])
        given = np.ascontiguousarray(descriptors).view(np.uint64)
        node = np.zeros(len(given), np.intp)
        for nodes in self.levels:
            centres = nodes.view(np.uint64).reshape(-1, branches, 4)[node]
            differing = np.bitwise_count(centres ^ given[:, None, :]).sum(axis=2, dtype=np.int64)
            node = node * branches + differing.argmin(axis=1)
        return node

    def parents_of(self, words: WordIds) -> WordIds:
        """The node above each of the words (N,) in the tree: words of one node are alike."""
        return words // len(self.levels[0])

    def bag_of(self, words_seen: WordIds) -> BagOfWords:
        """The bag of an image whose descriptors have the words (N,)."""
        words, counts = np.unique(words_seen, return_counts=True)
        weights = counts * self.idf[words]
        telling = weights > 0
        words, weights = words[telling], weights[telling]
        if len(words) == 0:
            return BagOfWords(words=words, weights=np.zeros(0, np.float32))
        return BagOfWords(words=words, weights=(weights / weights.sum()).astype(np.float32))


@functools.cache
def load_vocabulary() -> Vocabulary:
    """The vocabulary that comes with the package; `tools/train_vocabulary` makes it.

    Raises:
        VocabularyError: the file is missing or damaged.
    """
    path = asset_file(FILE)
    if path is None:
        missing = " or ".join(str(place) for place in asset_places(FILE))
        raise VocabularyError(f"no visual vocabulary in {missing}: reinstall the package")
    return read_vocabulary(path)


def read_vocabulary(path: Path) -> Vocabulary:
    """The vocabulary of an npz file with the arrays `level_0`, `level_1` and so on, and `idf`.

    Raises:
        VocabularyError: it cannot be read, or holds something else.
    """
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            depth = sum(name.startswith("level_") for name in file.files)
            return Vocabulary(levels=tuple(file[f"level_{k}"] for k in range(depth)), idf=file["idf"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise VocabularyError(
            f"the visual vocabulary {path} cannot be read ({error}): reinstall the package"
        ) from error
