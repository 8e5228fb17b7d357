"""Tree of supervised processes, without a process and without a clock: events go in, orders come out.

    supervision/supervised_runner.py                             this module
    a process reports, fails, ends; time passes   --events-->    petted, failed, ended, tick, stop
    starts, asks to end, kills a process          <--orders--    "start", "end", "kill", "safe stop"

A child that fails is started again after a delay. A supervisor whose children fail more often than its intensity
allows ends them, last one first, and fails as a child of its own parent, which starts all of it again. If that
happens to the root, there is a safe stop: all processes are ended, last one first, and none is started again.

A process has one instance at a time: it is started again only after it has ended. What fails while it is being ended
is not counted. A hang is one failure: the process is asked to end, and killed if it does not.
"""

from __future__ import annotations

import signal
from typing import Literal, NamedTuple

from snr_sim.prelude.errors import UnknownNameError, suggest
from snr_sim.supervision.members import Branch, Process
from snr_sim.supervision.plan import Backoff, Supervisor
from snr_sim.supervision.watch import Watch


class Order(NamedTuple):
    """What the owner of the processes does next; `name` is the process, empty for a safe stop."""

    what: Literal["start", "end", "kill", "safe stop"]
    name: str


class Tree:
    """State of supervised processes. Each event returns the orders that follow from it; times are of one clock [s].

    Attributes:
        root: the supervisor at the top.
        watch: deadlines of the processes that start or run.
        safe_stop: why there was a safe stop; empty without one. It is never cleared.
        is_stopping: whether all are being ended, so that nothing is started again.
    """

    def __init__(self, plan: Supervisor, backoff: Backoff | None = None) -> None:
        self.root: Branch = Branch(plan, None)
        self.watch: Watch = Watch()
        self.safe_stop: str = ""
        self.is_stopping: bool = False
        self._backoff = backoff or Backoff()
        self._processes = {process.name: process for process in self.root.processes()}
        self._orders: list[Order] = []
        self._stop_requests = 0

    @property
    def is_over(self) -> bool:
        """Whether no process runs or will be started."""
        return not self.root.is_up and not self.root.is_waiting

    def process(self, name: str) -> Process:
        """Return a process; raise an UnknownNameError for any other name."""
        try:
            return self._processes[name]
        except KeyError:
            raise UnknownNameError(f"'{name}' is not supervised.", fix=suggest(name, self._processes)) from None

    # Events

    def begin(self, now_s: float) -> list[Order]:
        """Start all processes, in order."""
        self._start(self.root, now_s)
        return self._settle(now_s)

    def petted(self, name: str, now_s: float) -> None:
        """Note that a process works; with its first report it has started."""
        process = self.process(name)
        if process.life == "starting":
            process.life = "running"
            self.watch.add(name, process.child.timeouts.hang_s, now_s)
        elif process.life == "running":
            self.watch.pet(name, now_s)

    def failed(self, name: str, why: str) -> None:
        """Note why a process fails, which will end; its first report counts."""
        process = self.process(name)
        if not process.has_failed:
            process.has_failed, process.why = True, why

    def ended(self, name: str, status: int, why: str, now_s: float) -> list[Order]:
        """Note that a process has ended.

        Args:
            status: its exit status, not 0 for a failure.
            why: reason of a failure that it has not reported itself.
        """
        process = self.process(name)
        is_asked = process.life == "ending" or process.is_going_down
        self._unwatch(process)
        if status and not (is_asked and status == -signal.SIGKILL):  # a process that has not begun is killed to end it
            self.failed(name, why)
        process.life, process.kill_at_s = "failed" if process.has_failed else "ended", None
        restart = process.child.restart
        if not is_asked and process.child.ends_all and not process.has_failed:
            self._stop()
        elif not is_asked and (restart == "always" or (restart == "on_failure" and process.has_failed)):
            self._member_failed(process, process.why if process.has_failed else "it ended by itself", now_s)
        return self._settle(now_s)

    def tick(self, now_s: float) -> list[Order]:
        """Note that time has passed: end what hangs, kill what does not end, start what is due.

        Raises:
            SupervisionError: the table of deadlines is corrupt.
        """
        for name in self.watch.get_hanging(now_s):
            process = self.process(name)
            silence = f"for {now_s - self.watch.deadlines[name].last_pet_s:.1f} s"
            has_begun = process.life == "running"
            self.failed(name, f"it hung: no report {silence}" if has_begun else f"it had not begun {silence}")
            self._ask_to_end(process, "hung", now_s)
        for process in self._processes.values():
            if process.kill_at_s is not None and process.kill_at_s <= now_s:
                self.failed(process.name, f"it did not end within {process.child.timeouts.end_s:g} s, and was killed")
                self._kill(process)
        return self._settle(now_s)

    def stop(self, now_s: float) -> list[Order]:
        """End all processes, last one first. The second request asks all at once; the third kills them."""
        self._stop_requests += 1
        self._stop()
        for process in self._processes.values():
            if process.is_up and self._stop_requests > 1:
                self._ask_to_end(process, "ending", now_s)
            if process.is_up and self._stop_requests > 2:
                self._kill(process)
        return self._settle(now_s)

    # What follows from them

    def _member_failed(self, member: Process | Branch, why: str, now_s: float) -> None:
        """Schedule the restart of a member that is down, or let its supervisor fail."""
        member.why, branch = why, member.parent
        assert branch is not None  # the root does not fail: there is a safe stop
        left = branch.budget_left(now_s)
        branch.failures.append((now_s, member.name))
        if left <= 0:
            branch.why = branch.describe_failures(why)
            branch.down_from, branch.is_failing = 0, branch.parent is not None
            branch.cancel_restarts()
            if branch.parent is None:
                self.safe_stop = branch.why
                self._orders.append(Order("safe stop", ""))
                self._stop()
            return
        if now_s - member.since_s >= self._backoff.healthy_s:
            member.streak = 0
        member.restart_at_s = now_s + self._backoff.delay_s(member.streak)
        member.streak += 1
        if branch.supervisor.strategy == "rest_for_one":
            self._restart_rest(branch, branch.members.index(member))

    def _restart_rest(self, branch: Branch, index: int) -> None:
        """Let the members after a failed one go down and start again after it; not those that have ended for good."""
        branch.down_from = index if branch.down_from is None else min(branch.down_from, index)
        at_s = branch.members[index].restart_at_s or 0.0
        for member in branch.members[index + 1 :]:
            is_required = member.is_up or member.is_waiting
            if isinstance(member, Branch):
                member.cancel_restarts()
            elif member.child.restart == "never":
                is_required = False
            at_s = max(at_s, member.restart_at_s or 0.0)  # so that the order of the start is kept
            member.restart_at_s = at_s if is_required else None

    def _settle(self, now_s: float) -> list[Order]:
        """Carry on what is due, and return the orders."""
        self._carry_on(self.root, now_s)
        orders, self._orders = self._orders, []
        return orders

    def _carry_on(self, branch: Branch, now_s: float) -> None:
        """Carry on the end of the members that are to be down; once they are, start what is due."""
        kept = branch.members if branch.down_from is None else branch.members[: branch.down_from]
        for member in kept:  # what is to be down waits for its turn, also if it was ending a part of itself
            if isinstance(member, Branch):
                self._carry_on(member, now_s)
        if branch.down_from is not None:
            up = [member for member in branch.members[branch.down_from :] if member.is_up]
            if up:
                self._end(up[-1], now_s)
                return
            for member in branch.members[branch.down_from :]:
                if isinstance(member, Branch):
                    member.forget_end()
            branch.down_from = None
            if branch.is_failing:
                branch.is_failing = False
                self._member_failed(branch, branch.why, now_s)
                return
        for member in branch.members:
            if member.restart_at_s is not None and member.restart_at_s <= now_s:
                self._start(member, now_s)

    def _start(self, member: Process | Branch, now_s: float) -> None:
        member.restart_at_s, member.since_s = None, now_s
        member.restarts += 1
        if isinstance(member, Branch):
            member.failures.clear()
            for one in member.members:
                self._start(one, now_s)
            return
        member.life, member.has_failed = "starting", False
        self.watch.add(member.name, member.child.timeouts.setup_s, now_s)
        self._orders.append(Order("start", member.name))

    def _end(self, member: Process | Branch, now_s: float) -> None:
        if isinstance(member, Branch):
            member.down_from = 0
            self._carry_on(member, now_s)
        else:
            self._ask_to_end(member, "ending", now_s)

    def _ask_to_end(self, process: Process, life: Literal["hung", "ending"], now_s: float) -> None:
        if process.life in ("starting", "running"):
            self._unwatch(process)
            process.kill_at_s = now_s + process.child.timeouts.end_s
            self._orders.append(Order("end", process.name))
        process.life = life

    def _kill(self, process: Process) -> None:
        process.kill_at_s = None
        self._orders.append(Order("kill", process.name))

    def _unwatch(self, process: Process) -> None:
        if process.life in ("starting", "running"):
            self.watch.remove(process.name)

    def _stop(self) -> None:
        """End all, and drop every pending restart; what fails from now on is being ended, so none follows."""
        self.is_stopping = True
        self.root.down_from = 0
        self.root.cancel_restarts()
