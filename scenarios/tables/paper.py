"""Figures of Vincent et al. 2020, "Dynamic Object Tracking and Masking for Visual SLAM", Tables II to IV.

Decimals, so that they keep the digits that are printed. They were measured on the recorded TUM sequences with the
network YOLACT and RTAB-Map.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperAte:
    """A row of Table II: RMSE of the absolute translational error in centimetres; None where the paper has a dash.

    Attributes:
        bamvo: Kim and Kim 2016.
        sun: Sun et al. 2017.
        dynaslam: Bescos et al. 2018.
        rtabmap: RTAB-Map alone.
        dotmask: RTAB-Map with DOTMask.
        improvement_percent: from RTAB-Map to DOTMask, as printed.
    """

    bamvo: Decimal | None
    sun: Decimal | None
    dynaslam: Decimal | None
    rtabmap: Decimal
    dotmask: Decimal
    improvement_percent: Decimal


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperLoops:
    """One half of a row of Table III.

    Attributes:
        count: loop closures.
        trans_error_cm: their mean translational error.
        rot_error_deg: their mean rotational error.
    """

    count: int
    trans_error_cm: Decimal
    rot_error_deg: Decimal


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperTime:
    """A row of Table IV: average time of a frame, without SLAM and odometry.

    Attributes:
        approach, resolution, cpu, gpu: as printed.
        time_ms: as printed.
    """

    approach: str
    resolution: str
    time_ms: Decimal
    cpu: str
    gpu: str


def _ate(bamvo: str, sun: str, dynaslam: str, rtabmap: str, dotmask: str, improvement: str) -> PaperAte:
    return PaperAte(
        bamvo=_or_none(bamvo),
        sun=_or_none(sun),
        dynaslam=_or_none(dynaslam),
        rtabmap=Decimal(rtabmap),
        dotmask=Decimal(dotmask),
        improvement_percent=Decimal(improvement),
    )


def _or_none(printed: str) -> Decimal | None:
    return None if printed == "-" else Decimal(printed)


def _loops(count: int, trans_error_cm: str, rot_error_deg: str) -> PaperLoops:
    return PaperLoops(count=count, trans_error_cm=Decimal(trans_error_cm), rot_error_deg=Decimal(rot_error_deg))


def _time(approach: str, resolution: str, time_ms: str, cpu: str, gpu: str) -> PaperTime:
    return PaperTime(approach=approach, resolution=resolution, time_ms=Decimal(time_ms), cpu=cpu, gpu=gpu)


TABLE_II: Mapping[str, PaperAte] = {
    "fr3_sitting_static": _ate("2.48", "-", "-", "1.70", "0.60", "64.71"),
    "fr3_sitting_xyz": _ate("4.82", "3.17", "1.5", "1.60", "1.80", "-12.50"),
    "fr3_walking_static": _ate("13.39", "0.60", "2.61", "10.7", "0.80", "92.52"),
    "fr3_walking_xyz": _ate("23.26", "9.32", "1.50", "24.50", "2.10", "91.42"),
    "fr3_walking_rpy": _ate("35.84", "13.33", "3.50", "22.80", "5.30", "76.75"),
    "fr3_walking_halfsphere": _ate("17.38", "12.52", "2.50", "14.50", "4.00", "72.41"),
}
"""By the name of our scenario; the six sequences that the paper has, in its order."""

TABLE_III: Mapping[str, tuple[PaperLoops, PaperLoops]] = {
    "fr3_sitting_static": (_loops(33, "1.80", "0.26"), _loops(1246, "0.60", "0.21")),
    "fr3_sitting_xyz": (_loops(288, "2.10", "0.42"), _loops(1486, "2.50", "0.45")),
    "fr3_walking_static": (_loops(105, "9.00", "0.18"), _loops(1260, "7.00", "0.15")),
    "fr3_walking_xyz": (_loops(55, "6.5", "0.99"), _loops(1516, "2.9", "0.45")),
    "fr3_walking_rpy": (_loops(94, "6.7", "1.06"), _loops(965, "6.00", "1.04")),
    "fr3_walking_halfsphere": (_loops(121, "5.90", "0.84"), _loops(964, "4.90", "0.79")),
}
"""RTAB-Map alone, and with DOTMask."""

TABLE_IV: tuple[PaperTime, ...] = (
    _time("BaMVO", "320x240", "42.6", "i7 3.3GHz", "-"),
    _time("Sun et al.", "640x480", "500", "i5", "-"),
    _time("DynaSLAM", "640x480", "500", "-", "-"),
    _time("DOTMask", "640x480", "70", "i5-8600K", "GTX1080"),
    _time("DOTMask", "640x480", "125", "i7-8750H", "GTX1050"),
)
