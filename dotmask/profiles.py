"""Every parameter of the method, each with its source: the paper, or our own calibration.

Sources: "paper" is Vincent et al. 2020, Table I (Experimental Parameters) or the section named; "not in the paper"
marks a choice that the text leaves open; "calibrated" is chosen so that the filter is statistically consistent on noisy
frames of walking people and of chairs that people pass.
"""

import difflib
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dotmask.errors import ProfileError
from dotmask.records import FloatArray

PoseFeedback = Literal["previous", "constant_velocity", "refined"]
UnknownPolicy = Literal["mask", "keep"]
MaskAlignment = Literal["none", "box"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassModel:
    """What is known beforehand about one class of objects of interest.

    Attributes:
        name: COCO class name.
        acceleration_sigma_m_s2: random acceleration per axis, constant over one frame (paper, Table I).
        prior_speed_sigma_m_s: velocity of a new track per axis (not in the paper).
        speed_threshold_m_s: faster is moving (paper, Table I).
        vertical_share: factor on both sigmas above along the world's z: what stands on the floor does not take off; 1
            treats all axes alike (paper: components uncorrelated, no values per axis).
        is_non_rigid: whether the deformation test applies (paper, Moving Object Classification).
        shape_sigma_m: how far the measured point (box centre, mean depth) strays from the object's path because the
            shape changes (swinging arms and legs), along the camera's x, y, z (calibrated).
        extent_m: usual width, height and depth: bounds what a truncated or half hidden box can be off (calibrated).
        size_play: share by which the box's width and height differ from their usual size while nothing hides the
            object: the stride of a walking person (calibrated).
        hidden_factor: R is widened by this times the offset that a hidden side can cause. Above 1 because that offset
            does not change from frame to frame as white noise would: an error that lasts for n frames weighs as much
            as white noise with sqrt(n) times its sigma.
    """

    name: str
    acceleration_sigma_m_s2: float
    prior_speed_sigma_m_s: float
    speed_threshold_m_s: float
    vertical_share: float = 1.0
    is_non_rigid: bool = False
    shape_sigma_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    extent_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    size_play: tuple[float, float] = (0.0, 0.0)
    hidden_factor: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what no filter can use."""
        if not (self.acceleration_sigma_m_s2 > 0 and self.prior_speed_sigma_m_s > 0 and self.speed_threshold_m_s >= 0):
            raise ValueError(f"class {self.name}: sigmas must be positive and the speed threshold not negative")

    @property
    def axis_shares(self) -> FloatArray:
        """(3,) factors on the sigmas of acceleration and speed, world axes."""
        return np.array([1.0, 1.0, self.vertical_share])


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurementNoise:
    """The model behind R. The paper calls its diagonal "the imprecision of the RGB-D camera" and gives no values.

    Attributes:
        pixel_sigma_px: of the box centre, both axes; becomes `sigma z / f` metres.
        depth_sigma_m: of the mean depth at the near limit.
        depth_sigma_per_m: growth with (z - 0.4 m)², 1/m; structured light: 0.0019 (Nguyen et al. 2012, "Modeling
            Kinect sensor noise", eq. 5).
        is_diagonal: leave out that an error in depth moves x and y along the viewing ray.
        inflates_hidden_sides: widen R on an axis where the box ends at the image border or at something nearer.
        hidden_depth_share: share of the class's depth by which the mean depth of a half hidden object can be off.
        occluder_margin_m: how much nearer than the object an occluder must be at 0 m; grows by 0.02 z².
        pose_position_sigma_m: camera position, each axis.
        pose_rotation_sigma_rad: camera rotation; becomes `sigma z` metres sideways.
    """

    pixel_sigma_px: float
    depth_sigma_m: float
    depth_sigma_per_m: float
    is_diagonal: bool
    inflates_hidden_sides: bool = False
    hidden_depth_share: float = 0.0
    occluder_margin_m: float = 0.12
    pose_position_sigma_m: float = 0.0
    pose_rotation_sigma_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """A complete parameter set.

    Attributes:
        name: how it is asked for.
        classes: the objects of interest; other classes are neither tracked nor masked (paper, Experimental Setup).
        score_threshold: detections below it are dropped (paper, Table I).
        max_observations: at most this many detections, the best first (paper, Table I: m).
        max_misses: a track ends when it was not observed for this many frames (paper, Table I: e).
        noise: the model behind R.
        min_depth_pixels: fewer pixels with depth give no observation (not in the paper).
        depth_trim_m: pixels farther than this from the median depth of the mask are left out of the mean; None keeps
            all (paper: "average depth from the masked region").
        gate_probability: an observation is a candidate for a track if its squared Mahalanobis distance is below this
            quantile of chi-square with 3 degrees of freedom (not in the paper).
        jump_share: share of an object that may be hidden or freed from one frame to the next. R is widened by what is
            missing of a box's usual size, and tracks and observations left over by the gate are tried once more
            with R widened by this share; 0 does neither (calibrated).
        whole_s: an object that was seen whole for this long and then leaves the gate has changed its velocity; one that
            was not has come out from behind something (calibrated).
        size_memory_s: how long the usual size of a box is remembered after the box has shrunk (calibrated).
        speed_confidence: speed counts as motion only if zero velocity is outside this confidence region of the
            velocity; 0 means the speed alone decides (paper).
        partial_speed_factor: on the speed threshold while something hides a part of the object; 1 = no difference
            (calibrated).
        deformation_iou: a non-rigid object whose consecutive masks have an IoU BELOW this is moving. The paper gives no
            value and prints "above": misprint (e).
        mask_alignment: how masks are laid over each other before the IoU: as they are, or with their boxes aligned in
            centre and scale.
        calm_frames: consecutive frames of idle evidence until a new or moving object is idle; 1 = no hysteresis.
        unknown_policy: what a track is in its first frames, before it is known to be idle: masked or kept.
        dilation_px: radius by which masks grow before they are cut out (not in the paper's text).
        coasting_mask_frames: for how many frames the last mask of an unseen moving track is still cut out.
        pose_feedback: default camera pose for the tracker (see dotmask.pipeline.ClosedLoop).
    """

    name: str
    classes: tuple[ClassModel, ...]
    score_threshold: float
    max_observations: int
    max_misses: int
    noise: MeasurementNoise
    min_depth_pixels: int
    depth_trim_m: float | None
    gate_probability: float
    jump_share: float
    size_memory_s: float
    whole_s: float
    speed_confidence: float
    partial_speed_factor: float
    deformation_iou: float
    mask_alignment: MaskAlignment
    calm_frames: int
    unknown_policy: UnknownPolicy
    dilation_px: int
    coasting_mask_frames: int
    pose_feedback: PoseFeedback

    def __post_init__(self) -> None:
        """Refuse values outside their range."""
        for name in ("max_observations", "max_misses", "min_depth_pixels", "calm_frames"):
            if getattr(self, name) < 1:
                raise ValueError(f"profile {self.name}: {name} must be at least 1")
        if not (0 < self.gate_probability < 1 and 0 <= self.speed_confidence < 1):
            raise ValueError(f"profile {self.name}: probabilities must lie between 0 and 1")
        if self.dilation_px < 0 or self.coasting_mask_frames < 0:
            raise ValueError(f"profile {self.name}: dilation_px and coasting_mask_frames must not be negative")

    def class_model(self, class_name: str) -> ClassModel:
        """The model of `class_name`.

        Raises:
            ValueError: it is no object of interest.
        """
        for model in self.classes:
            if model.name == class_name:
                return model
        raise ValueError(f"{class_name!r} is not an object of interest of profile {self.name}")


def _paper_other(name: str) -> ClassModel:
    return ClassModel(
        name=name, acceleration_sigma_m_s2=1.0, prior_speed_sigma_m_s=1.0, speed_threshold_m_s=0.1, is_non_rigid=False
    )


PAPER = Profile(
    name="paper",
    classes=(
        ClassModel(
            name="person",
            acceleration_sigma_m_s2=0.62,
            prior_speed_sigma_m_s=1.0,
            speed_threshold_m_s=0.01,
            is_non_rigid=True,
        ),
        _paper_other("chair"),
        _paper_other("cup"),
        _paper_other("bottle"),
    ),
    score_threshold=0.1,
    max_observations=5,
    max_misses=10,
    noise=MeasurementNoise(pixel_sigma_px=4.0, depth_sigma_m=0.02, depth_sigma_per_m=0.0019, is_diagonal=True),
    min_depth_pixels=1,
    depth_trim_m=None,
    gate_probability=0.9999,
    jump_share=0.0,
    size_memory_s=1.0,
    whole_s=0.0,
    speed_confidence=0.0,
    partial_speed_factor=1.0,
    deformation_iou=0.9,
    mask_alignment="none",
    calm_frames=1,
    unknown_policy="keep",
    dilation_px=1,
    coasting_mask_frames=0,
    pose_feedback="previous",
)
"""Table I and the text, with five misprints corrected.

(a) The lower block of Γ is printed `dt² I`; random acceleration gives `dt I`.
(b) Q written out in the paper's source has cross terms `dt⁴/4 σ³`; they are `dt³/2 σ²`.
(c) K is printed 3x3; it is 6x3.
(d) The rotation is printed camera-to-world with the camera's position added; h needs the inverse transform.
(e) "IoU above a threshold" means moving; deformation is an IoU below it.
"""


def _calibrated_small(name: str) -> ClassModel:
    return ClassModel(
        name=name,
        acceleration_sigma_m_s2=0.5,
        prior_speed_sigma_m_s=0.5,
        speed_threshold_m_s=0.1,
        shape_sigma_m=(0.005, 0.005, 0.01),
        extent_m=(0.1, 0.2, 0.1),
        size_play=(0.1, 0.1),
        hidden_factor=2.5,
    )


CALIBRATED = Profile(
    name="calibrated",
    classes=(
        ClassModel(
            name="person",
            acceleration_sigma_m_s2=1.0,
            prior_speed_sigma_m_s=1.0,
            speed_threshold_m_s=0.1,
            vertical_share=0.2,
            is_non_rigid=True,
            shape_sigma_m=(0.08, 0.03, 0.06),
            extent_m=(0.6, 1.7, 0.5),
            size_play=(0.5, 0.1),
        ),
        ClassModel(
            name="chair",
            acceleration_sigma_m_s2=0.5,
            prior_speed_sigma_m_s=0.5,
            speed_threshold_m_s=0.15,
            vertical_share=0.2,
            shape_sigma_m=(0.012, 0.012, 0.015),
            extent_m=(0.65, 1.0, 0.65),
            size_play=(0.15, 0.1),
            hidden_factor=4.0,
        ),
        _calibrated_small("cup"),
        _calibrated_small("bottle"),
    ),
    score_threshold=0.3,
    max_observations=10,
    max_misses=30,
    noise=MeasurementNoise(
        pixel_sigma_px=1.0,
        depth_sigma_m=0.0012,
        depth_sigma_per_m=0.0019,
        is_diagonal=False,
        inflates_hidden_sides=True,
        hidden_depth_share=0.25,
        pose_position_sigma_m=0.003,
        pose_rotation_sigma_rad=0.002,
    ),
    min_depth_pixels=30,
    depth_trim_m=0.8,
    gate_probability=0.98,
    jump_share=0.5,
    size_memory_s=3.0,
    whole_s=0.4,
    speed_confidence=0.99,
    partial_speed_factor=2.0,
    deformation_iou=0.9,
    mask_alignment="box",
    calm_frames=10,
    unknown_policy="mask",
    dilation_px=4,
    coasting_mask_frames=3,
    pose_feedback="refined",
)
"""Our best: R absorbs the wobble of walking people and the jumps of half hidden boxes, speed is tested against its own
uncertainty, and what is new is masked until it is known to be idle."""


def _original_other(name: str) -> ClassModel:
    return ClassModel(name=name, acceleration_sigma_m_s2=1.0, prior_speed_sigma_m_s=1.0, speed_threshold_m_s=0.3)


ORIGINAL = replace(
    PAPER,
    name="original",
    classes=(
        # 0.68 is meant for persons, but keyed to the number of another class: 1.0 for all.
        ClassModel(
            name="person",
            acceleration_sigma_m_s2=1.0,
            prior_speed_sigma_m_s=1.0,
            speed_threshold_m_s=0.01,
            is_non_rigid=True,
        ),
        _original_other("chair"),
        _original_other("cup"),
        _original_other("bottle"),
    ),
    score_threshold=0.1,
    max_observations=5,
    max_misses=10,
    deformation_iou=0.9,
    dilation_px=1,
    pose_feedback="previous",
)
"""What the authors' released program was observed to do (commit bc056cd). `dotmask.original` reads these values and has
the rest of them; it does not read those that are left as in PAPER."""

PROFILES: tuple[Profile, ...] = (PAPER, CALIBRATED, ORIGINAL)


def profile(name: str) -> Profile:
    """The profile called `name`.

    Raises:
        ProfileError: there is none; the message names the nearest.
    """
    for candidate in PROFILES:
        if candidate.name == name:
            return candidate
    known = [p.name for p in PROFILES]
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
    hint = f"did you mean {near[0]!r}? " if near else ""
    raise ProfileError(f"no profile is called {name!r}: {hint}choose one of {', '.join(known)}")
