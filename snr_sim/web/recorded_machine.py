"""A machine of a recorded run, for pages; the run may still continue in another process."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from snr_sim.behaviors.bridge import Bridge
from snr_sim.prelude.errors import TraceError
from snr_sim.web.explanation import Explanations
from snr_sim.web.messages import Hello, Program, Rights, State
from snr_sim.web.moments import Moments
from snr_sim.web.readings import parts_of
from snr_sim.web.timeline import RecordedTimeline

GROWTH_PERIOD_S = 0.2  # how often a trace is looked at that may grow


class RecordedMachine:
    """A machine of a run folder.

    Args:
        folder: of the run.
        name: of the machine; empty if there is one only.
        title: of the page.
        bridge: parts of the robot.
        is_trusted: whether the files of the run may be executed to explain it, also if they are not this user's.

    Raises:
        TraceError: the trace cannot be read.
        UnknownNameError: there is no such machine in it.
    """

    generation = 0

    def __init__(
        self, folder: Path, name: str, title: str, bridge: Bridge | None = None, *, is_trusted: bool = False
    ) -> None:
        self._timeline = RecordedTimeline(folder, name, bridge)
        try:
            self._timeline.read_all()
        except TraceError:
            self._timeline.close()
            raise
        self.name: str = self._timeline.name
        self.title: str = title
        self._bridge = bridge
        self.explanations: Explanations = Explanations(folder, is_trusted)
        self._read_s = -math.inf
        self._newest: State | None = None

    @property
    def moments(self) -> Moments:
        """All changes of state."""
        return self._timeline.moments

    def close(self) -> None:
        """Close the trace."""
        self._timeline.close()

    def hello(self, rights: Rights) -> Hello:
        """Return the first message of a connection."""
        program, until_s = self._timeline.newest_program, self._timeline.until_s
        return Hello(
            self.name, self.title, False, "look", False, program.number, program.sha256, program.text,
            program.files, program.graph, parts_of(self._bridge), program.signals, until_s, until_s,
        )  # fmt: skip

    def program(self, number: int) -> Program | None:
        """Return a program by its number."""
        return self._timeline.program(number)

    def update(self, now_s: float) -> None:
        """Read what has been recorded meanwhile, from time to time."""
        if now_s - self._read_s >= GROWTH_PERIOD_S and not self._timeline.read_some():
            self._read_s = now_s

    def newest(self) -> State:
        """Return the state at the end of what has been recorded."""
        until_s = self._timeline.until_s
        if self._newest is None or self._newest.t_s != until_s:
            self._newest = msgspec.structs.replace(self._timeline.state_at(until_s), is_live=True)
        return self._newest

    async def state_at(self, t_s: float) -> State:
        """Return the state at a moment of the run."""
        return self._timeline.state_at(t_s)
