"""The toy project of examples/ci as its owner has it: dotmask from a wheel in a fresh environment, far from here.

python .ci/example_ci.py

It must pass as it is, pass after a refactoring, and fail by name after a mistake.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
MOST_CPU_S = 120.0
"""Of the suite's first run: 60 s on two cores, whatever else the machine does."""

REFACTORED = (
    "return cv2.dilate(hidden, np.ones((MARGIN_PX, MARGIN_PX), np.uint8)) > 0",
    "wide = cv2.dilate(hidden, np.ones((1, MARGIN_PX), np.uint8))\n"
    "    return cv2.dilate(wide, np.ones((MARGIN_PX, 1), np.uint8)).astype(bool)",
)
MISTAKEN = ("NEAR_M = 2.8", "NEAR_M = 0.28")
TEST = "tests/test_masks.py::test_people_are_hidden_from_odometry[smoke-mask-baseline]"


def call(*command: object, folder: Path) -> None:
    """Run a command, and end with its error."""
    subprocess.run([str(part) for part in command], cwd=folder, check=True)


def children_cpu_s() -> float:
    """CPU time of all processes that were started and have ended, seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Build, install, and run the suite three times.

    Raises:
        SystemExit: something is not as it should be.
    """
    with tempfile.TemporaryDirectory(prefix="dotmask-example-ci-") as name:
        folder = Path(name)
        python = folder / "venv" / "bin" / "python"
        call(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT, folder=folder)
        call(sys.executable, "-m", "venv", folder / "venv", folder=folder)
        (wheel,) = folder.glob("dotmask-*.whl")
        packages = (wheel, "pytest", "pytest-xdist")
        call(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", *packages, folder=folder)

        def suite(project: Path) -> subprocess.CompletedProcess[str]:
            options = ("--dotmask-baseline", "tests/baseline.json", "--dotmask-summary", "summary.md")
            command = (python, "-m", "pytest", "-n2", *options, "--junitxml", "report.xml")
            kept = {
                key: value for key, value in os.environ.items() if not key.startswith(("PYTEST_", "PYTHON", "COV_"))
            }
            start, before = time.monotonic(), children_cpu_s()
            environment = {**kept, "CI": "true"}
            done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)
            print(f"{project.name}: exit code {done.returncode}, {time.monotonic() - start:.0f} s, ", end="")
            print(f"{children_cpu_s() - before:.0f} s of CPU", flush=True)
            return done

        def expect(is_well: bool, what: str, done: subprocess.CompletedProcess[str]) -> None:
            if not is_well:
                raise SystemExit(f"examples/ci: {what}\n{done.stdout}{done.stderr}")

        for title, change in (("as_it_is", None), ("refactored", REFACTORED), ("mistaken", MISTAKEN)):
            project = folder / title
            shutil.copytree(ROOT / "examples" / "ci", project)
            masks = project / "toy_front_end" / "masks.py"
            if change is not None:
                text = masks.read_text()
                assert text.count(change[0]) == 1, f"{change[0]} is not in masks.py"
                masks.write_text(text.replace(*change))
            before = children_cpu_s()
            done = suite(project)
            if title == "as_it_is":
                cpu_s = children_cpu_s() - before
                expect(cpu_s < MOST_CPU_S, f"the suite takes {cpu_s:.0f} s of CPU, more than {MOST_CPU_S:.0f}", done)
            if title != "mistaken":
                expect(done.returncode == 0, f"the suite fails ({title})", done)
                continue
            expect(done.returncode == 1, "the suite does not fail after a mistake", done)
            told = [line for line in done.stdout.splitlines() if line.startswith(f"FAILED {TEST} - worse: ")]
            expect(len(told) == 1 and "masks.leak" in told[0], "the failure does not name masks.leak", done)
            start = done.stdout.index("Worse than")
            print(done.stdout[start : done.stdout.index("=====", start)])


if __name__ == "__main__":
    main()
