"""Many landers as one vector environment: `gymnasium.make_vec(name, num_envs)`, of `LanderVertical` and its base.

With the same seed and actions, each lander matches a single environment: the same starts, bitwise equal observations,
and the same rewards but for rounding. In flight all landers are advanced in a few array operations
(`vertical_batch.py`, `plane_flight.py`). A lander that meets the ground is handed to the plant itself, so contact and
verdict are the plant's own.
"""

from __future__ import annotations

import copy
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.dispersion import factors_of
from snr_sim.learning.gym import AutoresetMode, VectorEnv, batch_space, np_random, spaces
from snr_sim.learning.lander_envs import (
    FUEL_WEIGHT,
    LANDED,
    NOT_LANDED,
    VERTICAL_THROTTLES,
    LanderEnv,
    LanderVertical,
    vertical_potentials,
)
from snr_sim.learning.scenario_env import OPTIONS, check_start, draw_start, end_info
from snr_sim.learning.sensor_batch import SensorBatch
from snr_sim.learning.vertical_batch import Landers, step
from snr_sim.plants.lander.descent import Engine
from snr_sim.plants.lander.lander_1d import Lander1D, Lander1DState
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.signals import EngineCommand

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.int64]


class LanderVectorEnv(VectorEnv[Any, Any, Any]):
    """Base of both vector environments. A subclass defines how landers start, move and are measured.

    Args:
        single: one of the environments: its scenario, spaces and devices are those of all.
        num_envs: how many.
        max_episode_steps: truncates after so many; None: at the scenario's time limit.
        autoreset_mode: NEXT_STEP: the step after the last one of an episode begins the next, whatever the action is,
            and is worth 0. SAME_STEP: the last step does, and `info` has "final_obs" and "final_info".

    `reset(seed=n)` seeds the first with n, the second with n + 1, and so on; `options={"start": ...}` begins at the
    start of a seed of the scenario, or with a list of them at one for each. "dispersion" and "factors" are those of a
    single environment, drawn for each lander; as there, they end with the episode: autoreset begins a nominal one.

    Raises:
        ParameterError: an argument is out of range.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 - as gymnasium has it

    closed: bool = True  # until it is made: gymnasium before 1.3 closes also what could not be

    def __init__(
        self, single: LanderEnv, num_envs: int, max_episode_steps: int | None, autoreset_mode: AutoresetMode | str
    ) -> None:
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise ParameterError(f"num_envs={num_envs!r}.", fix="a whole number, 1 or more.")
        modes = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
        mode = next((one for one in modes if autoreset_mode in (one, one.value)), None)
        if mode is None:
            raise ParameterError(
                f"autoreset_mode={autoreset_mode!r}.", fix=f"{' or '.join(repr(one.value) for one in modes)}."
            )
        self.metadata = {**self.metadata, "autoreset_mode": mode, "render_fps": round(single.rate_hz)}
        self.num_envs: int = num_envs
        self.single_observation_space: Any = single.observation_space
        self.single_action_space: Any = single.action_space
        self.observation_space: spaces.Space[Any] = batch_space(single.observation_space, num_envs)
        self.action_space: spaces.Space[Any] = batch_space(single.action_space, num_envs)
        self._single = single
        self.closed = False
        self._scenario = single.run.scenario
        self._parameters: Any = single.run.with_seed(0).robot.parameters
        self._rate_hz, self._step_s = single.rate_hz, 1.0 / single.rate_hz
        self._limit_steps = round(single.limit_s * single.rate_hz)
        self._max_steps = min(self._limit_steps, max_episode_steps or self._limit_steps)
        self._is_same_step = mode is AutoresetMode.SAME_STEP
        self._all_indices = np.arange(num_envs)
        self._all_true = np.ones(num_envs, bool)
        self._generators: list[np.random.Generator] = []
        self._starts, self._steps = np.zeros(num_envs, np.int64), np.zeros(num_envs, np.int64)
        self._tanks_kg, self._fuels_kg, self._potentials = np.ones(num_envs), np.zeros(num_envs), np.zeros(num_envs)
        self._nominal: Any = single.plant
        self._bodies: list[Any] = [self._nominal] * num_envs  # what each flies, as the plant that it equals
        self._factors: list[dict[str, float]] = [{} for _ in range(num_envs)]
        self._factor_infos: dict[str, Any] = {}
        self._ended: Bools | None = None  # before the first reset

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode of each.

        Args:
            seed: of the first, or one for each.
            options: {"start": n} or {"start": [n, ...]}; "dispersion" and "factors" as in `factors_of`.

        Raises:
            ParameterError: an option is unknown or not valid, or their number is not that of the landers.
            UnknownNameError: the plant does not have a number that is to be scaled.
        """
        count = self.num_envs
        seeds = [seed + i for i in range(count)] if isinstance(seed, int) else list(seed or [None] * count)
        if len(seeds) != count:
            raise ParameterError(f"reset() was given {len(seeds)} seeds for {count} landers.", fix="one for each.")
        options = options or {}
        if set(options) - OPTIONS:
            raise ParameterError(f"reset() was given the options {sorted(options)}.", fix='options={"start": 7}.')
        given = options.get("start")
        given = [given] * count if given is None or not isinstance(given, (list, tuple, np.ndarray)) else list(given)
        if len(given) != count:
            raise ParameterError(f"reset() was given {len(given)} starts for {count} landers.", fix="one for each.")
        checked = [None if one is None else check_start(one) for one in given]
        first = not self._generators
        old = [None] * count if first else self._generators
        self._generators = [
            np_random(one)[0] if one is not None or before is None else before
            for one, before in zip(seeds, old, strict=True)
        ]
        factors_of(options, self._nominal.SCALABLE, np.random.default_rng(0))  # raises before anything begins
        self._begin(self._all_indices, checked, options)
        self._ended = np.zeros(count, bool)
        return self._observed(), self._infos()

    def step(self, actions: Any) -> tuple[NDArray[np.float32], Floats, Bools, Bools, dict[str, Any]]:
        """Act, advance by one period, and observe.

        Raises:
            ParameterError: there was no reset, or the actions are not valid.
        """
        again = self._ended
        if again is None:
            raise ParameterError("step() before the first reset().", fix="call reset().")
        verdicts = self._advance(self._checked(actions), ~again)
        self._steps += 1
        terminated, landed = np.zeros(self.num_envs, bool), np.zeros(self.num_envs, bool)
        for i, verdict in verdicts.items():
            terminated[i], landed[i] = True, verdict.success
        truncated = ~terminated & (self._steps >= self._max_steps)
        fuels, potentials = self._fuels(), self._potentials_now()
        rewards = np.where(terminated, np.where(landed, LANDED, NOT_LANDED), potentials) - self._potentials
        rewards -= FUEL_WEIGHT * (self._fuels_kg - fuels) / self._tanks_kg
        self._fuels_kg, self._potentials = fuels, potentials
        ended = terminated | truncated
        begins = np.flatnonzero(again)
        if len(begins):
            self._begin(begins, [None] * len(begins))
            rewards[begins], terminated[begins], truncated[begins], ended[begins] = 0.0, False, False, False
        observations, infos = self._observed(), {}
        ends = np.flatnonzero(ended)
        if not self._is_same_step:
            infos = self._infos()
        for i in ends.tolist():
            end = self._end(i, verdicts.get(i))
            if self._is_same_step:
                info = {"start": int(self._starts[i]), "time_s": float(self._steps[i] / self._rate_hz), **end}
                info |= {"factors": dict(self._factors[i])} if self._factors[i] else {}
                end = {"final_obs": observations[i].copy(), "final_info": info}
            infos = self._add_info(infos, end, i)
        if self._is_same_step:
            if len(ends):
                self._begin(ends, [None] * len(ends))
                observations[ends] = self._observed(ends)
                ended = np.zeros(self.num_envs, bool)
            infos = {**self._infos(), **infos}
        self._ended = ended
        return observations, rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Close the plant's devices."""
        self._single.close()

    # -- for subclasses -----------------------------------------------------------------------------------------------

    @abstractmethod
    def _put(self, which: Indices, starts: Sequence[int]) -> None:
        """Put some landers at the starts of seeds, with the numbers of their bodies, and begin their sensors."""

    @abstractmethod
    def _advance(self, actions: Any, is_flying: Bools) -> dict[int, Verdict]:
        """Move all on by one period; return the verdict of each that flew and ended. The others do not matter."""

    @abstractmethod
    def _fuels(self) -> Floats:
        """Return the propellant of each [kg]."""

    @abstractmethod
    def _potentials_now(self, which: Indices | None = None) -> Floats:
        """Return how well placed some are, or all, as `LanderEnv.potential`."""

    @abstractmethod
    def _observed(self, which: Indices | None = None) -> NDArray[np.float32]:
        """Return the observations of some or all landers, then sample all sensors again. Shape (their number, ...)."""

    # -- inside -------------------------------------------------------------------------------------------------------

    def _begin(self, which: Indices, given: Sequence[int | None], options: Mapping[str, Any] | None = None) -> None:
        nominal, starts, is_changed = self._nominal, [], False
        for i, start in zip(which.tolist(), given, strict=True):
            starts.append(draw_start(self._generators[i]) if start is None else start)
            if options or self._factors[i]:
                self._factors[i] = factors_of(options or {}, nominal.SCALABLE, self._generators[i])
                self._bodies[i] = nominal.scaled(self._factors[i]) if self._factors[i] else nominal
                is_changed = True
        if is_changed:
            self._factor_infos = {}
            for i, factors in enumerate(self._factors):
                if factors:
                    self._factor_infos = self._add_info(self._factor_infos, {"factors": factors}, i)
        self._starts[which], self._steps[which] = starts, 0
        self._put(which, starts)
        self._tanks_kg[which] = self._fuels_kg[which] = self._fuels()[which]
        self._potentials[which] = self._potentials_now(which)

    def _checked(self, actions: Any) -> Any:
        """Return actions as their space has them."""
        given, space = np.asarray(actions), self.action_space
        single = self.single_action_space
        is_whole = hasattr(single, "n")
        if given.shape == space.shape and given.dtype.kind in ("iu" if is_whole else "fiu"):
            low, high = (0, single.n - 1) if is_whole else (single.low, single.high)
            if bool(((given >= low) & (given <= high)).all()):
                return given
        raise ParameterError(
            f"Actions of shape {given.shape}, {given.dtype}, are not in {space}.",
            fix=f"one for each of {self.num_envs} landers, as envs.action_space.sample().",
        )

    def _end(self, i: int, verdict: Verdict | None) -> dict[str, Any]:
        is_late = verdict is None and self._steps[i] >= self._limit_steps
        return end_info(verdict, self._single.limit_s) if verdict is not None or is_late else {}

    def _infos(self) -> dict[str, Any]:
        mask = self._all_true
        times_s = self._steps / self._rate_hz
        infos = {"start": self._starts.copy(), "_start": mask.copy(), "time_s": times_s, "_time_s": mask.copy()}
        return {**infos, **copy.deepcopy(self._factor_infos)}


class LanderVerticalVector(LanderVectorEnv):
    """Many of `LanderVertical`; its arguments, and those of `LanderVectorEnv`."""

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        is_continuous: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    ) -> None:
        super().__init__(LanderVertical(is_continuous), num_envs, max_episode_steps, autoreset_mode)
        self._plant = cast("Lander1D", self._single.plant)
        self._engines = np.ones((3, num_envs))  # rows as in Engine
        self._throttles = None if is_continuous else np.array(VERTICAL_THROTTLES)
        self._landers = np.ones((4, num_envs))
        fields = ("altitude_m", "velocity_mps")
        self._radar = SensorBatch("radar", fields, self._parameters.radar.errors, num_envs)

    def _put(self, which: Indices, starts: Sequence[int]) -> None:
        bodies = [self._bodies[i] for i in which.tolist()]
        self._engines[:, which] = np.array([(one.thrust_n, one.exhaust_mps, one.gravity_mps2) for one in bodies]).T
        begun = [one.start_of(start) for one, start in zip(bodies, starts, strict=True)]
        rows = np.array([(one.height_m, one.velocity_mps, one.mass_kg, one.fuel_kg) for one in begun]).T
        self._landers[:, which] = rows
        self._radar.begin(which, starts, rows[:2])

    def _advance(self, actions: Any, is_flying: Bools) -> dict[int, Verdict]:
        throttles = actions[:, 0].astype(np.float64) if self._throttles is None else self._throttles[actions]
        before = self._landers
        after, _, _ = step(Landers(*before), throttles, Engine(*self._engines), self._step_s)
        self._landers = np.stack(after)
        height, velocity, gravity = before[0], before[1], self._engines[2]
        # One that reverses within the step may have touched in between.
        dips = (velocity < 0.0) & (after.velocity_mps > 0.0)
        dips &= height + (velocity - gravity * self._step_s) * self._step_s <= 0.0
        met = is_flying & ((after.height_m <= 0.0) | dips | (after.height_m > self._plant.ceiling_m))
        verdicts = {}
        for i in np.flatnonzero(met).tolist():
            plant = self._bodies[i]
            verdict = self._take_over(plant, before[:, i], float(throttles[i]))
            self._landers[:, i] = plant.height_m, plant.velocity_mps, plant.mass_kg, plant.fuel_kg
            if verdict is not None:
                verdicts[i] = verdict
                if plant.time_s < self._step_s:
                    self._radar.stop(i)
        return verdicts

    def _take_over(self, plant: Lander1D, lander: Floats, throttle: float) -> Verdict | None:
        """Let the plant fly a step of one lander; return its verdict."""
        height_m, velocity_mps, mass_kg, fuel_kg = lander.tolist()
        plant.restore(Lander1DState(0.0, height_m, velocity_mps, mass_kg, fuel_kg, throttle, None, None))
        plant.write("engine", EngineCommand(throttle))
        plant.step(self._step_s)
        verdict: Verdict | None = self._scenario.verdict(plant)
        return verdict

    def _fuels(self) -> Floats:
        fuels: Floats = self._landers[3]
        return fuels

    def _potentials_now(self, which: Indices | None = None) -> Floats:
        height, velocity, *_ = self._landers if which is None else self._landers[:, which]
        return vertical_potentials(height, velocity)

    def _observed(self, which: Indices | None = None) -> NDArray[np.float32]:
        readings = self._radar.read(which).T.astype(np.float32)
        if which is None:
            self._radar.sample(self._landers[:2].copy())
        space = self.single_observation_space
        observed: NDArray[np.float32] = np.clip(readings, space.low, space.high)
        return observed
