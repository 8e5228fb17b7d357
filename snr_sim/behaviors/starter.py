"""The text of an LRP program to begin with: it names every part of a robot, and moves one."""

from __future__ import annotations

from collections.abc import Iterable

from snr_sim.behaviors.bridge import Bridge, Drive
from snr_sim.prelude.errors import ConfigError

_PROGRAM = """; {name}: a state machine for {robot}.
;
; Readings, by robot.PART.read(); None without a fresh one:
{reads}
; Commands, by robot.PART.start(VALUE), robot.PART.stop(), and robot.stop() for all parts:
{drives}
(machine {name}
  (event ready [robot.{reading}.read() is not None])
  (state waiting)
  (state moving
    (onentry [robot.{drive}.start({value:g})])
    (onexit [robot.stop()]))
  (state resting)
  (on ready waiting -> moving)
  (ontime 1000 moving -> resting)
  (ontime 2000 resting -> waiting))
(spawn {name} waiting)
"""


def starter_of(name: str, robot: str, bridge: Bridge) -> str:
    """Return a program for a robot.

    Args:
        name: of its machine.
        robot: its name.
        bridge: its parts.

    Raises:
        ConfigError: the robot has no part to read or none to command, or a page of the machine's name.
    """
    if not (bridge.reads and bridge.drives):
        raise ConfigError(f"Robot '{robot}' has no part to read, or none to command.", fix="add it to its bridge.py.")
    if name in bridge.keys:
        raise ConfigError(f"A page of robot '{robot}' is named '{name}'.", fix="choose another name.")
    drive, commanded = next(iter(bridge.drives.items()))
    return _PROGRAM.format(
        name=name,
        robot=robot,
        reads=_listed((part, one.unit) for part, one in bridge.reads.items()),
        drives=_listed((part, f"{one.low:g} to {one.high:g} {one.unit}") for part, one in bridge.drives.items()),
        reading=next(iter(bridge.reads)),
        drive=drive,
        value=_gentle(commanded),
    )


def _listed(parts: Iterable[tuple[str, str]]) -> str:
    return "\n".join(f";   {part:<14}{unit}".rstrip() for part, unit in parts)


def _gentle(drive: Drive) -> float:
    """Return a fifth of the way from neutral to the upper limit."""
    return drive.neutral + 0.2 * (drive.high - drive.neutral)
