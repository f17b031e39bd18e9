"""The people, chairs and camera of fr3_walking_xyz, and a segmenter with one fault in each."""

from scenarios.catalog.fr3_walking import CHAIRS, PEOPLE
from scenarios.catalog.hard_views import ROLLING
from scenarios.spec import (
    BordersSpec,
    CameraSpec,
    ClassFlipsSpec,
    FalsePositivesSpec,
    FaultsSpec,
    LateSpec,
    LimitSpec,
    MergedSpec,
    MissedBurstsSpec,
    MissedSpec,
    OrderSpec,
    Scenario,
    ScoresSpec,
    SplitSpec,
    TiltedSpec,
    TourCameraSpec,
)

FRAMES = 270
"""Nine seconds: both people pass the camera, and a chair is pushed."""


def _faulty(
    name: str, description: str, faults: FaultsSpec, camera: CameraSpec | TourCameraSpec | None = None
) -> Scenario:
    return Scenario(
        name=f"fault_{name}",
        description=description,
        tags=("faults",),
        frames=FRAMES,
        camera=camera or CameraSpec(path="xyz"),
        people=PEOPLE,
        things=CHAIRS,
        faults=faults,
    )


SCENARIOS = (
    _faulty(
        "missed",
        "Three detections in ten are missed, each on its own.",
        FaultsSpec(missed=MissedSpec(probability=0.3)),
    ),
    _faulty(
        "missed_bursts",
        "A fifth of the detections is missed, ten frames in a row on average.",
        FaultsSpec(missed_bursts=MissedBurstsSpec(share=0.2, mean_frames=10.0)),
    ),
    _faulty(
        "false_positives",
        "Something is found where nothing is, for eight frames each; one a frame on average.",
        FaultsSpec(false_positives=FalsePositivesSpec(per_frame=1.0, frames=8)),
    ),
    _faulty(
        "late_masks",
        "The masks of three frames before are given for every frame.",
        FaultsSpec(late=LateSpec(frames=3)),
    ),
    _faulty("eroded_masks", "Masks lose six pixels along their border.", FaultsSpec(borders=BordersSpec(pixels=-6))),
    _faulty(
        "dilated_masks", "Masks take eight pixels more along their border.", FaultsSpec(borders=BordersSpec(pixels=8))
    ),
    _faulty(
        "split",
        "Three instances in ten become two detections, in every frame anew.",
        FaultsSpec(split=SplitSpec(probability=0.3)),
    ),
    _faulty(
        "merged",
        "Seven times in ten, people whose boxes touch become one detection.",
        FaultsSpec(merged=MergedSpec(probability=0.7)),
    ),
    _faulty(
        "identity_shuffle",
        "The detections of every frame come in another order.",
        FaultsSpec(order=OrderSpec(is_shuffled=True)),
    ),
    _faulty(
        "class_flips",
        "One detection in five is given a wrong class.",
        FaultsSpec(class_flips=ClassFlipsSpec(probability=0.2)),
    ),
    _faulty(
        "score_shuffle",
        "Scores say nothing: they are drawn anew, but above the threshold.",
        FaultsSpec(scores=ScoresSpec(lowest=0.35, highest=1.0)),
    ),
    _faulty(
        "tilted",
        "The camera rolls onto its side, and people are not found beyond 45 degrees.",
        FaultsSpec(tilted=TiltedSpec(beyond_deg=45.0)),
        TourCameraSpec(stops=ROLLING),
    ),
    _faulty(
        "few_detections",
        "The two largest detections of each frame are given, and no others.",
        FaultsSpec(limit=LimitSpec(most=2)),
    ),
)
