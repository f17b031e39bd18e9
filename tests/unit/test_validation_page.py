import numpy as np
import pytest

from scenarios.errors import ScenarioError
from scenarios.validation import page, runs
from scenarios.validation.section import Section, bounds, markdown_table, number
from scenarios.validation.speeds import Answers, Slid
from sim.geometry import pose
from sim.scene import Placed


def write(out, only=(), quick=False):
    return page.validate(out, is_quick=quick, only=only, show=lambda title: None, advance=lambda: None)


@pytest.fixture
def sections(monkeypatch):
    made = []

    def section(name):
        def text(context):
            made.append(name)
            return f"text of {name}, run {len(made)}"

        return Section(name=name, title=name.upper(), write=text)

    monkeypatch.setattr(page, "SECTIONS", (section("first"), section("second")))
    return made


def test_the_page_holds_all_sections_in_order(tmp_path, sections) -> None:
    text = write(tmp_path / "docs" / "validation").read_text()
    assert (tmp_path / "docs" / "validation.md").exists()
    assert text.index("## FIRST") < text.index("text of first") < text.index("## SECOND")
    assert "--quick" not in text


def test_one_section_is_made_again_and_the_others_stay(tmp_path, sections) -> None:
    write(tmp_path / "page")
    text = write(tmp_path / "page", only=("second",)).read_text()
    assert sections == ["first", "second", "second"]
    assert "text of first, run 1" in text
    assert "text of second, run 3" in text


def test_a_quick_section_says_so(tmp_path, sections) -> None:
    assert write(tmp_path / "page", quick=True).read_text().count("Made with `--quick`") == 2
    text = write(tmp_path / "page", only=("second",)).read_text()
    assert text.index("Made with `--quick`") < text.index("## SECOND")
    assert text.count("Made with `--quick`") == 1


def test_an_unknown_section_is_named(tmp_path) -> None:
    with pytest.raises(ScenarioError, match="consistency"):
        write(tmp_path / "page", only=("consist",))
    assert not (tmp_path / "page").exists()


def test_tables_show_what_was_not_measured_as_a_dash() -> None:
    assert markdown_table(["a", "b"], [["x", number(None)]]) == "| a | b |\n| --- | ---: |\n| x | - |"
    assert number(0.1234, 1, 100) == "12.3"
    assert bounds((1.0, 2.0)) == "1.00 to 2.00"


def test_scenarios_that_differ_in_their_faults_alone_are_rendered_once(monkeypatch) -> None:
    asked = []

    def judged(scenario, contenders, advance):
        asked.append((scenario.name, scenario.frames, contenders))
        return {name: f"report on {name}" for name in contenders}

    monkeypatch.setattr(runs, "judged", judged)
    made = runs.Runs(25, lambda: None)
    reports = made.reports(("fault_missed", "smoke", "fault_missed_bursts"))
    assert list(reports) == ["fault_missed", "smoke", "fault_missed_bursts"]
    assert [(name, frames) for name, frames, _ in asked] == [("fault_missed", 25), ("smoke", 25)]
    assert reports["fault_missed_bursts"]["paper"] == "report on fault_missed_bursts/paper"
    assert asked[0][2]["fault_missed_bursts/paper"].scenario.name == "fault_missed_bursts"
    assert made.reports(("smoke",))["smoke"] is reports["smoke"]
    assert len(asked) == 2


def test_latencies_count_from_the_first_and_from_after_the_last_moving_frame() -> None:
    speed = np.array([0.0] * 12 + [0.5] * 6 + [0.0] * 6)
    flagged = np.zeros(24, bool)
    flagged[[10, *range(15, 20)]] = True
    said = Answers(true_speed_m_s=speed, speed_m_s=speed, is_flagged=flagged)
    assert said.flag_latency_frames(0.5) == 3
    assert said.unflag_latency_frames(0.5) == 2
    assert said.idle_flag_share(0.5) == 0.5
    never = Answers(true_speed_m_s=speed, speed_m_s=speed, is_flagged=speed < 0)
    assert never.flag_latency_frames(0.5) is None
    assert never.unflag_latency_frames(0.5) == 0


def test_a_slid_object_stands_slides_and_stands() -> None:
    start = pose(np.eye(3), (1.0, 2.0, 0.0))
    motion = Slid(resting=Placed(start), speed_m_s=0.5, begin_s=1.0, end_s=3.0)
    x = [motion.pose_at(t)[0, 3] for t in (0.0, 1.0, 2.0, 3.0, 9.0)]
    np.testing.assert_allclose(x, [1.0, 1.0, 1.5, 2.0, 2.0])
    np.testing.assert_allclose(motion.palette_at(2.0)[0, :3, 3], [1.5, 2.0, 0.0])
