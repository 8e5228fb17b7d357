"""The numbers of the lunar module, each with its source, and how good its sensors are.

[E] encyclopedia article on the descent engine; [C] ND Pyomo Cookbook 06.04, Apollo 11's masses; [L] Luminary 99, the
program of Apollo 11's lunar module (CONTROLLED_CONSTANTS.agc); [G] Grumman's summary of its reaction control subsystem
(longislandaerospacehistory.com); [P] "The LM Digital Autopilot" (astronomyclub.xyz/lunar-landing); [O] our own choice
or estimate, for the course.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from snr_sim.devices import SensorErrors
from snr_sim.plants import MOON_GRAVITY_MPS2, STANDARD_GRAVITY_MPS2, Engine, Leg, LunarModule, Throttle
from snr_sim.plants.lander.module_shapes import JETS_OUT_M

THRUST_N = 45_040.0  # descent engine at full throttle [C]
EXHAUST_MPS = 311.0 * STANDARD_GRAVITY_MPS2  # specific impulse 311 s [E]; at 10 % it was 285 s, which we leave out
DRY_MASS_KG = 2_445.0 + 2_376.0 + 2_034.0  # ascent stage, its propellant, empty descent stage: 6855 kg [C]

APOLLO = LunarModule(
    thrust_n=THRUST_N,
    exhaust_mps=EXHAUST_MPS,
    throttle=Throttle(lowest=0.10, highest=0.60),  # 1050 to 6825 lbf, or full [E]
    throttle_lag_s=0.15,  # [O]
    gimbal_rad=math.radians(6.0),  # [E]
    gimbal_rate_radps=math.radians(10.0),  # [O]: the real one trimmed far more slowly; students may steer with it
    jets_nm=4 * 445.0 * JETS_OUT_M,  # four of the sixteen jets of 100 lb [G]
    gyration_m=1.6,  # [O]: about 19 000 kg m2 at 7500 kg
    # [O]: 3 m/s is taken up within 0.4 m, damped to about half of critical, so that it hardly rebounds; Apollo's legs
    # crushed honeycomb and did not at all. Grip as of a dish in gravel. All three are estimates.
    leg=Leg(spring_npm=200e3, damper_nspm=26e3, friction=0.7),
    gravity_mps2=MOON_GRAVITY_MPS2,
)


@dataclass(frozen=True)
class SensorLevel:
    """How often a sensor is read, and how badly it measures."""

    rate_hz: float  # readings per second
    errors: SensorErrors = field(default_factory=SensorErrors)  # noise, resolution and delay


# A landing radar of the time gave height in steps of 1.079 ft (0.33 m) and vertical speed in steps of 0.644 ft/s (0.20
# m/s) [L]. What the computer made of it by smoothing, its noise and its finer steps, is an estimate [O]. One period of
# delay is what computing takes [O].
VERTICAL_RADAR = SensorLevel(
    rate_hz=5.0,  # enough to land within 2 % of the optimum to rest; at twice the rate a run takes twice as long [O]
    errors=SensorErrors(
        noise={"altitude_m": 0.15, "velocity_mps": 0.03},
        resolution={"altitude_m": 0.05, "velocity_mps": 0.01},
        delay_s=0.2,
    ),
)

# In the plane, attitude control needs a shorter delay than descent. 10 Hz, as the lunar module's digital autopilot ran
# [P]: it lands 1000 starts of 1000, a hundred of which were tried at 50 Hz too, and a node has a fifth of the work.
PLANE_RADAR = SensorLevel(
    rate_hz=10.0,
    errors=SensorErrors(
        noise={"altitude_m": 0.2, "velocity_mps": 0.05},
        resolution={"altitude_m": 0.05, "velocity_mps": 0.01},
        delay_s=0.1,
    ),
)
# Noise and steps are ours [O]: those of attitude are 2.6 times Apollo's, which gave it in 32768 steps of a full turn.
INERTIAL = SensorLevel(
    rate_hz=10.0,
    errors=SensorErrors(
        noise={"position_m": 0.15, "velocity_mps": 0.04, "attitude_rad": 0.002, "rate_radps": 0.001, "fuel_kg": 0.5},
        resolution={"attitude_rad": 0.0005, "rate_radps": 0.0002, "fuel_kg": 0.5},
        delay_s=0.1,
    ),
)


def scale_noise(level: SensorLevel, factor: float) -> SensorLevel:
    """Return a sensor with `factor` times the noise."""
    errors = level.errors
    noise = {name: factor * sigma for name, sigma in errors.noise.items()}
    return SensorLevel(level.rate_hz, SensorErrors(noise, errors.resolution, errors.delay_s))


@dataclass(frozen=True)
class LanderParameters:
    """Parameters of the lander for a controller. The start is known from the sensors only."""

    mass_kg: float  # all of it, at the start
    fuel_kg: float  # of the mass, what may be burned
    module: LunarModule = APOLLO  # its other numbers
    radar: SensorLevel = VERTICAL_RADAR
    inertial: SensorLevel | None = None  # None for the vertical lander
    engine_hz: float = 5.0  # how often a command is written to the engine
    engine_timeout_s: float = 0.5  # a command older than this shuts the engine off

    @property
    def engine(self) -> Engine:
        """The main engine, as the closed forms of descent want it."""
        return Engine(self.module.thrust_n, self.module.exhaust_mps, self.module.gravity_mps2)
