"""Several roles at once, each in its own process, under a supervisor: what dies or hangs is started again.

    Supervisor, Child (plan.py)  -->  Tree (tree.py)  --orders-->  SupervisedRunner  -->  processes (child.py)
                                                      <--events--                    <--  beats.py, role_process.py

Each process reports that its node makes progress. One that is silent for `Timeouts.hang_s` is asked to end, killed if
it does not, and started again. Its outputs are neutral once it has halted, or once the lease of its last command is
over, whichever comes first; outputs without a lease in hardware need `devices/pwm/pwm_supervisor.py`. If the
supervisor itself ends, its processes read the end of their lines, and end; under systemd it is then started again.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec

from snr_sim.core.config import Config
from snr_sim.core.standard_streams import print_line
from snr_sim.links.pipes import PipeLoopFactory
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError, SupervisionError
from snr_sim.supervision.beats import beat_period_s
from snr_sim.supervision.child import IDLE_PERIOD_S, POLL_PERIOD_S, RoleProcesses
from snr_sim.supervision.health import HEALTH, Health, HealthReports, Usage, health_of, write_health
from snr_sim.supervision.plan import Backoff, Child, Supervisor
from snr_sim.supervision.role_process import RoleRun, run_role
from snr_sim.supervision.systemd import SystemdReports
from snr_sim.supervision.tree import Order, Tree

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
        health_to: role whose node gets the page `health`, at every change and twice a second, if given.
        backoff: delay of restarts.
        run: runs one role, in its process: a function at the top level of a file.

    Raises:
        ConfigError: a child is not a role of the config, or has a link over a pipe, which cannot be opened again.
        UnknownNameError: `health_to` is not supervised.
    """

    def __init__(
        self,
        config: Config,
        plan: Supervisor | None = None,
        *,
        seed: int = 0,
        folder: str | Path | None = None,
        health_to: RoleName = "",
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
        if health_to:
            self._tree.process(health_to)
        self._folder = None if folder is None else Path(folder)
        self._health_to = health_to
        self._reports = HealthReports(self._tree)
        self._systemd = SystemdReports()
        self._checked_s = 0.0

    def health(self) -> Health:
        """Return the page `health`."""
        return health_of(self._tree, self._reports.usages, time.monotonic())

    def run(self) -> None:
        """Run the roles until all have ended for good.

        Raises:
            ConfigError: an object cannot be sent to a process, so none was started; or it has run before.
            LinkError: a port is in use, so none was started.
            SupervisionError: there was a safe stop, after more failures than the plan allows.
        """
        self._processes.run(self._begin, self._handle, self._do_due, type(self).__name__)
        if self._tree.safe_stop:
            self._print_last_lines()
            raise SupervisionError(
                f"{self._tree.safe_stop}\nAll processes were ended, and with them every output.",
                fix="remove the cause of the last failure, or allow more restarts: Intensity(restarts=...).",
            )

    def _begin(self) -> None:
        self._checked_s = time.monotonic()
        self._execute(self._tree.begin(self._checked_s))

    def _do_due(self) -> float:
        now_s = time.monotonic()
        if now_s - self._checked_s > STALL_S:
            self._tree.watch.reset(now_s)
            print_line(sys.stderr, f"note: the supervisor did not run for {now_s - self._checked_s:.1f} s.")
        self._checked_s = now_s
        self._execute(self._tree.tick(now_s))
        self._report(now_s)
        is_working = self._tree.root.state == "running"
        self._systemd.report(is_working, self._tree.is_stopping, now_s)
        if self._tree.is_over:
            return 0.0
        return IDLE_PERIOD_S if is_working else POLL_PERIOD_S

    def _handle(self, what: str, name: str, *values: Any) -> None:
        now_s = time.monotonic()
        if what == "signal":
            self._execute(self._tree.stop(now_s))
        elif what == "beat":
            self._tree.petted(name, now_s)
            self._reports.usages[name].beat(now_s, *values)
        elif what == "failed":
            self._tree.failed(name, values[0])
        else:
            self._on_end(name, values[0], now_s)

    def _on_end(self, name: str, status: int, now_s: float) -> None:
        process, why = self._processes.ended(name, status)
        self._reports.usages[name].last_lines = process.last_lines
        self._execute(self._tree.ended(name, status, why, now_s))

    def _execute(self, orders: Iterable[Order]) -> None:
        for what, name in orders:
            if what == "start":
                timeouts = self._tree.process(name).child.timeouts
                process = self._processes.start(name, beat_period_s(timeouts.hang_s))
                usages = self._reports.usages
                usages[name] = Usage(process.pid, last_lines=usages[name].last_lines)
            elif what == "end":
                self._processes.running[name].end("SIGTERM")
            elif what == "kill":
                self._processes.running[name].kill()
            else:
                print_line(sys.stderr, f"safe stop: {self._tree.safe_stop}")

    def _report(self, now_s: float) -> None:
        """Print what has begun to be wrong, write `health.json` if anything has changed, and send the page."""
        health = self._reports.take(now_s)
        if health is None:
            return
        for part in health.tree[1:]:
            if part.path in self._reports.changed and part.state in _PRINTED_STATES:
                print_line(sys.stderr, f"{part.path} is {part.state}: {part.why}")
        process = self._processes.running.get(self._health_to)
        if process is not None:
            process.send((HEALTH, HEALTH, msgspec.to_builtins(health)))
        if self._folder is not None and self._reports.changed:
            try:
                write_health(self._folder, health)
            except OSError as error:  # a robot must not stop because a disk is full
                print_line(sys.stderr, f"note: health.json cannot be written any more: {error}")
                self._folder = None

    def _print_last_lines(self) -> None:
        for name, usage in self._reports.usages.items():
            if usage.last_lines:
                print_line(sys.stderr, "\n    ".join([f"Last lines of role '{name}':", *usage.last_lines]))
