"""What a run asks of the place where its frames come from."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from dotmask.records import FloatArray, RgbdFrame
from scenarios.oracle import OracleSegmenter
from scenarios.run_folder import RunFolder
from scenarios.sources.ahead import Timed
from sim.records import GroundTruth

if TYPE_CHECKING:
    from scenarios.static_world import StaticWorld


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TruePose:
    """All that is known of a recorded frame.

    Attributes:
        T_world_camera: (4, 4) the measured pose of the camera; None where there is none.
    """

    T_world_camera: FloatArray | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SourceFrame:
    """What the methods may see of a frame, and what the judge may.

    Attributes:
        frame: for the methods.
        truth: for the judge: everything about a simulated frame, the camera's pose at most of a recorded one.
    """

    frame: RgbdFrame
    truth: GroundTruth | TruePose


class Source(Protocol):
    """A sequence of frames.

    The first frame's true pose fixes the world of the estimates; where it has none, the world is the first camera.

    Attributes:
        name: of the scenario or the folder.
        seed: of the scenario; None where nothing is drawn.
        renderer: that made the images; None where they were recorded.
        frame_rate_hz: of the frames, about.
        oracle: a segmenter that the run shows each frame's truth; None where the truth is not known.
    """

    name: str
    seed: int | None
    renderer: str | None
    frame_rate_hz: float
    oracle: OracleSegmenter | None

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def frames(self) -> Iterator[Timed[SourceFrame]]:
        """The frames in the order of time, with the wall time that making each took."""
        ...

    def static_world(self) -> "StaticWorld | None":
        """What a map should look like; None where it is not known."""
        ...

    def describe(self, folder: RunFolder) -> None:
        """Write into a run folder what the frames are."""
        ...
