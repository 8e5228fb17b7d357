"""A lunar module that moves up and down only, exact for any step.

Between two commands the throttle is constant, and constant thrust has a closed form (`plants/lander/descent.py`). So a
step takes as long as anyone likes, costs the same, and ends where the physics ends: also when the tank runs dry or
the pads touch the ground on the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

from snr_sim.plants.lander.descent import Engine, Motion, find_root, propagate
from snr_sim.plants.lander.gear import APOLLO_GEAR, GearLimits, Touchdown
from snr_sim.plants.lander.module import check_tank
from snr_sim.plants.lander.module_shapes import NOZZLE_BELOW_M, PADS_BELOW_M, module_shapes
from snr_sim.plants.lander.terrain import FLAT
from snr_sim.plants.lander.terrain_shapes import terrain_shapes
from snr_sim.plants.parameter_limits import LIMITS, Record, check_number, check_valid
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError, suggest
from snr_sim.prelude.signals import EngineCommand, RadarReading


@dataclass(frozen=True)
class VerticalStart(Record, who="The start's "):
    """Where a run begins.

    Args:
        height_m: of the pads over the ground.
        velocity_mps: positive up.
        mass_kg, fuel_kg: all of it, and what of that may be burned.
    """

    height_m: Annotated[float, LIMITS["above_m"]]
    velocity_mps: Annotated[float, LIMITS["flight_mps"]]
    mass_kg: Annotated[float, LIMITS["module_kg"]]
    fuel_kg: Annotated[float, LIMITS["fuel_kg"]]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_tank(self.mass_kg, self.fuel_kg)


class Lander1DState(NamedTuple):
    """Full state of the plant at one moment."""

    time_s: float
    height_m: float
    velocity_mps: float
    mass_kg: float
    fuel_kg: float
    throttle: float
    touchdown: Touchdown | None
    outcome: str | None


class Lander1D:
    """The vertical lander. Implements `Plant`.

    Args:
        start_of: returns the start that belongs to a seed.
        engine: thrust, exhaust speed and gravity.
        seed: of the first run.
        min_throttle: minimum throttle while there is propellant, for an engine that cannot be shut off.
        gear: judges the touchdown.
        ceiling_m: above it the module is lost.

    Raises:
        ParameterError: a number is out of range.
    """

    engine = "closed_form 1"
    step_s: float | None = None
    inputs: tuple[str, ...] = ("engine",)
    outputs: tuple[str, ...] = ("radar",)
    SCALABLE = ("thrust_n", "exhaust_mps", "gravity_mps2", "dry_mass_kg")  # for `scaled`

    thrust_n: float
    exhaust_mps: float
    gravity_mps2: float

    def __init__(
        self,
        start_of: Callable[[int], VerticalStart],
        engine: Engine,
        seed: int = 0,
        min_throttle: float = 0.0,
        gear: GearLimits = APOLLO_GEAR,
        ceiling_m: float = 50_000.0,
    ) -> None:
        for what, value, limit in (
            ("engine's thrust_n", engine.thrust_n, "engine_n"),
            ("engine's exhaust_mps", engine.exhaust_mps, "exhaust_mps"),
            ("engine's gravity_mps2", engine.gravity_mps2, "pull_mps2"),
            ("lander's min_throttle", min_throttle, "share"),
            ("lander's ceiling_m", ceiling_m, "above_m"),
        ):
            check_number(f"The {what}", value, LIMITS[limit])
        self.start_of: Callable[[int], VerticalStart] = start_of
        self.thrust_n, self.exhaust_mps, self.gravity_mps2 = engine
        self.min_throttle: float = min_throttle
        self.gear: GearLimits = gear
        self.ceiling_m: float = ceiling_m
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Put the module back to the start that belongs to this seed, engine off."""
        start = self.start_of(seed)
        check_valid(isinstance(start, VerticalStart), f"The start of seed {seed}", start, "return a VerticalStart.")
        self.time_s: float = 0.0
        self.height_m: float = float(start.height_m)
        self.velocity_mps: float = float(start.velocity_mps)
        self.mass_kg: float = start.mass_kg
        self.fuel_kg: float = start.fuel_kg
        self.throttle: float = self.min_throttle
        self.touchdown: Touchdown | None = None
        self.outcome: str | None = None

    def scaled(self, factors: Mapping[str, float]) -> Lander1D:
        """Return a module of which some numbers, those in `SCALABLE`, are multiplied; its propellant is the same."""
        thrust, exhaust, gravity, dry = (factors.get(name, 1.0) for name in self.SCALABLE)
        engine = Engine(self.thrust_n * thrust, self.exhaust_mps * exhaust, self.gravity_mps2 * gravity)

        def start_of(seed: int) -> VerticalStart:
            start = self.start_of(seed)
            return replace(start, mass_kg=start.fuel_kg + dry * (start.mass_kg - start.fuel_kg))

        return Lander1D(start_of, engine, min_throttle=self.min_throttle, gear=self.gear, ceiling_m=self.ceiling_m)

    def write(self, name: str, command: EngineCommand) -> None:
        """Set the throttle, clamped to what the engine can do. Gimbal and jets are not there."""
        if name != "engine":
            raise UnknownNameError(f"This plant has no input '{name}'.", fix=suggest(name, self.inputs))
        if not math.isfinite(command.throttle):
            raise PlantError(f"At {self.time_s:g} s the throttle was set to {command.throttle}.", fix="send 0 to 1.")
        self.throttle = min(1.0, max(self.min_throttle, command.throttle))

    def read(self, name: str) -> RadarReading:
        """Return the true height and its rate."""
        if name != "radar":
            raise UnknownNameError(f"This plant has no output '{name}'.", fix=suggest(name, self.outputs))
        return RadarReading(self.height_m, self.velocity_mps, self.time_s)

    def step(self, dt_s: float) -> None:
        """Advance by a time greater than 0, in at most two pieces: with propellant and without."""
        if not 0.0 < dt_s < math.inf:  # also NaN
            raise ParameterError(f"This plant moves on, and not by {dt_s} s.", fix="give more than 0 s, and an end.")
        if self.outcome:
            self.time_s += dt_s
            return
        flow = self.throttle * self.thrust_n / self.exhaust_mps
        burn_s = dt_s if flow * dt_s <= self.fuel_kg else self.fuel_kg / flow
        if self.fuel_kg > 0.0:
            self._move(burn_s, self.throttle * self.thrust_n)
        else:
            burn_s = 0.0
        if burn_s < dt_s and not self.outcome:
            self._move(dt_s - burn_s, 0.0)

    def _move(self, time_s: float, thrust_n: float) -> None:
        """Advance under constant thrust, or until the pads touch."""
        start = Motion(self.height_m, self.velocity_mps, self.mass_kg)
        end = propagate(start, thrust_n, self.exhaust_mps, self.gravity_mps2, time_s)
        contact_s = self._contact_s(start, end, thrust_n, time_s)
        if contact_s is not None:
            time_s = contact_s
            end = propagate(start, thrust_n, self.exhaust_mps, self.gravity_mps2, time_s)
        self.height_m, self.velocity_mps, self.mass_kg = end
        # Propellant from the mass, not the other way round: a dry tank is exactly 0 and never a rounding below.
        self.fuel_kg = max(0.0, self.fuel_kg - thrust_n / self.exhaust_mps * time_s)
        self.time_s += time_s
        if contact_s is not None:
            touchdown = Touchdown(vertical_mps=-end.velocity_mps, lateral_mps=0.0, attitude_deg=0.0, rate_degps=0.0)
            self.touchdown, self.outcome = touchdown, self.gear.outcome(touchdown, self.fuel_kg)  # it cannot tilt
            self.height_m = self.velocity_mps = self.throttle = 0.0
        elif end.height_m > self.ceiling_m:
            self.outcome = "out_of_bounds"
        elif not math.isfinite(end.height_m):
            raise PlantError(f"At {self.time_s:g} s the height is {end.height_m}.", fix="check the start and the step.")

    def _contact_s(self, start: Motion, end: Motion, thrust_n: float, time_s: float) -> float | None:
        """Return when the pads touch within a piece of constant thrust, or None.

        What burns grows lighter, so acceleration only grows, and velocity falls to one minimum before it rises. So
        there is at most one crest, then at most one trough; if the trough is under ground, contact is between them.
        """
        if end.height_m > 0.0 and end.velocity_mps <= 0.0:
            return None  # still falling and not there yet: by far the most frequent case

        def at(t: float) -> Motion:
            return propagate(start, thrust_n, self.exhaust_mps, self.gravity_mps2, t)

        fastest_fall_s = time_s
        if thrust_n > 0.0:
            lift_off_s = (start.mass_kg - thrust_n / self.gravity_mps2) * self.exhaust_mps / thrust_n
            fastest_fall_s = min(time_s, max(0.0, lift_off_s))
        if at(fastest_fall_s).velocity_mps >= 0.0:
            return None  # never falls
        trough_s = time_s
        if end.velocity_mps > 0.0:
            trough_s = find_root(lambda t: -at(t).velocity_mps, fastest_fall_s, time_s)
        if at(trough_s).height_m > 0.0:
            return None
        crest_s = find_root(lambda t: at(t).velocity_mps, 0.0, fastest_fall_s) if start.velocity_mps > 0.0 else 0.0
        return find_root(lambda t: at(t).height_m, crest_s, trough_s)

    @property
    def reason(self) -> str:
        """Description of what failed; empty if nothing did."""
        if self.outcome == "out_of_bounds":
            return "it left the region that is simulated"
        return "; ".join(self.gear.exceeded_limits(self.touchdown)) if self.touchdown is not None else ""

    def snapshot(self) -> Lander1DState:
        """Return all of the state."""
        return Lander1DState(*(getattr(self, name) for name in Lander1DState._fields))

    def restore(self, snapshot: Lander1DState) -> None:
        """Put back what `snapshot` returned."""
        for name, value in zip(Lander1DState._fields, snapshot, strict=True):
            setattr(self, name, value)

    def scene(self) -> dict[str, Any]:
        """Return flat ground with a pad, and the module."""
        return {"statics": terrain_shapes(FLAT), "bodies": module_shapes()}

    def truth(self) -> dict[str, Any]:
        """Return the true state for the recorder."""
        z = self.height_m + PADS_BELOW_M
        pose = [0.0, 0.0, z, 0.0, 0.0, 0.0, 1.0]
        thrust = self.throttle * self.thrust_n if self.fuel_kg > 0.0 else 0.0
        return {
            "poses": {"module": pose, "left_legs": pose, "right_legs": pose},
            "vectors": {"thrust": [0.0, 0.0, z - NOZZLE_BELOW_M, 0.0, 0.0, thrust]},
            "values": {
                "altitude_m": self.height_m,
                "vertical_mps": self.velocity_mps,
                "lateral_mps": 0.0,
                "throttle": self.throttle,
                "fuel_kg": self.fuel_kg,
                "attitude_deg": 0.0,
            },
        }
