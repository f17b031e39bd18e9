"""One parameter set for each sensor, with the source of every number.

"assumed" marks what no publication gives; the reason follows.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from sim.sensor.failures import SensorFailure
from sim.sensor.model import SensorModel
from sim.sensor.timing import Timing

NGUYEN = "Nguyen, Izadi and Lovell, Modeling Kinect sensor noise, 3DIMPVT 2012, section 2"
KHOSHELHAM = "Khoshelham and Elberink, Accuracy and resolution of Kinect depth data, Sensors 12(2), 2012"
KONOLIGE = "Konolige and Mihelich, Technical description of Kinect calibration, ROS wiki, 2011"
MALLICK = (
    "Mallick, Das and Majumdar, Characterizations of noise in Kinect depth images, IEEE Sensors Journal 14(6), 2014"
)
TUM = "Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems, IROS 2012, and its tools"
AHN = "Ahn et al., Analysis and noise modeling of the Intel RealSense D435 for mobile robots, UR 2019"
SUBPIXEL = "Grunnet-Jepsen et al., Subpixel linearity improvement for RealSense D400, Intel white paper"
TUNING = "Grunnet-Jepsen et al., Best-known methods for tuning RealSense D400 cameras, Intel white paper"
DATA_SHEET = "Intel RealSense D400 series data sheet"
LIBREALSENSE = "librealsense, default"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A camera.

    Attributes:
        model: the errors of single images.
        timing: the errors in time.
        sources: where the numbers are from, by field of `model` and `timing`.
        failures: what it does not deliver for a while.
    """

    model: SensorModel
    timing: Timing
    sources: Mapping[str, str]
    failures: tuple[SensorFailure, ...] = ()


IDEAL = Sensor(model=SensorModel(), timing=Timing(), sources=MappingProxyType({}))
"""Measures exactly what is there, at once."""

KINECT_V1 = Sensor(
    model=SensorModel(
        axial_sigma_m=0.0012,
        axial_growth_per_m=0.0019,
        axial_origin_m=0.4,
        axial_slant_m=0.0001,
        lateral_sigma_px=0.8,
        edge_jump=0.05,
        edge_dropout_px=1,
        baseline_m=0.075,
        focal_px=586.0,
        disparity_step_px=0.125,
        hole_start_deg=75.0,
        hole_end_deg=87.0,
        min_range_m=0.4,
        max_range_m=6.0,
        depth_step_m=1.0 / 5000.0,
        rgb_sigma_black=2.0,
        rgb_sigma_white=3.0,
    ),
    timing=Timing(
        exposure_s=0.016,
        readout_s=0.026,
        depth_delay_s=0.016,
        dropped_share=0.01,
        stamp_sigma_s=0.002,
    ),
    sources=MappingProxyType(
        {
            "axial_sigma_m": f"{NGUYEN}, axial noise",
            "axial_growth_per_m": f"{NGUYEN}, axial noise",
            "axial_origin_m": f"{NGUYEN}, axial noise",
            "axial_slant_m": f"{NGUYEN}, axial noise above 60 degrees",
            "lateral_sigma_px": f"{NGUYEN}, lateral noise; its small growth with the angle is left out",
            "edge_jump": "assumed: no smooth surface of a room changes so much from one pixel to the next",
            "edge_dropout_px": f"assumed; {MALLICK} describes the effect",
            "baseline_m": f"{KHOSHELHAM}, calibration",
            "focal_px": f"{KHOSHELHAM}, calibration: 5.453 mm over 9.3 µm",
            "disparity_step_px": f"{KONOLIGE}; with focal length and baseline: 2.84e-3 z², Khoshelham: 2.85e-3 z²",
            "hole_start_deg": "assumed: above the 60 degrees up to which Nguyen et al. see no effect of the angle",
            "hole_end_deg": "assumed; Nguyen et al. still measure above 80 degrees",
            "min_range_m": f"{NGUYEN}: the nearest distance they measure",
            "max_range_m": "assumed: noise and steps reach 0.1 m there",
            "depth_step_m": f"{TUM}: 5000 steps per metre in its files",
            "rgb_sigma_black": "assumed",
            "rgb_sigma_white": "assumed",
            "exposure_s": "assumed: half a period at 30 Hz, indoors",
            "readout_s": "assumed: most of a period at 30 Hz, as usual for CMOS imagers of its time",
            "depth_delay_s": f"assumed: half a period; {TUM} pair images up to 0.02 s apart",
            "dropped_share": "assumed",
            "stamp_sigma_s": "assumed: stamps are taken by the host when data arrive over USB",
        }
    ),
)
"""First-generation Kinect: structured light, colour 640x480 with a rolling shutter, not synchronised."""

REALSENSE_D435 = Sensor(
    model=SensorModel(
        axial_sigma_m=0.001029,
        axial_growth_per_m=0.003949,
        axial_origin_m=-0.0922,
        lateral_sigma_px=1.0,
        edge_jump=0.05,
        edge_dropout_px=2,
        baseline_m=0.050,
        focal_px=424.0,
        disparity_step_px=1.0 / 32.0,
        hole_start_deg=70.0,
        hole_end_deg=87.0,
        min_range_m=0.195,
        max_range_m=10.0,
        depth_step_m=0.001,
        rgb_sigma_black=1.5,
        rgb_sigma_white=2.5,
    ),
    timing=Timing(
        exposure_s=0.0156,
        readout_s=0.020,
        depth_delay_s=0.005,
        dropped_share=0.02,
        stamp_sigma_s=0.0005,
    ),
    sources=MappingProxyType(
        {
            "axial_sigma_m": f"{AHN}: 0.001063 + 0.0007278 z + 0.003949 z², the square completed",
            "axial_growth_per_m": f"{AHN}; {TUNING}: z² subpixel / (f b) = 0.0038 z² for a subpixel of 0.08",
            "axial_origin_m": f"{AHN}, the square completed",
            "lateral_sigma_px": "assumed",
            "edge_jump": "assumed: no smooth surface of a room changes so much from one pixel to the next",
            "edge_dropout_px": "assumed: block matching loses more at an edge than structured light",
            "baseline_m": DATA_SHEET,
            "focal_px": f"{TUNING}: half the width over tan(HFOV / 2), 848 pixels and 90 degrees",
            "disparity_step_px": f"{SUBPIXEL}: 1/32 pixel",
            "hole_start_deg": "assumed: matching foreshortened patterns fails earlier than structured light",
            "hole_end_deg": "assumed",
            "min_range_m": f"{DATA_SHEET}: Min-Z at 848x480",
            "max_range_m": f"{DATA_SHEET}: up to 10 m",
            "depth_step_m": f"{LIBREALSENSE} depth units",
            "rgb_sigma_black": "assumed",
            "rgb_sigma_white": "assumed",
            "exposure_s": f"{LIBREALSENSE} exposure of the colour sensor",
            "readout_s": f"assumed; {DATA_SHEET}: the colour imager has a rolling shutter",
            "depth_delay_s": "assumed: the imagers are triggered together and expose for different times",
            "dropped_share": "assumed",
            "stamp_sigma_s": "assumed: stamps come from the camera's own clock",
        }
    ),
)
"""Intel RealSense D435: infrared stereo with a pattern projector and a global shutter, rolling shutter in colour."""

SENSORS: Mapping[str, Sensor] = MappingProxyType(
    {"ideal": IDEAL, "kinect_v1": KINECT_V1, "realsense_d435": REALSENSE_D435}
)
"""What `sensor.model` of a scenario may name."""
