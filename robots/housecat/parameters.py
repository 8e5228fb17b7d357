"""The numbers of Housecat, a small bulldozer with cameras. All are our own choice: its figures are not published."""

from __future__ import annotations

import math
from dataclasses import dataclass

from snr_sim.devices import Camera, Lidar, SensorErrors, StereoCamera
from snr_sim.plants import Dozer

DOZER = Dozer(
    mass_kg=12.0,
    inertia_kgm2=0.52,  # as of a plate of its size
    size_m=(0.60, 0.42),
    height_m=0.24,
    track_m=0.34,
    track_length_m=0.40,
    full_speed_mps=0.30,
    lag_s=0.10,
    max_pull_n=60.0,  # of a track; friction allows 47
    grip_along=0.8,  # rubber on concrete
    grip_across=0.5,
    wall_friction=0.4,
    blade_s=0.5,
)

STONE_M = 0.03  # radius
STONE_KG = 0.15
STONE_FRICTION = 0.6

CAMERA_M = (0.28, 0.0, 0.16)  # the cameras, above the blade: lower ones see the floor nearer
MONO = Camera(width_px=48, height_px=36, field_of_view_rad=math.radians(70.0), mount_position_m=CAMERA_M, medium="air")
STEREO = StereoCamera(
    Camera(
        width_px=96,
        height_px=32,
        field_of_view_rad=math.radians(60.0),
        period_s=0.4,
        mount_position_m=CAMERA_M,
        medium="air",
    ),
    baseline_m=0.12,
)
LIDAR = Lidar(rays=121, field_of_view_rad=math.radians(90.0), mount_position_m=(0.30, 0.0, STONE_M), period_s=0.2)

POSE_ERRORS = SensorErrors(noise={"position_m": 0.003, "heading_rad": 0.003})


@dataclass(frozen=True)
class HousecatParameters:
    """Parameters of the robot for a controller."""

    dozer: Dozer = DOZER
    edge_m: float = 1.2  # x of the edge of the pit
    home_m: float = -1.5  # x of where a look begins
    pose_hz: float = 20.0
    dozer_hz: float = 50.0  # how often a command is written
    dozer_timeout_s: float = 0.5  # a command older than this stops the tracks and lifts the blade
