"""The T200 thruster: what a pulse width and a supply voltage give in thrust and current, from its maker's table.

The table is of six voltages. Around 1500 us nothing turns, and that dead band is narrower the higher the voltage. So
between two voltages a pulse is compared by how far it stands from the band's edge to full thrust: then the band's edge
lies between those of the table too, and at the table's own voltages the numbers are the table's.

Measured at rest, in a tank. A thruster that moves through the water pushes less, which the table does not include.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from snr_sim.prelude.errors import ParameterError

TABLE = Path(__file__).with_name("t200.csv")  # states its source
NEWTONS_PER_KGF = 9.80665
STOP_US = 1500.0
MIN_PULSE_US, MAX_PULSE_US = 1100.0, 1900.0
MIN_VOLTAGE_V, MAX_VOLTAGE_V = 7.0, 20.0  # the speed controller runs at 7 to 26 V (its maker), the table ends at 20
# Below the table's 10 V everything shrinks with these powers of the voltage, as full thrust does from 12 V to 10 V.
FORCE_POWER, CURRENT_POWER = 1.29, 1.19


class Curve(NamedTuple):
    """What a thruster does at one voltage, by pulse width. Between two of its pulses all is linear."""

    pulses_us: tuple[float, ...]  # rising, from `MIN_PULSE_US` to `MAX_PULSE_US`
    forces_n: tuple[float, ...]  # positive ahead; never falls with the pulse, and is 0 in the dead band only
    currents_a: tuple[float, ...]  # drawn from the supply

    def at(self, pulse_us: float) -> tuple[float, float]:
        """Return force [N] and current [A] at a pulse between `MIN_PULSE_US` and `MAX_PULSE_US`."""
        pulses, forces, currents = self
        i = min(len(pulses) - 2, max(0, bisect_right(pulses, pulse_us) - 1))
        share = (pulse_us - pulses[i]) / (pulses[i + 1] - pulses[i])
        force, current = forces[i], currents[i]
        return force + share * (forces[i + 1] - force), current + share * (currents[i + 1] - current)

    @property
    def dead_band_us(self) -> tuple[float, float]:
        """The shortest and the longest pulse without thrust."""
        still = [pulse for pulse, force in zip(self.pulses_us, self.forces_n, strict=True) if force == 0.0]
        return still[0], still[-1]


@lru_cache(maxsize=128)
def curve(voltage_v: float) -> Curve:
    """Return force and current of the thruster at a supply voltage, `MIN_VOLTAGE_V` to `MAX_VOLTAGE_V`.

    >>> force_n, current_a = curve(16.0).at(1900.0)
    >>> round(force_n / NEWTONS_PER_KGF, 2), current_a
    (5.25, 23.83)

    Raises:
        ParameterError: the thruster does not run at this voltage.
    """
    if not MIN_VOLTAGE_V <= voltage_v <= MAX_VOLTAGE_V:
        raise ParameterError(
            f"A T200 thruster at {voltage_v!r} V.",
            fix=f"{MIN_VOLTAGE_V:g} to {MAX_VOLTAGE_V:g} V; 16.8 V is a full battery.",
        )
    table = load_table()
    voltages = sorted(table)
    if voltage_v < voltages[0]:
        return _scaled(table[voltages[0]], voltage_v / voltages[0])
    i = min(len(voltages) - 2, bisect_right(voltages, voltage_v) - 1)
    below, above = (table[voltage] for voltage in voltages[i : i + 2])
    share = (voltage_v - voltages[i]) / (voltages[i + 1] - voltages[i])
    astern = _side(below, above, share, MIN_PULSE_US, lambda band: band[0])
    ahead = _side(below, above, share, MAX_PULSE_US, lambda band: band[1])
    columns = list(zip(*reversed(astern), strict=True)), list(zip(*ahead, strict=True))
    return Curve(*(one + other for one, other in zip(*columns, strict=True)))


@lru_cache(maxsize=1)
def load_table() -> dict[float, Curve]:
    """Return the maker's table: a curve for each voltage that was measured."""
    lines = [line for line in TABLE.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    names, rows = lines[0].split(","), [[float(cell) for cell in line.split(",")] for line in lines[1:]]
    pulses, *columns = (tuple(column) for column in zip(*rows, strict=True))
    voltages = [float(name[len("kgf_") : -len("V")]) for name in names if name.startswith("kgf_")]
    return {  # the third column of each voltage is the propeller's speed
        voltage: Curve(pulses, tuple(NEWTONS_PER_KGF * force for force in columns[3 * i]), columns[3 * i + 1])
        for i, voltage in enumerate(voltages)
    }


def _side(
    below: Curve, above: Curve, share: float, end_us: float, edge_of: Callable[[tuple[float, float]], float]
) -> list[Sequence[float]]:
    """Return rows of a curve between two others, from the edge of its dead band to full thrust at `end_us`.

    `share` is its position between them, 0 to 1; `edge_of` takes the edge of that side from a dead band.
    """
    edges = edge_of(below.dead_band_us), edge_of(above.dead_band_us)
    edge_us = edges[0] + share * (edges[1] - edges[0])
    places = {0.0, 1.0}
    for one, its_edge_us in zip((below, above), edges, strict=True):
        places |= {(pulse - its_edge_us) / (end_us - its_edge_us) for pulse in one.pulses_us}
    rows: list[Sequence[float]] = []
    for place in sorted(place for place in places if 0.0 <= place <= 1.0):
        lower, upper = (
            one.at(its_edge_us + place * (end_us - its_edge_us))
            for one, its_edge_us in zip((below, above), edges, strict=True)
        )
        values = (a + share * (b - a) for a, b in zip(lower, upper, strict=True))
        rows.append((edge_us + place * (end_us - edge_us), *values))
    return _without_repeats(rows)


def _scaled(lowest: Curve, share: float) -> Curve:
    force, current = share**FORCE_POWER, share**CURRENT_POWER
    return Curve(
        lowest.pulses_us,
        tuple(force * value for value in lowest.forces_n),
        tuple(current * value for value in lowest.currents_a),
    )


def _without_repeats(rows: list[Sequence[float]]) -> list[Sequence[float]]:
    """Places that differ by rounding only are one."""
    new = (row for before, row in pairwise(rows) if not math.isclose(before[0], row[0], abs_tol=1e-6))
    return [rows[0], *new]
