"""Page `health` of supervised processes: what each part of the tree does, why it failed last, and what it uses."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from snr_sim.prelude.errors import RecordingError
from snr_sim.prelude.text import one_line
from snr_sim.recording.atomic_files import write_atomic
from snr_sim.supervision.members import Branch, Process, State
from snr_sim.supervision.tree import Tree

FILE_NAME = "health.json"
HEALTH = "health"  # key of the page
PERIOD_S = 0.5


class PartHealth(msgspec.Struct, frozen=True, kw_only=True):
    """Health of a supervisor or a process.

    Args:
        path: names from the root to it, with slashes.
        restarts: number of starts after the first.
        why: its last failure; empty before the first.
        pid: process id of its present or last instance.
        pet_age_s: time since its last report, while it is watched.
        timeout_s: time of silence after which it hangs, while it is watched.
        cpu_share: processor time between its last two reports, as a fraction of one core.
        rss_mb: its resident memory; None where there is no /proc.
        waiting: number of tasks that wait in its node.
        last_lines: that it printed on stderr, of an instance that has ended.
    """

    name: str
    path: str
    state: State
    restarts: int
    why: str
    pid: int | None = None
    pet_age_s: float | None = None
    timeout_s: float | None = None
    cpu_share: float | None = None
    rss_mb: float | None = None
    waiting: int | None = None
    last_lines: list[str] = []


class Health(msgspec.Struct, frozen=True, kw_only=True):
    """The page: all parts of the tree, a supervisor before its members.

    Args:
        supervisor_pid: process id of the supervisor; None in lock step, where there is none.
        is_degraded: whether a part does not work that should.
        is_safe_stop: whether the root has given up.
        why: the reason of the safe stop; empty without one.
        budget_left: how many failures more the root survives.
    """

    supervisor_pid: int | None
    tree: list[PartHealth]
    is_degraded: bool
    is_safe_stop: bool
    why: str
    budget_left: int

    def __post_init__(self) -> None:
        if self.supervisor_pid is not None and not 0 < self.supervisor_pid < 1 << 31:
            raise ValueError(f"no process has the id {self.supervisor_pid}")
        if not self.tree:
            raise ValueError("its tree has no part")


@dataclass
class Usage:
    """What a process has reported of itself, and its last lines."""

    pid: int | None = None
    cpu_share: float | None = None
    rss_mb: float | None = None
    waiting: int | None = None
    last_lines: Sequence[str] = ()
    _before: tuple[float, float] | None = field(default=None, repr=False)  # time, and processor time until then [s]

    def beat(self, now_s: float, cpu_s: float, rss_mb: float | None, waiting: int) -> None:
        """Note a report; see `Beats`."""
        if self._before is not None and now_s > self._before[0]:
            self.cpu_share = (cpu_s - self._before[1]) / (now_s - self._before[0])
        self._before = now_s, cpu_s
        self.rss_mb, self.waiting = rss_mb, waiting


def health_of(tree: Tree, usages: Mapping[str, Usage], now_s: float) -> Health:
    """Return the page.

    Args:
        tree: of the processes.
        usages: by process; one that is missing has reported nothing.
        now_s: present time of the tree's clock.
    """
    root = tree.root
    return Health(
        supervisor_pid=os.getpid(),
        tree=[_part_health(part, tree, usages.get(part.name, Usage()), now_s) for part in (root, *root.parts())],
        is_degraded=root.state not in ("running", "ended"),
        is_safe_stop=bool(tree.safe_stop),
        why=tree.safe_stop,
        budget_left=max(0, root.budget_left(now_s)),
    )


def _part_health(part: Branch | Process, tree: Tree, usage: Usage, now_s: float) -> PartHealth:
    deadline = tree.watch.deadlines.get(part.name)
    return PartHealth(
        name=part.name,
        path=part.path,
        state=part.state,
        restarts=part.restarts,
        why=part.why,
        pid=usage.pid,
        pet_age_s=None if deadline is None else now_s - deadline.last_pet_s,
        timeout_s=None if deadline is None else deadline.timeout_s,
        cpu_share=usage.cpu_share,
        rss_mb=usage.rss_mb,
        waiting=usage.waiting,
        last_lines=list(usage.last_lines),
    )


class HealthReports:
    """When a page is due: at each change of a state or a number of restarts, and every `PERIOD_S`.

    Attributes:
        usages: by process.
        changed: paths of the parts that had changed when the last page was made.
    """

    def __init__(self, tree: Tree) -> None:
        self.usages: dict[str, Usage] = {process.name: Usage() for process in tree.root.processes()}
        self.changed: set[str] = set()
        self._tree = tree
        self._states: dict[str, tuple[State, int]] = {}
        self._due_s = -math.inf

    def take(self, now_s: float) -> Health | None:
        """Return the page if it is due."""
        root = self._tree.root
        states = {part.path: (part.state, part.restarts) for part in (root, *root.parts())}
        self.changed = {path for path, state in states.items() if state != self._states.get(path)}
        if not self.changed and now_s < self._due_s:
            return None
        self._states, self._due_s = states, now_s + PERIOD_S
        return health_of(self._tree, self.usages, now_s)


def write_health(folder: Path, health: Health) -> None:
    """Write the page as `health.json`, whole or not at all."""
    write_atomic(folder / FILE_NAME, msgspec.json.format(msgspec.json.encode(health)) + b"\n")


def read_health(folder: Path) -> Health:
    """Return the page of a folder.

    Raises:
        RecordingError: there is no `health.json`, or it is not such a page.
    """
    path = folder / FILE_NAME
    if folder.is_file():
        raise RecordingError(f"{folder} is not a folder.", fix="name the run folder that it is in.")
    try:
        return _DECODER.decode(path.read_bytes())
    except FileNotFoundError:
        raise RecordingError(f"There is no {path}.", fix="name a run folder of snr processes, or HOST:PORT.") from None
    except (OSError, msgspec.MsgspecError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error


_DECODER = msgspec.json.Decoder(Health)
_HEAD = ("part", "state", "restarts", "pid", "silent", "CPU", "memory", "waiting", "last failure")


def health_table(health: Health) -> str:
    """Return the page as a table for a terminal, with a line on top that sums it up."""
    rows = [_HEAD, *(_row(part) for part in health.tree)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    if health.is_safe_stop:
        summary = f"safe stop: {one_line(health.why)}"
    elif health.tree[0].state == "ended":
        summary = "all have ended"
    else:
        state = "degraded" if health.is_degraded else "all that is to run is running"
        summary = f"{state}; failures until a safe stop: {health.budget_left + 1}"
    return "\n".join([summary, *lines])


def _row(part: PartHealth) -> tuple[str, ...]:
    is_silent = part.pet_age_s is not None and part.timeout_s is not None
    return (
        "  " * part.path.count("/") + one_line(part.name, 60),
        part.state,
        str(part.restarts),
        _cell(part.pid, "{}"),
        f"{part.pet_age_s:.1f} of {part.timeout_s:g} s" if is_silent else "-",
        _cell(part.cpu_share, "{:.0%}"),
        _cell(part.rss_mb, "{:.0f} MB"),
        _cell(part.waiting, "{}"),
        one_line(part.why, 100),
    )


def _cell(value: float | None, text: str) -> str:
    return "-" if value is None else text.format(value)
