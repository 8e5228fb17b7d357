"""The numbers of Dora, an explorer of toy bricks, each with its source.

[F] Fabry and Campusano, "Live Programming the Lego Mindstorms" (IWST 2014); [E] the user guide of the EV3 set: its
ultrasonic sensor measures up to 255 cm, in steps of 0.1 cm; [O] our own choice or estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from snr_sim.devices import SensorErrors
from snr_sim.plants import Explorer

# [F] 3.2: 5 cm in 0.12 s at 55 % of full speed. The time is printed in microseconds there; 120 us would make 417 m/s.
FULL_SPEED_MPS = 0.05 / 0.12 / 0.55

DORA = Explorer(
    mass_kg=0.7,  # [O]: brick, two motors, sensors
    inertia_kgm2=0.0038,  # [O]: as of a plate of its size
    size_m=(0.20, 0.16),  # [O]
    height_m=0.08,  # [O]
    axle_m=-0.03,  # [O]: two driven wheels and a caster, as in [F] figure 1
    caster_m=0.08,  # [O]
    track_m=0.13,  # [O]
    wheel_radius_m=0.028,  # [O]: the wheel of the set has a diameter of 56 mm
    full_speed_mps=FULL_SPEED_MPS,
    lag_s=0.06,  # [O]
    grip=0.9,  # [O]: rubber on a wooden floor
    wall_friction=0.3,  # [O]: plastic on plaster
    echo_range_m=2.55,  # [E]
    echo_half_angle_rad=math.radians(10.0),  # [O]
    bar_m=0.008,  # [O]
)

RANGE_ERRORS = SensorErrors(
    noise={"distance_m": 0.003},  # [O]
    resolution={"distance_m": 0.001},  # [E]
    limits={"distance_m": (0.03, 2.55)},  # [E] 3 cm to 255 cm
)


@dataclass(frozen=True)
class DoraParameters:
    """Parameters of the robot for a controller."""

    explorer: Explorer = DORA
    range_hz: float = 20.0  # readings of the ultrasonic sensor [O]
    touch_hz: float = 50.0  # of the touch bars [O]
    wheels_hz: float = 20.0  # of the encoders [O]
    motors_hz: float = 100.0  # how often a command is written [O]
    motors_timeout_s: float = 0.5  # a command older than this stops the motors [O]
