"""Vehicles in files: TOML, each number with its source.

The files contain numbers as papers print them, in their frame (FRD: x forward, y right, z down) or in ours (FLU); this
module converts them to ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.parameter_limits import check_number, check_valid, check_vector, checked_matrix, format_value
from snr_sim.plants.toml_file import read_tables
from snr_sim.plants.urov.vehicle import Matrix, Thruster, Vector, Vehicle
from snr_sim.prelude.errors import ParameterError, suggest
from snr_sim.prelude.sums import ordered_sum
from snr_sim.prelude.water import FRESH_KGM3, GRAVITY_MPS2
from snr_sim.prelude.wrench import AXES, unactuated_axes

Flip: TypeAlias = NDArray[np.float64]  # signs of six axes

FLIP = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])  # from FRD to FLU and back
FRAMES = {"FRD": FLIP, "FLU": np.ones(6)}
MAX_LINEAR_RATIO = 2.0  # of drag at 1 m/s, linear by quadratic: those in robots/urov/vehicles have 0.1 and 0.2
_OPTIONAL = {"net_buoyancy_n"}
_NUMBER = ("value", "source")
_THRUSTER = ("name", "position_m", "direction")


def read_vehicle(path: Path | str) -> Vehicle:
    """Return the vehicle of a TOML file; its name is the file's.

    The file contains its `frame` ("FRD" or "FLU"), the `[sources]` by short names, the numbers as
    `mass_kg = { value = 13.5, source = "paper" }`, the `[[thruster]]` tables, and in `lacks` the axes that these
    thrusters cannot push, so that a misplaced one is not taken for a choice. Matrices may be given by their diagonal.

    Raises:
        ParameterError: the file cannot be read, lacks a number or its source, or a number is out of range; the message
            names the file, the field and what was found in it.
    """
    check_valid(isinstance(path, str | Path), "The path of the vehicle's file", path, 'Path("vehicles/mine.toml").')
    path = Path(path)
    data = read_tables(path, "The vehicle", "benzon2022.toml")
    try:
        vehicle = _vehicle(path.stem, data)
        # A vehicle that cannot be trimmed is reported with its file, not when it is put into water.
        vehicle.trimmed(FRESH_KGM3, GRAVITY_MPS2)
        _check_upright(vehicle)
        _check_drag(vehicle)
        _check_lacks(vehicle, _lacks(data))
    except ParameterError as error:
        raise ParameterError(f"{path.name}: {error.message}", fix=error.fix) from error
    return vehicle


def _vehicle(name: str, data: dict[str, Any]) -> Vehicle:
    _check_keys("the file", data, "key of a vehicle file", _KNOWN)
    frame = data.get("frame")
    if not isinstance(frame, str) or frame not in FRAMES:
        found = f"the file has the frame {format_value(frame)}" if "frame" in data else "the file lacks frame"
        raise ParameterError(f"{found}.", fix='write frame = "FRD" (z down) or frame = "FLU" (z up).')
    flip = FRAMES[frame]
    about = data.get("about", "")
    check_valid(isinstance(about, str), "about", about, 'write about = "...".', ", which is not text")
    values, sources = _numbers(data, flip)
    thrusters = _thrusters(data.get("thruster", []), flip)
    return Vehicle(name, **values, thrusters=thrusters, sources=sources)


def _numbers(data: dict[str, Any], flip: Flip) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the values in our frame and their sources, in full, by name."""
    named = _sources(data)
    values, sources = {}, {}
    for name, read_value in _NUMBERS.items():
        fix = f'write {name} = {{ value = ..., source = "..." }}.'
        if name not in data:
            if name in _OPTIONAL:
                continue
            raise ParameterError(f"the file lacks {name}.", fix=fix)
        entry = data[name]
        check_valid(isinstance(entry, dict), name, entry, fix, ", which is not a value with a source")
        _check_keys(name, entry, "key of a value", _NUMBER, _NUMBER)
        values[name] = read_value(name, entry["value"], flip)
        sources[name] = _source(f"{name}: source", entry["source"], named)
    if data.get("thruster"):
        if "thrusters_source" not in data:
            raise ParameterError("the thrusters have no source.", fix='write thrusters_source = "...".')
        sources["thrusters"] = _source("thrusters_source", data["thrusters_source"], named)
    return values, sources


def _sources(data: dict[str, Any]) -> dict[str, str]:
    named: dict[str, str] = data.get("sources", {})
    check_valid(isinstance(named, dict), "sources", named, 'write [sources] and below it paper = "who, where".')
    for key, text in named.items():
        is_text = isinstance(text, str) and bool(text.strip())
        check_valid(is_text, f"sources: {key}", text, "name the paper.", ", which does not name a source")
    return named


def _source(what: str, key: Any, named: dict[str, str]) -> str:
    if not isinstance(key, str) or key not in named:
        raise ParameterError(
            f"{what} is {format_value(key)}, which is not a value with a source that [sources] has.",
            fix=suggest(str(key), named),
        )
    return named[key]


def _number(name: str, value: Any, _flip: Flip) -> float:
    check_number(name, value)
    return float(value)


def _place(name: str, value: Any, flip: Flip) -> Vector:
    check_vector(name, value)
    x, y, z = (float(one * sign) + 0.0 for one, sign in zip(value, flip[:3], strict=True))
    return x, y, z


def _row(name: str, value: Any, _flip: Flip, axes: Sequence[str] = AXES) -> tuple[float, ...]:
    check_vector(name, value, axes=axes)
    return tuple(map(float, value))


def _matrix(name: str, value: Any, flip: Flip, axes: Sequence[str] = AXES) -> Matrix:
    """Return a matrix that is given in full or by its diagonal."""
    flip = flip[: len(axes)]
    if isinstance(value, list) and any(isinstance(row, list) for row in value):
        matrix = checked_matrix(name, value, axes)  # here, as the file has it, not turned to FLU
    else:
        check_vector(name, value, axes=axes)
        matrix = np.diag(np.array(value, dtype=float))
    return matrix * np.outer(flip, flip) + 0.0


# What takes each number from the file's frame to ours, and checks its shape before.
_NUMBERS: dict[str, Callable[[str, Any, Flip], Any]] = {
    "mass_kg": _number,
    "volume_m3": _number,
    "net_buoyancy_n": _number,
    "inertia_kgm2": partial(_matrix, axes=AXES[3:]),
    "added_mass": _matrix,
    "linear_damping": _row,
    "quadratic_damping": _row,
    "centre_of_mass_m": _place,
    "centre_of_buoyancy_m": _place,
    "size_m": partial(_row, axes=("length", "width", "height")),
}
_KNOWN = ("about", "frame", "sources", "thruster", "thrusters_source", "lacks", *_NUMBERS)


def _thrusters(tables: Any, flip: Flip) -> tuple[Thruster, ...]:
    is_list = isinstance(tables, list) and all(isinstance(one, dict) for one in tables)
    check_valid(is_list, "thruster", tables, "begin each thruster with [[thruster]], in two pairs.")
    thrusters = []
    for i, one in enumerate(tables, start=1):
        name = one.get("name")
        where = f"thruster {i}" + (f" ('{name}')" if isinstance(name, str) else "")
        _check_keys(where, one, "key of a thruster", _THRUSTER, _THRUSTER)
        check_valid(isinstance(name, str), f"{where}: name", name, 'write name = "T1".', ", which is not text")
        thrusters.append(Thruster(name, *(_place(f"{where}: {key}", one[key], flip) for key in _THRUSTER[1:])))
    return tuple(thrusters)


def _check_keys(where: str, table: dict[str, Any], what: str, known: Sequence[str], needed: Sequence[str] = ()) -> None:
    for key in table:
        if key not in known:
            raise ParameterError(f"{where} has '{key}', which is not a {what}.", fix=suggest(key, known))
    for key in needed:
        if key not in table:
            raise ParameterError(f"{where} lacks {key}.", fix=f"it has {', '.join(needed)}.")


def _lacks(data: dict[str, Any]) -> tuple[str, ...]:
    """Return the axes that, by the file, its thrusters cannot push."""
    declared = data.get("lacks", [])
    fix = 'write lacks = ["pitch"], or [].'
    check_valid(isinstance(declared, list), "lacks", declared, fix, ", which is not a list")
    for axis in declared:
        if not isinstance(axis, str) or axis not in AXES:
            raise ParameterError(f"lacks has {format_value(axis)}, which is not an axis.", fix=suggest(str(axis), AXES))
    return tuple(declared)


def _check_upright(vehicle: Vehicle) -> None:
    above = vehicle.centre_of_buoyancy_m[2] - vehicle.centre_of_mass_m[2]
    if above <= 0.0:
        raise ParameterError(
            f"Vehicle '{vehicle.name}' has its buoyancy {-above:g} m below its mass: it would turn over.",
            fix="in FRD z points down, so a centre above another has the smaller z.",
        )


def _check_drag(vehicle: Vehicle) -> None:
    """Check that water resists every motion, and more than in proportion: a file describes a vehicle under water.

    A `Vehicle` made in Python may have no drag, to be compared with closed forms.
    """
    linear, quadratic = vehicle.linear_damping, vehicle.quadratic_damping
    without = [axis for axis, one, two in zip(AXES, linear, quadratic, strict=True) if one == two == 0.0]
    if without:
        raise ParameterError(
            f"linear_damping and quadratic_damping of {', '.join(without)} are 0: nothing would slow it down there.",
            fix="one of the two has a number for each axis; without a measurement take that of benzon2022.toml.",
        )
    slow, fast = ordered_sum(linear[:3]), ordered_sum(quadratic[:3])
    if 0.0 < MAX_LINEAR_RATIO * fast < slow:
        raise ParameterError(
            f"linear_damping of surge, sway and heave adds up to {slow:g}, quadratic_damping to {fast:g}: at 1 m/s "
            "drag would be in proportion to speed.",
            fix="are the two swapped? From some centimetres a second on, drag goes with the square of speed.",
        )


def _check_lacks(vehicle: Vehicle, declared: tuple[str, ...]) -> None:
    found = unactuated_axes(vehicle.thruster_matrix()) if vehicle.thrusters else ()
    if set(found) != set(declared):
        raise ParameterError(
            f"The thrusters of '{vehicle.name}' lack authority in {', '.join(found) or 'no axis'}, "
            f"the file says {', '.join(declared) or 'none'}.",
            fix="check places and directions; a frame that is meant to lack an axis says so with lacks = [...].",
        )
