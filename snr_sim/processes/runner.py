"""ProcessRunner: one description of a robot's processes, run in one lock step, or each in a process of its own.

runner = ProcessRunner([Drive.with_args(gain=0.5), Web, Gps])
runner.simulate(until_s=60.0)     # virtual time, the same order every time
runner.run()                      # processes, wall clock
"""

from __future__ import annotations

import inspect
import re
import secrets
import time
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from snr_sim.core.clocks import WallClock
from snr_sim.core.config import AnyFactory, Config
from snr_sim.core.node import Node
from snr_sim.core.output_recording import record_output
from snr_sim.core.runners import SimRunner, SynchronousRunner
from snr_sim.core.source_location import is_content, is_student_file
from snr_sim.links.faults import LinkFaults
from snr_sim.links.sockets import SocketsPair
from snr_sim.prelude.component import RoleName
from snr_sim.prelude.errors import ConfigError
from snr_sim.processes.enabled import load_enabled
from snr_sim.processes.message import BROKER, LINK
from snr_sim.processes.process_components import LOOP_SUFFIX, ProcessEndpoint, ProcessLoop
from snr_sim.processes.rover_process import ProcessSpec, RoverProcess
from snr_sim.processes.state_manager import ReportLoop, StateManager
from snr_sim.recording.folder import header_of_program, new_run_folder
from snr_sim.recording.records import TraceInfo
from snr_sim.recording.sources import keep_copies, program_files
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.supervision.health import HEALTH
from snr_sim.supervision.health_link import health_link
from snr_sim.supervision.plan import Child, Supervisor
from snr_sim.supervision.supervised_runner import SupervisedRunner

QUEUE_MESSAGES = 10_000
KEEP_ALIVE_S = 1.5  # on one computer a process that ends is noticed at once, and one that hangs by its supervisor
_NAME = re.compile(r"[A-Za-z]\w*")


class ProcessRunner:
    """Runner of a robot's processes and of the broker between them, the state manager.

    Args:
        processes: classes, descriptions that `with_args` returns, or names of modules in the folder.
        folder: of modules; of each the class with the module's name is taken.
        seed: of the run.
        queue_messages: maximum number of messages that wait for one subscriber; then the oldest is dropped and counted.
        faults: faults of the links between processes and broker.
        plan: how the processes are supervised; names of its children are the processes' and "state_manager". Each
            alone if not given, restarted after a failure; all end with the state manager.
        health_at: host and port at which `snr health HOST:PORT` is answered while processes run; none if not given.

    Attributes:
        nodes: of the newest simulation, by role.
        health_at: as above.

    Raises:
        ConfigError: a module or a class is not there or cannot be imported, or two processes have one name.
    """

    def __init__(
        self,
        processes: Iterable[type[RoverProcess] | ProcessSpec | str],
        *,
        folder: str | Path = ".",
        seed: int = 0,
        queue_messages: int = QUEUE_MESSAGES,
        faults: LinkFaults | None = None,
        plan: Supervisor | None = None,
        health_at: tuple[str, int] | None = None,
    ) -> None:
        self.specs: list[ProcessSpec] = [_spec_of(one, Path(folder)) for one in processes]
        self.seed: int = seed
        self.nodes: dict[RoleName, Node] = {}
        self._queue_messages = queue_messages
        self._faults = faults
        self.health_at: tuple[str, int] | None = health_at
        names = Counter(spec.name for spec in self.specs)
        for name, count in names.items():
            if not _NAME.fullmatch(name) or name == BROKER:
                raise ConfigError(f"A process cannot be named {name!r}.", fix="letters, digits and _, a letter first.")
            if count > 1:
                raise ConfigError(f"Two processes are named {name}.", fix=f"{name}.with_args(name='{name}2').")
        if not names:
            raise ConfigError("A ProcessRunner without processes.", fix="ProcessRunner([Drive, Gps]).")
        self._plan = plan or Supervisor(
            "root", [Child(BROKER, "on_failure", ends_all=True), *(Child(name, "on_failure") for name in names)]
        )
        planned = {process.name for process in self._plan.processes()}
        if planned != {BROKER, *names}:
            only = ", ".join(sorted(planned ^ {BROKER, *names}))
            raise ConfigError(
                f"The plan and the processes do not have the same names: {only}.",
                fix=f"one Child for each process, and Child({BROKER!r}, 'on_failure', ends_all=True).",
            )

    def config(self, folder: Path | None = None, secret: str | None = None) -> Config:
        """Return the wiring: a role for the broker, and one for each process.

        Args:
            folder: of the run, for the logs; None writes none.
            secret: of the links; a simulation needs none.
        """
        pair = SocketsPair(
            ("127.0.0.1", 0),
            name=LINK,
            secret=secret,
            queue_pages=self._queue_messages,
            faults=self._faults,
            keep_alive_s=KEEP_ALIVE_S,
        )
        broker = StateManager.factory(name=BROKER, plan=self._plan)
        roles: dict[RoleName, list[AnyFactory]] = {BROKER: [broker, ReportLoop.factory(name="reports"), pair.server()]}
        for spec in self.specs:
            endpoint = ProcessEndpoint.factory(name=spec.name, spec=spec, folder=folder)
            loop = ProcessLoop.factory(name=f"{spec.name}{LOOP_SUFFIX}", process=spec.name)
            roles[spec.name] = [endpoint, pair.client(), loop]
        return Config(factories=roles)

    def simulate(self, until_s: float, out: str | Path | None = None) -> Path | None:
        """Run all in one lock step, in virtual time, and return the run folder; `snr replay FOLDER` replays it.

        Args:
            until_s: the longest virtual time [s].
            out: folder that run folders go into; None records nothing.

        Raises:
            ComponentFailedError: a process raised; all have been ended, and are recorded up to the failure.
            TraceError: the recording cannot be written.
        """
        if out is None:
            self._simulate(until_s, None, None).run()
            return None
        program = self.program
        folder = new_run_folder(Path(out), program.stem, self.seed)
        roles = [BROKER, *(spec.name for spec in self.specs)]
        header = header_of_program(roles, {}, program, "sim", self.seed)
        recorder = TraceWriter(folder / FILE_NAME, header, TraceInfo.now("", str(program)))
        try:
            runner = self._simulate(until_s, folder, recorder)
            with keep_copies(folder, program_files(program), _is_own), record_output(runner.nodes.values()):
                runner.run()
        finally:
            recorder.close()
        return folder

    def _simulate(self, until_s: float, folder: Path | None, recorder: TraceWriter | None) -> SimRunner:
        runner = SimRunner(self.config(folder), recorder=recorder, seed=self.seed, until_s=until_s)
        self.nodes = runner.nodes
        return runner

    @property
    def program(self) -> Path:
        """The file of the first process's class."""
        return Path(inspect.getfile(self.specs[0].kind)).resolve()

    def run(self, folder: Path | None = None) -> None:
        """Run each in a process of its own, until Ctrl-C, SIGTERM, `terminate_state` or too many failures.

        What fails, is killed or hangs is started again, the broker too.

        Args:
            folder: of the run, for the logs and `health.json`; None writes none.

        Raises:
            SupervisionError: more failures than the plan allows; all have been ended.
        """
        config = self.config(folder, secrets.token_hex(16))
        if self.health_at is not None:
            config.factories[BROKER].append(health_link(self.health_at).server(HEALTH, accept=()))
        run = partial(run_process, time.monotonic())
        SupervisedRunner(config, self._plan, seed=self.seed, folder=folder, health_to=BROKER, run=run).run()


def run_process(start_s: float, role: RoleName, config: Config, seed: int, has_node: Callable[[Node], None]) -> None:
    """Run one role in its process; the time of all processes begins at `start_s` of the monotonic clock."""
    runner = SynchronousRunner(role, config, clock=WallClock(start_s), seed=seed)
    has_node(runner.node)
    runner.run()


def _is_own(path: Path) -> bool:
    return is_student_file(str(path)) and not is_content(str(path))


def _spec_of(process: object, folder: Path) -> ProcessSpec:
    if isinstance(process, str):
        process = load_enabled(process, folder)
    if isinstance(process, type) and issubclass(process, RoverProcess):
        process = process.with_args()
    if isinstance(process, ProcessSpec):
        return process
    raise ConfigError(
        f"{repr(process)[:80]} is not a RoverProcess.", fix="a class, Drive.with_args(...), or the name of a module."
    )
