"""The thrusters of an underwater vehicle, from pulses to forces, with the battery that they share.

    pulses --> speed controllers --> thrust and current of the table, at the voltage --> lag --> forces
               (esc.py)              (t200.py)                ^                           |
                                                          battery <---------- current ----'
                                                          (battery.py)

Position and direction of the thrusters are not needed here: the vehicle's matrix turns forces into a wrench.

Between two changes of a pulse, or quarters of a volt, the table is straight lines: what a thruster gives when it has
settled is base + volts * slope. All follow it with one lag. So each force and current, and any sum of them, is

    decay * (what it was when the lines were laid) + (1 - decay) * base + ramp_integral * slope

with the same two numbers for all: `decay` falls with the lag, and `ramp_integral` follows the volts with it. A step
moves these two on and one sum, that of the currents. That is exact, and a third of the work of moving all forces on by
themselves.

Sixteen dependent numbers, and their mixing, executed 430 more of a step's 3800 bytecodes, and changed the last bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from snr_sim.plants.battery import Battery, Supply
from snr_sim.plants.parameter_limits import LIMITS, check_number, check_valid, check_whole
from snr_sim.plants.urov.esc import Esc
from snr_sim.plants.urov.t200 import MAX_PULSE_US, MAX_VOLTAGE_V, MIN_PULSE_US, MIN_VOLTAGE_V, STOP_US, curve
from snr_sim.plants.urov.vehicle import Matrix
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError, suggest
from snr_sim.prelude.sums import dot_product, ordered_sum

# von Benzon et al. 2022 (JMSE 10:1898) measured how a T200's force follows its command, as a filter of third order:
# (6136 s + 108700) / (s^3 + 89 s^2 + 9258 s + 108700). A first-order lag that is late by as much on the whole has the
# time constant (9258 - 6136) / 108700 s.
LAG_S = (9258.0 - 6136.0) / 108700.0
ELECTRONICS_A = 1.0  # computer, camera, sensors: our own guess, about 15 W
STEPS_PER_VOLT = 4  # the table is looked up at every quarter of a volt and every microsecond; between, all is linear
PULSE_RANGE_US = (800.0, 2200.0)  # what no servo output makes: a percentage, or seconds, given as a pulse by mistake
_HEALTHY = (1.0, 1.0)  # fractions of its force and of its current
FAULTS = ("none", "off", "weak", "stuck")
NEGLIGIBLE = 1e-15  # a fraction below rounding; ever smaller numbers would become denormal, which is slow

Numbers: TypeAlias = tuple[float, ...]
PropulsionState: TypeAlias = tuple[Any, ...]  # of the thrusters, of their speed controllers, and of the supply
# Attributes that are the state of the thrusters. None is changed in place.
STATE = (
    "_range_v", "_drives", "_current_a", "_mix", "_decay", "_ramp_integral", "applied_us", "_effectiveness", "_stuck",
    "voltage_v", "_is_stale",
)  # fmt: skip


class ThrustLinearisation(NamedTuple):
    """Numbers that approach targets, all with the same lag."""

    before: Sequence[float]  # what they were when the lines were laid
    bases: Sequence[float]  # what they settle to at the voltage from which the lines hold
    slopes: Sequence[float]  # how that changes with each volt more

    def at(self, decay: float, ramp_integral: float) -> list[float]:
        """Return where they are."""
        gone = 1.0 - decay
        return [decay * a + gone * b + ramp_integral * c for a, b, c in zip(*self, strict=True)]


class MixedThrust(NamedTuple):
    """Products of a matrix and the forces, as lines of their own."""

    matrix: Matrix
    rows: list[list[float]]  # its: for so few numbers Python is quicker than numpy, whose code is cold by then
    lines: ThrustLinearisation


class Propulsion:
    """Eight thrusters, or any number, of type T200, each with its speed controller, on one battery.

    Args:
        count: of thrusters.
        supply: feeds them; a full battery if None.
        lag_s: time constant of force and current following the table.
        electronics_a: current that everything else draws.

    Raises:
        ParameterError: a number is out of range, such as a supply of 0 V; the message gives the usual range.

    Attributes:
        escs: their speed controllers.
        applied_us: pulse that each thruster turns by; 1500 where its controller does not let it turn.
        voltage_v: at the speed controllers, after the last step.
    """

    def __init__(
        self, count: int, supply: Supply | None = None, lag_s: float = LAG_S, electronics_a: float = ELECTRONICS_A
    ) -> None:
        check_whole("The number of thrusters", count, LIMITS["thruster_count"])
        check_number("The thrusters' lag_s", lag_s, LIMITS["thruster_lag_s"])
        check_number("The vehicle's electronics_a", electronics_a, LIMITS["electronics_a"])
        is_supply = supply is None or hasattr(supply, "voltage_v")
        check_valid(is_supply, "The supply of the thrusters", supply, "Battery(charge=0.8), or BenchSupply(16.0).")
        self.count: int = count
        self.supply: Supply = Battery() if supply is None else supply
        self.lag_s: float = lag_s
        self.electronics_a: float = electronics_a
        self.reset()
        volts = self.supply.voltage_v(0.0)
        if not MIN_VOLTAGE_V <= volts <= MAX_VOLTAGE_V:
            raise ParameterError(
                f"The supply of the thrusters has {volts:g} V, but they run at {MIN_VOLTAGE_V:g} to "
                f"{MAX_VOLTAGE_V:g} V.",
                fix="a battery of 4 cells with charge in it.",
            )

    def reset(self) -> None:
        """Reset to the moment when the battery is connected: nothing turns, is armed or has a fault."""
        n = self.count
        self.supply.reset()
        self.escs: list[Esc] = [Esc() for _ in range(n)]
        nothing = (0.0,) * (2 * n)
        self._range_v = 0.0, 0.0  # where the lines hold
        self._drives = ThrustLinearisation(nothing, nothing, nothing)  # forces [N], then currents [A]
        self._current_a = 0.0, 0.0, 0.0  # the line of all currents together: before, base, slope
        self._decay, self._ramp_integral = 1.0, 0.0
        self._mean = self._decay, self._ramp_integral  # of the last step
        self._mix: MixedThrust | None = None
        self.applied_us: list[float] = [STOP_US] * n
        self._effectiveness = [_HEALTHY] * n
        self._stuck = [False] * n
        self.voltage_v: float = self.supply.voltage_v(self.electronics_a)
        self._lag_of = (0.0, 0.0, 0.0)  # for a step: the fraction that the lag covers, and where its mean lies
        self._last_pulses: list[float | None] | None = None
        self._is_settled = False
        self._neutral_offsets_us = [0.0] * n
        self._invalidate()

    @property
    def forces_n(self) -> list[float]:
        """Force of each thruster along its own axis, after the last step."""
        return self._drives.at(self._decay, self._ramp_integral)[: self.count]

    @property
    def mean_forces_n(self) -> list[float]:
        """Force of each thruster along its own axis, on average over the last step: what moved the vehicle.

        With the force of the step's end a vehicle would be ahead of its thrusters' lag by half a step.
        """
        return self._drives.at(*self._mean)[: self.count]

    @property
    def currents_a(self) -> list[float]:
        """Current of each thruster."""
        return self._drives.at(self._decay, self._ramp_integral)[self.count :]

    @property
    def current_a(self) -> float:
        """Total current of the supply: 0 if it is empty or has been cut off."""
        if self.voltage_v <= 0.0:
            return 0.0
        before, base, slope = self._current_a
        return self._decay * before + (1.0 - self._decay) * base + self._ramp_integral * slope + self.electronics_a

    @property
    def charge(self) -> float:
        """What is left in the supply, 0 empty to 1 full."""
        return self.supply.charge

    @property
    def energy_j(self) -> float:
        """Taken from the supply since the reset."""
        return self.supply.energy_j

    @property
    def is_armed(self) -> bool:
        """Whether all speed controllers are armed."""
        return all(esc.is_armed for esc in self.escs)

    def fail(self, thruster: int, fault: str, effectiveness: float = 0.5) -> None:
        """Set or clear the fault of a thruster.

        Args:
            thruster: its number, from 0.
            fault: 'off' gives no force and draws no current; 'weak' gives a fraction of its force for all of its
                current, as with a damaged propeller; 'stuck' keeps its last pulse, whatever is commanded; 'none' clears
                the fault.
            effectiveness: of a weak one, 0 to 1.

        Raises:
            ParameterError: there is no such thruster, or the effectiveness is out of range.
            UnknownNameError: there is no such fault.
        """
        if not 0 <= thruster < self.count:
            raise ParameterError(f"There is no thruster {thruster!r}.", fix=f"0 to {self.count - 1}.")
        if fault not in FAULTS:
            raise UnknownNameError(f"A thruster cannot be '{fault}'.", fix=suggest(fault, FAULTS))
        check_number("The thruster's effectiveness", effectiveness, LIMITS["share"])
        stuck, effectivenesses = list(self._stuck), list(self._effectiveness)
        stuck[thruster] = fault == "stuck"
        effectivenesses[thruster] = {"off": (0.0, 0.0), "weak": (effectiveness, 1.0)}.get(fault, _HEALTHY)
        self._stuck, self._effectiveness = stuck, effectivenesses
        self._invalidate()

    def mix_forces(self, matrix: Matrix) -> list[float]:
        """Return a matrix of n columns times `mean_forces_n`: with the vehicle's, the wrench of all thrusters.

        Of the same matrix it is quick: only the lines are multiplied, and they seldom change.
        """
        mix = self._mix
        if mix is not None and mix.matrix is not matrix and np.array_equal(mix.matrix, matrix):
            # State of another vehicle of the same type: multiplying again would change the last bit.
            self._mix = mix = mix._replace(matrix=matrix)
        if mix is None or mix.matrix is not matrix:
            rows, n = matrix.tolist(), self.count
            self._mix = mix = MixedThrust(
                matrix, rows, ThrustLinearisation(*(_products(rows, one[:n]) for one in self._drives))
            )
        return mix.lines.at(*self._mean)

    def step(self, dt_s: float, pulses_us: Sequence[float | None]) -> None:
        """Advance by `dt_s`.

        Args:
            dt_s: step [s].
            pulses_us: of each thruster; None where no pulse comes.

        Raises:
            PlantError: a pulse is not valid, or their number is not that of the thrusters.
        """
        volts = self.voltage_v
        if not self._is_settled or volts < MIN_VOLTAGE_V or pulses_us != self._last_pulses:
            self._update_escs(dt_s, list(pulses_us))
        from_v, to_v = self._range_v
        if not from_v <= volts < to_v or self._is_stale:
            self._linearise(volts)
            from_v, _ = self._range_v
        if self._lag_of[0] != dt_s:
            share = 1.0 - math.exp(-dt_s / self.lag_s)
            self._lag_of = dt_s, share, 1.0 / share - self.lag_s / dt_s
        _, share, middle = self._lag_of
        old_decay, old_ramp = self._decay, self._ramp_integral
        decay = old_decay - share * old_decay
        self._decay = decay = decay if decay > NEGLIGIBLE else 0.0
        self._ramp_integral = ramp_integral = old_ramp + share * (volts - from_v - old_ramp)
        self._mean = old_decay + middle * (decay - old_decay), old_ramp + middle * (ramp_integral - old_ramp)
        before, base, slope = self._current_a
        current_a = decay * before + (1.0 - decay) * base + ramp_integral * slope + self.electronics_a
        supply = self.supply
        supply.draw(current_a, volts, dt_s)
        # The current has its lag, so it is known, and the voltage follows from it. Where both have settled, current and
        # voltage satisfy the table and the battery at once.
        self.voltage_v = supply.voltage_v(current_a)

    def _update_escs(self, dt_s: float, pulses: list[float | None]) -> None:
        """Pass the pulses to the speed controllers; skipped while these are armed and the pulses have not changed."""
        if pulses != self._last_pulses:
            self._check(pulses)
            self._last_pulses = pulses
        volts = self.voltage_v
        if self._is_settled and None not in pulses and volts >= MIN_VOLTAGE_V:  # all armed, and nothing to disarm them
            applied = [
                MIN_PULSE_US
                if (shifted := pulse - shift) < MIN_PULSE_US
                else MAX_PULSE_US
                if shifted > MAX_PULSE_US
                else shifted
                for pulse, shift in zip(cast("list[float]", pulses), self._neutral_offsets_us, strict=True)
            ]
        else:
            applied = [esc.update(pulse, volts, dt_s) for esc, pulse in zip(self.escs, pulses, strict=True)]
            self._is_settled = self.is_armed and None not in pulses
            self._neutral_offsets_us = [esc.neutral_offset_us for esc in self.escs]
        if True in self._stuck:
            both = zip(self.applied_us, applied, self._stuck, strict=True)
            applied = [before if is_stuck else now for before, now, is_stuck in both]
        if applied != self.applied_us:
            self.applied_us = applied
            self._is_stale = True  # what was looked up is of other pulses

    def _check(self, pulses: list[float | None]) -> None:
        if len(pulses) != self.count:
            raise PlantError(
                f"{len(pulses)} pulses for {self.count} thrusters.", fix="one for each thruster, in their order."
            )
        min_us, max_us = PULSE_RANGE_US
        odd = [i for i, pulse in enumerate(pulses) if pulse is not None and not min_us <= pulse <= max_us]  # also NaN
        if odd:
            raise PlantError(
                f"Thruster {odd[0]} was sent a pulse of {pulses[odd[0]]!r} us.",
                fix="1100 to 1900 us, 1500 to stop, or None for no pulse.",
            )

    def _linearise(self, volts: float) -> None:
        """Lay straight lines through thrust and current of all thrusters, about a voltage."""
        if volts < MIN_VOLTAGE_V:  # nothing turns, up to the voltage at which it does
            nothing = (0.0,) * self.count
            self._set_linearisation(0.0, MIN_VOLTAGE_V, (nothing, nothing, nothing, nothing))
            return
        step = min(int(volts * STEPS_PER_VOLT), int(MAX_VOLTAGE_V * STEPS_PER_VOLT) - 1)
        from_v, to_v = step / STEPS_PER_VOLT, (step + 1) / STEPS_PER_VOLT
        if to_v == MAX_VOLTAGE_V:
            to_v = math.inf  # exactly 20 V is in this range too, and there is none above
        rows = []
        for pulse, (gives, draws) in zip(self.applied_us, self._effectiveness, strict=True):
            whole = int(pulse)
            part = pulse - whole
            force, dforce, slope, dslope, current, dcurrent, current_slope, dcurrent_slope = _patch(step, whole)
            thrust = gives * (force + part * dforce), gives * (slope + part * dslope)
            drawn = draws * (current + part * dcurrent), draws * (current_slope + part * dcurrent_slope)
            rows.append((*thrust, *drawn))
        self._set_linearisation(from_v, to_v, tuple(zip(*rows, strict=True)))

    def _set_linearisation(self, from_v: float, to_v: float, columns: Sequence[Numbers]) -> None:
        """Have forces and currents follow other lines, from where they are, between two voltages.

        `columns` are forces at `from_v` and how they change with each volt, then the same of currents.
        """
        forces, forces_per_v, currents, currents_per_v = columns
        decay, ramp_integral = self._decay, self._ramp_integral
        if self._mix is not None:  # it continues from its current value, too
            matrix, rows, lines = self._mix
            lines = ThrustLinearisation(
                lines.at(decay, ramp_integral), _products(rows, forces), _products(rows, forces_per_v)
            )
            self._mix = MixedThrust(matrix, rows, lines)
        before_a, base_a, slope_a = self._current_a
        now_a = decay * before_a + (1.0 - decay) * base_a + ramp_integral * slope_a
        self._current_a = now_a, ordered_sum(currents), ordered_sum(currents_per_v)
        self._drives = ThrustLinearisation(
            self._drives.at(decay, ramp_integral), forces + currents, forces_per_v + currents_per_v
        )
        self._range_v = from_v, to_v
        self._decay, self._ramp_integral, self._is_stale = 1.0, 0.0, False

    def _invalidate(self) -> None:
        self._last_pulses = None
        self._is_settled = False
        self._is_stale = True

    def snapshot(self) -> PropulsionState:
        """Return all of the state."""
        own = [getattr(self, name) for name in STATE]
        return own, [esc.state for esc in self.escs], self.supply.snapshot()

    def restore(self, snapshot: PropulsionState) -> None:
        """Put back what `snapshot` returned."""
        own, escs, supply = snapshot
        for name, value in zip(STATE, own, strict=True):
            setattr(self, name, value)
        for esc, state in zip(self.escs, escs, strict=True):
            esc.state = state
        self.supply.restore(supply)
        self._mean = self._decay, self._ramp_integral
        self._last_pulses, self._is_settled = None, False


def _products(rows: Sequence[Sequence[float]], column: Sequence[float]) -> list[float]:
    return [dot_product(row, column) for row in rows]


@lru_cache(maxsize=1 << 16)  # all there are: 52 steps of voltage and 801 pulses
def _patch(step: int, pulse_us: int) -> tuple[float, float, float, float, float, float, float, float]:
    """Return force and current about a voltage and a pulse, as numbers that a bilinear surface is made of.

    Of the force, then of the current: value, change per microsecond, change per volt, change of that per microsecond.
    """
    following_us = min(pulse_us + 1, int(MAX_PULSE_US))
    lower, upper = curve(step / STEPS_PER_VOLT), curve((step + 1) / STEPS_PER_VOLT)
    corners = [one.at(pulse) for one in (lower, upper) for pulse in (pulse_us, following_us)]
    force, current = zip(*corners, strict=True)
    return (*_bilinear(*force), *_bilinear(*current))


def _bilinear(low: float, low_next: float, high: float, high_next: float) -> tuple[float, float, float, float]:
    slope, slope_next = STEPS_PER_VOLT * (high - low), STEPS_PER_VOLT * (high_next - low_next)
    return low, low_next - low, slope, slope_next - slope
