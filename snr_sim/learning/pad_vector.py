"""Many of `LanderPad` as one vector environment: the flight in arrays, the landing in the plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.gym import AutoresetMode
from snr_sim.learning.lander_envs import PAD_THROTTLES, PAD_TURNS, LanderPad, lateral_cost, vertical_potentials
from snr_sim.learning.lander_vector import Bools, Floats, Indices, LanderVectorEnv
from snr_sim.learning.plane_flight import PlaneFlight
from snr_sim.learning.sensor_batch import SensorBatch
from snr_sim.plants.lander.lander_2d import Lander2D
from snr_sim.plants.lander.module_shapes import PADS_BELOW_M
from snr_sim.prelude.angles import wrap_rad
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.signals import EngineCommand

INERTIAL_FIELDS = (
    "position_m", "position_m", "velocity_mps", "velocity_mps", "attitude_rad", "rate_radps", "fuel_kg",
    "contact", "contact",
)  # fmt: skip


class LanderPadVector(LanderVectorEnv):
    """Many of `LanderPad` under pymunk; its arguments, and those of `LanderVectorEnv`.

    A lander that touches down within its gear's limits continues in its own plant until it comes to rest or tips over;
    for any other, the plant's judge gives the verdict at once.
    """

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        is_continuous: bool = False,
        engine: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ) -> None:
        if engine not in (None, "pymunk"):
            raise ParameterError(
                f"engine={engine!r} flies one lander at a time.", fix='"pymunk", or vectorization_mode="sync".'
            )
        super().__init__(LanderPad(is_continuous), num_envs, max_episode_steps, autoreset_mode)
        self._judge = cast("Lander2D", self._single.plant)
        self._module = self._judge.module
        self._parts = round(self._step_s / self._judge.step_s)
        self._flight = PlaneFlight(self._judge.step_s, num_envs)
        self._jets_nm = np.zeros(num_envs)
        self._plants: dict[int, Any] = {}
        self._contact = np.zeros((2, num_envs))
        self._is_continuous = is_continuous
        radar, inertial = self._parameters.radar.errors, self._parameters.inertial.errors
        self._radar = SensorBatch("radar", ("altitude_m", "velocity_mps"), radar, num_envs)
        self._inertial = SensorBatch("inertial", INERTIAL_FIELDS, inertial, num_envs)
        self._truth = self._measured()

    def _put(self, which: Indices, starts: Sequence[int]) -> None:
        bodies = [self._bodies[i] for i in which.tolist()]
        begun = [one.start_of(start) for one, start in zip(bodies, starts, strict=True)]
        self._flight.put(which, begun, [one.module for one in bodies])
        self._jets_nm[which] = [one.module.jets_nm for one in bodies]
        self._contact[:, which] = 0.0
        self._truth = self._measured()
        radar, inertial = self._truth
        self._radar.begin(which, starts, radar[:, which])
        self._inertial.begin(which, starts, inertial[:, which])
        for i in which.tolist():
            self._plants.pop(i, None)

    def _advance(self, actions: Any, is_flying: Bools) -> dict[int, Verdict]:
        throttles, gimbals, turns, goals = self._commands(actions)
        flight = self._flight
        before = flight.numbers.copy()
        alone = is_flying.copy()  # in flight, and not in a plant of its own
        alone[list(self._plants)] = False
        near = flight.near(self._step_s)
        near = near[alone[near]]
        jets_nm = turns * self._jets_nm
        verdicts, ended = dict[int, Verdict](), dict[int, Floats]()
        for part in range(self._parts):
            flight.push(goals, gimbals, jets_nm)
            met = flight.met(near).tolist() if len(near) else []
            gone = np.flatnonzero(flight.lost() & alone).tolist() if part == 0 else []
            for i in [*met, *gone]:
                alone[i] = False
                verdict = self._judged(i, is_lost=i not in met)
                if verdict is None:
                    self._plants[i] = self._plant_of(i, before)
                else:
                    verdicts[i], ended[i] = verdict, flight.numbers[:, i].copy()
            near = near[alone[near]]
            flight.move()
        for i, column in ended.items():
            flight.numbers[:, i] = column
        for i, plant in list(self._plants.items()):
            plant.write("engine", EngineCommand(float(throttles[i]), float(gimbals[i]), float(turns[i])))
            for _ in range(self._parts):
                plant.step(plant.step_s)
            reading = plant.read("inertial")
            flight.take(i, reading, plant.mass_kg)
            self._contact[:, i] = reading.contact
            verdict = self._scenario.verdict(plant)
            if verdict is not None:
                verdicts[i] = verdict
                del self._plants[i]
        self._truth = self._measured()
        return verdicts

    def _commands(self, actions: Any) -> tuple[Floats, Floats, Floats, Floats]:
        """Return throttles, gimbals [rad] and turn that are commanded, and the throttles that the engine runs at."""
        if self._is_continuous:
            throttles, gimbals, turns = actions.T.astype(np.float64)
            goals = np.array([self._module.throttle.snap(one) for one in throttles.tolist()])
            return throttles, gimbals * self._module.gimbal_rad, turns, goals
        throttle, turn = np.divmod(actions, len(PAD_TURNS))
        runs_at = np.array([self._module.throttle.snap(one) for one in PAD_THROTTLES])
        return np.array(PAD_THROTTLES)[throttle], np.zeros(self.num_envs), np.array(PAD_TURNS)[turn], runs_at[throttle]

    def _judged(self, i: int, is_lost: bool) -> Verdict | None:
        """Return the verdict on a lander that has left the region or meets the ground; None if its gear takes that."""
        judge = self._judge
        judge.outcome = judge.touchdown = None
        judge.fuel_kg = float(self._flight.fuel[i])
        if is_lost:
            judge._end("out_of_bounds")
        else:
            judge._judge_contact(self._flight.midway(i))
        verdict: Verdict | None = self._scenario.verdict(judge)
        return verdict

    def _plant_of(self, i: int, before: Floats) -> Any:
        """Return a plant that is where a lander was before this step."""
        plant = self._scenario.plant(int(self._starts[i]), "pymunk")
        if self._factors[i]:
            plant = plant.scaled(self._factors[i])
            plant.reset(int(self._starts[i]))
        plant.restore(self._flight.state_of(before, i, plant.terrain, int(self._steps[i]) * self._parts))
        return plant

    def _measured(self) -> tuple[Floats, Floats]:
        """Return what the radar and the inertial unit of each measure."""
        x, z, attitude, vx, vz, rate = self._flight.pose()
        radar = np.stack([z - PADS_BELOW_M - self._flight.heights_m(), vz])
        return radar, np.stack([x, z, vx, vz, attitude, rate, self._flight.fuel, *self._contact])

    def _fuels(self) -> Floats:
        fuels: Floats = self._truth[1][6]
        return fuels

    def _potentials_now(self, which: Indices | None = None) -> Floats:
        radar, inertial = self._truth if which is None else (truth[:, which] for truth in self._truth)
        (altitude, vz), (x, _, vx, _, attitude, *_) = radar, inertial
        potentials: Floats = vertical_potentials(altitude, vz) - lateral_cost(x, vx, np.degrees(attitude))
        return potentials

    def _observed(self, which: Indices | None = None) -> NDArray[np.float32]:
        altitude, _ = self._radar.read(which)
        x, _, vx, vz, attitude, rate, fuel, left, right = self._inertial.read(which)
        if which is None:
            radar, inertial = self._truth
            self._radar.sample(radar)
            self._inertial.sample(inertial)
        for i in np.flatnonzero(np.abs(attitude) > np.pi).tolist():
            attitude[i] = wrap_rad(attitude[i])
        readings = np.stack([x, altitude, vx, vz, attitude, rate, left, right, fuel], axis=1).astype(np.float32)
        space = self.single_observation_space
        observed: NDArray[np.float32] = np.clip(readings, space.low, space.high)
        return observed
