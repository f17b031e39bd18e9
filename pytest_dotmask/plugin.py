"""What pytest loads in every session: options, the marker and the fixtures. All else is imported where it is used.

See docs/ci.md.
"""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pytest_dotmask.kept_frames import FrameStore
    from pytest_dotmask.runs import DotmaskRun
    from pytest_dotmask.session import DotmaskSession
    from scenarios.spec import Scenario

MARKER = (
    "dotmask(*scenarios, seeds=1, frames=None, overrides=None): the scenarios (names or Scenario objects) that the "
    "test is run on; seeds: how many, from the scenario's own on, or a list of them; frames: how many of each; "
    "overrides: dotted keys to values, as `dotmask run --set`"
)
MISSING_MARK = 'it uses dotmask_scenario or dotmask_run: mark it, for example @pytest.mark.dotmask("smoke", seeds=8)'

Recorded = dict[str, object]
RECORDED = pytest.StashKey[list[Recorded]]()
"""Of an item: the runs of its test, as JSON would hold them."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("dotmask", "front ends in simulated scenes")
    group.addoption(
        "--dotmask-baseline",
        metavar="FILE",
        type=Path,
        help="compare the figures of all runs with those stored in FILE; fail where one is worse with 95 %% confidence",
    )
    group.addoption(
        "--dotmask-update-baseline",
        action="store_true",
        help="store the figures in the file of --dotmask-baseline and compare nothing; only if no test has failed",
    )
    group.addoption(
        "--dotmask-summary", metavar="FILE", type=Path, help="write figures and comparisons to FILE, as Markdown"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker; where an option of the plugin is used, collect results, apart from pytest-xdist's workers."""
    config.addinivalue_line("markers", MARKER)
    baseline, summary = config.getoption("dotmask_baseline"), config.getoption("dotmask_summary")
    if config.getoption("dotmask_update_baseline") and baseline is None:
        raise pytest.UsageError("--dotmask-update-baseline: name the file to write with --dotmask-baseline FILE")
    if (baseline is not None or summary is not None) and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_session(config), "dotmask-session")


def _session(config: pytest.Config) -> DotmaskSession:
    _check_packages()
    from pytest_dotmask.session import DotmaskSession
    from scenarios.errors import ScenarioError

    try:
        return DotmaskSession(config)
    except ScenarioError as error:
        raise pytest.UsageError(str(error)) from error


def _check_packages() -> None:
    """Refuse to go on where another package hides ours.

    Raises:
        pytest.UsageError: naming it.
    """
    try:
        import scenarios
    except ImportError as error:
        raise pytest.UsageError(str(error)) from error
    if getattr(scenarios, "DISTRIBUTION", None) != "dotmask":
        where = scenarios.__file__ or list(scenarios.__path__)
        raise pytest.UsageError(
            f"another package named 'scenarios' hides dotmask's: {where}; rename it, or run `pytest`"
        )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test that uses the fixtures once for every scenario and seed of its marker, the nearest one."""
    if "dotmask_scenario" not in metafunc.fixturenames:
        return
    try:
        scenarios, problem = _chosen(metafunc.definition), ""
    except pytest.UsageError as error:
        scenarios, problem = [], str(error)
    if problem:  # not told above, where pytest would tell the errors behind it too
        pytest.fail(f"{metafunc.definition.nodeid}: {problem}", pytrace=False)
    from pytest_dotmask.marks import seed_id

    metafunc.parametrize("dotmask_scenario", scenarios, indirect=True, ids=map(seed_id, scenarios), scope="module")


def _chosen(item: pytest.Item) -> list[Scenario]:
    """The scenarios of a test.

    Raises:
        pytest.UsageError: it has no marker, or one that is not possible.
    """
    mark = item.get_closest_marker("dotmask")
    if mark is None:
        raise pytest.UsageError(MISSING_MARK)
    _check_packages()
    from pytest_dotmask.marks import chosen

    return chosen(mark)


@pytest.fixture(scope="module")
def dotmask_scenario(request: pytest.FixtureRequest) -> Scenario:
    """The scenario of the test's marker, with its seed."""
    scenario: Scenario = request.param
    return scenario


@pytest.fixture(scope="session")
def _dotmask_frames() -> FrameStore:
    from pytest_dotmask.kept_frames import FrameStore

    # Beside other workers of pytest-xdist a second thread has no core of its own.
    return FrameStore(threads=1 if "PYTEST_XDIST_WORKER" in os.environ else 2)


@pytest.fixture
def dotmask_run(
    request: pytest.FixtureRequest, dotmask_scenario: Scenario, _dotmask_frames: FrameStore, tmp_path: Path
) -> DotmaskRun:
    """Runs a segmenter, a masking function or a SLAM back end in the standard loop; see `pytest_dotmask.runs`."""
    from pytest_dotmask.marks import without_seed
    from pytest_dotmask.runs import DotmaskRun

    recorded: list[Recorded] = []
    request.node.stash[RECORDED] = recorded
    test = without_seed(request.node.nodeid, dotmask_scenario)
    frames = _dotmask_frames.frames(dotmask_scenario)
    return DotmaskRun(test, frames, tmp_path, recorded, request.node.user_properties)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Send the runs of a test along with the report of its end: from pytest-xdist's workers too."""
    report = yield
    if report.when == "teardown" and item.stash.get(RECORDED, None):
        report.dotmask = item.stash[RECORDED]  # type: ignore[attr-defined]
    return report
