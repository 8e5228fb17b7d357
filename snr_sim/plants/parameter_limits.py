"""Plausible ranges of the numbers of a small vehicle in a pool and of a lander: one table, each limit with its reason.

A `Record` names its limits in its annotations, and `check_record` applies them. msgspec's `Meta` and `convert` do not
suffice: they do not support numpy numbers, and their errors contain neither the value nor the unit that may have been
meant.

The ranges are wide: a value outside is not unusual but a mistake, most often of the unit, and the message names the
unit that would explain it. A limit shows a mistake before a dive; in the physics it would show as odd motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Union, get_args, get_origin, get_type_hints

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.wrench import AXES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

GRAMS = {"grams": 1e-3}
MILLIMETRES = {"millimetres": 1e-3, "centimetres": 1e-2}
LITRES = {"litres": 1e-3, "cubic centimetres": 1e-6}
DEGREES = {"degrees": math.pi / 180.0}
IS_ABOVE = True  # excludes the bound `min_value` itself


@dataclass(frozen=True)
class Limit:
    """Range of a number.

    Args:
        min_value, max_value: bounds, inclusive, but for `min_value` if `is_above`.
        unit: of it.
        reason: for the bounds.
        unit_mistakes: units that are used by mistake, and how many of ours each is.
        is_above: whether it must be greater than `min_value`.
    """

    min_value: float
    max_value: float
    unit: str = ""
    reason: str = ""
    unit_mistakes: Mapping[str, float] = field(default_factory=dict)
    is_above: bool = False

    def contains(self, value: float) -> bool:
        """Return whether a number is within the limit; NaN is not."""
        return self.min_value <= value <= self.max_value and not (self.is_above and value == self.min_value)

    def expected(self) -> str:
        """Return the range as text."""
        unit = f" {self.unit}" if self.unit else ""
        if math.isinf(self.min_value) and math.isinf(self.max_value):
            return f"a finite number{unit and ' of' + unit}"
        start = f"more than {self.min_value:g} and at most" if self.is_above else f"{self.min_value:g} to"
        return f"{start} {self.max_value:g}{unit}"


# fmt: off
LIMITS = {
    # a vehicle
    "mass_kg": Limit(0.5, 200.0, "kg", "four people lift no more over the edge of a pool, and thrusters and a battery "
                     "weigh half a kilogram", GRAMS),
    "volume_m3": Limit(0.0005, 0.2, "m3", "what floats has a litre for each kilogram", LITRES),
    "density_kgm3": Limit(500.0, 2000.0, "kg/m3", "what thrusters can hold at a depth weighs about as much as the "
                          "water it displaces"),
    "net_buoyancy_n": Limit(-50.0, 50.0, "N", "pilots trim to 1 or 2 N, and small thrusters must hold it down",
                            {"millinewtons": 1e-3}),
    "ballast_share": Limit(-0.1, 0.1, "", "trim is a matter of a few hundred grams"),
    "size_m": Limit(0.05, 3.0, "m", "it fits into a pool, and its thrusters onto it", MILLIMETRES),
    "body_position_m": Limit(-3.0, 3.0, "m", "no part of a small vehicle is farther from its origin", MILLIMETRES),
    "inertia_share": Limit(0.0, 1.0, "", "all of the mass in the corners of the frame has no more", {}, IS_ABOVE),
    "added_mass_share": Limit(0.0, 10.0, "", "a plate as large as the frame, moved against its face, takes along about "
                              "four times the displaced water", GRAMS),
    "linear_damping": Limit(0.0, 1000.0, "per m/s or rad/s", "it is given as a positive number, and published sets of "
                            "small vehicles end at 50"),
    "quadratic_damping": Limit(0.0, 5000.0, "per (m/s)^2 or (rad/s)^2", "it is given as a positive number, and a plate "
                               "of a square metre, moved against its face, has about 600"),
    # a battery and thrusters
    "cells": Limit(1, 14, "", "the vehicle has 4 in series, and no small vehicle's pack has more than 14"),
    "capacity_ah": Limit(0.1, 500.0, "Ah", "the vehicle has 18, and 500 weigh more than the vehicle",
                         {"milliampere hours": 1e-3}),
    "resistance_ohm": Limit(0.0, 1.0, "ohm", "0.02 to 0.05 is usual, and at 1 ohm nothing would be left for a thruster",
                            {"milliohms": 1e-3}),
    "cutoff_cell_v": Limit(0.0, 4.0, "V", "it is of one cell: 2.5 to 3.0 is usual, and a full one has 4.2",
                           {"of four cells": 0.25}),
    "cutoff_s": Limit(0.0, 10.0, "s", "0.1 is usual, and deep discharge damages cells within minutes",
                      {"milliseconds": 1e-3}),
    "electronics_a": Limit(0.0, 50.0, "A", "computer, camera and sensors take about 1", {"milliamperes": 1e-3}),
    "thruster_count": Limit(1, 100, "", "the vehicle has 8"),
    "thruster_lag_s": Limit(0.0, 5.0, "s", "a T200 has 0.029, as measured", {"milliseconds": 1e-3}, IS_ABOVE),
    # a dive
    "time_s": Limit(0.0, 1e6, "s", "a dive begins at 0 s, and 1e6 s is eleven days", {"milliseconds": 1e-3}),
    "speed_mps": Limit(-10.0, 10.0, "m/s", "the strongest tidal streams run at about that",
                       {"centimetres a second": 1e-2, "millimetres a second": 1e-3}),
    "start_mps": Limit(-20.0, 20.0, "m/s", "nothing begins a dive faster"),
    "start_radps": Limit(-100.0, 100.0, "rad/s", "nothing begins a dive faster", DEGREES),
    "angle_rad": Limit(-2.0 * math.pi, 2.0 * math.pi, "rad", "a full turn is 6.28 rad", DEGREES),
    "position_m": Limit(-1e5, 1e5, "m", "no basin is larger", MILLIMETRES),
    "load_kg": Limit(0.0, 100.0, "kg", "more would not hang at a small vehicle", GRAMS, IS_ABOVE),
    "load_m3": Limit(0.0, 0.2, "m3", "a kilogram of lead displaces 0.000088", LITRES),
    "leak_lps": Limit(0.0, 10.0, "l/s", "the hull is full in a second", {"cubic centimetres a second": 1e-3}),
    "leak_l": Limit(0.0, 200.0, "l", "no small hull holds more", {"cubic centimetres": 1e-3}),
    "share": Limit(0.0, 1.0, "", "it is a share of the whole", {"percent": 1e-2}),
    # a tether
    "length_m": Limit(0.0, 2000.0, "m", "tethers of small vehicles end at some hundred metres", MILLIMETRES, IS_ABOVE),
    "diameter_m": Limit(0.0, 0.05, "m", "a small vehicle cannot drag a thicker one", MILLIMETRES, IS_ABOVE),
    "modulus_pa": Limit(0.0, 2.5e11, "Pa", "steel has 2e11", {}, IS_ABOVE),
    "across": Limit(0.0, 5.0, "", "a smooth cylinder has 1.2, one that sways in the flow up to 3"),
    "along": Limit(0.0, 1.0, "", "skin friction is about 0.01"),
    "damping_share": Limit(0.0, 1.0, "", "1 is critical"),
    # a pool
    "basin_m": Limit(0.5, 1e5, "m", "a vehicle fits in, and no basin is larger", MILLIMETRES),
    "water_kgm3": Limit(500.0, 2000.0, "kg/m3", "fresh water has 1000, the sea 1026", {"kg/l": 1000.0}),
    "gravity_mps2": Limit(0.1, 30.0, "m/s2", "Earth has 9.81"),
    "temperature_c": Limit(-5.0, 60.0, "degrees Celsius", "it is liquid, and divers can stand it"),
    "height_m": Limit(-1e5, 100.0, "m", "under water z is negative; from higher up nothing is dropped", MILLIMETRES),
    "gate_m": Limit(0.1, 100.0, "m", "something can go through, and it fits into a basin", MILLIMETRES),
    # a lander
    "module_kg": Limit(1.0, 1e6, "kg", "Apollo's had 15 000 with full tanks", {"tonnes": 1e3, **GRAMS}),
    "fuel_kg": Limit(0.0, 1e6, "kg", "Apollo's descent stage had 8200", {"tonnes": 1e3, **GRAMS}),
    "above_m": Limit(0.0, 1e7, "m", "its pads are on the ground or over it, and nothing lands from higher up",
                     {"kilometres": 1e3}),
    "way_m": Limit(-1e7, 1e7, "m", "the Moon's radius is 1.7e6 m", MILLIMETRES),
    "flight_mps": Limit(-1e4, 1e4, "m/s", "an orbit of the Moon has 1700"),
    "tumble_radps": Limit(-10.0, 10.0, "rad/s", "nothing that can land turns faster", DEGREES),
    "engine_n": Limit(0.0, 1e8, "N", "Apollo's descent engine had 45 040", {}, IS_ABOVE),
    "exhaust_mps": Limit(500.0, 1e5, "m/s", "rockets that burn something have 2000 to 4500",
                         {"a specific impulse in seconds": 9.80665, "kilometres a second": 1e3}),
    "pull_mps2": Limit(0.0, 30.0, "m/s2", "it pulls down, and the Moon has 1.62", {}, IS_ABOVE),
    "lag_s": Limit(0.0, 5.0, "s", "an engine follows its command within some tenths", {"milliseconds": 1e-3}),
    "gimbal_rad": Limit(0.0, 0.5 * math.pi, "rad", "Apollo's nozzle turned by 0.105, 6 degrees", DEGREES),
    "gimbal_radps": Limit(0.0, 20.0, "rad/s", "nozzles are heavy", DEGREES),
    "couple_nm": Limit(0.0, 1e7, "N m", "Apollo's attitude jets had some 3000"),
    "gyration_m": Limit(0.0, 100.0, "m", "the square of it and the mass make the inertia", MILLIMETRES, IS_ABOVE),
    "leg_npm": Limit(0.0, 1e9, "N/m", "with none it would fall through", {}, IS_ABOVE),
    "leg_nspm": Limit(0.0, 1e9, "N s/m", "a damper takes energy and gives none"),
    "grip": Limit(0.0, 10.0, "", "ice has 0.02, and a dish in gravel about 0.7"),
    "gear_mps": Limit(0.0, 1e9, "m/s", "without any it could not even stand", {}, IS_ABOVE),
    "gear_rad": Limit(0.0, math.pi, "rad", "Apollo's gear took 0.105, 6 degrees", DEGREES, IS_ABOVE),
    "gear_radps": Limit(0.0, 20.0, "rad/s", "Apollo's gear took 0.035, 2 degrees a second", DEGREES, IS_ABOVE),
    "flight_step_s": Limit(0.0, 0.05, "s", "0.005 is a good step, and legs need a short one", {"milliseconds": 1e-3},
                           IS_ABOVE),
}
# fmt: on
FINITE = Limit(-math.inf, math.inf)
AXES_OF = {2: ("x", "z"), 3: ("x", "y", "z"), 6: AXES}  # unless an annotation names others


class Record:
    """Base of frozen dataclasses that are checked when they are made, as in `class Leak(Record, who="The leak's ")`.

    The ParameterError for a number that is out of range names it, its owner and the usual range.
    """

    _who = ""

    def __init_subclass__(cls, who: str = "") -> None:
        cls._who = who or cls._who

    def __post_init__(self) -> None:
        check_record(self, self._who)


def check_record(record: Any, who: str) -> None:
    """Check a frozen dataclass against its annotations, and put plain floats where other numbers were given.

        speed_mps: Annotated[float, Limit(...)]             a number, or a whole one if annotated as int
        velocity_mps: Annotated[Vector, Limit(...)]         a number for each axis; axes may be named after the limit
        inertia_kgm2: Annotated[Matrix, FINITE, AXES[3:]]   symmetric, a row and a column of them for each axis
        leak: Annotated[Leak | None, "an example"]          of this class, or None; the example ends the message
        faults: Annotated[tuple[Fault, ...], "an example"]  a row of them

    What is annotated with neither a `Limit` nor an example is not checked. The ParameterError for a field that is out
    of range names it and `who`, its owner: "The tether's ".
    """
    made_of: Any = type(record)
    for name, kind in _kinds(made_of).items():
        value = getattr(record, name)
        clean = _checked(f"{who}{name}", value, kind)
        if clean is not value:
            object.__setattr__(record, name, clean)


@cache
def _kinds(record: Any) -> dict[str, Any]:
    # Names as in the module that made the class: the module of a robot that is loaded twice has two of each class.
    return get_type_hints(record, record.__init__.__globals__, include_extras=True)


def _checked(what: str, value: Any, kind: Any, *rules: Any) -> Any:
    """Return a value as its annotation `kind` wants it, and `rules` of an annotation around that."""
    origin, inside = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _checked(what, value, *inside)
    if origin in (Union, UnionType) and NoneType in inside:
        (kind, *_) = (one for one in inside if one is not NoneType)
        return None if value is None else _checked(what, value, kind, *rules)
    if not rules:
        return value
    rule, *more = rules
    if not isinstance(rule, Limit):  # an example
        if origin is tuple:
            check_members(what, value, inside[0])
            return tuple(value)
        if not isinstance(value, kind):
            raise ParameterError(f"{what} is {format_value(value)}.", fix=rule)
    elif kind is int:
        check_whole(what, value, rule)
    elif kind is float:
        check_number(what, value, rule)
        return float(value)
    elif origin is tuple:
        check_vector(what, value, rule, *(more or [AXES_OF[len(inside)]]))
        return tuple(float(one) for one in value)
    else:
        return checked_matrix(what, value, *more)
    return value


def check_number(what: str, value: Any, limit: Limit = FINITE, axis: str = "") -> None:
    """Raise a ParameterError, with the value and the expected range, unless a value is a number within a limit.

    Args:
        what: name of the value, for the message: "The tether's length_m".
        value: that was given.
        limit: for it; see `LIMITS`.
        axis: of it, if it is one of several.
    """
    name = f"{what} of {axis}" if axis else what
    if not is_number(value):
        hint = ", without quotation marks" if isinstance(value, str) else ""
        raise ParameterError(
            f"{name} is {format_value(value)}, which is not a number.", fix=f"give {limit.expected()}{hint}."
        )
    if limit.contains(value) and math.isfinite(value):
        return
    units = [unit for unit, factor in limit.unit_mistakes.items() if value and limit.contains(value * factor)]
    hint = f": {units[0]}?" if units and math.isfinite(value) else "."
    reason = f": {limit.reason}" if limit.reason else ""
    raise ParameterError(f"{name} is {value}{hint}", fix=f"give {limit.expected()}{reason}.")


def check_whole(what: str, value: Any, limit: Limit) -> None:
    """Check that a value is a whole number within a limit, as `check_number` does."""
    check_number(what, value, limit)
    if not isinstance(value, Integral):
        message = f"{what} is {format_value(value)}, which is not an integer."
        raise ParameterError(message, fix=f"give {limit.expected()}.")


def check_vector(what: str, value: Any, limit: Limit = FINITE, axes: Sequence[str] = ("x", "y", "z")) -> None:
    """Check that a value is a sequence of numbers, one for each axis; an error names the axis."""
    found, names = f"{what} is {format_value(value)}", ", ".join(axes)
    if isinstance(value, str) or not hasattr(value, "__len__") or isinstance(value, Mapping):
        raise ParameterError(f"{found}, which is not a list of numbers.", fix=f"give {len(axes)}: {names}.")
    if len(value) != len(axes):
        raise ParameterError(f"{found}: {len(value)} numbers, not {len(axes)}.", fix=f"give {names}.")
    for axis, one in zip(axes, value, strict=True):
        check_number(what, one, limit, axis)


def check_members(what: str, value: Any, kind: type) -> None:
    """Check that a value is a tuple or list of one type."""
    name = kind.__name__
    if isinstance(value, kind):
        raise ParameterError(f"{what} is one {name}, not a row of them.", fix=f"write ({name}(...),) with the comma.")
    odd = value if not isinstance(value, tuple | list) else next((x for x in value if not isinstance(x, kind)), None)
    if odd is not None or value is None:
        message = f"{what} has {format_value(odd)} where a {name} is due."
        raise ParameterError(message, fix=f"give a tuple of {name}(...).")


def checked_matrix(what: str, rows: Any, axes: Sequence[str]) -> NDArray[np.float64]:
    """Return a symmetric matrix with a row and a column of finite numbers for each axis; an error names the entry."""
    import numpy as np  # here: see `lander/gear.py`

    if isinstance(rows, np.ndarray):
        rows = rows.tolist()
    n = len(axes)
    if not isinstance(rows, list | tuple) or len(rows) != n:
        raise ParameterError(f"{what} is {format_value(rows)}.", fix=f"it is a matrix of {n} x {n}: {', '.join(axes)}.")
    for axis, row in zip(axes, rows, strict=True):
        check_vector(f"{what} (row of {axis})", row, axes=axes)
    matrix = np.array(rows, dtype=float)
    askew = np.argwhere(~np.isclose(matrix, matrix.T, rtol=1e-9, atol=0.0))
    if len(askew):
        i, j = askew[0].tolist()
        raise ParameterError(
            f"{what} has {matrix[i, j]:g} at {axes[i]}, {axes[j]}, but {matrix[j, i]:g} at {axes[j]}, {axes[i]}.",
            fix="it is symmetric.",
        )
    return matrix


def check_valid(is_valid: bool, what: str, value: Any, fix: str, why: str = "") -> None:
    """Raise a ParameterError that shows a value, and why it is refused, unless it is valid."""
    if not is_valid:
        raise ParameterError(f"{what} is {format_value(value)}{why}.", fix=fix)


def is_number(value: Any) -> bool:
    """Return whether a value is a number; true and false are none, and neither is one too large for a float."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    try:
        float(value)
    except OverflowError:
        return False
    return True


def format_value(value: Any) -> str:
    """Return a value for a message, shortened."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
