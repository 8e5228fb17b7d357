"""State of the parts of a tree of supervised processes: `Branch` for a supervisor, `Process` for a child."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Literal, TypeAlias

from snr_sim.supervision.plan import Child, Supervisor

Life: TypeAlias = Literal["starting", "running", "hung", "ending", "ended", "failed"]
State: TypeAlias = Literal["starting", "running", "hung", "ending", "ended", "failed", "restarting", "degraded"]


class Member:
    """What supervisors and processes have in common.

    Attributes:
        parent: the supervisor above, None for the root.
        path: names from the root to here.
        restart_at_s: when it is started again; None if it is not waiting for that.
        restarts: number of starts after the first.
        streak: failures in a row, for the delay of the next restart.
        since_s: time of its last start.
        why: its last failure.
    """

    def __init__(self, name: str, parent: Branch | None) -> None:
        self.name: str = name
        self.parent: Branch | None = parent
        self.path: str = name if parent is None else f"{parent.path}/{name}"
        self.restart_at_s: float | None = None
        self.restarts: int = -1
        self.streak: int = 0
        self.since_s: float = 0.0
        self.why: str = ""

    @property
    def is_going_down(self) -> bool:
        """Whether a supervisor above is ending it."""
        branch = self.parent
        if branch is None:
            return False
        down_from = branch.down_from
        return (down_from is not None and self in branch.members[down_from:]) or branch.is_going_down


class Process(Member):
    """A process in the tree.

    Attributes:
        life: what it does.
        kill_at_s: when it is killed if it has not ended.
        has_failed: whether it has failed in its present life, by its own report or by a hang.
    """

    def __init__(self, child: Child, parent: Branch) -> None:
        super().__init__(child.name, parent)
        self.child: Child = child
        self.life: Life = "ended"
        self.kill_at_s: float | None = None
        self.has_failed: bool = False

    @property
    def is_up(self) -> bool:
        """Whether it has been started and has not ended."""
        return self.life not in ("ended", "failed")

    @property
    def is_waiting(self) -> bool:
        """Whether it is to be started again."""
        return self.restart_at_s is not None

    @property
    def state(self) -> State:
        """Its state, for the page `health`."""
        return "restarting" if self.is_waiting and not self.is_up else self.life


class Branch(Member):
    """A supervisor in the tree.

    Attributes:
        members: its children, in the order of their start.
        failures: time [s] and name of each failure of a member that its intensity counts.
        down_from: index of the first member that is to be down; None if all are to be up.
        is_failing: whether it ends its members because it has failed itself.
    """

    def __init__(self, supervisor: Supervisor, parent: Branch | None) -> None:
        super().__init__(supervisor.name, parent)
        self.supervisor: Supervisor = supervisor
        self.members: list[Branch | Process] = [
            Branch(child, self) if isinstance(child, Supervisor) else Process(child, self)
            for child in supervisor.children
        ]
        self.failures: deque[tuple[float, str]] = deque()
        self.down_from: int | None = None
        self.is_failing: bool = False

    @property
    def is_up(self) -> bool:
        """Whether one of its processes runs."""
        return any(member.is_up for member in self.members)

    @property
    def is_waiting(self) -> bool:
        """Whether it, or a part of it, is to be started again."""
        return self.restart_at_s is not None or any(member.is_waiting for member in self.members)

    @property
    def state(self) -> State:
        """Its state, for the page `health`: "degraded" if a part of it does not work."""
        if self.restart_at_s is not None:
            return "restarting"
        states = {member.state for member in self.members}
        if self.is_up or self.is_waiting:
            return "running" if states <= {"running", "ended"} else "degraded"
        return "failed" if "failed" in states else "ended"

    def parts(self) -> Iterator[Branch | Process]:
        """Yield everything below it, in the order of the start, a supervisor before its members."""
        for member in self.members:
            yield member
            if isinstance(member, Branch):
                yield from member.parts()

    def processes(self) -> Iterator[Process]:
        """Yield all processes below it, in the order of their start."""
        return (part for part in self.parts() if isinstance(part, Process))

    def budget_left(self, now_s: float) -> int:
        """Return how many failures more it survives."""
        intensity = self.supervisor.intensity
        while self.failures and now_s - self.failures[0][0] >= intensity.within_s:
            self.failures.popleft()
        return intensity.restarts - len(self.failures)

    def describe_failures(self, why: str) -> str:
        """Return a text on the counted failures; `why` is the reason of the last one."""
        names = " and ".join(dict.fromkeys(name for _, name in self.failures))
        count, span_s = len(self.failures), self.failures[-1][0] - self.failures[0][0]
        times = "once" if count == 1 else f"{count} times in {span_s:.0f} s"
        return f"{names} failed {times} ({self.supervisor.intensity}), last: {why}"

    def cancel_restarts(self) -> None:
        """Drop the pending restarts of everything below it."""
        for part in self.parts():
            part.restart_at_s = None

    def forget_end(self) -> None:
        """Drop what it and all supervisors below were ending themselves: a supervisor above has ended all of it."""
        self.down_from, self.is_failing = None, False
        for member in self.members:
            if isinstance(member, Branch):
                member.forget_end()
