"""A battery of lithium-ion cells: the more is drawn and the less is left, the lower its voltage.

voltage = open-circuit voltage (charge) - current * resistance
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

from snr_sim.prelude.errors import ParameterError

# Open-circuit voltage of a cell over its charge s: a - b exp(-35 s) + c s + d s^2 + e s^3 (Chen and Rincon-Mora,
# "Accurate electrical battery model", IEEE Transactions on Energy Conversion 21 (2006), 504). Their cell was another
# than those in this pack; so only the shape is theirs, moved and stretched to the two voltages that makers print.
_SHAPE = (3.685, 1.031, 0.2156, -0.1178, 0.3201)
FULL_CELL_V = 4.2
MEAN_CELL_V = 3.7  # "nominal": averaged over the charge


def _shape_v(charge: float) -> float:
    a, b, c, d, e = _SHAPE
    return a - b * math.exp(-35.0 * charge) + charge * (c + charge * (d + charge * e))


_MEAN_SHAPE_V = _SHAPE[0] - _SHAPE[1] * (1.0 - math.exp(-35.0)) / 35.0 + _SHAPE[2] / 2 + _SHAPE[3] / 3 + _SHAPE[4] / 4
_FULL_SHAPE_V = _shape_v(1.0)
_STRETCH = (FULL_CELL_V - MEAN_CELL_V) / (_FULL_SHAPE_V - _MEAN_SHAPE_V)


def cell_v(charge: float) -> float:
    """Returns the voltage of a cell from which nothing is drawn.

    >>> cell_v(1.0), round(cell_v(0.5), 2), round(cell_v(0.1), 2)
    (4.2, 3.7, 3.48)

    Args:
        charge: 0 empty to 1 full.
    """
    return FULL_CELL_V + _STRETCH * (_shape_v(charge) - _FULL_SHAPE_V)


@dataclass(frozen=True)
class Pack:
    """What a battery is made of. The default is the 14.8 V, 18 Ah pack of the vehicle's maker.

    Args:
        cells: in series.
        capacity_ah: ampere hours from full to empty.
        resistance_ohm: of cells, plugs and cables up to the speed controllers. Nobody prints it: 0.02 to 0.05 ohm is
            usual for such packs, and the default lies between.

    Raises:
        ParameterError: a number makes no sense.
    """

    cells: int = 4
    capacity_ah: float = 18.0
    resistance_ohm: float = 0.03

    def __post_init__(self) -> None:
        if not self.cells >= 1:
            raise ParameterError(f"A battery of {self.cells!r} cells.", fix="4, as the vehicle has.")
        if not (math.isfinite(self.capacity_ah) and self.capacity_ah > 0.0):
            raise ParameterError(f"A battery with capacity_ah={self.capacity_ah!r}.", fix="18.0.")
        if not (math.isfinite(self.resistance_ohm) and self.resistance_ohm >= 0.0):
            raise ParameterError(f"A battery with resistance_ohm={self.resistance_ohm!r}.", fix="0.03.")


class Supply(Protocol):
    """What feeds the thrusters."""

    @property
    def charge(self) -> float:
        """What is left, 0 to 1."""
        ...

    @property
    def energy_j(self) -> float:
        """Given since the last reset, at the terminals."""
        ...

    def reset(self) -> None:
        """Puts it back to the start."""
        ...

    def voltage_v(self, current_a: float) -> float:
        """Returns the voltage at which a current flows."""
        ...

    def draw(self, current_a: float, voltage_v: float, dt_s: float) -> None:
        """Takes a current out of it for a time, at a voltage."""
        ...

    def snapshot(self) -> Any:
        """Returns all of its state."""
        ...

    def restore(self, snapshot: Any) -> None:
        """Puts back what `snapshot` returned."""
        ...


class BenchSupply:
    """A supply that holds its voltage whatever is drawn, as one on a bench; for measuring. Keeps the promise of Supply.

    Args:
        volts: that it holds.
    """

    charge = 1.0

    def __init__(self, volts: float) -> None:
        self.volts = volts
        self.energy_j = 0.0

    def reset(self) -> None:
        """Counts from nothing."""
        self.energy_j = 0.0

    def voltage_v(self, current_a: float) -> float:
        """Returns what it holds."""
        return self.volts

    def draw(self, current_a: float, voltage_v: float, dt_s: float) -> None:
        """Counts the energy."""
        self.energy_j += current_a * voltage_v * dt_s

    def snapshot(self) -> float:
        """Returns what it counted."""
        return self.energy_j

    def restore(self, snapshot: float) -> None:
        """Puts it back."""
        self.energy_j = snapshot


class Battery:
    """A pack and how much is left in it. Keeps the promise of Supply.

    Args:
        pack: what it is.
        charge: of a run's beginning, 0 empty to 1 full.

    Raises:
        ParameterError: the charge is none.
    """

    def __init__(self, pack: Pack | None = None, charge: float = 1.0) -> None:
        if not 0.0 <= charge <= 1.0:
            raise ParameterError(f"A battery with charge={charge!r}.", fix="0.0 (empty) to 1.0 (full).")
        self.pack = pack or Pack()
        self._first_charge = charge
        self.reset()

    def reset(self) -> None:
        """Charges it as it was at first."""
        self.charge = self._first_charge
        self.energy_j = 0.0  # given so far, at the terminals

    def voltage_v(self, current_a: float) -> float:
        """Returns the voltage at which a current flows; 0 if it is empty, for then its own protection cuts it off."""
        if self.charge <= 0.0:
            return 0.0
        return max(0.0, self.pack.cells * cell_v(self.charge) - current_a * self.pack.resistance_ohm)

    def draw(self, current_a: float, voltage_v: float, dt_s: float) -> None:
        """Takes a current out of it for a time, at a voltage."""
        self.charge = max(0.0, self.charge - current_a * dt_s / (3600.0 * self.pack.capacity_ah))
        self.energy_j += current_a * voltage_v * dt_s

    def snapshot(self) -> tuple[float, float]:
        """Returns all of its state."""
        return self.charge, self.energy_j

    def restore(self, snapshot: tuple[float, float]) -> None:
        """Puts back what `snapshot` returned."""
        self.charge, self.energy_j = snapshot
