"""A segmenter with one fault in each: on the people, chairs and camera of fr3_walking_xyz, or what shows it better.

`fault_tilted` has the camera of `tilted`, `fault_merged` the people and the camera of `crowd`, where some hide each
other in nearly all frames.
"""

from scenarios.catalog.fr3_walking import CHAIRS, PEOPLE
from scenarios.catalog.gatherings import CROWD
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

TAGS = ("faults",)

FRAMES = 270
"""Nine seconds: both people pass the camera twice, and a chair is hit."""


def _faulty(
    name: str, description: str, faults: FaultsSpec, camera: CameraSpec | TourCameraSpec | None = None
) -> Scenario:
    return Scenario(
        name=f"fault_{name}",
        description=description,
        tags=TAGS,
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
    CROWD.model_copy(
        update={
            "name": "fault_merged",
            "description": "In a crowd, people whose boxes touch become one detection, seven times in ten.",
            "tags": TAGS,
            "frames": FRAMES,
            "faults": FaultsSpec(merged=MergedSpec(probability=0.7)),
        }
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
