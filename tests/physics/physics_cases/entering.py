"""From air into water: a free fall, the surface, and the bobbing of what floats; compared with a Runge-Kutta solution.

The reference is a level box whose wet share grows with its draught. Weight, buoyancy and drag are as in the book;
while it gets wetter, the water it takes along must be brought to its speed (von Karman, NACA TN 321), and while it
gets drier, that water is left behind with its speed.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial

from snr_sim.plants.urov.urov import Urov

from .case import Case
from .closed_forms import rk4
from .vehicles import SEA, along_axis, go, make_urov, trimmed

DROP_M = 0.6
FINE_S = 2e-5
KINK = "the surface is crossed within a few steps, each with one wet share"


@cache
def dropped(name: str, height_m: float, time_s: float) -> tuple[float, float]:
    """Return height and speed upwards after a time, by Runge and Kutta."""
    one = trimmed(name)
    added, volume = float(one.added_mass[2, 2]), one.volume_m3
    mass, a, b = along_axis(one, 2)
    dry = mass - added
    tall, middle = one.size_m[2], one.centre_of_buoyancy_m[2]

    def rate(_: float, state: tuple[float, ...]) -> tuple[float, ...]:
        z, w = state
        draught = 0.5 - (z + middle) / tall
        share = min(1.0, max(0.0, draught))
        wetting = max(0.0, -w / tall) if 0.0 < draught < 1.0 else 0.0
        force = SEA.gravity_mps2 * (SEA.density_kgm3 * volume * share - dry)
        force -= share * (a + b * abs(w)) * w + added * wetting * w
        return w, force / (dry + share * added)

    z, w = rk4(rate, (height_m, 0.0), time_s, FINE_S)
    return z, w


def entries(name: str) -> Iterator[Case]:
    """Dropped from over the water, and released half under it."""
    case = partial(Case, "From air into water")

    def fall(step_s: float, height_m: float, time_s: float) -> Urov:
        return go(make_urov(trimmed(name), step_s, position_m=(0.0, 0.0, height_m)), time_s)

    def after(time_s: float) -> Iterator[Case]:
        what = f"{name}, dropped from {DROP_M} m, after {time_s:g} s"
        height, speed = (lambda: dropped(name, DROP_M, time_s)[0]), (lambda: dropped(name, DROP_M, time_s)[1])
        allowed = 1e-2 if time_s < 0.5 else 2e-3
        yield case(f"{what}: height", height, "m", lambda h: fall(h, DROP_M, time_s).position_m[2], allowed, KINK)
        yield case(f"{what}: speed up", speed, "m/s", lambda h: fall(h, DROP_M, time_s).velocity_mps[2], 2e-3, KINK)

    for time_s in (0.4, 0.7, 2.0):
        yield from after(time_s)
    yield case(
        f"{name}, released with its middle at the surface: height after 1.5 s", lambda: dropped(name, 0.0, 1.5)[0], "m",
        lambda h: fall(h, 0.0, 1.5).position_m[2], 1e-4,
    )  # fmt: skip
