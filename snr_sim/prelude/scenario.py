"""Interfaces of robot and scenario files, and the small records that they exchange with a run.

A scenario is one file (`scenarios/<name>.py`); a robot is a folder (`robots/<name>/robot.py`). Both are ordinary
Python modules found by path; the library does not contain their names. It requires:

    scenario file                                       robot.py
      ROBOT: str                 robot's name             ROLES: tuple[str, ...]
      ENGINES: tuple[str, ...]   first is the default     IO: tuple[str, ...]     rows of its device table
      CONTROLLER: str            used unless one is named roles(rig, controller) -> {role: [factory, ...]}
      TIME_LIMIT_S: float
      parameters(seed) -> object handed to controllers    controllers/<name>.py, or any file:
      plant(seed, engine) -> Plant, already reset           factories(robot) -> [factory, ...]
      verdict(plant) -> Verdict | None (None: run continues)
      metrics(plant, seed) -> dict, into result.json

A controller has components for the robot's first role, unless it lists roles: ROLES = ("topside",). Then factories is
called once for each of them, with `robot.role`; a first role that is not listed gets the scenario's CONTROLLER.

robot.py may also have `dressed(rig) -> Plant`: the plant to step in place of the scenario's (`rig.plant`), for a row
of the device table that puts a part between devices and plant, such as an emulated board; otherwise it returns
`rig.plant`.

A controller may also have `start_lines(robot) -> [text, ...]`: information for the user who starts a run, such as the
robot's automatic reactions to failures; `snr run` prints it.

robot.py and a controller may also have OPTIONS, a dict from each key that they read in `options` to a line of help.
With OPTIONS in robot.py, any other `--option` is refused before the run; without, any key is allowed. A scenario reads
no options.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from snr_sim.prelude.component import Factory
from snr_sim.prelude.page import Page
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.rng import rng_for

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Verdict:
    """How a run ended.

    Args:
        outcome: one word for result.json, such as 'landed' or 'crashed'.
        success: whether the scenario's criterion was met.
        why: what was against it, in words for a note: which limit was passed, and by what number.
    """

    outcome: str
    success: bool
    why: str = ""


@dataclass(frozen=True)
class Robot:
    """What a controller file may know: never the plant.

    Args:
        name: the robot's name.
        role: the role the controller will run in.
        scenario: the scenario's name.
        engine: the physics engine's name.
        parameters: the robot's own numbers in this scenario, from the scenario's `parameters(seed)`.
        options: what the command line passed on to the controller.
    """

    name: str
    role: str
    scenario: str
    engine: str
    parameters: Any
    options: dict[str, str]


@dataclass(frozen=True)
class Rig:
    """What a robot file needs to wire itself up.

    Args:
        robot: as above.
        io: which row of the device table to use; 'sim' is the plant.
        seed: the run's seed.
        plant: the simulated body; None when there is none: all devices are real, or it is a replay, where none is ever
            opened.
        where: what follows `io` on the command line: a port, a bus and an address (`prelude/io.py`).
        clock_s: the clock of the run, which devices stamp by; the plant's time if not given.
        shared: what several devices share, such as the board that they are on; see `share`.
        recorded: gives the pages that a sensor stored in the run that `where` names, for `--io replay:RUN`.
        role_apart: the role that runs by itself, its links reaching other processes; empty if all meet in this one.
        crew: what the controller has for other roles than the robot's first; robot.py says where that stands.
    """

    robot: Robot
    io: str
    seed: int
    plant: Plant | None
    where: str = ""
    clock_s: Callable[[], float] | None = None
    shared: dict[str, Any] = field(default_factory=dict)
    recorded: Callable[[str], Sequence[Page]] | None = None
    role_apart: str = ""
    crew: Mapping[str, Sequence[Factory]] = field(default_factory=dict)

    def share(self, name: str, make: Callable[[], Any]) -> Any:
        """Return what several devices of this run share: made when it is asked for first. For several threads."""
        return self.shared[name] if name in self.shared else self.shared.setdefault(name, make())

    def now_s(self) -> float:
        """Return the time of the run, which devices stamp by."""
        if self.clock_s is not None:
            return self.clock_s()
        return 0.0 if self.plant is None else self.plant.time_s

    def rng(self, name: str) -> np.random.Generator:
        """Return the generator for the chance in one device."""
        return rng_for(self.seed, f"device:{name}")
