"""A lunar module in flight, independent of the physics engine: propellant, throttle, judge and sensors.

    command --> write --> burn --> force on the body    (lander_2d.py: pymunk, two legs; lander_3d.py: MuJoCo, four)
                                        |
    reading <-- read <-- pose in the x-z plane <--'

This module contains what both engines share: they differ only in how the body moves.

Both compute a step as a kick (velocity += what engine, jets, legs and weight give in a step), then a drift (position
+= velocity * step). This is the leapfrog scheme if the kick is that of the middle of the step: so the position that an
engine of physics holds is half a step ahead of its velocity. `reset` puts it there, and `read` subtracts the half step
again. It costs nothing. A flight under constant force is exact (either engine alone ends g t dt / 2 too high or too
low), a command acts from the moment at which it is written, errors shrink with the step squared, and a bouncing leg
gains no energy.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, Self

from snr_sim.plants.lander.gear import Touchdown
from snr_sim.plants.lander.legs import FEET_M, BodyPose, Grip, Kick
from snr_sim.plants.lander.module import LunarModule, PlaneStart
from snr_sim.plants.lander.module_shapes import HULL_M, NOZZLE_BELOW_M, PADS_BELOW_M
from snr_sim.plants.lander.terrain import HALF_WIDTH_M, ROOF_REACH_M, Terrain
from snr_sim.plants.parameter_limits import LIMITS, check_number, check_valid
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError, suggest
from snr_sim.prelude.signals import EngineCommand, InertialReading, RadarReading

# Halving it moves a touchdown by less than 1 cm/s and, after it, the module by a few millimetres (measured in
# tests/plants/test_lander_2d.py). Four times as long would still be stable: the stiffest motion, a foot gripping
# sideways, has 25 steps in each radian. Shorter steps only cost time.
STEP_S = 0.005
THROTTLE_TOLERANCE = 1e-5  # a throttle this near to the command has reached it
STILL_MPS, STILL_RADPS, SETTLE_S = 0.05, 0.01, 0.5  # slower than this for so long, on both sides' feet: at rest
MAX_INITIAL_PENETRATION_M = 0.01  # depth in the ground at which a run may begin: legs give way
CEILING_M = 20_000.0
EDGE_M = HALF_WIDTH_M - ROOF_REACH_M


class LanderState(NamedTuple):
    """Full state: that of the engine of physics (positions half a step ahead), and ours. Defaults: a start."""

    body: Any  # in the plane a `BodyPose`, in space all that MuJoCo has
    mass_kg: float
    fuel_kg: float
    terrain: Terrain
    steps: int = 0
    throttle: float = 0.0
    gimbal_rad: float = 0.0
    command: tuple[float, float, float] = (0.0, 0.0, 0.0)  # throttle, gimbal, couple of the jets [N m]
    still_steps: int = 0
    touchdown: Touchdown | None = None
    outcome: str | None = None
    attitude_rad: float = 0.0  # in space, with full turns
    has_hull_touched: bool = False  # in the plane, as the next two
    grips_m: tuple[Grip, Grip] = (None, None)
    far_steps: int = 0


IN_BOTH = LanderState._fields[1:11]  # attributes of both landers


class Lander(ABC):
    """Base of the landers of both engines. With `_advance` and the other hooks it implements `Plant`.

    Args:
        module: its numbers.
        start_of: returns the start and the ground that belong to a seed.
        seed: of the first run.
        step_s: of integration; see `STEP_S`.

    Raises:
        ParameterError: a number is out of range, or a start is below ground.

    Attributes:
        touchdown: the first contact, once there was one.
        outcome: 'landed', 'crashed', 'out_of_fuel' (crashed with an empty tank), 'tilted' (at rest, and not upright
            enough) or 'out_of_bounds' (left the region), once over. From then on the state does not change.
    """

    inputs: tuple[str, ...] = ("engine",)
    outputs: tuple[str, ...] = ("radar", "inertial")
    # For `scaled`: of the module, of its legs, and of what it weighs.
    SCALABLE_MODULE = (
        "thrust_n", "exhaust_mps", "throttle_lag_s", "gimbal_rate_radps", "jets_nm", "gyration_m", "gravity_mps2",
    )  # fmt: skip
    SCALABLE_LEG = ("spring_npm", "damper_nspm", "friction")
    SCALABLE = (*SCALABLE_MODULE, *SCALABLE_LEG, "dry_mass_kg")

    engine: str
    mass_kg: float
    fuel_kg: float
    terrain: Terrain
    steps: int
    throttle: float
    gimbal_rad: float
    command: tuple[float, float, float]
    still_steps: int
    touchdown: Touchdown | None
    outcome: str | None

    def __init__(
        self,
        module: LunarModule,
        start_of: Callable[[int], tuple[PlaneStart, Terrain]],
        seed: int = 0,
        step_s: float = STEP_S,
    ) -> None:
        check_number("The lander's step_s", step_s, LIMITS["flight_step_s"])
        self.module: LunarModule = module
        self.start_of: Callable[[int], tuple[PlaneStart, Terrain]] = start_of
        self.step_s: float = step_s
        lag_s = module.throttle_lag_s
        self._lag_left, self._lag_steps = (math.exp(-step_s / lag_s), lag_s / step_s) if lag_s > 0.0 else (0.0, 0.0)
        self._gimbal_step = module.gimbal_rate_radps * step_s
        self._flow_step = module.thrust_n / module.exhaust_mps * step_s  # propellant of one step at full throttle
        self._build(self._start(seed)[1])
        self.reset(seed)

    def _start(self, seed: int) -> tuple[PlaneStart, Terrain]:
        """Return the start and the ground of a seed; raise a ParameterError if the module is in the ground."""
        given = self.start_of(seed)
        is_start = isinstance(given, tuple) and tuple(map(type, given)) == (PlaneStart, Terrain)
        check_valid(is_start, f"The start of seed {seed}", given, "return a PlaneStart and a Terrain.")
        start, terrain = given
        (x, z), cos, sin = start.position_m, math.cos(start.attitude_rad), math.sin(start.attitude_rad)
        corners = [(x + cos * a - sin * b, z + sin * a + cos * b) for a, b in (*FEET_M, *HULL_M)]
        deep_m = max(terrain.ground(at_x)[0] - at_z for at_x, at_z in corners)
        if deep_m > MAX_INITIAL_PENETRATION_M:
            raise ParameterError(
                f"The start of seed {seed} is at {start.position_m} m, and there the module is {deep_m:.3g} m under "
                "ground.",
                fix=f"begin higher: the ground is at {terrain.ground(x)[0]:.3g} m, the pads {PADS_BELOW_M} m below the "
                "centre of mass.",
            )
        return start, terrain

    def _flight_state(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in IN_BOTH}

    def _restore_flight(self, state: LanderState) -> None:
        for name in IN_BOTH:
            setattr(self, name, getattr(state, name))

    def scaled(self, factors: Mapping[str, float]) -> Self:
        """Return a module of which some numbers, those in `SCALABLE`, are multiplied; its propellant is the same."""

        def times(numbers: Any, names: tuple[str, ...]) -> dict[str, Any]:
            return {name: getattr(numbers, name) * factors[name] for name in names if name in factors}

        dry = factors.get("dry_mass_kg", 1.0)

        def start_of(seed: int) -> tuple[PlaneStart, Terrain]:
            start, terrain = self.start_of(seed)
            return replace(start, mass_kg=start.fuel_kg + dry * (start.mass_kg - start.fuel_kg)), terrain

        leg = replace(self.module.leg, **times(self.module.leg, self.SCALABLE_LEG))
        module = replace(self.module, leg=leg, **times(self.module, self.SCALABLE_MODULE))
        return type(self)(module, start_of, step_s=self.step_s)

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset: a count, so that nothing adds up."""
        return self.steps * self.step_s

    # -- what an engine of physics brings -----------------------------------------------------------------------------

    @abstractmethod
    def _build(self, terrain: Terrain) -> None:
        """Build the world over a ground."""

    @abstractmethod
    def reset(self, seed: int) -> None:
        """Put the module at the start that belongs to this seed, over its ground."""

    @abstractmethod
    def _advance(self) -> None:
        """Advance by one step."""

    @abstractmethod
    def _read_pose(self) -> BodyPose:
        """Return position and velocity in the x-z plane, at the same moment."""

    @abstractmethod
    def _contact(self) -> list[bool]:
        """Return whether feet touch: [left, right]."""

    @abstractmethod
    def _tilt_rad(self) -> float:
        """Return the angle between the module's upward axis and the vertical, 0 to pi."""

    @abstractmethod
    def _has_hull_touched(self) -> bool:
        """Return whether the hull has met the ground."""

    @abstractmethod
    def _stand_still(self) -> None:
        """Take all motion from the body."""

    # -- moving -------------------------------------------------------------------------------------------------------

    def write(self, name: str, command: EngineCommand) -> None:
        """Set throttle, gimbal and jets, clamped to what the module can do."""
        if name != "engine":
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        throttle, gimbal, jets = command.throttle, command.gimbal_rad, command.attitude
        if not math.isfinite(throttle + gimbal + jets):
            raise PlantError(
                f"At {self.time_s:g} s the engine command is not finite: {command}.", fix="send finite numbers."
            )
        goal, limit = self.module.throttle.snap(min(1.0, max(0.0, throttle))), self.module.gimbal_rad
        self.command = goal, min(limit, max(-limit, gimbal)), min(1.0, max(-1.0, jets)) * self.module.jets_nm

    def step(self, dt_s: float) -> None:
        """Advance by one step."""
        if dt_s != self.step_s and not abs(dt_s - self.step_s) <= 1e-9:  # also NaN
            raise ParameterError(
                f"This plant moves in steps of {self.step_s} s, not {dt_s} s.", fix="use plant.step_s."
            )
        self.steps += 1
        if self.outcome is None:
            self._advance()

    def _burn(self) -> Kick:
        """Let throttle and nozzle follow their commands for a step; return what engine and jets give the module in it.

        That is the change of velocity to its side and upwards, in its own frame, and twist.
        """
        mean = throttle = self.throttle
        goal, gimbal_goal, jets = self.command
        if throttle != goal:
            self.throttle = goal + (throttle - goal) * self._lag_left
            if abs(self.throttle - goal) < THROTTLE_TOLERANCE:
                self.throttle = goal
            # Of a lag of first order, exactly: where it was, where it is, and how long that takes.
            mean = goal + (throttle - self.throttle) * self._lag_steps
        gimbal = self.gimbal_rad
        if gimbal != gimbal_goal:
            max_turn = self._gimbal_step
            turned = min(max_turn, max(-max_turn, gimbal_goal - gimbal))
            self.gimbal_rad = gimbal + turned
            # Turning at its rate, and then at rest where it was to turn to.
            gimbal = self.gimbal_rad - (0.5 * turned * abs(turned) / max_turn if turned else 0.0)
        burned = mean * self._flow_step
        if burned >= self.fuel_kg:
            burned = self.fuel_kg
            self.throttle, self.command = 0.0, (0.0, gimbal_goal, jets)
        self.fuel_kg -= burned
        self.mass_kg -= burned
        # By the mean mass of the step: so any burn agrees with the rocket equation, to the step squared.
        mass_kg = self.mass_kg + 0.5 * burned
        push, twist = burned * self.module.exhaust_mps / mass_kg, jets * self.step_s / mass_kg
        side = push * math.sin(gimbal)
        return side, push * math.cos(gimbal), twist + NOZZLE_BELOW_M * side

    def _judge_contact(self, pose: BodyPose) -> None:
        """Write down the first contact, as it was before legs pushed, and end the flight if they cannot take it."""
        self.touchdown = Touchdown(
            vertical_mps=-pose.vz_mps,
            lateral_mps=pose.vx_mps,
            attitude_deg=math.degrees(pose.attitude_rad),
            rate_degps=math.degrees(pose.rate_radps),
        )
        outcome = self.module.gear.outcome(self.touchdown, self.fuel_kg)
        if outcome != "landed":
            self._end(outcome)

    def _settle(self, is_still: bool) -> None:
        """Count the time at rest, and end the flight when it is long enough."""
        self.still_steps = self.still_steps + 1 if is_still else 0
        if self.outcome is None and self.touchdown is not None and self.still_steps * self.step_s >= SETTLE_S:
            self._end(self.module.gear.outcome(self.touchdown, self.fuel_kg, self._tilt_rad()))

    def _end(self, outcome: str) -> None:
        """Stop everything where it is."""
        self.outcome = outcome
        self._stand_still()
        self.throttle, self.command = 0.0, (0.0, self.command[1], 0.0)

    @property
    def reason(self) -> str:
        """Description of what failed; empty if nothing did."""
        if self.outcome == "out_of_bounds":
            return "it left the region that is simulated"
        rest_rad = self._tilt_rad() if self.outcome == "tilted" else 0.0
        exceeded = self.module.gear.exceeded_limits(self.touchdown, rest_rad) if self.touchdown is not None else []
        if self.outcome == "crashed" and not exceeded:  # the gear took the first contact, but not what followed
            exceeded = ["the hull met the ground" if self._has_hull_touched() else "it tipped over on its legs"]
        return "; ".join(exceeded)

    # -- being measured -----------------------------------------------------------------------------------------------

    def read(self, name: str) -> RadarReading | InertialReading:
        """Return the reading of a sensor without errors."""
        x, z, attitude, vx, vz, rate = self._read_pose()
        if name == "inertial":
            return InertialReading([x, z], [vx, vz], attitude, rate, self.fuel_kg, self._contact(), self.time_s)
        if name == "radar":
            return RadarReading(z - PADS_BELOW_M - self.terrain.ground(x)[0], vz, self.time_s)
        raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.outputs))

    def _true_values(self, pose: BodyPose) -> dict[str, Any]:
        return {
            "altitude_m": pose.z_m - PADS_BELOW_M - self.terrain.ground(pose.x_m)[0],
            "vertical_mps": pose.vz_mps,
            "lateral_mps": pose.vx_mps,
            "throttle": self.throttle,
            "fuel_kg": self.fuel_kg,
            "attitude_deg": math.degrees(pose.attitude_rad),
        }
