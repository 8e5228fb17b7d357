"""Landers as arrays compared with the plant itself: the same commands, the same flight."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest

import snr_sim.learning  # noqa: F401 - makes the names known
from snr_sim.learning.lander_envs import PAD_THROTTLES, PAD_TURNS
from snr_sim.learning.plane_batch import FEET_OUT_M, PlaneLanders, step, touches
from snr_sim.plants.lander.module_shapes import PADS_BELOW_M
from snr_sim.prelude.signals import EngineCommand


def as_one(plant: Any) -> PlaneLanders:
    """The state of a plant, as a batch of one above ground at height 0."""
    pose = plant._read_pose()
    values = (
        pose.z_m - PADS_BELOW_M,
        pose.vz_mps,
        pose.vx_mps,
        pose.attitude_rad,
        pose.rate_radps,
        plant.mass_kg,
        plant.fuel_kg,
        plant.throttle,
    )
    return PlaneLanders(*(np.array([value]) for value in values))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ten_seconds_of_batch_flight_are_close_to_plant(seed: int) -> None:
    """The plant steps 20 times as often; what differs is that here the push is the mean of 0.05 s."""
    env: Any = gymnasium.make("snr_sim/LanderPad-v0").unwrapped
    env.reset(options={"start": seed})
    plant, rng = env.plant, np.random.default_rng(seed)
    landers = as_one(plant)
    turn = 0.0
    for k in range(100):
        throttle = PAD_THROTTLES[rng.integers(3)] if k % 5 == 0 else throttle  # noqa: F821 - set at k = 0
        tilt = plant._read_pose()
        turn = PAD_TURNS[1 - int(np.sign(tilt.attitude_rad + 3.0 * tilt.rate_radps))] if k % 3 == 0 else turn
        plant.write("engine", EngineCommand(throttle, 0.0, turn))
        for _ in range(20):
            plant.step(plant.step_s)
        landers = step(landers, np.array([throttle]), np.array([turn]), plant.module, 0.1)
    assert plant.outcome is None
    assert abs(plant._read_pose().attitude_rad) < 1.0
    found, expected = [float(one[0]) for one in landers], [float(one[0]) for one in as_one(plant)]
    assert found[0] == pytest.approx(expected[0], abs=0.1)  # height
    assert found[1:5] == pytest.approx(expected[1:5], abs=0.01)
    assert found[5:] == pytest.approx(expected[5:], abs=0.05)


def test_empty_tank_gives_no_thrust() -> None:
    module = gymnasium.make("snr_sim/LanderPad-v0").unwrapped.plant.module  # type: ignore[attr-defined]
    one = PlaneLanders(*(np.array([value]) for value in (100.0, 0.0, 0.0, 0.0, 0.0, 7000.0, 1.0, 0.6)))
    for _ in range(20):
        one = step(one, np.array([0.6]), np.zeros(1), module, 0.1)
    assert float(one.fuel_kg[0]) == 0.0
    assert float(one.mass_kg[0]) == pytest.approx(6999.0)
    falls = step(one, np.array([0.6]), np.zeros(1), module, 0.1)
    assert float(falls.vz_mps[0] - one.vz_mps[0]) == pytest.approx(-0.1 * module.gravity_mps2)


def test_lower_foot_of_tilted_lander_touches_first() -> None:
    tilt = math.radians(6.0)
    lower_m = FEET_OUT_M * math.sin(tilt) - PADS_BELOW_M * (1.0 - math.cos(tilt))
    heights = np.array([0.01, -0.01, lower_m + 0.01, lower_m - 0.01])
    attitudes = np.array([0.0, 0.0, tilt, -tilt])
    zeros = np.zeros(4)
    down = touches(PlaneLanders(heights, zeros, zeros, attitudes, zeros, zeros, zeros, zeros))
    assert down.tolist() == [False, True, False, True]
