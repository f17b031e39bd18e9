"""The stages that know the truth: wrappers around a front end, and functions in the place of the method's own.

The method has no option for any of this: its interfaces are enough, and the truth stays on this side of the border.
"""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np

from dotmask.classification import Classify, classify
from dotmask.pipeline import DotMask, FrontEnd, FrontEndResult
from dotmask.profiles import Profile
from dotmask.records import (
    DepthImage,
    FloatArray,
    Intrinsics,
    MaskedDepth,
    Observation,
    Reason,
    RgbdFrame,
    Track,
    Verdict,
)
from dotmask.tracking.association import Associate, Association, associate
from scenarios.attribution.variants import Stage
from scenarios.attribution.witness import Witness


class Noted:
    """Lets the witness note whom the tracks follow."""

    def __init__(self, front_end: FrontEnd, witness: Witness) -> None:
        self._front_end, self._witness = front_end, witness

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd."""
        result = self._front_end.step(frame, T_world_camera)
        self._witness.note(result)
        return result

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd."""
        result = self._front_end.refine(T_world_camera)
        self._witness.note(result)
        return result


class TruePose:
    """Gives the front end the true camera pose, in the first look at a frame and in the second."""

    def __init__(self, front_end: FrontEnd, witness: Witness) -> None:
        self._front_end, self._witness = front_end, witness

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd; the given pose is not used."""
        return self._front_end.step(frame, self._witness.truth.T_world_camera)

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd; the given pose is not used."""
        return self._front_end.refine(self._witness.truth.T_world_camera)


class TrueDepth:
    """Lets the front end measure on the true depth, while SLAM is given the sensor's.

    From the sensor's depth go the pixels that the front end removed. Where the true depth is 0 (nothing was hit) a
    removal cannot be told, and the sensor's value stays.
    """

    def __init__(self, front_end: FrontEnd, witness: Witness) -> None:
        self._front_end, self._witness = front_end, witness

    def step(self, frame: RgbdFrame, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd."""
        true_m = self._witness.truth.depth_m
        result = self._front_end.step(replace(frame, depth_m=true_m), T_world_camera)
        self._masked = MaskedDepth(
            mo_mdi_m=_removed_alike(frame.depth_m, true_m, result.masked.mo_mdi_m),
            mdi_m=_removed_alike(frame.depth_m, true_m, result.masked.mdi_m),
        )
        return replace(result, masked=self._masked)

    def refine(self, T_world_camera: FloatArray) -> FrontEndResult:
        """See FrontEnd."""
        return replace(self._front_end.refine(T_world_camera), masked=self._masked)


def _removed_alike(sensor_m: DepthImage, measured_m: DepthImage, masked_m: DepthImage) -> DepthImage:
    """`sensor_m` without the pixels that `measured_m` has and `masked_m` has not."""
    return np.where((measured_m > 0) & (masked_m == 0), np.float32(0), sensor_m)


def true_association(witness: Witness) -> Associate:
    """Pairs tracks and observations of the same true instance.

    Tracks and observations without an instance (false detections) are paired among themselves by the method's own rule.
    """

    def associate_truly(
        tracks: Sequence[Track],
        observations: Sequence[Observation],
        T_world_camera: FloatArray,
        intrinsics: Intrinsics,
        profile: Profile,
    ) -> Association:
        follows = [witness.instance_of_track(track) for track in tracks]
        shows = [witness.instance_of_detection(observation.detection_index) for observation in observations]
        pairs = [
            (i, shows.index(instance))
            for i, instance in enumerate(follows)
            if instance is not None and instance in shows
        ]
        false_tracks = [i for i, instance in enumerate(follows) if instance is None]
        false_observations = [j for j, instance in enumerate(shows) if instance is None]
        among_false = associate(
            [tracks[i] for i in false_tracks],
            [observations[j] for j in false_observations],
            T_world_camera,
            intrinsics,
            profile,
        )
        pairs += [(false_tracks[i], false_observations[j]) for i, j in among_false.pairs]
        paired_tracks, paired_observations = {i for i, _ in pairs}, {j for _, j in pairs}
        return Association(
            pairs=tuple(sorted(pairs)),
            unmatched_tracks=tuple(i for i in range(len(tracks)) if i not in paired_tracks),
            unmatched_observations=tuple(j for j in range(len(observations)) if j not in paired_observations),
        )

    return associate_truly


def true_classification(witness: Witness) -> Classify:
    """Answers whether the track's instance truly moves; a track without an instance keeps the method's own verdict."""

    def classify_truly(track: Track, previous: Track | None, profile: Profile) -> Verdict:
        own = classify(track, previous, profile)
        instance = witness.instance_of_track(track)
        if instance is None or witness.is_moving(instance) is own.is_moving:
            return own
        moves = not own.is_moving
        return replace(own, is_moving=moves, reason=Reason.SPEED if moves else Reason.IDLE)

    return classify_truly


def build_front_end(true_stages: AbstractSet[Stage], witness: Witness, profile: Profile) -> FrontEnd:
    """The method with `true_stages` replaced. Whether the masks are true is up to what the witness is shown."""
    front_end: FrontEnd = DotMask(
        witness,
        profile,
        associate=true_association(witness) if "association" in true_stages else associate,
        classify=true_classification(witness) if "moc" in true_stages else classify,
    )
    front_end = Noted(front_end, witness)
    if "depth" in true_stages:
        front_end = TrueDepth(front_end, witness)
    if "pose" in true_stages:
        front_end = TruePose(front_end, witness)
    return front_end
