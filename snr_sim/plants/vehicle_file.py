"""Vehicles in files: TOML, each number with its source.

Numbers stand there as papers print them, in their frame (FRD: x forward, y right, z down) or in ours (FLU); here they
are turned into ours.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from snr_sim.plants.vehicle import Matrix, Six, Thruster, Vector, Vehicle
from snr_sim.prelude.errors import ParameterError, nearest
from snr_sim.prelude.wrench import lacking_axes

FLIP = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])  # from FRD to FLU and back
_NUMBERS = {
    "mass_kg", "inertia_kgm2", "volume_m3", "added_mass", "linear_damping", "quadratic_damping",
    "centre_of_mass_m", "centre_of_buoyancy_m", "size_m", "net_buoyancy_n",
}  # fmt: skip
_OPTIONAL = {"net_buoyancy_n"}


def read_vehicle(path: Path) -> Vehicle:
    """Returns the vehicle of a TOML file; its name is the file's.

    The file says its `frame` ("FRD" or "FLU"), the `[sources]` by short names, the numbers as
    `mass_kg = { value = 13.5, source = "paper" }`, the `[[thruster]]` tables, and in `lacks` the axes that these
    thrusters cannot push, so that a misplaced one is not taken for a choice. Matrices may be given by their diagonal.

    Raises:
        ParameterError: the file cannot be read, lacks a number or its source, or a number cannot be.
    """
    try:
        with path.open("rb") as file:
            data = tomllib.load(file)
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise ParameterError(
            f"The vehicle in {path} cannot be read: {error}", fix="compare it with benzon2022.toml."
        ) from error
    known = {"about", "frame", "sources", "thruster", "thrusters_source", "lacks", *_NUMBERS}
    for key in data:
        if key not in known:
            raise ParameterError(f"{path.name} has '{key}', which is no number of a vehicle.", fix=nearest(key, known))
    values, sources = _numbers(path.name, data)
    flip = {"FRD": FLIP, "FLU": np.ones(6)}.get(data.get("frame", ""))
    if flip is None:
        raise ParameterError(f"{path.name} has the frame {data.get('frame')!r}.", fix='write frame = "FRD" or "FLU".')
    vehicle = Vehicle(
        path.stem,
        mass_kg=float(values["mass_kg"]),
        inertia_kgm2=_matrix(values["inertia_kgm2"], flip[:3]),
        volume_m3=float(values["volume_m3"]),
        added_mass=_matrix(values["added_mass"], flip),
        linear_damping=_six(values["linear_damping"]),
        quadratic_damping=_six(values["quadratic_damping"]),
        centre_of_mass_m=_vector(values["centre_of_mass_m"], flip),
        centre_of_buoyancy_m=_vector(values["centre_of_buoyancy_m"], flip),
        size_m=_vector(values["size_m"], np.ones(6)),
        thrusters=tuple(
            Thruster(str(one["name"]), _vector(one["position_m"], flip), _vector(one["direction"], flip))
            for one in data.get("thruster", [])
        ),
        net_buoyancy_n=values.get("net_buoyancy_n"),
        sources=sources,
    )
    _check_upright(vehicle)
    _check_lacks(vehicle, tuple(data.get("lacks", ())))
    return vehicle


def _numbers(file: str, data: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Returns the values and their sources, in full, by name."""
    values, sources = {}, {}
    named = data.get("sources", {})
    for name in sorted(_NUMBERS):
        entry = data.get(name)
        if entry is None:
            if name in _OPTIONAL:
                continue
            raise ParameterError(f"{file} lacks {name}.", fix=f'write {name} = {{ value = ..., source = "..." }}.')
        if not isinstance(entry, dict) or set(entry) != {"value", "source"} or entry["source"] not in named:
            raise ParameterError(
                f"{file}: {name} is {entry!r}, which is not a value with a source.",
                fix=f'write {{ value = ..., source = "..." }}, with one of the sources {", ".join(sorted(named))}.',
            )
        values[name] = entry["value"]
        sources[name] = named[entry["source"]]
    if data.get("thruster"):
        source = data.get("thrusters_source")
        if source not in named:
            raise ParameterError(f"{file}: the thrusters have no source.", fix='write thrusters_source = "...".')
        sources["thrusters"] = named[source]
    return values, sources


def _matrix(value: list[Any], flip: NDArray[np.float64]) -> Matrix:
    given = np.array(value, dtype=float)
    matrix: Matrix = np.diag(given) if given.ndim == 1 else given
    return matrix * np.outer(flip, flip) if matrix.shape == (len(flip), len(flip)) else matrix


def _vector(value: list[float], flip: NDArray[np.float64]) -> Vector:
    x, y, z = (float(one * sign) + 0.0 for one, sign in zip(value, flip[:3], strict=True))
    return x, y, z


def _six(value: list[float]) -> Six:
    u, v, w, p, q, r = (float(one) for one in value)
    return u, v, w, p, q, r


def _check_upright(vehicle: Vehicle) -> None:
    above = vehicle.centre_of_buoyancy_m[2] - vehicle.centre_of_mass_m[2]
    if above <= 0.0:
        raise ParameterError(
            f"Vehicle '{vehicle.name}' has its buoyancy {-above:g} m below its mass: it would turn over.",
            fix="in FRD z points down, so a centre above another has the smaller z.",
        )


def _check_lacks(vehicle: Vehicle, declared: tuple[str, ...]) -> None:
    found = lacking_axes(vehicle.thruster_matrix()) if vehicle.thrusters else ()
    if set(found) != set(declared):
        raise ParameterError(
            f"The thrusters of '{vehicle.name}' lack authority in {', '.join(found) or 'no axis'}, "
            f"the file says {', '.join(declared) or 'none'}.",
            fix="check places and directions; a frame that is meant to lack an axis says so with lacks = [...].",
        )
