"""What distinguishes the networks of the YOLACT family."""

from dataclasses import dataclass
from typing import Literal

from dotmask.segmentation.coco import COCO_CLASSES

Backbone = Literal["resnet50", "resnet50_deformable", "compact"]


@dataclass(frozen=True, slots=True, kw_only=True)
class YolactDesign:
    """One network of the family.

    Attributes:
        class_names: COCO names of the classes; class 0 of the network is background and not among them.
        height, width: of the image that the network is given, pixels; other images are stretched to it.
        backbone: what the features come from.
        channels: of the feature pyramid, the prototype network and the head.
        prototypes: number of prototype masks, and so of coefficients.
        scales_px: of the anchors, for each level of the pyramid, pixels of the network's image.
        aspect_ratios: width over height of the anchors.
        has_square_anchors: whether an anchor's height is set to its width: a slip of the authors' program that the
            published YOLACT was trained with, and YOLACT++ was not.
        rescores_masks: whether a score is multiplied with the IoU that a small network expects of the mask (YOLACT++).
        sees_depth: whether the network is given the depth image beside the colours.
        is_normalised: whether the convolutions behind the backbone are followed by group normalisation (Wu and He, ECCV
            2018). The published networks begin with a trained backbone and need none; in one that began with random
            weights, a quarter to two thirds of the channels of each of these layers fell silent.
        weighs_certainty: whether a score is multiplied with the certainty of the mask, the mean of its values above one
            half (Wang et al., SOLO: a simple framework for instance segmentation, TPAMI 2021).
        least_mask_px: masks with fewer pixels of the image are left out.
    """

    class_names: tuple[str, ...]
    height: int
    width: int
    backbone: Backbone
    channels: int
    prototypes: int
    scales_px: tuple[tuple[float, ...], ...]
    aspect_ratios: tuple[float, ...] = (1.0, 0.5, 2.0)
    has_square_anchors: bool = False
    rescores_masks: bool = False
    sees_depth: bool = False
    is_normalised: bool = False
    weighs_certainty: bool = False
    least_mask_px: int = 1

    @property
    def image_channels(self) -> int:
        """Of what the network is given."""
        return 4 if self.sees_depth else 3

    @property
    def anchors_a_cell(self) -> int:
        """Number of anchors at each place of each level."""
        return len(self.scales_px[0]) * len(self.aspect_ratios)

    @property
    def level_sizes(self) -> tuple[tuple[int, int], ...]:
        """Height and width of the levels P3 to P7: every layer of stride 2 halves, rounding up."""
        return tuple((-(-self.height // 2**n), -(-self.width // 2**n)) for n in range(3, 8))


_LEVELS_PX = (24.0, 48.0, 96.0, 192.0, 384.0)

YOLACT = YolactDesign(
    class_names=COCO_CLASSES,
    height=550,
    width=550,
    backbone="resnet50",
    channels=256,
    prototypes=32,
    scales_px=tuple((scale,) for scale in _LEVELS_PX),
    has_square_anchors=True,
)
"""YOLACT-550 with ResNet-50-FPN."""

YOLACT_PLUS = YolactDesign(
    class_names=COCO_CLASSES,
    height=550,
    width=550,
    backbone="resnet50_deformable",
    channels=256,
    prototypes=32,
    scales_px=tuple(tuple(scale * 2 ** (n / 3) for n in range(3)) for scale in _LEVELS_PX),
    rescores_masks=True,
    least_mask_px=25,
)
"""YOLACT++ with ResNet-50-FPN: deformable convolutions, three scales a level, masks scored anew."""

COMPACT = YolactDesign(
    class_names=("person", "chair", "cup", "bottle"),
    height=240,
    width=320,
    backbone="compact",
    channels=64,
    prototypes=24,
    # So large beside the distance of the cells (8 to 128 px) that most objects have several anchors to learn from.
    scales_px=((18.0, 26.0), (36.0, 52.0), (72.0, 104.0), (144.0, 208.0), (256.0, 340.0)),
    aspect_ratios=(1.0, 0.4, 2.0),
    sees_depth=True,
    is_normalised=True,
    weighs_certainty=True,
)
"""A small network for two cores without a GPU, and for the paper's four classes alone."""
