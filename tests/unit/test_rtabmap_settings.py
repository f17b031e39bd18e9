"""RTAB-Map's parameters: sets, changes, and what is refused."""

import pytest

from dotmask.errors import SlamError
from dotmask.slam.rtabmap.library import Core, Parameter
from dotmask.slam.rtabmap.settings import FIXED, rtabmap_settings

KNOWN = Core(
    version="0.21.12",
    parameters={
        "Kp/MaxFeatures": Parameter(type="int", default="500"),
        "Vis/MaxFeatures": Parameter(type="int", default="1000"),
        "Vis/MinInliers": Parameter(type="int", default="20"),
        "Vis/DepthAsMask": Parameter(type="bool", default="true"),
        "Kp/IncrementalFlann": Parameter(type="bool", default="true"),
        "Odom/ResetCountdown": Parameter(type="int", default="0"),
        "Rtabmap/DetectionRate": Parameter(type="float", default="1"),
        "Rtabmap/MemoryThr": Parameter(type="unsigned int", default="0"),
        "RGBD/LinearUpdate": Parameter(type="float", default="0.1"),
        "Kp/DictionaryPath": Parameter(type="string", default=""),
        **{name: Parameter(type="bool", default="true") for name in FIXED},
    },
)


def test_refined_is_default_with_refined_pnp_and_more_features() -> None:
    default, refined = (rtabmap_settings(name, [], KNOWN).parameters for name in ("default", "refined"))
    assert set(refined.items()) - set(default.items()) == {
        ("Vis/MaxFeatures", "2000"),
        ("Vis/PnPRefineIterations", "5"),
    }
    assert set(default) <= set(refined)
    assert FIXED.items() <= default.items()


def test_a_change_wins_over_the_set() -> None:
    changes = ["Vis/MaxFeatures=700", " RGBD/LinearUpdate = 0.05 ", "Kp/DictionaryPath=a=b"]
    parameters = rtabmap_settings("refined", changes, KNOWN).parameters
    assert parameters["Vis/MaxFeatures"] == "700"
    assert parameters["RGBD/LinearUpdate"] == "0.05"
    assert parameters["Kp/DictionaryPath"] == "a=b"
    assert parameters["Vis/PnPRefineIterations"] == "5"


def test_the_rate_of_the_map_is_ours_to_keep() -> None:
    assert rtabmap_settings("default", [], KNOWN).mapping_period_s == 0.5
    assert rtabmap_settings("default", ["Rtabmap/DetectionRate=0"], KNOWN).mapping_period_s == 0.0
    assert rtabmap_settings("default", ["Rtabmap/DetectionRate=4"], KNOWN).mapping_period_s == 0.25


def test_lost_frames_are_counted_by_us() -> None:
    settings = rtabmap_settings("default", ["Odom/ResetCountdown=7"], KNOWN)
    assert settings.restart_after == 7
    assert settings.handed_over["Odom/ResetCountdown"] == "0"
    assert settings.handed_over | {"Odom/ResetCountdown": "7"} == settings.parameters


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("Vis/MinInlier=12", "Did you mean Vis/MinInliers?"),
        ("vis/mininliers=12", "knows no parameter 'vis/mininliers'"),
        ("MinInliers=12", "Did you mean Vis/MinInliers?"),
        ("MaxFeatures=12", "Vis/MaxFeatures"),
        ("Odom/MinInliers=12", "Did you mean Vis/MinInliers?"),
        ("Nonsense=1", "RTAB-Map 0.21.12 knows no parameter 'Nonsense'."),
        ("Vis/MinInliers", "expected NAME=VALUE"),
        ("=12", "expected NAME=VALUE"),
        ("Vis/MinInliers=many", "takes a value of type int"),
        ("Vis/MinInliers=1.5", "takes a value of type int"),
        ("Rtabmap/MemoryThr=-1", "takes a value of type unsigned int"),
        ("RGBD/LinearUpdate=nan", "takes a value of type float"),
        ("Vis/DepthAsMask=yes", "takes a value of type bool"),
        ("Mem/GenerateIds=true", "must stay false"),
    ],
)
def test_a_wrong_change_is_one_line(change: str, says: str) -> None:
    with pytest.raises(SlamError) as caught:
        rtabmap_settings("default", [change], KNOWN)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_set_names_the_known_ones() -> None:
    with pytest.raises(SlamError, match=r"unknown parameter set 'best' of RTAB-Map. Known: default, refined"):
        rtabmap_settings("best", [], KNOWN)
