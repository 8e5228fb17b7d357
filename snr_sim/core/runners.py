"""Runners, which start a config: one role here, one role by command line, a test, or all roles in lock step."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Sequence
from typing import Protocol

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import ComponentsByRole, Config, Mode
from snr_sim.core.interrupts import RunInterrupted, graceful_shutdown
from snr_sim.core.lockstep import LockStep
from snr_sim.core.node import Node
from snr_sim.core.reload.sources import reloading_file
from snr_sim.core.reload.watch import with_watch
from snr_sim.core.standard_streams import print_line
from snr_sim.core.standstill import SlowStart, notes_on_threads
from snr_sim.core.unblocked_output import unblocked_output
from snr_sim.prelude.clock import Clock
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError, SnrError, suggest
from snr_sim.prelude.recorder import Recorder

TEST_ROLE = "test"
_OPTIONS = {  # of a program with a CliRunner
    "-d": "DEBUG mode: shows all that is logged, and the time of each handler",
    "--watch": "reloads a component when its file is saved",
    "--help": "shows this",
    "-h": "shows this",
}


class NodeLink(Protocol):
    """Interface of a link that carries pages between nodes of one process."""

    def attach(self, nodes: dict[RoleName, Node], clock: SimClock) -> None:
        """Connect to the linked nodes, before they begin."""


class SynchronousRunner:
    """Runner of one role.

    Args:
        role: its name.
        config: of the robot.
        clock: the wall clock if not given.
        recorder: writes the trace, if given.
        seed: of the run.
    """

    def __init__(
        self,
        role: RoleName,
        config: Config,
        *,
        clock: Clock | None = None,
        recorder: Recorder | None = None,
        seed: int = 0,
    ) -> None:
        self.node: Node = Node(role, config, clock=clock, recorder=recorder, seed=seed)

    def run(self) -> None:
        """Run until a terminate task, or a signal, ends it.

        Raises:
            ComponentFailedError: a handler or a loop raised.
        """
        threads = threading.enumerate()
        try:
            with unblocked_output(), graceful_shutdown([self.node]) as signals:
                self._loop(signals)
        finally:
            _log_notes([self.node], threads)

    def _loop(self, signals: Sequence[str]) -> None:
        try:
            self.node.loop()
        except RunInterrupted as interrupted:
            if not signals:
                raise
            self.node.add_note(f"{signals[0]}: {interrupted}, and was interrupted.")


def _log_notes(nodes: Sequence[Node], threads_before: Sequence[threading.Thread]) -> None:
    """Print the nodes' notes on stderr, with the node's name if there are several, and notes on running threads."""
    for node in nodes:
        whose = f"{node.name}: " if len(nodes) > 1 else ""
        for note in node.notes:
            print_line(sys.stderr, f"note: {whose}{note}")
    if threading.current_thread() is threading.main_thread():
        for note in notes_on_threads(threads_before):
            print_line(sys.stderr, f"note: {note}")


class CliRunner:
    """Runner of the role that the command line names: `python robot.py ROLE`; of the only one, if there is one.

    `-d` is for DEBUG mode; with `--watch` a component whose file is saved is reloaded while the robot runs.

    Args:
        components: factories by role, or a Config.
        argv: the command line, `sys.argv` if not given.
    """

    def __init__(self, components: ComponentsByRole | Config, argv: Sequence[str] | None = None) -> None:
        self._components = components
        self._argv = list(sys.argv if argv is None else argv)

    def run(self) -> None:
        """Run the role until it ends. Without a known role: print the roles, exit status 2; with --help, 0.

        Errors are printed on stderr, exit status 1; in DEBUG mode they are raised, for the traceback.
        """
        words = self._argv[1:]
        mode = Mode.DEBUG if "-d" in words else Mode.DEPLOYED
        is_watched = "--watch" in words
        unknown = [word for word in words if word.startswith("-") and word not in _OPTIONS]
        roles = [word for word in words if not word.startswith("-")]
        config = self._components if isinstance(self._components, Config) else Config(mode, self._components)
        if mode is Mode.DEBUG:
            config = Config(mode, config.factories, **config.bounds)
        if mode is Mode.DEBUG or is_watched:
            show_log(logging.DEBUG if mode is Mode.DEBUG else logging.INFO)
        if "--help" in words or "-h" in words:
            print(self._usage(list(config.factories)))
            raise SystemExit(0)
        if not roles and len(config.factories) == 1:
            roles = list(config.factories)
        if unknown or len(roles) != 1 or roles[0] not in config.factories:
            self._explain(unknown, roles, list(config.factories))
            raise SystemExit(2)
        try:
            with SlowStart():
                runner = SynchronousRunner(roles[0], with_watch(config) if is_watched else config)
            runner.run()
        except SnrError as error:
            if mode is Mode.DEBUG or reloading_file.get():  # a reload reports errors itself
                raise
            print_line(sys.stderr, str(error))
            raise SystemExit(1) from error
        if runner.node.profiler is not None:
            print_line(sys.stderr, runner.node.profiler.dump())

    def _explain(self, unknown: list[str], given: list[str], known: list[str]) -> None:
        if unknown:
            print(f"There is no option {unknown[0]}.\n  Try: {suggest(unknown[0], _OPTIONS)}", file=sys.stderr)
        elif not given:
            print("Which role? None was given.", file=sys.stderr)
        elif len(given) > 1:
            print(f"One role at a time, not {len(given)}: {' '.join(given)}.", file=sys.stderr)
        else:
            print(f"There is no role '{given[0]}'.\n  Try: {suggest(given[0], known)}", file=sys.stderr)
        print(self._usage(known), file=sys.stderr)

    def _usage(self, roles: list[str]) -> str:
        options = "".join(f"\n  {option:<8} {what}" for option, what in _OPTIONS.items())
        program = self._argv[0] if self._argv else "robot.py"
        role = "[ROLE]" if len(roles) == 1 else "ROLE"
        return f"usage: {program} [-d] [--watch] {role}{options}\nroles: {', '.join(roles)}"


def show_log(level: int) -> None:
    """Show components' log messages from this level up; by default Python shows warnings and errors only."""
    handler = _ToStderr()
    handler.setFormatter(logging.Formatter("%(levelname)s %(name)s: %(message)s"))
    logger = logging.getLogger("snr")
    logger.handlers[:] = [handler]
    logger.setLevel(level)
    logger.propagate = False


class _ToStderr(logging.Handler):
    """Handler that writes to the `sys.stderr` of the time of the message: above a progress line, if one is shown."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line."""
        try:
            line = self.format(record)
        except Exception:  # a log call that is wrong, or an object's own __str__
            self.handleError(record)
            return
        print_line(sys.stderr, line)


class SimRunner:
    """Runner of several roles in one process under one virtual clock, with simulated links between them.

    Args:
        config: of the robot.
        roles: in the order in which they work at the same instant; all of the config's if not given.
        links: carry pages between them.
        clock: a new one if not given; a plant follows it.
        recorder: writes one trace for all nodes, if given.
        seed: of the run.
        pace: virtual seconds per wall second; None is as fast as possible.
        until_s: the longest virtual time.
        log_notes: whether the nodes' notes are printed on stderr at the end.

    Raises:
        ConfigError: a role is named twice.
    """

    def __init__(
        self,
        config: Config,
        roles: Sequence[RoleName] | None = None,
        *,
        links: Sequence[NodeLink] = (),
        clock: SimClock | None = None,
        recorder: Recorder | None = None,
        seed: int = 0,
        pace: float | None = None,
        until_s: float | None = None,
        log_notes: bool = True,
    ) -> None:
        names = list(roles if roles is not None else config.factories)
        if len(set(names)) != len(names):
            raise ConfigError(f"A role is named twice: {', '.join(names)}.", fix="each role runs once.")
        self.clock: SimClock = clock or SimClock()
        self.nodes: dict[RoleName, Node] = {
            role: Node(role, config, clock=self.clock, recorder=recorder, seed=seed) for role in names
        }
        for link in links:
            link.attach(self.nodes, self.clock)
        self._lock_step = LockStep(list(self.nodes.values()), self.clock, pace, until_s)
        self._log_notes = log_notes
        self.signals: list[str] = []

    def run(self) -> None:
        """Run until every node has ended, nothing is due any more, or the time limit is reached.

        Raises:
            ComponentFailedError: a handler or a loop raised; every node has been halted.
        """
        nodes, threads = list(self.nodes.values()), threading.enumerate()
        try:
            with graceful_shutdown(nodes) as self.signals:
                self._lock_step.run()
        finally:
            if self._log_notes:
                _log_notes(nodes, threads)


class TestRunner(SimRunner):
    """Runner of the role 'test' in virtual time, so that nothing sleeps.

    Args:
        config: has the role 'test'.
        seed: of the run.
        until_s: the longest virtual time.
    """

    __test__ = False  # pytest: this is not a test class

    def __init__(self, config: Config, *, seed: int = 0, until_s: float = 3600.0) -> None:
        super().__init__(config, [TEST_ROLE], seed=seed, until_s=until_s, log_notes=False)
        self.node: Node = self.nodes[TEST_ROLE]
