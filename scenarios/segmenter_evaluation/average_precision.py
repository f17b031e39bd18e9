"""COCO's average precision of masks, by pycocotools."""

import contextlib
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from dotmask.records import Detections, MaskImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueMask:
    """An instance of a class that is judged, in one image.

    Attributes:
        class_name: of the instance.
        mask: (H, W).
        counts: whether it is to be found; if not, finding it is not wrong either.
        is_reasonable: whether it counts among the reasonable ones too.
    """

    class_name: str
    mask: MaskImage
    counts: bool
    is_reasonable: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Precision:
    """Average precision of one class; None where there is nothing to be found.

    Attributes:
        ap: mean over the IoU 0.5 to 0.95.
        ap50: at an IoU of 0.5.
        ap50_reasonable: the same if the reasonable instances alone count.
        ap50_small, ap50_medium, ap50_large: the same of COCO's sizes: fewer than 32 x 32 visible pixels, than 96 x 96,
            and more.
        reasonable: how many instances were.
    """

    ap: float | None
    ap50: float | None
    ap50_reasonable: float | None
    ap50_small: float | None
    ap50_medium: float | None
    ap50_large: float | None
    reasonable: int


class AveragePrecision:
    """Collects true and found masks of many images; masks are kept as run lengths.

    Args:
        class_names: the classes that are judged.
    """

    def __init__(self, class_names: Sequence[str]) -> None:
        self._numbers = {name: number for number, name in enumerate(class_names, start=1)}
        self._images: list[dict[str, Any]] = []
        self._true: list[dict[str, Any]] = []
        self._found: list[dict[str, Any]] = []

    def see(self, size: tuple[int, int], true: Iterable[TrueMask], found: Detections) -> None:
        """Add an image.

        Args:
            size: height and width.
            true: every instance of a class that is judged.
            found: of any class and score.
        """
        image = len(self._images) + 1
        self._images.append({"id": image, "height": size[0], "width": size[1]})
        for one in true:
            annotation = self._annotation(image, one.class_name, one.mask, len(self._true) + 1)
            self._true.append(annotation | {"counts": one.counts, "is_reasonable": one.counts and one.is_reasonable})
        for class_name, mask, score in zip(found.class_names, found.masks, found.scores.tolist(), strict=True):
            if class_name in self._numbers:
                self._found.append(self._annotation(image, class_name, mask, len(self._found) + 1) | {"score": score})

    def by_class(self) -> dict[str, Precision]:
        """The figures of each class."""
        precision, of_reasonable = (self._precision(that_counts) for that_counts in ("counts", "is_reasonable"))
        figures = {}
        for n, (name, number) in enumerate(self._numbers.items()):
            ap50, small, medium, large = (_mean(precision[0, :, n, area]) for area in range(4))
            figures[name] = Precision(
                ap=_mean(precision[:, :, n, 0]),
                ap50=ap50,
                ap50_reasonable=_mean(of_reasonable[0, :, n, 0]),
                ap50_small=small,
                ap50_medium=medium,
                ap50_large=large,
                reasonable=sum(one["is_reasonable"] for one in self._true if one["category_id"] == number),
            )
        return figures

    def _precision(self, that_counts: str) -> npt.NDArray[np.float64]:
        """By IoU, recall, class and area (all, small, medium, large), if the true masks marked so count."""
        # COCO calls what does not count a crowd.
        true = [one | {"iscrowd": int(not one[that_counts])} for one in self._true]
        with open(os.devnull, "w", encoding="utf-8") as nowhere, contextlib.redirect_stdout(nowhere):
            evaluation = COCOeval(self._coco(true), self._coco(self._found), "segm")
            evaluation.evaluate()
            evaluation.accumulate()
        precision: npt.NDArray[np.float64] = evaluation.eval["precision"][..., -1]  # of at most 100 detections
        return precision

    def _annotation(self, image: int, class_name: str, mask: MaskImage, number: int) -> dict[str, Any]:
        return {
            "id": number,
            "image_id": image,
            "category_id": self._numbers[class_name],
            "segmentation": coco_mask.encode(np.asfortranarray(mask.view(np.uint8))),
            "area": int(np.count_nonzero(mask)),
        }

    def _coco(self, annotations: list[dict[str, Any]]) -> Any:
        made = COCO()
        categories = [{"id": number, "name": name} for name, number in self._numbers.items()]
        made.dataset = {"images": self._images, "categories": categories, "annotations": annotations}
        made.createIndex()
        return made


def _mean(precision: npt.NDArray[np.float64]) -> float | None:
    known = precision[precision > -1]
    return float(known.mean()) if known.size else None
