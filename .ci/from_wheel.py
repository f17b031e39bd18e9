"""What people outside this repository use, as they have it: dotmask from a wheel in a fresh environment, far from here.

python .ci/from_wheel.py

A sweep and its page, and an agent in an environment of Gymnasium. Then the toy project of examples/ci: it must pass as
it is, pass after a refactoring, and fail by name after a mistake.
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


def expect(is_well: bool, what: str, output: str = "") -> None:
    """End with `what` unless all is well."""
    if not is_well:
        raise SystemExit(f"{what}\n{output}")


def install(folder: Path) -> Path:
    """Build the wheel and install it; the environment's folder of programs."""
    programs = folder / "venv" / "bin"
    call(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT, folder=folder)
    call(sys.executable, "-m", "venv", folder / "venv", folder=folder)
    (wheel,) = folder.glob("dotmask-*.whl")
    packages = (wheel, "pytest", "pytest-xdist")
    constraints = ("-c", ROOT / "constraints.txt")
    call(programs / "python", "-m", "pip", "install", "--quiet", *constraints, *packages, folder=folder)
    return programs


def check_sweep(programs: Path, folder: Path) -> None:
    """A short sweep leaves its table, and `dotmask plot` its page."""
    short = ("--set", "frames=6", "--vary", "camera.speed=1,2", "--methods", "unmasked,dotmask", "--out", "speeds")
    call(programs / "dotmask", "sweep", "smoke", *short, folder=folder)
    call(programs / "dotmask", "plot", "speeds", folder=folder)
    for name in ("table.parquet", "report.html"):
        expect((folder / "speeds" / name).is_file(), f"the sweep has no {name}")


def check_environment(programs: Path, folder: Path) -> None:
    """The random agent of the examples drives to the end of its scenario."""
    agent = shutil.copy(ROOT / "examples" / "03_random_agent.py", folder)
    done = subprocess.run((programs / "python", agent, "6"), cwd=folder, capture_output=True, text=True, check=False)
    is_well = done.returncode == 0 and done.stdout.startswith("5 steps, the scenario is over")
    expect(is_well, "03_random_agent.py does not drive to the end", done.stdout + done.stderr)


def suite(programs: Path, project: Path) -> subprocess.CompletedProcess[str]:
    """Run the toy project's tests as its workflow does."""
    options = ("--dotmask-baseline", "tests/baseline.json", "--dotmask-summary", "summary.md")
    command = (programs / "python", "-m", "pytest", "-n2", *options, "--junitxml", "report.xml")
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("PYTEST_", "PYTHON", "COV_"))}
    start, before = time.monotonic(), children_cpu_s()
    environment = {**kept, "CI": "true"}
    done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)
    print(f"{project.name}: exit code {done.returncode}, {time.monotonic() - start:.0f} s, ", end="")
    print(f"{children_cpu_s() - before:.0f} s of CPU", flush=True)
    return done


def check_toy_project(programs: Path, folder: Path) -> None:
    """It passes as it is and after a refactoring, and fails by name after a mistake."""
    for title, change in (("as_it_is", None), ("refactored", REFACTORED), ("mistaken", MISTAKEN)):
        project = folder / title
        shutil.copytree(ROOT / "examples" / "ci", project)
        masks = project / "toy_front_end" / "masks.py"
        if change is not None:
            text = masks.read_text()
            assert text.count(change[0]) == 1, f"{change[0]} is not in masks.py"
            masks.write_text(text.replace(*change))
        before = children_cpu_s()
        done = suite(programs, project)
        output = done.stdout + done.stderr
        if title == "as_it_is":
            cpu_s = children_cpu_s() - before
            expect(cpu_s < MOST_CPU_S, f"examples/ci takes {cpu_s:.0f} s of CPU, more than {MOST_CPU_S:.0f}", output)
        if title != "mistaken":
            expect(done.returncode == 0, f"examples/ci fails ({title})", output)
            continue
        expect(done.returncode == 1, "examples/ci does not fail after a mistake", output)
        told = [line for line in done.stdout.splitlines() if line.startswith(f"FAILED {TEST} - worse: ")]
        expect(len(told) == 1 and "masks.leak" in told[0], "the failure does not name masks.leak", output)
        start = done.stdout.index("Worse than")
        print(done.stdout[start : done.stdout.index("=====", start)])


def main() -> None:
    """Build, install, and try everything.

    Raises:
        SystemExit: something is not as it should be.
    """
    with tempfile.TemporaryDirectory(prefix="dotmask-from-wheel-") as name:
        folder = Path(name)
        programs = install(folder)
        check_sweep(programs, folder)
        check_environment(programs, folder)
        check_toy_project(programs, folder)


if __name__ == "__main__":
    main()
