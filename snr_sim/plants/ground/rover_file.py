"""Rovers in files: TOML with the fields of `RoverVehicle`, tables inside tables."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec

from snr_sim.plants.ground.rover_vehicle import RoverVehicle
from snr_sim.plants.parameter_limits import check_valid
from snr_sim.plants.toml_file import read_tables
from snr_sim.prelude.errors import ParameterError, suggest
from snr_sim.prelude.task import ensure_type_info


def read_rover(path: Path | str) -> RoverVehicle:
    """Return the rover of a TOML file.

    Raises:
        ParameterError: the file cannot be read, lacks a field or has one that is not known, or a number is out of
            range; the message names the file, the field and what was found in it.
    """
    check_valid(isinstance(path, str | Path), "The path of the rover's file", path, 'Path("vehicles/mine.toml").')
    path = Path(path)
    tables = read_tables(path, "The rover", "competition.toml")
    try:
        _check_names(tables, RoverVehicle, "the file")
        return msgspec.convert(tables, ensure_type_info(RoverVehicle))
    except msgspec.ValidationError as error:
        cause = error.__cause__
        if isinstance(cause, ParameterError):
            raise ParameterError(f"{path.name}: {cause.message}", fix=cause.fix) from error
        raise ParameterError(f"{path.name}: {error}.", fix="compare it with competition.toml.") from error
    except ParameterError as error:
        raise ParameterError(f"{path.name}: {error.message}", fix=error.fix) from error


def _check_names(table: Any, record: type, where: str) -> None:
    """Raise a ParameterError for a name that a record does not have; `msgspec.convert` would leave it out."""
    if not isinstance(table, dict):
        return  # msgspec's message says what is due
    kinds = get_type_hints(record)
    names = [field.name for field in fields(record)]
    for name, value in table.items():
        if name not in names:
            raise ParameterError(f"{where} has '{name}'.", fix=suggest(name, names))
        for kind in (kinds[name], *get_args(kinds[name])):
            if isinstance(kind, type) and is_dataclass(kind):
                for one in value if isinstance(value, list) else [value]:
                    _check_names(one, kind, name)
