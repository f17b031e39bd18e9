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
Measurement = Literal["bbox_centre", "mask_centroid", "pixel_depth"]


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
        slide_sigma_m: how far, per root second, the measured point slides over the object while something hides a side
            of it (calibrated).
        surface_sigma_m_s: how much the velocity of the surface's points differs from that of the object's centre
            because it turns and swings (calibrated).
        moving_share: share of the surface's points that must move for an object to be moving: a hand of what is not
            rigid, most of what is (calibrated).
        moving_points: and so many points at least: one alone may have slipped (calibrated).
        still_moving_share: the share for an object that was moving before: between strokes a hand hardly moves
            (calibrated).
    """

    name: str
    acceleration_sigma_m_s2: float
    prior_speed_sigma_m_s: float
    speed_threshold_m_s: float
    vertical_share: float = 1.0
    is_non_rigid: bool = False
    shape_sigma_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    slide_sigma_m: float = 0.0
    surface_sigma_m_s: float = 0.0
    moving_share: float = 0.5
    moving_points: int = 1
    still_moving_share: float = 0.5

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
        pixel_sigma_px: of the measured centre, whatever the mask, both axes; becomes `sigma z / f` metres.
        depth_sigma_m: of the depth of one pixel at the near limit.
        depth_sigma_per_m: growth with (z - 0.4 m)², 1/m; structured light: 0.0019 (Nguyen et al. 2012, "Modeling
            Kinect sensor noise", eq. 5).
        averages_pixels: the depth of n pixels is as uncertain as that of one over sqrt(n); else as that of one.
        edge_sigma_px: of each border of a mask. A border that is right to the pixel is uniform over one pixel,
            `1/sqrt(12)`; larger for a segmenter with blurred borders.
        depth_step_per_m: depth is rounded to steps of this times z², 1/m; structured light: 0.00284 (1/8 px of
            disparity, Khoshelham and Elberink 2012, "Accuracy and resolution of Kinect depth data").
        depth_rounding_m: step of the depth image's numbers: 1/5000 m in files of the TUM benchmark.
        is_diagonal: leave out that an error in depth moves x and y along the viewing ray.
        notices_hidden_sides: look whether the box ends at the image border or at something nearer.
        occluder_margin_m: how much nearer than the object an occluder must be at 0 m; grows by 0.02 z².
        pose_position_sigma_m: camera position, each axis.
        pose_rotation_sigma_rad: camera rotation; becomes `sigma z` metres sideways.
    """

    pixel_sigma_px: float
    depth_sigma_m: float
    depth_sigma_per_m: float
    is_diagonal: bool
    averages_pixels: bool = False
    edge_sigma_px: float = 0.0
    depth_step_per_m: float = 0.0
    depth_rounding_m: float = 0.0
    notices_hidden_sides: bool = False
    occluder_margin_m: float = 0.12
    pose_position_sigma_m: float = 0.0
    pose_rotation_sigma_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceSettings:
    """Points on the objects' surfaces (calibrated; not in the paper), see dotmask.tracking.surface.

    Attributes:
        points: wanted for each object.
        least_points: fewer say nothing.
        memory_frames: for how many frames a point's positions are kept.
        velocity_s: a point's velocity is taken over at most this time.
        flow_sigma_px: of a point's place in the image, pixels.
        flow_sigma_share: grows by this times the way that it has gone in the image.
        flow_sigmas: a point moves if it left its place by more than so many of them.
    """

    points: int = 40
    least_points: int = 5
    memory_frames: int = 6
    velocity_s: float = 0.11
    flow_sigma_px: float = 0.5
    flow_sigma_share: float = 0.02
    flow_sigmas: float = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MaskGrowth:
    """By how much masks grow before they are cut out (not in the paper's text).

    Attributes:
        base_px: radius for the error of the mask and of the depth at edges.
        margin_m: further radius in metres at the object: more pixels when it is near.
        depth_delay_s: time between the colour image, which the mask is of, and the depth image: the object moves on.
            The paper names this delay as a cause of artefacts (Results).
        nearest_m: an object is taken to be at least this far away.
        most_px: the radius is never larger.
    """

    base_px: float
    margin_m: float = 0.0
    depth_delay_s: float = 0.0
    nearest_m: float = 0.3
    most_px: float = 16.0

    def __post_init__(self) -> None:
        """Refuse a mask that shrinks."""
        if min(self.base_px, self.margin_m, self.depth_delay_s) < 0:
            raise ValueError("growth of masks: base_px, margin_m and depth_delay_s must not be negative")


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """A complete parameter set.

    Attributes:
        name: how it is asked for.
        classes: the objects of interest; other classes are neither tracked nor masked (paper, Experimental Setup).
        score_threshold: detections below it are dropped (paper, Table I).
        max_observations: at most this many detections, the best first (paper, Table I: m).
        max_misses: a track ends when it was not observed for this many frames (paper, Table I: e).
        max_misses_idle: the same for a track that was idle: it is where it was when the camera looks back (calibrated).
        confirming_hits: a track that was seen less often is tentative and ends when it is missed (not in the paper).
        measurement: what is measured of a detection (see dotmask.tracking.measurement.observe); paper: `bbox_centre`.
        noise: the model behind R.
        min_depth_pixels: fewer pixels with depth give no observation (not in the paper).
        depth_trim_m: pixels farther than this from the median depth of the mask are left out of the mean; None keeps
            all (paper: "average depth from the masked region").
        gate_probability: an observation is a candidate for a track if its squared Mahalanobis distance is below this
            quantile of chi-square with 3 degrees of freedom (not in the paper).
        least_mask_likelihood: where the gate holds several candidates, the IoU of the masks counts as a likelihood, but
            never less than this; 1: masks have no say (paper).
        reappearance_m: tracks and observations that the gate left over are paired once more with tracks whose position
            is this uncertain: an object that comes out from behind something is seen elsewhere; 0 does not
            (calibrated).
        surface: points on the objects' surfaces; None: none are followed (paper).
        speed_confidence: speed counts as motion only if zero velocity is outside this confidence region of the
            velocity; 0 means the speed alone decides (paper).
        deformation_iou: a non-rigid object whose consecutive masks have an IoU BELOW this is moving. The paper gives no
            value and prints "above": misprint (e).
        aligns_masks: whether masks are laid over each other with their boxes before the IoU, so that neither the
            camera's motion nor a change of distance counts (calibrated), or as they are (paper).
        proof_frames: frames that speak for rest until a new object is idle.
        calm_frames: consecutive frames that speak for rest until a moving object is idle; 1 = no hysteresis.
        unknown_policy: what a track is in its first frames, before it is known to be idle: masked or kept.
        growth: of masks before they are cut out.
        coasting_mask_frames: for how many frames an unseen moving track is still cut out, where it is predicted.
        pose_feedback: default camera pose for the tracker (see dotmask.pipeline.ClosedLoop).
    """

    name: str
    classes: tuple[ClassModel, ...]
    score_threshold: float
    max_observations: int
    max_misses: int
    max_misses_idle: int
    confirming_hits: int
    measurement: Measurement
    noise: MeasurementNoise
    min_depth_pixels: int
    depth_trim_m: float | None
    gate_probability: float
    least_mask_likelihood: float
    reappearance_m: float
    surface: SurfaceSettings | None
    speed_confidence: float
    deformation_iou: float
    aligns_masks: bool
    proof_frames: int
    calm_frames: int
    unknown_policy: UnknownPolicy
    growth: MaskGrowth
    coasting_mask_frames: int
    pose_feedback: PoseFeedback

    def __post_init__(self) -> None:
        """Refuse values outside their range."""
        for name in (
            "max_observations",
            "max_misses",
            "max_misses_idle",
            "confirming_hits",
            "min_depth_pixels",
            "proof_frames",
            "calm_frames",
        ):
            if getattr(self, name) < 1:
                raise ValueError(f"profile {self.name}: {name} must be at least 1")
        if not (0 < self.gate_probability < 1 and 0 <= self.speed_confidence < 1):
            raise ValueError(f"profile {self.name}: probabilities must lie between 0 and 1")
        if self.coasting_mask_frames < 0:
            raise ValueError(f"profile {self.name}: coasting_mask_frames must not be negative")

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
    max_misses_idle=10,
    confirming_hits=1,
    measurement="bbox_centre",
    noise=MeasurementNoise(pixel_sigma_px=4.0, depth_sigma_m=0.02, depth_sigma_per_m=0.0019, is_diagonal=True),
    min_depth_pixels=1,
    depth_trim_m=None,
    gate_probability=0.9999,
    least_mask_likelihood=1.0,
    reappearance_m=0.0,
    surface=None,
    speed_confidence=0.0,
    deformation_iou=0.9,
    aligns_masks=False,
    proof_frames=1,
    calm_frames=1,
    unknown_policy="keep",
    growth=MaskGrowth(base_px=1.0),
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


def _calibrated_thing(name: str, *, shape_sigma_m: float, slide_sigma_m: float) -> ClassModel:
    return ClassModel(
        name=name,
        acceleration_sigma_m_s2=0.5,
        prior_speed_sigma_m_s=0.5,
        speed_threshold_m_s=0.1,
        vertical_share=0.2 if name == "chair" else 1.0,
        shape_sigma_m=(shape_sigma_m, shape_sigma_m, shape_sigma_m),
        slide_sigma_m=slide_sigma_m,
        surface_sigma_m_s=0.03,
        moving_share=0.55,
        still_moving_share=0.4,
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
            shape_sigma_m=(0.03, 0.02, 0.03),
            slide_sigma_m=0.2,
            surface_sigma_m_s=0.15,
            moving_share=0.06,
            moving_points=2,
            still_moving_share=0.03,
        ),
        _calibrated_thing("chair", shape_sigma_m=0.012, slide_sigma_m=0.2),
        _calibrated_thing("cup", shape_sigma_m=0.005, slide_sigma_m=0.05),
        _calibrated_thing("bottle", shape_sigma_m=0.005, slide_sigma_m=0.05),
    ),
    score_threshold=0.3,
    max_observations=10,
    max_misses=90,
    max_misses_idle=150,
    confirming_hits=3,
    measurement="bbox_centre",
    noise=MeasurementNoise(
        pixel_sigma_px=0.0,
        depth_sigma_m=0.0012,
        depth_sigma_per_m=0.0019,
        is_diagonal=False,
        averages_pixels=True,
        edge_sigma_px=0.29,
        depth_step_per_m=0.00284,
        depth_rounding_m=0.0002,
        notices_hidden_sides=True,
        pose_position_sigma_m=0.003,
        pose_rotation_sigma_rad=0.002,
    ),
    min_depth_pixels=12,
    depth_trim_m=0.8,
    gate_probability=0.98,
    least_mask_likelihood=0.02,
    reappearance_m=0.3,
    surface=SurfaceSettings(),
    speed_confidence=0.99,
    deformation_iou=0.9,
    aligns_masks=True,
    proof_frames=2,
    calm_frames=5,
    unknown_policy="mask",
    growth=MaskGrowth(base_px=3.0, margin_m=0.005, depth_delay_s=0.005),
    coasting_mask_frames=10,
    pose_feedback="refined",
)
"""Our best: points on the surfaces measure velocity and tell what moves, speed is tested against its own uncertainty,
the position of a half hidden object follows what is seen, and what is new is masked until it is known to be idle."""


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
    max_misses_idle=10,
    deformation_iou=0.9,
    growth=MaskGrowth(base_px=1.0),
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
