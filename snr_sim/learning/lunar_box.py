"""An environment that is stepped, observed and rewarded as gymnasium's LunarLander-v3 is, without Box2D."""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.learning.copyable import CopyableEnv
from snr_sim.learning.gym import box, spaces
from snr_sim.learning.lunar_box_picture import frame_of
from snr_sim.learning.lunar_box_world import CHUNKS, HEIGHT, LEG_DOWN, PAD_Y, START_ARM, STEPS_HZ, WIDTH, LunarBoxWorld
from snr_sim.prelude.errors import ParameterError

POWERS = {0: (0.0, 0.0), 1: (0.0, -1.0), 2: (1.0, 0.0), 3: (0.0, 1.0)}  # of the main and the orientation engines
MAX_PUSH = 1000.0  # of the impulse at the start, in each direction
MAIN_COST, SIDE_COST = 0.30, 0.03  # of an engine at full power for a step
LANDED, CRASHED = 100.0, -100.0  # in place of the last step's reward
LIMITS = np.array([2.5, 2.5, 10.0, 10.0, 2.0 * math.pi, 10.0, 1.0, 1.0], np.float32)


class LunarLanderBox(CopyableEnv):
    """LunarLander-v3's definitions under pymunk: code written for it runs when its id is changed. 50 steps a second.

    Observation, Box(8), float32, dimensionless:
        0, 1  x from the pad, y over a lander that rests on it: 1 is half the width, half the height of the world
        2, 3  their speeds: 1 is 7.5 times the former and 3.75 times the latter in a second
        4     angle [rad], positive when the nose goes to the left
        5     angular velocity, times 0.4 s
        6, 7  whether the left and the right leg touch the ground
    Angle and speeds are clipped to their bounds; the original does not clip them.

    Action, Discrete(4): nothing, left orientation engine, main engine, right orientation engine. With
    `continuous=True` Box(2): the main engine's throttle (above 0: 50 to 100 %), and the orientation engines' (below
    -0.5 left, above 0.5 right); values beyond -1 and 1 are clipped.

    Reward: how much a potential has grown, -100 times the distance from the pad, the speed and the tilt, and 10 for
    each leg on the ground; less 0.3 for the main engine and 0.03 for an orientation engine at full power. In place of
    all that, -100 in the step in which the hull touches the ground or the lander leaves the world sideways, and +100
    when it has come to rest. Both terminate. `make` truncates after 1000 steps, as for the original.

    Ground, first push and the engines' scatter of a seed are the original's, number by number; so a flight is the
    same until something touches, to about 0.002 rad of tilt and 0.01 at worst. On the ground the original bounces more.
    The policy of its documentation returns 283 in both (continuous). Discrete, it returns 247 here and 243 there over
    1000 seeds, each with a standard error of 3; 92.5 and 90.6 % of them return 200 or more. Seed by seed, over 200, it
    returns 8 more here, 1.2 standard errors of the mean difference.

    Args:
        render_mode: None or 'rgb_array'.
        continuous: which actions.
        gravity: more than -12, less than 0.
        enable_wind, wind_power, turbulence_power: as the original has them.

    Raises:
        ParameterError: an argument is out of range.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": STEPS_HZ}  # noqa: RUF012 - as gymnasium declares it

    def __init__(
        self,
        render_mode: str | None = None,
        continuous: bool = False,
        gravity: float = -10.0,
        enable_wind: bool = False,
        wind_power: float = 15.0,
        turbulence_power: float = 1.5,
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ParameterError(f"render_mode={render_mode!r}.", fix="None or 'rgb_array'.")
        if not -12.0 < gravity < 0.0:
            raise ParameterError(f"gravity={gravity!r}.", fix="more than -12 and less than 0, such as -10.")
        for name, power, max_power in (("wind_power", wind_power, 20.0), ("turbulence_power", turbulence_power, 2.0)):
            if not 0.0 <= power <= max_power:
                raise ParameterError(f"{name}={power!r}.", fix=f"0 to {max_power:g}.")
        self.render_mode: str | None = render_mode
        self.continuous: bool = continuous
        self._gravity = gravity
        self._wind = (wind_power, turbulence_power) if enable_wind else None
        self.observation_space: spaces.Space[Any] = box([*-LIMITS[:6], 0.0, 0.0], LIMITS.tolist())
        self.action_space: spaces.Space[Any] = box([-1.0, -1.0], [1.0, 1.0]) if continuous else spaces.Discrete(4)
        self.world: LunarBoxWorld | None = None
        self._is_over = True
        self._power = (0.0, 0.0)  # of the main engine and the orientation engines, in the last step

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode: a new world, and a first step in which no engine is on.

        Raises:
            ParameterError: there are options; it takes none.
        """
        super().reset(seed=seed)
        if options:
            raise ParameterError(f"reset() was given the options {sorted(options)}.", fix="it takes none.")
        self._note_reset(options)
        self._draw = self.np_random.random
        draw = self.np_random.uniform
        heights = draw(0.0, HEIGHT / 2.0, size=CHUNKS + 1).tolist()
        heights[CHUNKS // 2 - 2 : CHUNKS // 2 + 3] = 5 * [PAD_Y]
        around = [0.33 * (heights[i - 1] + heights[i] + heights[i + 1]) for i in range(CHUNKS)]
        if self.world is None:
            self.world = LunarBoxWorld(self._gravity)
        self.world.begin(around)
        self.world.kick((draw(-MAX_PUSH, MAX_PUSH), draw(-MAX_PUSH, MAX_PUSH)), arm=START_ARM)
        if self._wind is not None:
            self._moments = [int(self.np_random.integers(-9999, 9999)) for _ in range(2)]
        self._is_over, self._power = False, (0.0, 0.0)
        self._move(0.0, 0.0)
        state = self._state()
        self._potential = potential(state)
        return self._observation(state), {}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Act, advance by 0.02 s, and observe.

        Raises:
            ParameterError: the episode has not begun or has ended, or the action is not valid.
        """
        if self._is_over or self.world is None:
            raise ParameterError("step() outside an episode: it has not begun, or has ended.", fix="call reset().")
        main, side = self._power = self._powers(action)
        self._note_action(np.array(action))
        self._move(main, side)
        state = self._state()
        here = potential(state)
        reward = here - self._potential - MAIN_COST * main - SIDE_COST * abs(side)
        self._potential = here
        if self.world.is_asleep:
            self._is_over, reward = True, LANDED
        elif self.world.is_crashed or abs(state[0]) >= 1.0:
            self._is_over, reward = True, CRASHED
        return self._observation(state), reward, self._is_over, False, {}

    def render(self) -> Any:
        """Return the current scene, shape (height, width, 3), dtype uint8; needs no screen and no GPU."""
        if self.render_mode is None:
            return None
        if self.world is None:
            raise ParameterError("render() before the first reset().", fix="call reset().")
        return frame_of(self.world, self._power)

    def _powers(self, given: Any) -> tuple[float, float]:
        """Return power of the main engine, 0 to 1, and of the orientation engines, negative for the left one."""
        if not self.continuous:
            try:
                return POWERS[operator.index(given)]  # takes what Discrete.contains() takes, in a tenth of its time
            except (TypeError, KeyError):
                raise ParameterError(
                    f"{given!r} is not an action of {self.action_space}.", fix="0, 1, 2 or 3."
                ) from None
        try:
            throttle, turn = map(float, given)
        except (TypeError, ValueError):
            throttle = turn = math.nan
        if not (math.isfinite(throttle) and math.isfinite(turn)):
            raise ParameterError(f"{given!r} is not an action of {self.action_space}.", fix="two numbers from -1 to 1.")
        main = 0.5 + 0.5 * min(throttle, 1.0) if throttle > 0.0 else 0.0
        return main, math.copysign(min(abs(turn), 1.0), turn) if abs(turn) > 0.5 else 0.0

    def _move(self, main: float, side: float) -> None:
        """Have the wind blow and the engines push for a step, and make it."""
        world, draw = self.world, self._draw
        assert world is not None
        if self._wind is not None and not any(world.contacts):
            force, torque = (power * gust(at) for power, at in zip(self._wind, self._moments, strict=True))
            world.kick((force, 0.0), torque)
            self._moments = [at + 1 for at in self._moments]
        spread = 2.0 * draw() - 1.0, 2.0 * draw() - 1.0
        if main:
            world.fire_main(main, spread)
        if side:
            world.fire_side(abs(side), math.copysign(1.0, side), spread)
        world.step()

    def _state(self) -> tuple[float, ...]:
        world = self.world
        assert world is not None
        left, right = world.contacts
        return (
            (world.x - WIDTH / 2.0) / (WIDTH / 2.0),
            (world.y - PAD_Y - LEG_DOWN) / (HEIGHT / 2.0),
            world.vx * (WIDTH / 2.0) / STEPS_HZ,
            world.vy * (HEIGHT / 2.0) / STEPS_HZ,
            world.angle_rad,
            20.0 * world.turn_radps / STEPS_HZ,
            float(left),
            float(right),
        )

    @staticmethod
    def _observation(state: tuple[float, ...]) -> NDArray[np.float32]:
        seen = np.array(state, np.float32)
        x, y, vx, vy, angle, turn, _, _ = map(abs, state)
        if x > 2.5 or y > 2.5 or vx > 10.0 or vy > 10.0 or angle > 6.28 or turn > 10.0:
            np.clip(seen, -LIMITS, LIMITS, out=seen)
        return seen


def potential(state: tuple[float, ...]) -> float:
    """Return the potential of a lander: 20 at rest on the pad, less everywhere else.

    >>> potential((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0)), potential((0.3, 0.4, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0))
    (20.0, -60.0)
    """
    x, y, vx, vy, angle, _, left, right = state
    return -100.0 * (math.hypot(x, y) + math.hypot(vx, vy) + abs(angle)) + 10.0 * (left + right)


def gust(moment: int) -> float:
    """Return the wind at a moment, -1 to 1; it is not periodic."""
    return math.tanh(math.sin(0.02 * moment) + math.sin(math.pi * 0.01 * moment))
