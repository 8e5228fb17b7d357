"""A scenario as a gymnasium environment: its plant, the robot's own devices, the same moments as in a node.

There is no node around the agent, so an episode takes a fraction of a run's time; but what it observes is what the
robot's sensor pages hold, and what it does goes through the robot's actuators. So a policy that was trained here does
the same in a node, to the last bit (tests/learning/test_lander_envs.py).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.devices.device_loop import start_device
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.learning.copyable import CopyableEnv
from snr_sim.learning.dispersion import factors_of
from snr_sim.learning.gym import spaces
from snr_sim.learning.rendering import Frame
from snr_sim.plants.stepping import Stepper
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.scenario import Verdict
from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.student_calls import call_student

MAX_START = 2**31 - 1
OPTIONS = {"start", "factors", "dispersion"}  # of `reset`


class ScenarioEnv(CopyableEnv):
    """Base of all environments over scenarios. A subclass defines observations, actions and rewards.

    Args:
        scenario: its name or file.
        engine: the physics engine; the scenario's first if not given.
        render_mode: None or 'rgb_array'.

    `reset(seed=...)` seeds the draw of starts; each reset draws the seed of the scenario's start from it.
    `reset(options={"start": n})` begins at the start that `snr run --seed n` has. `options={"dispersion": {"thrust_n":
    0.05}}` draws the plant's thrust within 5 % of the nominal one, `{"factors": {"thrust_n": 0.95}}` says which it is;
    `plant.SCALABLE` names what can be scaled. `info` holds `start` and `time_s`, and `factors` if there are any; at
    the end also `outcome`, `success` and `reason`, as the scenario judges.

    An episode is terminated when the scenario has its verdict, and truncated at the scenario's time limit; or, if the
    verdict is given when the time is over (`ends_by_clock`), truncated then.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as gymnasium declares it
        "render_modes": ["rgb_array"],
        "render_fps": 10,  # a subclass has its own, from its steps
    }
    rate_hz: float  # of steps: the rate at which the robot reads its sensors
    begins_s: float = 0.0  # moment of the scenario at which an episode begins
    ends_by_clock = False  # whether the scenario gives its verdict when its time is over, so that it truncates

    def __init_subclass__(cls) -> None:
        """Set as many pictures a second as there are steps, so that a film takes as long as the flight."""
        super().__init_subclass__()
        if "rate_hz" in cls.__dict__:
            cls.metadata = {**cls.metadata, "render_fps": round(cls.rate_hz)}

    def __init__(self, scenario: str, engine: str | None = None, render_mode: str | None = None) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ParameterError(f"render_mode={render_mode!r}.", fix="None or 'rgb_array'.")
        self.render_mode: str | None = render_mode
        self._simulation = prepare(Request(scenario, engine=engine))
        self.plant: Plant = self._simulation.plant()
        self._nominal: Any = self.plant
        self._factors: dict[str, float] = {}
        self.limit_s: float = float(self._simulation.scenario.TIME_LIMIT_S)
        self._frame: Frame | None = None
        self._steps = -1  # none until the first reset
        self.verdict: Verdict | None = None
        self.run: Simulation = self._simulation
        self.sensors: dict[str, Any] = {}
        self.actuators: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of the draw of starts from now on.
            options: {"start": n} begins at the start of that seed of the scenario, and draws none; "dispersion" and
                "factors" as in `factors_of`.

        Raises:
            ParameterError: an option is unknown or not valid.
            UnknownNameError: the plant does not have a number that is to be scaled.
        """
        super().reset(seed=seed)
        self._note_reset(options)
        options = options or {}
        start = self._start_of(options)
        self._factors = factors_of(options, getattr(self._nominal, "SCALABLE", ()), self.np_random)
        self.plant = self._nominal.scaled(self._factors) if self._factors else self._nominal
        self.run = self._simulation.with_seed(start)
        self.plant.reset(start)
        self._open()
        self._stepper = Stepper(self.plant)
        self._steps, self.verdict = 0, None
        self.begin()
        self._stepper.advance_to(self.begins_s)
        return self._observed(), self._info()

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Act, advance by one period, and observe.

        Raises:
            ParameterError: the episode has not begun or has ended, or the action is not valid.
        """
        if self._steps < 0 or self.verdict is not None or self._is_over():
            raise ParameterError("step() outside an episode: it has not begun, or has ended.", fix="call reset().")
        action = self._action(action)
        self._note_action(action)
        self.act(action)
        self._steps += 1
        self._stepper.advance_to(self._time_s)
        observation = self._observed()
        self.verdict = call_student(self._simulation.scenario.verdict, "verdict(plant)", self.plant)
        is_over = self._is_over() if self.verdict is None else self.ends_by_clock
        info = self._info()
        if self.verdict is not None or is_over:
            info |= end_info(self.verdict, self.limit_s)
        is_ended = self.verdict is not None and not self.ends_by_clock
        return observation, float(self.reward(self.verdict)), is_ended, is_over, info

    def render(self) -> Any:
        """Return the current scene, shape (height, width, 3), dtype uint8; needs no screen and no GPU."""
        if self.render_mode is None:
            return None
        if self._steps < 0:
            raise ParameterError("render() before the first reset().", fix="call reset().")
        if self._frame is None:
            self._frame = Frame(self.plant.scene())
        return self._frame.draw(self.plant.truth())

    def close(self) -> None:
        """Close the devices."""
        for device in (*self.sensors.values(), *self.actuators.values()):
            device.close()

    # -- for subclasses -----------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Prepare for an episode; called at each reset, when the devices are open."""

    def act(self, action: Any) -> None:
        """Write to `self.actuators`."""
        raise NotImplementedError(f"{type(self).__name__} needs a method act(self, action)")

    def observe(self) -> list[float]:
        """Read `self.sensors`; values outside the bounds of the space are clipped to them."""
        raise NotImplementedError(f"{type(self).__name__} needs a method observe(self)")

    def reward(self, verdict: Verdict | None) -> float:
        """Return what the last step was worth."""
        raise NotImplementedError(f"{type(self).__name__} needs a method reward(self, verdict)")

    # -- inside -------------------------------------------------------------------------------------------------------

    def _info(self) -> dict[str, Any]:
        info = {"start": self.run.request.seed, "time_s": self._time_s}
        return {**info, "factors": dict(self._factors)} if self._factors else info

    def _start_of(self, options: dict[str, Any]) -> int:
        unknown = set(options) - OPTIONS
        if unknown:
            raise ParameterError(
                f"reset() was given the options {sorted(unknown)}.",
                fix=f'of {", ".join(sorted(OPTIONS))}, such as options={{"start": 7}}.',
            )
        start = options.get("start")
        return draw_start(self.np_random) if start is None else check_start(start)

    def _action(self, action: Any) -> Any:
        """Return an action as its space has it. Numbers of another kind are taken if they are within its bounds."""
        space: Any = self.action_space
        if type(action) is int and isinstance(space, spaces.Discrete) and 0 <= action - space.start < space.n:
            return action  # the usual case; `contains` takes five times as long
        kind = type(action).__name__
        if isinstance(space, spaces.Box):
            try:
                given = np.asarray(action)
            except ValueError:  # lists of different lengths
                given = np.array(None)
            is_numbers = given.dtype.kind in "fiu" and given.shape == space.shape
            if is_numbers and bool(np.all((given >= space.low) & (given <= space.high))):
                return given.astype(space.dtype)
            kind = f"{given.dtype} of shape {given.shape}"
            example = f"np.array({space.low.tolist()}, np.float32)"
        elif not isinstance(action, str) and space.contains(action):
            return action
        else:
            example = "a whole number from 0 on"
        raise ParameterError(
            f"{action!r} ({kind}) is not an action of {space}.", fix=f"such as {example}, or env.action_space.sample()."
        )

    def _open(self) -> None:
        self.close()
        roles = self.run.robot_file.roles(self.run.context(self.plant), [])
        factories = [factory for role in roles.values() for factory in role]
        self.sensors, self.actuators = (
            {one.key: start_device(one.open_device(), one.key) for one in factories if isinstance(one, kind)}
            for kind in (SensorLoopFactory, ActuatorLoopFactory)
        )

    def _observed(self) -> NDArray[np.float32]:
        space: Any = self.observation_space
        return np.clip(np.array(self.observe(), np.float32), space.low, space.high)

    @property
    def _time_s(self) -> float:
        return self.begins_s + self._steps / self.rate_hz

    def _is_over(self) -> bool:
        return self._time_s >= self.limit_s - 1e-9


def draw_start(rng: np.random.Generator) -> int:
    """Return the seed of the scenario that an episode begins at."""
    return int(rng.integers(1, MAX_START))


def check_start(start: Any) -> int:
    """Return the start that was requested.

    Raises:
        ParameterError: it is not a whole number.
    """
    if isinstance(start, bool) or not isinstance(start, (int, np.integer)):
        raise ParameterError(f"reset() was given the start {start!r}.", fix="a whole number, as for --seed.")
    return int(start)


def end_info(verdict: Verdict | None, limit_s: float) -> dict[str, Any]:
    """Return the entries of `info` at the end of an episode: the scenario's verdict, or the time limit."""
    if verdict is None:
        return {"outcome": "timeout", "success": False, "reason": f"longer than {limit_s:g} s"}
    return {"outcome": verdict.outcome, "success": verdict.success, "reason": verdict.reason}
