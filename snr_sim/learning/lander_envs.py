"""The lunar module's two environments: straight down, and in the plane to a pad."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.gym import box, spaces
from snr_sim.learning.scenario_env import ScenarioEnv
from snr_sim.plants.lander.descent import MOON_GRAVITY_MPS2
from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.signals import EngineCommand, InertialReading, RadarReading

Floats = NDArray[np.float64]

VERTICAL_THROTTLES = (0.0, 0.25, 0.5, 1.0)
VERTICAL_NAMES = ("altitude_m", "velocity_mps")  # of the observation
VERTICAL_ACTIONS = tuple(f"throttle {throttle:g}" for throttle in VERTICAL_THROTTLES)
VERTICAL_LOW, VERTICAL_HIGH = (-20.0, -250.0), (5000.0, 250.0)
# Off (which the engine does not stay for long), about hovering, the most it gives steadily.
PAD_THROTTLES = (0.0, 0.25, 0.6)
PAD_TURNS = (-1.0, 0.0, 1.0)
PAD_LOW = (-500.0, -20.0, -100.0, -100.0, -math.pi, -5.0, 0.0, 0.0, -10.0)
PAD_HIGH = (500.0, 1000.0, 100.0, 100.0, math.pi, 5.0, 1.0, 1.0, 1000.0)

LANDED, NOT_LANDED = 100.0, -100.0
FUEL_WEIGHT = 50.0  # for all of the propellant
SPEED_WEIGHT = 0.2  # per m/s of difference from the suitable speed for the height
BRAKING_G = 1.0  # deceleration behind the suitable speed for a height, in units of the Moon's gravity
TOUCHDOWN_MPS = 1.0


class LanderEnv(ScenarioEnv):
    """What both have in common: the reward.

    +100 for a landing and -100 for any other end, less 50 times the burned fraction of the propellant, and
    a shaping term that is a difference of potentials, so that it does not change which policy is best (Ng, Harada,
    Russell 1999): 0.2 for each metre per second that the module comes nearer to the speed that suits its height,
    from which it can stop braking gently.

    A soft touchdown is worth no more than one as fast as the gear takes, which saves propellant: some 0.5 of the 50 for
    all of it. So this reward pays, a little, for falling the last metre.
    """

    def begin(self) -> None:
        """Remember where the episode begins."""
        self._tank_kg = self._fuel_kg = self._values()["fuel_kg"]
        self._potential = self.potential()

    def reward(self, verdict: Verdict | None) -> float:
        """Return what the last step was worth."""
        fuel_kg = self._values()["fuel_kg"]
        reward = -FUEL_WEIGHT * (self._fuel_kg - fuel_kg) / self._tank_kg
        self._fuel_kg = fuel_kg
        potential = self.potential() if verdict is None else 0.0
        reward += potential - self._potential
        self._potential = potential
        if verdict is not None:
            reward += LANDED if verdict.success else NOT_LANDED
        return reward

    def potential(self) -> float:
        """Return how well placed the module is: 0 at best."""
        values = self._values()
        return -SPEED_WEIGHT * abs(values["vertical_mps"] - reference_speed_mps(values["altitude_m"]))

    def _values(self) -> dict[str, float]:
        values: dict[str, float] = self.plant.truth()["values"]
        return values


def reference_speed_mps(altitude_m: float, gravity_mps2: float = MOON_GRAVITY_MPS2) -> float:
    """Return the vertical speed that suits a height [m/s], negative down: what gentle braking takes to touch down.

    >>> round(reference_speed_mps(0.0), 2), round(reference_speed_mps(100.0), 1)
    (-1.0, -18.0)
    """
    return -math.sqrt(TOUCHDOWN_MPS**2 + 2.0 * BRAKING_G * gravity_mps2 * max(0.0, altitude_m))


def reference_speeds_mps(altitudes_m: Floats, gravity_mps2: float) -> Floats:
    """Return the same for many heights at once, bitwise; for a single one it would take seven times as long.

    >>> speeds = reference_speeds_mps(np.array([-1.0, 100.0]), 1.62).tolist()
    >>> speeds == [reference_speed_mps(-1.0), reference_speed_mps(100.0)]
    True
    """
    speeds: Floats = -np.sqrt(TOUCHDOWN_MPS**2 + 2.0 * BRAKING_G * gravity_mps2 * np.maximum(0.0, altitudes_m))
    return speeds


def vertical_potentials(altitudes_m: Floats, speeds_mps: Floats, gravity_mps2: float = MOON_GRAVITY_MPS2) -> Floats:
    """Return `LanderEnv.potential` of many landers, to the last bit.

    >>> vertical_potentials(np.array([0.0]), np.array([-3.0])).tolist()
    [-0.4]
    """
    potentials: Floats = -SPEED_WEIGHT * np.abs(speeds_mps - reference_speeds_mps(altitudes_m, gravity_mps2))
    return potentials


def radar_observation(radar: RadarReading) -> list[float]:
    """Return what `LanderVertical` observes of a reading, to the last bit: a policy in a node uses it, too.

    >>> radar_observation(RadarReading(altitude_m=0.1, velocity_mps=-300.0, stamp_s=0.0))
    [0.10000000149011612, -250.0]
    """
    return [
        float(np.float32(min(max(value, low), high)))  # a fifth of what np.clip takes for two numbers
        for value, low, high in zip((radar.altitude_m, radar.velocity_mps), VERTICAL_LOW, VERTICAL_HIGH, strict=True)
    ]


class LanderVertical(LanderEnv):
    """Scenario lander_vertical: one engine, straight down. 5 steps a second; at most 240 s.

    Observation, Box(2), float32: what the radar reads, with its noise and its delay of 0.2 s.
        0  altitude_m     height of the pads over the ground [m], -20 to 5000
        1  velocity_mps   vertical [m/s], up positive, -250 to 250

    Action, Discrete(4): throttle 0, 0.25, 0.5 or 1 until the next step. Hovering takes 0.27 to 0.3.

    Args:
        is_continuous: the action is Box(1), the throttle from 0 to 1.
        render_mode: None or 'rgb_array'.
    """

    rate_hz: float = 5.0

    def __init__(self, is_continuous: bool = False, render_mode: str | None = None) -> None:
        super().__init__("lander_vertical", render_mode=render_mode)
        self.observation_space: spaces.Space[Any] = box(VERTICAL_LOW, VERTICAL_HIGH)
        self.is_continuous: bool = is_continuous
        self.action_space: spaces.Space[Any] = (
            box([0.0], [1.0]) if is_continuous else spaces.Discrete(len(VERTICAL_THROTTLES))
        )

    def observe(self) -> list[float]:
        """Return what the radar reads."""
        return radar_observation(self.sensors["radar"].read())

    def act(self, action: Any) -> None:
        """Set the throttle."""
        throttle = float(action[0]) if self.is_continuous else VERTICAL_THROTTLES[int(action)]
        self.actuators["engine"].write(EngineCommand(throttle))


def pad_observation(radar: RadarReading, inertial: InertialReading) -> list[float]:
    """Return what `LanderPad` observes of readings, to the last bit: a policy in a node uses it, too."""
    left, right = inertial.contact
    seen = [
        inertial.position_m[0],
        radar.altitude_m,
        *inertial.velocity_mps,
        wrap_rad(inertial.attitude_rad),  # it turns over; a clipped angle would show it at rest there
        inertial.rate_radps,
        float(left),
        float(right),
        inertial.fuel_kg,
    ]
    within: list[float] = np.clip(np.array(seen, np.float32), PAD_LOW, PAD_HIGH).tolist()
    return within


def pad_command(action: int) -> EngineCommand:
    """Return the engine command of a discrete action of `LanderPad`.

    >>> pad_command(8)
    EngineCommand(throttle=0.6, gimbal_rad=0.0, attitude=1.0)
    """
    throttle, turn = divmod(action, len(PAD_TURNS))
    return EngineCommand(PAD_THROTTLES[throttle], 0.0, PAD_TURNS[turn])


def lateral_cost(x_m: Any, lateral_mps: Any, attitude_deg: Any) -> Any:
    """Return how much distance from the pad, sideways speed and tilt lower the potential of `LanderPad`.

    >>> lateral_cost(np.array([-10.0]), np.array([0.0]), np.array([4.0])).tolist()
    [4.0]
    """
    return 0.2 * (abs(x_m) + abs(lateral_mps)) + 0.5 * abs(attitude_deg)


class LanderPad(LanderEnv):
    """Scenario lander_pad: in the plane, above gentle hills, to the pad at x = 0. 10 steps a second; at most 180 s.

    Observation, Box(9), float32: what radar and inertial unit read, with noise and a delay of 0.1 s.
        0  x_m            from the middle of the pad [m], -500 to 500
        1  altitude_m     over the ground straight below [m], -20 to 1000
        2  vx_mps         [m/s], -100 to 100
        3  vz_mps         up positive [m/s], -100 to 100
        4  attitude_rad   0 upright, positive when the nose goes to -x [rad], -pi to pi
        5  rate_radps     of attitude [rad/s], -5 to 5
        6  left           left pad touches the ground, 0 or 1
        7  right          right pad, 0 or 1
        8  fuel_kg        left [kg], -10 to 1000 (the gauge is noisy too)

    Action, Discrete(9): throttle 0, 0.25 or 0.6 (index // 3), and attitude jets -1, 0 or 1 (index % 3 - 1).
    Continuous, Box(3): throttle 0 to 1, gimbal as a fraction of its largest angle -1 to 1, jets -1 to 1.

    The reward has two more potentials: for the distance to the pad and for leaning.

    Args:
        is_continuous: which actions.
        engine: 'pymunk', or 'mujoco' for a module that is free in all directions.
        render_mode: None or 'rgb_array'.
    """

    rate_hz: float = 10.0

    def __init__(self, is_continuous: bool = False, engine: str | None = None, render_mode: str | None = None) -> None:
        super().__init__("lander_pad", engine, render_mode)
        self.observation_space: spaces.Space[Any] = box(PAD_LOW, PAD_HIGH)
        self.is_continuous: bool = is_continuous
        self.action_space: spaces.Space[Any] = (
            box([0.0, -1.0, -1.0], [1.0, 1.0, 1.0])
            if is_continuous
            else spaces.Discrete(len(PAD_THROTTLES) * len(PAD_TURNS))
        )

    def observe(self) -> list[float]:
        """Return what the sensors read."""
        return pad_observation(self.sensors["radar"].read(), self.sensors["inertial"].read())

    def act(self, action: Any) -> None:
        """Set throttle, gimbal and jets."""
        if self.is_continuous:
            throttle, gimbal, turn = (float(one) for one in action)
            _, max_rad = self.actuators["engine"].limits["gimbal_rad"]
            command = EngineCommand(throttle, gimbal * max_rad, turn)
        else:
            command = pad_command(int(action))
        self.actuators["engine"].write(command)

    def potential(self) -> float:
        """Return how well placed the module is, also sideways and upright."""
        values = self._values()
        x_m: float = self.plant.truth()["poses"]["module"][0]
        aside: float = lateral_cost(x_m, values["lateral_mps"], values["attitude_deg"])
        return super().potential() - aside
