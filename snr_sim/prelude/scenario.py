"""Interfaces of robot and scenario files, and the small records that they exchange with a run.

A scenario is one file (`scenarios/<name>.py`); a robot is a folder (`robots/<name>/robot.py`). Both are ordinary
Python modules found by path; the library does not contain their names. It requires:

    scenario file                                       robot.py
      ROBOT: str                 robot's name             ROLES: tuple[str, ...]
      ENGINES: tuple[str, ...]   first is the default     IO: tuple[str, ...]     rows of its device table
      CONTROLLER: str            used unless one is named roles(context, controller) -> {role: [factory, ...]}
      TIME_LIMIT_S: float
      parameters(seed) -> object handed to controllers    controllers/<name>.py, or any file:
      plant(seed, engine) -> Plant, already reset           factories(robot) -> [factory, ...]
      verdict(plant) -> Verdict | None (None: run continues)
      metrics(plant, seed) -> dict, into result.json

A controller has components for the robot's first role, unless it lists roles: ROLES = ("topside",). Then factories is
called once for each of them, with `robot.role`; a first role that is not listed gets the scenario's CONTROLLER.

A scenario without a pilot may list the roles that run in it: ROLES = ("rover",). Otherwise all of the robot's do.

robot.py may have `wrap_plant(context) -> Plant`: the plant to step in place of the scenario's
(`context.plant`), for a row of the device table that puts a part between devices and plant, such as an emulated
board; otherwise it returns `context.plant`.

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
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.task import Page

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True)
class Verdict:
    """Result of a scenario.

    Args:
        outcome: one word for result.json, such as 'landed' or 'crashed'.
        success: whether the scenario's criterion was met.
        reason: of a failure, as text: which limit was exceeded, and the value.
    """

    outcome: str
    success: bool
    reason: str = ""


@dataclass(frozen=True)
class RobotInfo:
    """Information for a controller file: never the plant.

    Args:
        name, scenario, engine: names of the robot, the scenario and the physics engine.
        role: the role the controller will run in.
        parameters: the robot's own numbers in this scenario, from the scenario's `parameters(seed)`.
        options: options of the command line for the controller.
    """

    name: str
    role: str
    scenario: str
    engine: str
    parameters: Any
    options: dict[str, str]


@dataclass(frozen=True)
class RobotContext:
    """Context that a robot file uses to create its components.

    Args:
        robot: as above.
        io: row of the device table; 'sim' is the plant.
        seed: the run's seed.
        plant: the simulated body; None if there is none: all devices are real, or it is a replay, which opens no
            devices.
        address: text after `io` on the command line: a port, a bus and an address (`prelude/io.py`).
        clock_s: the run's clock, which stamps devices' readings; the plant's time if not given.
        shared: objects that several devices share, such as their board; see `get_or_create`.
        recorded: returns the pages that a sensor stored in the run that `address` names, for `--io replay:RUN`.
        standalone_role: the role that runs alone, linked to other processes; empty if all roles run in this process.
        extra_components: the controller's components for roles other than the robot's first; robot.py adds them to
            its roles.
    """

    robot: RobotInfo
    io: str
    seed: int
    plant: Plant | None
    address: str = ""
    clock_s: Callable[[], float] | None = None
    shared: dict[str, Any] = field(default_factory=dict)
    recorded: Callable[[str], Sequence[Page]] | None = None
    standalone_role: str = ""
    extra_components: Mapping[str, Sequence[Factory]] = field(default_factory=dict)

    def get_or_create(self, name: str, make: Callable[[], Any]) -> Any:
        """Return an object that several devices of this run share, created at the first call. Thread-safe."""
        return self.shared[name] if name in self.shared else self.shared.setdefault(name, make())

    def now_s(self) -> float:
        """Return the time of the run, which stamps devices' readings."""
        if self.clock_s is not None:
            return self.clock_s()
        return 0.0 if self.plant is None else self.plant.time_s

    def rng(self, name: str) -> np.random.Generator:
        """Return the random generator of a device."""
        return rng_for(self.seed, f"device:{name}")
