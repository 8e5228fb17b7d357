"""Machines without a clock: they take a step when something happens, and an alarm is the only thing that waits.

signals, pages that conditions read --> MachineEndpoint --> page "<name>.alarm" --> AlarmLoop --> event "<name>.step"

The page has the time of the next step, for a time-out, a reading that becomes too old, or a command that is repeated.
So time-outs are exact, and a machine in which nothing happens leaves nothing in the trace.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

from snr_sim.behaviors.bridge import Bridge
from snr_sim.behaviors.program import Block, Problem, Program, ProgramError
from snr_sim.core.loop import NEVER_S, Loop, LoopFactory
from snr_sim.prelude import tasks
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import DataKey

NEXT_S = "next_s"  # in the page: None if nothing is to come
_FIX = "a time-out, such as (ontime 100 ...), or steps at a rate: step_hz=100."


class AlarmLoopFactory(LoopFactory):
    """Factory of the alarm of a machine: event "<name>.step" at the times in page "<name>.alarm"."""

    def __init__(self, name: str = "machine") -> None:
        super().__init__()
        self.name: str = name

    def get(self, parent: NodeApi) -> AlarmLoop:
        """Return the loop."""
        return AlarmLoop(self, parent, alarm_key(self.name))


class AlarmLoop(Loop):
    """Schedules one step at the time in the page of its own name, and waits for the next page."""

    factory: AlarmLoopFactory

    def __init__(self, factory: AlarmLoopFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.wakes_on: tuple[DataKey, ...] = (name,)
        self._answered_s: float | None = None  # a time is not given twice: it is after that of its page

    def loop(self) -> None:
        """Schedule the step if its time has come; else wait for it."""
        page = self.parent.get_page(self.name)
        next_s = None if page is None else page.data[NEXT_S]
        if next_s is not None and next_s != self._answered_s and next_s <= self.get_time_s():
            self._answered_s = next_s
            self.schedule(tasks.event(f"{self.factory.name}.step"))
        self.next_tick_at_s = NEVER_S if next_s in (None, self._answered_s) else next_s


class AlarmTime:
    """The time in the page of a machine's alarm. `is_stale`: something other than a page may have moved it."""

    def __init__(self) -> None:
        self._set_ns: int | None = -1  # no page has been stored
        self.is_stale: bool = True

    def must_move(self, next_ns: int | None, now_ns: int, *, is_new: bool) -> bool:
        """Return whether a page with the time of the next step has to be stored; it then counts as stored.

        A time that a reading has moved to a later one stays: it then causes a step in which nothing happens. Otherwise
        each reading would set the time at which it becomes too old.

        Args:
            next_ns: time of the next step; None if there is none.
            now_ns: the present.
            is_new: whether a state was entered.
        """
        before_ns, must_move = self._set_ns, self.is_stale or is_new
        self.is_stale = False
        is_ahead = before_ns is not None and now_ns < before_ns and (next_ns is None or before_ns < next_ns)
        if next_ns == before_ns or (is_ahead and not must_move):
            return False
        self._set_ns = next_ns
        return True


def alarm_key(name: str) -> DataKey:
    """Return the key of the page of a machine's alarm, which is also the name of the loop."""
    return f"{name}.alarm"


def check_needs_no_clock(program: Program) -> None:
    """Raise a ProgramError for what a machine does in each step, or asks in each step: there are no such steps."""
    found = [
        Problem(one.place, "A machine without a clock (step_hz=0) cannot execute (running ...) in each step.", _FIX)
        for _, spawn in program.walk()
        for state in spawn.machine.states
        for one in state.during
    ]
    found += [
        Problem(one.place, f"A machine without a clock (step_hz=0) has no steps in which {one.polls} changes.", _FIX)
        for one in conditions_of(program)
        if one.polls
    ]
    if found:
        raise ProgramError(sorted(dict.fromkeys(found), key=lambda one: (one.place.line, one.place.column)))


def pages_read(program: Program, bridge: Bridge | None) -> list[DataKey]:
    """Return the keys of the pages that conditions and time-outs of a program read."""
    parts = dict.fromkeys(part for one in conditions_of(program) for part in sorted(one.reads))
    return [] if bridge is None else list(dict.fromkeys(bridge.reads[part].page for part in parts))


def conditions_of(program: Program) -> Iterator[Block]:
    """Yield the blocks that decide: conditions and times of transitions, and conditions of rules."""
    arrows = chain.from_iterable(spawn.machine.transitions for _, spawn in program.walk())
    deciding = [one for arrow in arrows for one in (arrow.condition, arrow.after_ns)]
    yield from (one for one in [*deciding, *(rule.condition for rule in program.rules)] if isinstance(one, Block))
