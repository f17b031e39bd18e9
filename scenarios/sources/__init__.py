"""Where a run takes its frames from: the simulator, or a recorded folder."""

from scenarios.sources.ahead import Timed, made_ahead, rendered_ahead
from scenarios.sources.recorded import Recorded
from scenarios.sources.simulated import Simulated
from scenarios.sources.source import Source, SourceFrame, TruePose

__all__ = ["Recorded", "Simulated", "Source", "SourceFrame", "Timed", "TruePose", "made_ahead", "rendered_ahead"]
