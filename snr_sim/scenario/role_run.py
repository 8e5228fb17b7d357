"""Run of one role of a scenario, on the wall clock: links connect it to the other roles in their own processes.

The role that has the devices also has the plant, which follows the clock. The referee checks it each time a sensor has
been read. A role without devices, or with real ones only, has no simulated body to evaluate: it succeeds if it ends
without an error.

Each read or write steps the plant to now first (`plants/stepping.py`). `RobotContext.standalone_role` names the role:
only then do a robot's links, and their secrets, leave the process.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from typing import Any

from snr_sim.core.clocks import WallClock
from snr_sim.core.config import Config
from snr_sim.core.interrupts import graceful_shutdown
from snr_sim.core.node import Node
from snr_sim.core.output_recording import record_output
from snr_sim.devices.commands import ActuatorLoopFactory
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.links.sockets import SocketsListenerFactory, SocketsLoopFactory
from snr_sim.plants.stepping import RealTimePlant
from snr_sim.prelude import tasks
from snr_sim.prelude.component import PortFactory
from snr_sim.prelude.errors import ConfigError, LinkError, SnrError
from snr_sim.prelude.interfaces import implements
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.scenario import Verdict
from snr_sim.prelude.task import Page
from snr_sim.recording.trace import TraceWriter
from snr_sim.scenario.simulation import Simulation
from snr_sim.scenario.simulation_run import RunResult, result_of
from snr_sim.scenario.student_calls import Referee, TruthLog

_CHECK_PERIOD_S = 0.02  # between two checks of the referee
_TIME_LIMIT = "time limit"


class RoleRun:
    """A run of one role, with clock, plant and wiring of its own.

    Args:
        simulation: with one role.

    Attributes:
        plant: None, if the role has no devices.
        config: its wiring.
        nodes: its node, after `begin`.

    Raises:
        ConfigError: a file of the scenario is not valid.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.role: str = simulation.roles[0]
        self._clock = WallClock()
        self.nodes: list[Node] = []
        self._referee: Referee | None = None
        self._truth: TruthLog | None = None
        self._checked_s = -_CHECK_PERIOD_S
        plant = simulation.plant() if simulation.has_plant else None
        self._paced = None if plant is None else RealTimePlant(plant, self._clock)
        reached: Any = self._paced  # devices only read from and write to a plant
        self.config: Config = simulation.config(reached, lambda: self._clock.now_s(), self.role)
        factories = self.config.factories
        with_devices = [
            role
            for role in simulation.robot_file.ROLES
            if any(isinstance(one, (SensorLoopFactory, ActuatorLoopFactory)) for one in factories.get(role, []))
        ]
        if plant is not None and len(with_devices) > 1:
            raise ConfigError(
                f"The roles {' and '.join(with_devices)} both have devices here, and there is only one plant: "
                "in processes of their own, each would have another.",
                fix=f"run them under one clock: snr run {simulation.scenario_name}, without --role.",
            )
        own = factories[self.role]
        self._sensor_keys = [factory.key for factory in own if isinstance(factory, SensorLoopFactory)]
        self._ports = [factory for factory in own if implements(factory, PortFactory)]
        self.plant: Plant | None = plant if self.role in with_devices else None

    def start_lines(self) -> list[str]:
        """Return where the role's links listen or connect, and which roles they wait for."""
        others = [role for role in self._simulation.robot_file.ROLES if role != self.role]
        start = f"snr run {self._simulation.request.scenario} --role"
        waits = " and ".join(f"the role {other} ({start} {other})" for other in others)
        own = self.config.factories[self.role]
        links = [one for one in own if isinstance(one, (SocketsLoopFactory, SocketsListenerFactory))]
        return [f"{self.role}: {link.where()} and waits for {waits}" for link in links]

    def claim(self) -> None:
        """Open the listening ports of the role's links, so that a port in use is reported before the run.

        Raises:
            LinkError: a port is in use.
        """
        for factory in self._ports:
            try:
                factory.claim()
            except LinkError as error:
                if "port" not in getattr(self._simulation.robot_file, "OPTIONS", {}):
                    raise
                fix = f"{error.fix} Another one: --option port=..., the same at both ends."
                raise LinkError(error.message, fix=fix) from error

    def release(self) -> None:
        """Close the ports that no link has taken over. Safe to call twice."""
        for factory in self._ports:
            factory.release()

    def begin(self, config: Config, recorder: TraceWriter | None = None) -> None:
        """Start the clock, with the plant's time, and create the node and everything around it, but start nothing else.

        Args:
            config: the role's, possibly with additional components.
            recorder: writes the trace, if given; the caller closes it.

        Raises:
            ConfigError: the components cannot be created.
        """
        simulation = self._simulation
        self._clock = WallClock()
        if self._paced is not None:
            self._paced.follow(self._clock)
        self.nodes = [Node(self.role, config, clock=self._clock, recorder=recorder, seed=simulation.request.seed)]
        if self.plant is not None:
            self._truth = TruthLog(self.plant, recorder) if recorder is not None else None
            self._referee = Referee(simulation.judge, self.plant, self.nodes, self._truth)
            for key in self._sensor_keys:
                self.nodes[0].add_store_listener(key, self._check)

    def run(self, signals: Sequence[str] = ()) -> RunResult:
        """Run until the scenario's verdict, its time limit, an error or a signal.

        Args:
            signals: names of signals received before the run; then it ends at once.
        """
        error, caught, node = "", list(signals), self.nodes[0]
        limit_s = float(self._simulation.scenario.TIME_LIMIT_S)
        start_s = time.perf_counter()
        limit = threading.Timer(limit_s, node.enqueue_input, [tasks.terminate(_TIME_LIMIT), "referee"])
        limit.daemon = True
        limit.start()
        try:
            with record_output(self.nodes), graceful_shutdown(self.nodes) as more:
                try:
                    node.loop()
                finally:
                    caught += more
        except SnrError as failure:
            error = str(failure)
        except KeyboardInterrupt as stop:  # a handler that did not return, or a second signal
            caught.append("SIGINT")
            node.add_note(f"{stop or 'The run'} was interrupted.")
        finally:
            limit.cancel()
        wall_time_s = time.perf_counter() - start_s
        verdict = self._verdict(bool(caught))
        return result_of(self._simulation, self.plant, self.nodes, verdict, wall_time_s, caught, error)

    def _check(self, page: Page) -> None:
        """Call the referee on the node's own thread, where the trace is written."""
        now_s = self._clock.now_s()
        if self._referee is None or self._paced is None or now_s < self._checked_s + _CHECK_PERIOD_S:
            return
        self._checked_s = now_s
        with self._paced.now() as plant:
            self._referee.check(plant.time_s)
            if self._truth is not None and self._referee.verdict is None:
                self._truth.record_if_due(plant.time_s)

    def _verdict(self, is_interrupted: bool) -> Verdict:
        if self._referee is None:
            return Verdict("ended", True, "" if is_interrupted else self.nodes[0].exit_reason or "")
        if self._referee.verdict is not None:
            return self._referee.verdict
        if is_interrupted:
            return Verdict("interrupted", False)
        return Verdict("timeout" if self.nodes[0].exit_reason == _TIME_LIMIT else "ended", False)
