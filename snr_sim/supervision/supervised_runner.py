"""Several roles at once, each in its own process, under a supervisor: what dies or hangs is started again.

    Supervisor, Child (plan.py)  -->  Tree (tree.py)  --orders-->  SupervisedRunner  -->  processes (child.py)
                                                      <--events--                    <--  beats.py, role_process.py

Each process reports that its node makes progress. One that is silent for `Timeouts.hang_s` is asked to end, killed if
it does not, and started again. Its outputs are neutral once it has halted, or once the lease of its last command is
over, whichever comes first; outputs without a lease in hardware need `devices/pwm/pwm_supervisor.py`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from pathlib import Path
from queue import Empty
from typing import Any

from snr_sim.core.config import Config
from snr_sim.core.standard_streams import print_line
from snr_sim.links.pipes import PipeLoopFactory
from snr_sim.prelude.errors import ConfigError, SupervisionError
from snr_sim.supervision.beats import beat_period_s
from snr_sim.supervision.child import PRINTED_NOTHING, RoleProcesses, signals_as
from snr_sim.supervision.health import Health, Usage, health_of, write_health
from snr_sim.supervision.members import State
from snr_sim.supervision.plan import Backoff, Child, Supervisor
from snr_sim.supervision.role_process import RoleRun, run_role
from snr_sim.supervision.tree import Order, Tree

POLL_PERIOD_S = 0.1
# If this program itself did not run for so long, the silence of the others in that time says nothing.
STALL_S = 1.0
_PRINTED_STATES = ("hung", "restarting", "failed")


class SupervisedRunner:
    """Runner of several roles at once, each in its own process, that starts again what fails.

    The output of a role is forwarded line by line, with its name in front. Ctrl-C or SIGTERM ends all, the last one
    first; a second one ends all at once, a third one kills.

    Args:
        config: of the robot. Its factories are sent to a process: see `core/process/factory_pickling.py`.
        plan: what is supervised; names of children are roles. All of the config's, each alone, if not given.
        seed: of the run.
        folder: that `health.json` is written to at every change, if given.
        backoff: delay of restarts.
        run: runs one role, in its process: a function at the top level of a file.

    Raises:
        ConfigError: a child is not a role of the config, or has a link over a pipe, which cannot be opened again.
    """

    def __init__(
        self,
        config: Config,
        plan: Supervisor | None = None,
        *,
        seed: int = 0,
        folder: str | Path | None = None,
        backoff: Backoff | None = None,
        run: RoleRun = run_role,
    ) -> None:
        self._tree: Tree = Tree(plan or Supervisor("root", [Child(role) for role in config.factories]), backoff)
        names = [process.name for process in self._tree.root.processes()]
        self._processes = RoleProcesses(config, names, seed, run)
        for name in names:
            if any(isinstance(factory, PipeLoopFactory) for factory in config.get(name)):
                raise ConfigError(
                    f"Role '{name}' has a link over a pipe, which cannot be opened again after a restart.",
                    fix="SocketsPair(('127.0.0.1', 0)) in place of PipesPair().",
                )
        self._usages = {name: Usage() for name in names}
        self._folder = None if folder is None else Path(folder)
        self._states: dict[str, tuple[State, int]] = {}
        self._checked_s = 0.0
        self._has_run = False

    def health(self) -> Health:
        """Return the page `health`."""
        return health_of(self._tree, self._usages, time.monotonic())

    def run(self) -> None:
        """Run the roles until all have ended for good.

        Raises:
            ConfigError: an object cannot be sent to a process, so none was started; or it has run before.
            LinkError: a port is in use, so none was started.
            SupervisionError: there was a safe stop, after more failures than the plan allows.
        """
        if self._has_run:
            raise ConfigError("This SupervisedRunner has already run.", fix="make a new one for a new run.")
        self._has_run = True
        with signals_as(self._processes.events):
            try:
                self._processes.prepare()
                self._checked_s = time.monotonic()
                self._execute(self._tree.begin(self._checked_s))
                self._processes.release()
                while not self._tree.is_over:
                    self._report_changes()
                    self._wait()
            finally:
                self._processes.kill_all()  # only if this program fails itself
                self._processes.release()
        self._report_changes()
        if self._tree.safe_stop:
            self._print_last_lines()
            raise SupervisionError(
                f"{self._tree.safe_stop}\nAll processes were ended, and with them every output.",
                fix="remove the cause of the last failure, or allow more restarts: Intensity(restarts=...).",
            )

    def _wait(self) -> None:
        try:
            event = self._processes.events.get(POLL_PERIOD_S)
            while True:  # all that has arrived, before silence is judged
                self._handle(*event)
                event = self._processes.events.get(0.0)
        except Empty:
            pass
        now_s = time.monotonic()
        if now_s - self._checked_s > STALL_S:
            self._tree.watch.reset(now_s)
            print_line(sys.stderr, f"note: the supervisor did not run for {now_s - self._checked_s:.1f} s.")
        self._checked_s = now_s
        self._execute(self._tree.tick(now_s))

    def _handle(self, what: str, name: str, *values: Any) -> None:
        now_s = time.monotonic()
        if what == "signal":
            self._execute(self._tree.stop(now_s))
        elif what == "beat":
            self._tree.petted(name, now_s)
            self._usages[name].beat(now_s, *values)
        elif what == "failed":
            self._tree.failed(name, values[0])
        elif what == "unsendable":
            self._tree.failed(name, str(values[0]))
            self._processes.running[name].kill()
        else:
            self._on_end(name, values[0], now_s)

    def _on_end(self, name: str, status: int, now_s: float) -> None:
        process = self._processes.ended(name)
        self._usages[name].last_lines = process.last_lines
        self._execute(self._tree.ended(name, status, process.exit_message(status, "", PRINTED_NOTHING), now_s))

    def _execute(self, orders: Iterable[Order]) -> None:
        for what, name in orders:
            if what == "start":
                timeouts = self._tree.process(name).child.timeouts
                process = self._processes.start(name, beat_period_s(timeouts.hang_s))
                self._usages[name] = Usage(process.pid, last_lines=self._usages[name].last_lines)
            elif what == "end":
                self._processes.running[name].end("SIGTERM")
            elif what == "kill":
                self._processes.running[name].kill()
            else:
                print_line(sys.stderr, f"safe stop: {self._tree.safe_stop}")

    def _report_changes(self) -> None:
        """Print what is wrong since the last call, and write `health.json` if anything has changed."""
        root = self._tree.root
        states = {part.path: (part.state, part.restarts) for part in (root, *root.parts())}
        if states == self._states:
            return
        for part in root.parts():
            if states[part.path] != self._states.get(part.path) and part.state in _PRINTED_STATES:
                print_line(sys.stderr, f"{part.path} is {part.state}: {part.why}")
        self._states = states
        if self._folder is not None:
            try:
                write_health(self._folder, self.health())
            except OSError as error:  # a robot must not stop because a disk is full
                print_line(sys.stderr, f"note: health.json cannot be written any more: {error}")
                self._folder = None

    def _print_last_lines(self) -> None:
        for name, usage in self._usages.items():
            if usage.last_lines:
                print_line(sys.stderr, "\n    ".join([f"Last lines of role '{name}':", *usage.last_lines]))
