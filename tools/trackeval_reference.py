"""Random tracking cases and what TrackEval, the program of HOTA's authors, says of them: the tests' second opinion.

TrackEval is not a dependency of the project: it needs an environment of its own. Example::

    python3.11 -m venv /tmp/trackeval && /tmp/trackeval/bin/pip install trackeval==1.3.0
    /tmp/trackeval/bin/python -m tools.trackeval_reference
"""

import importlib.metadata
import json
from pathlib import Path
from typing import Any

import numpy as np
from trackeval.metrics import CLEAR, HOTA, Identity

OUT = Path(__file__).parent.parent / "tests" / "golden" / "trackeval.json"
SEEDS = range(6)
FRAMES, INSTANCES = 40, 5


def case(seed: int) -> list[dict[str, Any]]:
    """Frames with true ids, track ids and their similarity: with misses, false positives, switches and swaps."""
    rng = np.random.default_rng(seed)
    born = rng.integers(0, FRAMES // 2, INSTANCES)
    dies = born + rng.integers(5, FRAMES, INSTANCES)
    owner = np.arange(INSTANCES) + 100
    next_track, frames = 200, []
    for k in range(FRAMES):
        instances = [i + 1 for i in range(INSTANCES) if born[i] <= k < dies[i]]
        for i in range(INSTANCES):
            if rng.random() < 0.06:
                owner[i], next_track = next_track, next_track + 1
        if rng.random() < 0.1:
            a, b = rng.choice(INSTANCES, 2, replace=False)
            owner[[a, b]] = owner[[b, a]]
        followed = [(int(owner[i - 1]), i) for i in instances if rng.random() > 0.15]
        doubles = [(300 + i, i) for i in instances if rng.random() < 0.1]
        strays = [(400 + int(s), 0) for s in range(2) if rng.random() < 0.15]
        tracks = [] if k == FRAMES // 3 else [*followed, *doubles, *strays]
        similarity = rng.uniform(0.0, 0.25, (len(instances), len(tracks)))
        for column, (_, i) in enumerate(tracks):
            if i:
                similarity[instances.index(i), column] = rng.uniform(0.3, 1.0)
        frames.append(
            {"instances": instances, "tracks": [t for t, _ in tracks], "similarity": similarity.round(4).tolist()}
        )
    return frames


def opinion(frames: list[dict[str, Any]]) -> dict[str, float]:
    """TrackEval's figures."""
    truth_ids = sorted({i for f in frames for i in f["instances"]})
    track_ids = sorted({t for f in frames for t in f["tracks"]})
    data = {
        "num_timesteps": len(frames),
        "num_gt_ids": len(truth_ids),
        "num_tracker_ids": len(track_ids),
        "num_gt_dets": sum(len(f["instances"]) for f in frames),
        "num_tracker_dets": sum(len(f["tracks"]) for f in frames),
        "gt_ids": [np.array([truth_ids.index(i) for i in f["instances"]], int) for f in frames],
        "tracker_ids": [np.array([track_ids.index(t) for t in f["tracks"]], int) for f in frames],
        "similarity_scores": [
            np.reshape(f["similarity"], (len(f["instances"]), len(f["tracks"]))).astype(float) for f in frames
        ],
    }
    quiet = {"PRINT_CONFIG": False}
    hota, clear = HOTA().eval_sequence(data), CLEAR(quiet).eval_sequence(data)
    return {
        "HOTA": float(np.mean(hota["HOTA"])),
        "DetA": float(np.mean(hota["DetA"])),
        "AssA": float(np.mean(hota["AssA"])),
        "MOTA": float(clear["MOTA"]),
        "IDSW": int(clear["IDSW"]),
        "CLR_FN": int(clear["CLR_FN"]),
        "CLR_FP": int(clear["CLR_FP"]),
        "IDF1": float(Identity(quiet).eval_sequence(data)["IDF1"]),
    }


def main() -> None:
    """Write the file."""
    cases = [{"frames": frames, "trackeval": opinion(frames)} for frames in map(case, SEEDS)]
    tree = {"trackeval_version": importlib.metadata.version("trackeval"), "cases": cases}
    OUT.write_text(json.dumps(tree, separators=(",", ":")) + "\n")
    for one in cases:
        print(one["trackeval"])


if __name__ == "__main__":
    main()
