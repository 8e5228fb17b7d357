"""What an LRP program sees of its robot: parts to read and parts to command, by names of the robot's own.

    page --> Read --> robot.range.read()          robot.motor.start(50) --> Drive --> page

Five functions are enough for every robot: a large interface was what cost people most time in the experiment of
Campusano, Fabry and Bergel, "Live programming in practice: A controlled experiment on state machines for robotic
behaviors" (Information and Software Technology 108, 2019).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from keyword import iskeyword
from typing import Any

from snr_sim.behaviors.context import Owner
from snr_sim.prelude.errors import ConfigError, ParameterError
from snr_sim.prelude.task import DataKey, Task

READ_FUNCTIONS = frozenset({"read", "age_ms", "read_since_entry"})
DRIVE_FUNCTIONS = frozenset({"start", "stop"})
# Ages are differences of times, and rounded. A reading of the moment in which a state is entered is what caused it.
SAME_MOMENT_S = 1e-6


@dataclass(frozen=True)
class Read:
    """A part that can be read.

    Args:
        page: key of its page.
        field: of the page's data; empty if the data are the value.
        to: converts the value to the unit that programs use.
        unit: that unit.
        fresh_s: a reading that is older is not given.
        low, high: what can be read, in that unit: for random tests.
    """

    page: DataKey
    field: str = ""
    to: Callable[[Any], Any] | None = None
    unit: str = ""
    fresh_s: float = math.inf
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True)
class Drive:
    """A part that can be commanded.

    Args:
        page: key of its page.
        field: of the page's data.
        low, high: limits, to which commands are clamped.
        neutral: the command of `stop()`.
        to: converts a command to what the page contains.
        unit: of commands.
        repeat_s: a command that is not neutral is stored again when its page is so old, for an actuator that takes a
            command for a limited time. None: never.
    """

    page: DataKey
    field: str
    low: float
    high: float
    neutral: float = 0.0
    to: Callable[[float], Any] | None = None
    unit: str = ""
    repeat_s: float | None = None


@dataclass(frozen=True)
class Bridge:
    """The parts of a robot, by name. A name may be in both tables.

    Args:
        reads, drives: the parts.
        pages: for a command page that has more than its commands: makes its data, from the commands by field and from
            how often the page has been stored.

    Raises:
        ConfigError: a name is not one of Python's, or is one of Robot's own.
    """

    reads: Mapping[str, Read] = field(default_factory=dict)
    drives: Mapping[str, Drive] = field(default_factory=dict)
    pages: Mapping[DataKey, Callable[[dict[str, Any], int], Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in (*self.reads, *self.drives):
            if not name.isidentifier() or iskeyword(name) or name.startswith("_") or hasattr(Robot, name):
                raise ConfigError(f"A part of a robot cannot be named '{name}'.", fix="letters, digits and '_'.")

    @property
    def keys(self) -> set[DataKey]:
        """The keys of its pages."""
        return {one.page for one in self.reads.values()} | {one.page for one in self.drives.values()}

    @property
    def parts(self) -> dict[str, frozenset[str]]:
        """The functions of each part."""
        found = dict.fromkeys(self.reads, READ_FUNCTIONS)
        for name in self.drives:
            found[name] = found.get(name, frozenset()) | DRIVE_FUNCTIONS
        return found


class Robot:
    """The robot in a program: an attribute for each part, and `stop()`.

    Commands are kept until `take_tasks`, one page for all that are on it, so what a block commanded can be undone.

    Args:
        bridge: its parts.
        owner: the component that reads and stores pages.
        in_state_s: returns the time since the state was entered whose block is executed.
    """

    def __init__(self, bridge: Bridge, owner: Owner, in_state_s: Callable[[], float]) -> None:
        self._owner = owner
        self._reads, self._drives = bridge.reads, dict(bridge.drives)
        self._pages = bridge.pages
        self._stored: dict[DataKey, int] = {}
        self._commands = {name: drive.neutral for name, drive in self._drives.items()}
        self._changed: dict[DataKey, None] = {}  # pages to store, in order of their first command
        self._used: dict[DataKey, None] = {}  # pages that have been stored at all
        self._is_held = False
        self._marked = self._commands, self._changed
        for name in bridge.parts:
            setattr(self, name, Part(self, name, bridge.reads.get(name), owner, in_state_s))

    def command(self, name: str, value: Any) -> None:
        """Command a part.

        Raises:
            ParameterError: the value is not a number.
        """
        if not isinstance(value, (int, float)) or value != value:
            raise ParameterError(
                f"robot.{name}.start() was given {value!r:.80}.", fix=f"a number, such as robot.{name}.start(1.0)."
            )
        drive = self._drives[name]
        self._commands[name] = drive.low if value <= drive.low else drive.high if value >= drive.high else float(value)
        self._changed[drive.page] = None

    def stop(self, *names: str) -> None:
        """Command neutral to parts; to all, if none is named."""
        for name in names or self._drives:
            self.command(name, self._drives[name].neutral)

    def mark(self) -> None:
        """Set the state to which `undo` returns."""
        self._marked = dict(self._commands), dict(self._changed)

    def undo(self) -> None:
        """Forget what was commanded since `mark`."""
        commands, changed = self._marked
        self._commands, self._changed = dict(commands), dict(changed)

    def hold(self, *, is_held: bool) -> list[Task]:
        """Keep all parts at neutral, whatever they are commanded, until they are released; return the tasks for it."""
        self._is_held = is_held
        self._changed |= dict.fromkeys(drive.page for drive in self._drives.values())
        return self.take_tasks()

    def snapshot(self) -> dict[str, Any]:
        """Return what is commanded, and what was stored, as JSON values."""
        return {
            "commands": dict(self._commands), "stored": dict(self._stored), "used": list(self._used),
            "changed": list(self._changed), "is_held": self._is_held,
        }  # fmt: skip

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Continue from a snapshot."""
        self._commands, self._stored = dict(snapshot["commands"]), dict(snapshot["stored"])
        self._used, self._changed = dict.fromkeys(snapshot["used"]), dict.fromkeys(snapshot["changed"])
        self._is_held = snapshot["is_held"]

    def take_tasks(self) -> list[Task]:
        """Return the tasks that store what was commanded since the last call, and what repeats."""
        pages = dict(self._changed)
        self._used |= pages
        for name, drive in self._drives.items():
            if drive.repeat_s is None or drive.page not in self._used or drive.page in pages or self._is_held:
                continue
            if self._commands[name] != drive.neutral and self._owner.get_age_s(drive.page) >= drive.repeat_s:
                pages[drive.page] = None
        self._changed = {}
        return [self._owner.store_data_task(page, self._data(page)) for page in pages]

    def next_s(self, parts: Iterable[str]) -> float:
        """Return in what time one of the parts has no fresh reading, or a command is due again; infinite if never."""
        reads = [self._reads[part] for part in parts if self._reads[part].fresh_s < math.inf]
        delays = [one.fresh_s - self._owner.get_age_s(one.page) for one in reads]
        for name, drive in self._drives.items():
            if drive.repeat_s is None or self._is_held or self._commands[name] == drive.neutral:
                continue
            # One that was due has just been stored: see `take_tasks`.
            age_s = self._owner.get_age_s(drive.page)
            delays.append(drive.repeat_s - (age_s if age_s < drive.repeat_s else 0.0))
        return min((one + SAME_MOMENT_S for one in delays if one >= 0.0), default=math.inf)

    def _data(self, page: DataKey) -> Any:
        data = {}
        for name, drive in self._drives.items():
            if drive.page == page:
                command = drive.neutral if self._is_held else self._commands[name]
                data[drive.field] = command if drive.to is None else drive.to(command)
        if page not in self._pages:
            return data
        self._stored[page] = self._stored.get(page, 0) + 1
        return self._pages[page](data, self._stored[page])


class Part:
    """A part of the robot in a program. One that is only commanded has no `reads`, and no text can read it."""

    def __init__(self, robot: Robot, name: str, reads: Any, owner: Owner, in_state_s: Callable[[], float]) -> None:
        self._robot, self._name, self._reads = robot, name, reads
        self._owner, self._in_state_s, self._get_data = owner, in_state_s, owner.get_data

    def read(self) -> Any:
        """Return the newest value; None if there is none, or if it is too old."""
        reads: Read = self._reads
        value = self._get_data(reads.page)
        if value is None or (reads.fresh_s != math.inf and self._owner.get_age_s(reads.page) > reads.fresh_s):
            return None
        if reads.field:
            value = value[reads.field]
        return value if value is None or reads.to is None else reads.to(value)

    def age_ms(self) -> float:
        """Return how old the newest value is [ms]; infinite if there is none."""
        return 1000.0 * self._owner.get_age_s(self._reads.page)

    def read_since_entry(self) -> Any:
        """Return the newest value if it was made after the state was entered, otherwise None."""
        is_new = self._owner.get_age_s(self._reads.page) < self._in_state_s() - SAME_MOMENT_S
        return self.read() if is_new else None

    def start(self, value: float) -> None:
        """Command the part; the value is clamped to its limits."""
        self._robot.command(self._name, value)

    def stop(self) -> None:
        """Command neutral."""
        self._robot.stop(self._name)
