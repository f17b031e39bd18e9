"""Frames of a recorded TUM RGB-D folder, read as they are asked for."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from dotmask.tum import find_camera, read_sequence
from scenarios.errors import ScenarioError
from scenarios.oracle import OracleSegmenter
from scenarios.run_folder import RunFolder
from scenarios.sources.ahead import Timed, made_ahead
from scenarios.sources.source import SourceFrame, TruePose


class Recorded:
    """A recorded folder as a source of frames; see `Source`.

    Args:
        folder: in the format of the TUM RGB-D benchmark.
        camera: name of a published camera, None to look for it.
        intrinsics: file that tells the camera instead.
        frames: only the first so many; None for all.

    Attributes:
        notes: what a user should know about the recording, a line each.

    Raises:
        SequenceFolderError, TrajectoryFileError: the folder cannot be read; see `dotmask.tum.read_sequence`.
        ScenarioError: fewer than one frame is asked for.
    """

    def __init__(
        self, folder: Path, camera: str | None = None, intrinsics: Path | None = None, frames: int | None = None
    ) -> None:
        if frames is not None and frames < 1:
            raise ScenarioError(f"--frames {frames}: ask for at least one")
        # A folder that is none is said to be so before its camera is looked for.
        given = find_camera(folder, camera, intrinsics) if camera or intrinsics else None
        self._sequence = read_sequence(folder, given)
        self._count = len(self._sequence) if frames is None else min(frames, len(self._sequence))
        self.name: str = folder.resolve().name
        self.seed: int | None = None
        self.renderer: str | None = None
        self.frame_rate_hz: float = self._sequence.frame_rate_hz
        self.oracle: OracleSegmenter | None = None
        self.notes = self._sequence.notes
        if not self._sequence.has_truth:
            lack = "no true poses in groundtruth.txt: the world is the first camera, and no error is measured"
            self.notes = (*self.notes, f"{folder}: {lack}")

    def __len__(self) -> int:
        """Number of frames."""
        return self._count

    def frames(self) -> Iterator[Timed[SourceFrame]]:
        """See `Source`.

        Raises:
            SequenceFolderError: an image cannot be read; see `dotmask.tum.TumSequence.frame`.
        """

        def make(index: int) -> SourceFrame:
            truth = TruePose(T_world_camera=self._sequence.true_poses[index])
            return SourceFrame(frame=self._sequence.frame(index), truth=truth)

        return made_ahead(make, range(len(self)))

    def static_world(self) -> None:
        """Nobody knows."""
        return None

    def describe(self, folder: RunFolder) -> None:
        """Write `recording.json`: folder, camera, time span, what the world is, and the notes."""
        sequence = self._sequence
        facts = {
            "folder": str(sequence.root.resolve()),
            "frames": len(self),
            "first_s": float(sequence.timestamps_s[0]),
            "last_s": float(sequence.timestamps_s[len(self) - 1]),
            "world": "groundtruth.txt" if sequence.has_truth else "first camera",
            "camera": asdict(sequence.camera),
            "notes": self.notes,
        }
        folder.write("recording.json", json.dumps(facts, indent=2) + "\n")
