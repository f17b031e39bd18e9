"""Which keyframes look like this one: bags of visual words, compared as in DBoW2 (Galvez-Lopez & Tardos, T-RO 2012)."""

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dotmask.slam.vocabulary import BagOfWords


@dataclass(frozen=True, slots=True, kw_only=True)
class SimilarPlace:
    """A keyframe that looks like the image in question.

    Attributes:
        place: its number.
        similarity: share of the words' weight that both have, 0 to 1.
    """

    place: int
    similarity: float


class PlaceRecognition:
    """The words of all places, by number.

    Args:
        words: how many words there are.
    """

    def __init__(self, words: int) -> None:
        # A column for each place, so that the words of a query are whole rows; grown by doubling.
        self._weights = np.zeros((words, 16), np.float32)
        self._places: list[int] = []

    def __len__(self) -> int:
        """How many places are known."""
        return len(self._places)

    def add(self, place: int, bag: BagOfWords) -> None:
        """Remember a place; numbers must rise.

        Raises:
            ValueError: the number is not greater than all before.
        """
        if self._places and place <= self._places[-1]:
            raise ValueError(f"place {place} does not come after {self._places[-1]}")
        column = len(self._places)
        if column == self._weights.shape[1]:
            self._weights = np.concatenate([self._weights, np.zeros_like(self._weights)], axis=1)
        self._weights[:, column] = 0
        self._weights[bag.words, column] = bag.weights
        self._places.append(place)

    def forget(self, place: int) -> None:
        """Remove a place."""
        column, count = self._places.index(place), len(self._places)
        self._weights[:, column : count - 1] = self._weights[:, column + 1 : count]
        del self._places[column]

    def similarities(self, bag: BagOfWords) -> npt.NDArray[np.float32]:
        """Similarity of `bag` to each place, in the order of their numbers, see `BagOfWords.similarity`."""
        known = self._weights[bag.words, : len(self._places)]
        return np.asarray(np.minimum(known, bag.weights[:, None]).sum(axis=0))

    def similar(
        self, bag: BagOfWords, *, count: int, least: float = 0.0, before: int | None = None
    ) -> tuple[SimilarPlace, ...]:
        """The places most similar to `bag`, the best first; of a run of places in a row, the best one alone.

        A place that has no word of `bag` is never similar.

        Args:
            bag: the words of the image.
            count: at most this many.
            least: with a similarity of at least this.
            before: places with this number and later ones are left out; None for an image that has no place yet.
        """
        known = len(self._places) if before is None else bisect_left(self._places, before)
        places = np.array(self._places[:known], np.intp)
        scores = self.similarities(bag)[:known]
        padded = np.concatenate([[-np.inf], scores, [-np.inf]])
        # One look at a place leaves several keyframes that are about as similar; a local maximum stands for them.
        enough = (scores >= least) & (scores > 0)
        peaks = np.flatnonzero(enough & (scores > padded[:-2]) & (scores >= padded[2:]))
        best = peaks[np.argsort(-scores[peaks], kind="stable")][:count]
        return tuple(SimilarPlace(place=int(places[k]), similarity=float(scores[k])) for k in best)
