"""Pulses instead of a wrench: what the thrusters push at a voltage, how late, and what they cost the battery.

Forces and currents are typed in here from the maker's table, arms from the paper, so a slip in the plant's own table,
its mixing of thrusters or its frame would show.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

from snr_sim.plants.battery import Battery, BenchSupply
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.vehicle import Vehicle
from snr_sim.prelude.signals import PwmCommand
from snr_sim.prelude.sums import ordered_sum

from .case import LEFT, Case
from .closed_forms import rk4, terminal_speed
from .vehicles import DEEP, SEA, along_axis, go, weightless

# T200 at 16 V: Blue Robotics, T200 public performance data 10-20 V (2019).
N_PER_KGF = 9.80665
AHEAD_KGF, ASTERN_KGF = {1700.0: 1.82, 1600.0: 0.60}, {1300.0: 1.44, 1400.0: 0.48}
# Current flat out at 14 and 16 V, ahead and astern.
AHEAD_A, ASTERN_A = (20.36, 23.83), (20.71, 24.3)
ARM_M = (0.156 + 0.111) / math.sqrt(2.0)  # of a level thruster about z: von Benzon et al. 2022
LAG_S = (9258.0 - 6136.0) / 108700.0  # of their filter, taken as one of first order
FULL_V, RESISTANCE_OHM, ELECTRONICS_A = 4 * 4.2, 0.03, 1.0  # the pack's: parameters, not results
GROUP = "Pulses"

STOP = [1500.0] * 8
# The two upright thrusters that point down push up when they run astern.
UP = [1500.0] * 4 + [1700.0, 1300.0, 1300.0, 1700.0]
ALL_UP = [1500.0] * 4 + [1900.0, 1100.0, 1100.0, 1900.0]
LEFT_TURN = [1700.0, 1300.0, 1300.0, 1700.0] + [1500.0] * 4
SLOW_TURN = [1600.0, 1400.0, 1400.0, 1600.0] + [1500.0] * 4


def pulsed(one: Vehicle, step_s: float, pulses: list[float], time_s: float, supply: Battery | BenchSupply) -> Urov:
    """Return a plant that has been given pulses for a time, after its speed controllers had armed."""
    plant = Urov(one, SEA, lambda seed: Dive(DEEP), Propulsion(8, supply), step_s=step_s)
    plant.write("pwm", PwmCommand(STOP))
    go(plant, 1.2)
    plant.write("pwm", PwmCommand(pulses))
    return go(plant, time_s)


def pushed(name: str) -> Iterator[Case]:
    """Rising and turning by pulses at 16 V."""
    case = partial(Case, GROUP)
    one = weightless(name)
    up_n = 2.0 * N_PER_KGF * (AHEAD_KGF[1700.0] + ASTERN_KGF[1300.0])

    def rising(step_s: float, time_s: float) -> float:
        return pulsed(one, step_s, UP, time_s, BenchSupply(16.0)).through_water[2]

    terminal = terminal_speed(*along_axis(one, 2)[1:], up_n)
    what = f"{name}: four thrusters up at 1700 and 1300 us, 16 V: terminal"
    yield case(what, terminal, "m/s", lambda h: rising(h, 12.0), 1e-5, LEFT)
    for pulses, ahead, astern in ((LEFT_TURN, 1700.0, 1300.0), (SLOW_TURN, 1600.0, 1400.0)):
        turn_nm = 2.0 * ARM_M * N_PER_KGF * (AHEAD_KGF[ahead] + ASTERN_KGF[astern])
        yield case(
            f"{name}: level thrusters against each other at {ahead:g} and {astern:g} us, 16 V: terminal",
            terminal_speed(*along_axis(one, 5)[1:], turn_nm), "rad/s",
            lambda h, pulses=pulses: pulsed(one, h, pulses, 12.0, BenchSupply(16.0)).rate_radps[2], 1e-5, LEFT,
        )  # fmt: skip
    what = f"{name}: four thrusters up, 0.2 s after the pulse, with their lag"
    yield case(what, late(one, up_n, 0.2), "m/s", lambda h: rising(h, 0.2), 2e-4)


def sagging() -> Iterator[Case]:
    """The voltage that four thrusters flat out leave."""
    yield Case(
        GROUP, "voltage of a full battery under four thrusters flat out", sagged_v(), "V",
        lambda h: pulsed(weightless("benzon2022"), h, ALL_UP, 0.5, Battery()).read("power").voltage_v, 5e-4,
        "the charge that half a second takes",
    )  # fmt: skip


def late(one: Vehicle, push_n: float, time_s: float) -> float:
    """Return the speed up that a push gives which follows its command with a lag, by Runge and Kutta."""
    mass, a, b = along_axis(one, 2)

    def rate(time_s: float, state: tuple[float, ...]) -> tuple[float, ...]:
        (w,) = state
        return ((push_n * (1.0 - math.exp(-time_s / LAG_S)) - a * w - b * w * abs(w)) / mass,)

    return rk4(rate, (0.0,), time_s, 1e-4)[0]


def sagged_v() -> float:
    """Return where the battery's line and the table's meet: between 14 and 16 V both are straight."""
    slope = ordered_sum(AHEAD_A[1] - AHEAD_A[0] + ASTERN_A[1] - ASTERN_A[0] for _ in range(2)) / 2.0
    at_14_v = 2.0 * (AHEAD_A[0] + ASTERN_A[0]) + ELECTRONICS_A
    return (FULL_V - RESISTANCE_OHM * (at_14_v - 14.0 * slope)) / (1.0 + RESISTANCE_OHM * slope)
