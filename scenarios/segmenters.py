"""The segmenters of a run: chosen by name, and asked once for each frame."""

import importlib.util
import sys
import time
import traceback
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from dotmask.interfaces import Segmenter
from dotmask.records import Detections, RgbdFrame
from dotmask.segmentation.networks import (
    DEVICES,
    NETWORKS,
    NetworkChoice,
    choose_network,
    load_network,
    network_threads,
)
from scenarios.errors import ScenarioError, unknown
from scenarios.no_segmenter import NoSegmenter
from scenarios.oracle import OracleSegmenter
from scenarios.report import SegmenterReport
from scenarios.sources.source import Source, TruePose
from sim.records import GroundTruth

SEGMENTERS = ("oracle", "none", *NETWORKS)
"""Segmenters that have a name; `package.module:factory` is one of the user's own."""


def parse_segmenter(name: str, weights: str | Path | None, device: str | None) -> NetworkChoice | None:
    """What stands behind the name of a segmenter on a command line; None where it is no network.

    Args:
        name: of `SEGMENTERS`, or `package.module:factory`.
        weights: file with the weights of a network.
        device: where a network runs; None for the CPU.

    Raises:
        ScenarioError: an unknown name, or an option that the segmenter does not have.
        dotmask.errors.SegmenterError: the network cannot run here.
    """
    if name in NETWORKS:
        chosen = device or "cpu"
        if chosen not in DEVICES:
            raise unknown("device", chosen, DEVICES)
        return choose_network(name, None if weights is None else Path(weights), chosen)
    if name not in SEGMENTERS and ":" not in name:
        raise unknown("segmenter", name, (*SEGMENTERS, "package.module:factory"))
    if weights is not None or device is not None:
        raise ScenarioError(f"--weights and --device are for networks ({', '.join(NETWORKS)}), not for {name}")
    return None


def segmenter_report(name: str, network: NetworkChoice | None) -> SegmenterReport:
    """What a report says of a segmenter."""
    if network is None:
        return SegmenterReport(name=name)
    return SegmenterReport(name=name, weights_sha256=network.weights_sha256, device=network.device)


def load_segmenter(name: str, network: NetworkChoice | None, source: Source) -> "FrameSegmenter":
    """A segmenter that is ready for the first frame of a source.

    Raises:
        ScenarioError: the oracle is asked for and the source has none, or the user's segmenter cannot be made.
        dotmask.errors.SegmenterError: the weights cannot be loaded.
    """
    if network is not None:
        return FrameSegmenter(load_network(network), name)
    if name == "none":
        return FrameSegmenter(NoSegmenter(), name)
    if name != "oracle":
        return FrameSegmenter(_own(name), name)
    if source.oracle is None:
        raise ScenarioError(
            f"--segmenter oracle: the true masks of {source.name} are not known, it is recorded; use --segmenter none "
            "or a network"
        )
    return FrameSegmenter(source.oracle, name)


def segmenter_threads(network: NetworkChoice | None, count: int) -> AbstractContextManager[None]:
    """Inside the block a network on the CPU works with so many threads."""
    return nullcontext() if network is None else network_threads(count)


class FrameSegmenter:
    """Asks a segmenter once for each frame, so that all who look at the frame share the answer and its cost.

    Args:
        segmenter: that is asked.
        name: for messages.

    Attributes:
        seconds: wall time of the last answer; None for the oracle, which is told.
    """

    def __init__(self, segmenter: Segmenter, name: str) -> None:
        self._segmenter, self._name = segmenter, name
        self._frame_index: int | None = None
        self._answer: Detections | None = None
        self.seconds: float | None = None

    def see(self, frame: RgbdFrame, truth: GroundTruth | TruePose) -> None:
        """Look at the frame that will be segmented next; the oracle alone is shown the truth.

        Raises:
            ScenarioError: a segmenter of the user's own fails, or answers with what does not fit the frame.
        """
        if isinstance(self._segmenter, OracleSegmenter):
            assert isinstance(truth, GroundTruth), "a source with an oracle knows all"
            self._segmenter.show(frame.index, truth)
            self._answer = self._segmenter.segment(frame)
        else:
            start = time.perf_counter()
            self._answer = self._asked(frame)
            self.seconds = time.perf_counter() - start
        self._frame_index = frame.index

    def segment(self, frame: RgbdFrame) -> Detections:
        """See `dotmask.interfaces.Segmenter`.

        Raises:
            RuntimeError: another frame was seen last.
        """
        if self._answer is None or self._frame_index != frame.index:
            raise RuntimeError(f"{self._name}: asked for frame {frame.index}, but has seen {self._frame_index}")
        return self._answer

    def _asked(self, frame: RgbdFrame) -> Detections:
        if self._name in SEGMENTERS:
            return self._segmenter.segment(frame)
        try:
            answer = self._segmenter.segment(frame)
            if not isinstance(answer, Detections):
                raise TypeError(f"segment answered with {type(answer).__name__}, expected dotmask.records.Detections")
            answer.check_size(frame.intrinsics)
        except Exception as error:  # whatever it is, it is the user's to mend
            raise ScenarioError(f"segmenter {self._name}: frame {frame.index}: {_told(error)}") from error
        return answer


def _own(name: str) -> Segmenter:
    """The segmenter that `package.module:factory` makes; the module may lie in the current folder."""
    module_name, _, factory_name = name.partition(":")
    if not (module_name and factory_name):
        raise ScenarioError(f"--segmenter {name}: expected package.module:factory")
    _find_in_current_folder()
    try:
        module = importlib.import_module(module_name)
        factory = getattr(module, factory_name)
        segmenter = factory()
    except Exception as error:  # whatever it is, it is the user's to mend
        raise ScenarioError(f"--segmenter {name}: {_told(error)}") from error
    if not callable(getattr(segmenter, "segment", None)):
        raise ScenarioError(f"--segmenter {name}: {type(segmenter).__name__} has no method segment(frame)")
    made: Segmenter = segmenter
    return made


def own_segmenter_file(name: str) -> Path | None:
    """The file with the factory of `package.module:factory`; None where there is none."""
    _find_in_current_folder()
    try:
        spec = importlib.util.find_spec(name.partition(":")[0])
    except (ImportError, ValueError):
        return None
    return Path(spec.origin) if spec is not None and spec.has_location and spec.origin is not None else None


def _find_in_current_folder() -> None:
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)  # last, so that it hides nothing


def _told(error: Exception) -> str:
    """An error of the user's code in one line, with the place where it was raised."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    message = " ".join(str(error).split())
    return f"{type(error).__name__}: {message} ({Path(place.filename).name}, line {place.lineno})"
