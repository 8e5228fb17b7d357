"""Several roles at once, each in its own process: a role that fails ends the others, in order.

`supervision/child.py` starts the processes. A `LocalConsole` is rejected, because a role's process has no terminal.
Recorded roles (`program.record_roles`) have a trace each, `<run folder>/<role>/trace.jsonl`: there is no common order
of events.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import Any

from snr_sim.core.config import Config
from snr_sim.core.standard_streams import print_line
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.supervision.child import POLL_PERIOD_S, RoleProcesses
from snr_sim.supervision.role_process import RoleRun, run_role

# Time for roles to halt everything: after the request, and after the interrupt. A role that is stuck ends itself before
# that, and halts its loops: see `core/interrupts.py`.
GRACE_S = 4.0
SHORT_GRACE_S = 1.0


class MultiProcRunner:
    """Runner of several roles at once, each in its own process, until all have ended.

    The output of a role is forwarded line by line, with its name in front. If a role fails, by an exception or because
    its process dies, the others are shut down gracefully, and `run` raises: so the program's exit status is 1. Ctrl-C
    or SIGTERM shuts all down gracefully; a second one interrupts the roles that still run.

    Args:
        config: of the robot. Its factories are sent to a process: see `core/process/factory_pickling.py`.
        roles: all of the config's if not given.
        seed: of the run.
        ends_all: roles that end all others when they end, such as the one with the operator's `exit`. Without it the
            others continue, as nodes of a `SimRunner` do.
        run: runs one role, in its process: a function at the top level of a file.

    Raises:
        ConfigError: a role is unknown or named twice.
    """

    def __init__(
        self,
        config: Config,
        roles: Sequence[RoleName] | None = None,
        *,
        seed: int = 0,
        ends_all: Sequence[RoleName] = (),
        run: RoleRun = run_role,
    ) -> None:
        names = [roles] if isinstance(roles, str) else list(config.factories if roles is None else roles)
        self._processes = RoleProcesses(config, names, seed, run)
        for role in ends_all:
            config.get(role)
        self.roles: list[RoleName] = names
        self._ends_all = set(ends_all)
        self._overdue: set[RoleName] = set()
        self._failed: set[RoleName] = set()  # roles that reported their failure themselves
        self._failures: list[ComponentFailedError] = []
        self._signals = 0
        self._kill_at_s: float | None = None

    def run(self) -> None:
        """Run the roles until all have ended.

        Raises:
            ConfigError: an object cannot be sent to a process, so none was started; or it has run before.
            LinkError: a port is in use, so none was started.
            ComponentFailedError: a role failed; all others have been ended.
        """
        self._processes.run(self._begin, self._handle, self._do_due, type(self).__name__)
        if self._failures:
            raise self._failures[0]

    def _begin(self) -> None:
        for role in self.roles:
            self._processes.start(role)

    def _handle(self, what: str, *values: Any) -> None:
        if what == "signal":
            self._on_signal(values[0])
        elif what == "failed":
            self._on_failure(*values)
        else:
            self._on_end(*values)

    def _do_due(self) -> float:
        running = self._processes.running
        if self._kill_at_s is not None and time.monotonic() >= self._kill_at_s:
            self._kill_at_s = None
            self._overdue.update(running)
            for process in running.values():
                process.kill()
        return POLL_PERIOD_S if running else 0.0

    def _on_signal(self, name: str) -> None:
        self._signals += 1
        if self._signals == 1:
            self._end_all(name, GRACE_S)
        elif self._signals == 2:
            self._end_all("now", SHORT_GRACE_S)
        else:
            self._kill_at_s = time.monotonic()

    def _on_failure(self, role: RoleName, message: str, component: str) -> None:
        self._failed.add(role)
        if self._failures:
            message = f"{message}\n  in role '{role}', after another role had failed."
            print_line(sys.stderr, message)
        else:
            message = f"{message}\n  in role '{role}'; the other roles have been ended."
        self._failures.append(ComponentFailedError(message, f"{role}_node", component))
        self._end_all("SIGTERM", GRACE_S)

    def _on_end(self, role: RoleName, status: int) -> None:
        process, why = self._processes.ended(role, status)
        if role in self._overdue:
            self._on_failure(role, f"The process of role '{role}' did not end when it was asked, and was killed.", "")
        elif status and role not in self._failed and not process.is_killed:
            self._on_failure(role, why, "")
        elif role in self._ends_all:
            self._end_all("SIGTERM", GRACE_S)

    def _end_all(self, how: str, grace_s: float) -> None:
        for process in self._processes.running.values():
            process.end(how)
        kill_at_s = time.monotonic() + grace_s
        self._kill_at_s = kill_at_s if self._kill_at_s is None else min(self._kill_at_s, kill_at_s)
