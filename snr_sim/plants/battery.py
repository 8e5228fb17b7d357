"""A battery of lithium-ion cells: the more is drawn and the less is left, the lower its voltage, until it is cut off.

voltage = open-circuit voltage (charge) - current * resistance
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, TypeAlias

from snr_sim.plants.parameter_limits import LIMITS, Record, check_number, check_valid, format_value, is_number
from snr_sim.prelude.errors import ParameterError

# Open-circuit voltage of a cell over its charge: a Samsung INR21700-40T, measured at C/20 and room temperature, at the
# ten points between which straight lines fit it best (Sunil, Pattipati and Balasingam, "Piecewise linear approximation
# of battery open-circuit voltage characteristics using dynamic programming", IEEE Transactions on Instrumentation and
# Measurement, 2025, with tables in the repository soorajsunil/Piecewise-Battery-OCV). The maker does not publish which
# cells are in the vehicle's pack; these are of their kind, and their full, average and empty voltages are the usual
# ones.
OPEN_CIRCUIT = (
    (0.0, 2.5), (0.0050, 2.8080), (0.0352, 3.1179), (0.0854, 3.3182), (0.1357, 3.4193),
    (0.2915, 3.5826), (0.4523, 3.6941), (0.8392, 4.0664), (0.9548, 4.1121), (1.0, 4.2),
)  # fmt: skip
_CHARGES = [charge for charge, _ in OPEN_CIRCUIT]
# From which charge on, the voltage there, and volts per charge above it.
_LINES = [(low, low_v, (high_v - low_v) / (high - low)) for (low, low_v), (high, high_v) in pairwise(OPEN_CIRCUIT)]


def _line_at(charge: float) -> tuple[float, float, float]:
    return _LINES[min(len(_LINES) - 1, max(0, bisect_right(_CHARGES, charge) - 1))]


def cell_v(charge: float) -> float:
    """Return the voltage of a cell without load, at a charge of 0 (empty) to 1 (full).

    >>> cell_v(1.0), round(cell_v(0.5), 2), round(cell_v(0.1), 2), cell_v(0.0)
    (4.2, 3.74, 3.35, 2.5)
    """
    low, low_v, slope = _line_at(charge)
    return low_v + (charge - low) * slope


@dataclass(frozen=True)
class BatteryPack(Record, who="The battery's "):
    """Parameters of a battery. The default is the 14.8 V, 18 Ah pack of the vehicle's maker.

    Args:
        cells: in series.
        capacity_ah: ampere hours from full to empty.
        resistance_ohm: of cells, plugs and cables up to the speed controllers. The maker does not publish it: 0.02 to
            0.05 ohm is usual for such packs, and the default lies between.
        cutoff_cell_v: of each cell, under load. Below it for `cutoff_s` a protection circuit disconnects the pack,
            until it is charged; None is a pack without such a circuit, which delivers until it is empty.
            The maker's pack has none, and its guide asks the user to stop at 3.0 V a cell to prevent permanent damage
            (bluerobotics.com/learn/battery-info). That one is fitted is our choice, and so are its numbers: 2.5 V, at
            which the cells' own makers call them empty, and a delay longer than a motor's start. Thrusters stop then;
            that the computers would stop, too, is not simulated.
        cutoff_s: that delay.
    """

    cells: Annotated[int, LIMITS["cells"]] = 4
    capacity_ah: Annotated[float, LIMITS["capacity_ah"]] = 18.0
    resistance_ohm: Annotated[float, LIMITS["resistance_ohm"]] = 0.03
    cutoff_cell_v: Annotated[float | None, LIMITS["cutoff_cell_v"]] = 2.5
    cutoff_s: Annotated[float, LIMITS["cutoff_s"]] = 0.1


_ROUNDING_S = 1e-9  # a tenth of a second is one, however many steps it is made of


class BenchSupply:
    """A supply of constant voltage at any current, like a bench supply; for measuring."""

    charge: float = 1.0

    def __init__(self, volts: float) -> None:
        if not is_number(volts):
            raise ParameterError(f"A supply of {format_value(volts)} V.", fix="BenchSupply(16.0)")
        self.volts: float = volts
        self.reset()

    def reset(self) -> None:
        """Reset the counter to 0."""
        self.energy_j: float = 0.0

    def voltage_v(self, current_a: float) -> float:
        """Return its voltage."""
        return self.volts

    def draw(self, current_a: float, voltage_v: float, dt_s: float) -> None:
        """Count the energy."""
        self.energy_j += current_a * voltage_v * dt_s

    def snapshot(self) -> float:
        """Return its counter."""
        return self.energy_j

    def restore(self, snapshot: float) -> None:
        """Put it back."""
        self.energy_j = snapshot


class Battery:
    """A pack and its remaining charge.

    Args:
        pack: its parameters.
        charge: at the start of a run, 0 empty to 1 full.

    Raises:
        ParameterError: the charge is not valid.

    Attributes:
        is_cut_off: its protection circuit has disconnected it; it delivers no more current.
    """

    def __init__(self, pack: BatteryPack | None = None, charge: float = 1.0) -> None:
        fix = "Battery(BatteryPack(cells=4), charge=0.8)."
        check_valid(pack is None or isinstance(pack, BatteryPack), "The battery's pack", pack, fix)
        check_number("The battery's charge", charge, LIMITS["share"])
        self.pack: BatteryPack = pack or BatteryPack()
        self._first_charge = charge
        self._share_per_as = 1.0 / (3600.0 * self.pack.capacity_ah)
        self._cutoff_v = self.pack.cells * (self.pack.cutoff_cell_v or 0.0)
        self.reset()

    def reset(self) -> None:
        """Restore the initial charge."""
        self.charge: float = self._first_charge
        self.energy_j: float = 0.0  # given so far, at the terminals
        self.is_cut_off: bool = self.charge <= 0.0
        self._low_s = 0.0  # for how long the voltage has been below the cut-off
        self._update_line()

    def voltage_v(self, current_a: float) -> float:
        """Return the voltage at which a current flows; 0 if it is empty or has been cut off."""
        if self.is_cut_off:
            return 0.0
        from_charge, from_v, slope, resistance_ohm = self._line
        return max(0.0, from_v + (self.charge - from_charge) * slope - current_a * resistance_ohm)

    def draw(self, current_a: float, voltage_v: float, dt_s: float) -> None:
        """Draw a current for a time, at a voltage; no effect once it is cut off."""
        if self.is_cut_off:
            return
        charge = self.charge - current_a * dt_s * self._share_per_as
        self.charge = charge = charge if charge > 0.0 else 0.0
        self.energy_j += current_a * voltage_v * dt_s
        if charge <= self._line[0]:
            self._update_line()
        if charge <= 0.0:
            self.is_cut_off = True
        elif voltage_v < self._cutoff_v:
            self._low_s += dt_s
            self.is_cut_off = self._low_s >= self.pack.cutoff_s - _ROUNDING_S
        elif self._low_s:
            self._low_s = 0.0

    def snapshot(self) -> tuple[float, float, float, bool]:
        """Return all of its state."""
        return self.charge, self.energy_j, self._low_s, self.is_cut_off

    def restore(self, snapshot: tuple[float, float, float, bool]) -> None:
        """Put back what `snapshot` returned."""
        self.charge, self.energy_j, self._low_s, self.is_cut_off = snapshot
        self._update_line()

    def _update_line(self) -> None:
        """Lay the straight line of the pack's voltage about its charge: looked up once for thousands of steps."""
        low, low_v, slope = _line_at(self.charge)
        cells = self.pack.cells
        self._line = low, cells * low_v, cells * slope, self.pack.resistance_ohm


Supply: TypeAlias = Battery | BenchSupply  # what feeds the thrusters
