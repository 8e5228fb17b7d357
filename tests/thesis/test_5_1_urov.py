"""Listing 5.1: an underwater robot and its topside, joined by a pair of sockets in each direction.

    python tests/thesis/test_5_1_urov.py urov
    python tests/thesis/test_5_1_urov.py topside

    topside   keyboard --> page "controller_input" --> commands.client --.
    urov      commands.server --> mixer --> page "thrust" --> motors     |  over the tether
              depth sensor --> page "depth" --> telemetry.client --------'
    topside   telemetry.server --> display

What was wrong. It could not start in either order: clients connected while they were made and servers bound only when
they began, so each side was refused by the other. And `pair.client("controller_input")` registered the letters of its
text as keys: 'c', 'o', 'n', ...

What we changed. Nothing in the listing: a text is one key, either side may start first, and either may be restarted.
One pair would do for both directions; two are shown because the thesis shows two. In lock step the same config runs
without sockets.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from snr_sim import (
    CliRunner,
    Config,
    Endpoint,
    EndpointFactory,
    Loop,
    LoopFactory,
    Node,
    PrinterEndpointFactory,
    SimRunner,
    SocketsPair,
    SomeTasks,
    Task,
    TaskId,
    TaskType,
    TimeoutLoopFactory,
    tasks,
)

HOST = "127.0.0.1"


class KeyboardFactory(LoopFactory):
    """Makes the pilot's input; here it pushes ahead, harder each time."""

    def get(self, parent: Node) -> Loop:
        return Keyboard(self, parent, "keyboard", max_tick_rate_hz=20.0)


class Keyboard(Loop):
    """Stores what is pressed."""

    def setup(self) -> None:
        self.pressed_s = 0.0

    def loop(self) -> None:
        self.pressed_s += 1 / 20.0
        self.store_data("controller_input", {"ahead": min(self.pressed_s, 1.0), "turn": 0.25})


class MixerFactory(EndpointFactory):
    """Makes what turns the pilot's wishes into thrust."""

    def get(self, parent: Node) -> Endpoint:
        return Mixer(self, parent, "mixer")


class Mixer(Endpoint):
    """Left and right thruster, -1 to 1."""

    def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "controller_input"): self.mix}

    def mix(self, task: Task, task_id: TaskId) -> SomeTasks:
        wish = self.get_data("controller_input")
        pair = [wish["ahead"] - wish["turn"], wish["ahead"] + wish["turn"]]
        return self.store_data_task("thrust", [max(-1.0, min(1.0, value)) for value in pair])


class DepthSensorFactory(LoopFactory):
    """Makes a stand-in for the depth sensor: it sinks while the robot pushes ahead."""

    def get(self, parent: Node) -> Loop:
        return DepthSensor(self, parent, "depth_sensor", max_tick_rate_hz=10.0)


class DepthSensor(Loop):
    """Stores the depth."""

    def setup(self) -> None:
        self.depth_m = 0.0

    def loop(self) -> None:
        thrust = self.get_data("thrust") or [0.0, 0.0]
        self.depth_m += 0.01 * sum(thrust)
        self.store_data("depth", self.depth_m)


class DeepEnoughFactory(EndpointFactory):
    """Makes what ends each side's run: the dive is over when both know that the robot is deep enough."""

    def get(self, parent: Node) -> Endpoint:
        return DeepEnough(self, parent, "deep_enough")


class DeepEnough(Endpoint):
    """Ends the node at 0.05 m."""

    def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
        super().__init__(factory, parent, name)
        self.task_handlers = {(TaskType.process_data, "depth"): self.look}

    def look(self, task: Task, task_id: TaskId) -> SomeTasks:
        return tasks.terminate("deep enough") if self.get_data("depth") > 0.05 else None


def components(commands_port: int = 54321, telemetry_port: int = 54322) -> dict[str, Sequence[Any]]:
    """The robot's wiring, as in the listing."""
    commands = SocketsPair((HOST, commands_port))
    telemetry = SocketsPair((HOST, telemetry_port))
    return {
        "topside": [
            KeyboardFactory(),
            commands.client("controller_input"),
            telemetry.server(),
            PrinterEndpointFactory([(TaskType.process_data, "depth")]),
            DeepEnoughFactory(),
        ],
        "urov": [
            commands.server(),
            MixerFactory(),
            DepthSensorFactory(),
            telemetry.client("depth"),
            # Longer than the topside needs to receive the last depth.
            TimeoutLoopFactory(seconds=60.0),
        ],
    }


def test_the_dive_runs_in_lock_step_without_sockets() -> None:
    runner = SimRunner(Config(factories=components()), until_s=30.0)
    runner.run()
    topside, urov = runner.nodes["topside"], runner.nodes["urov"]
    assert topside.exit_reason == "deep enough"
    assert topside.get_page("depth").origin == "urov_node"  # type: ignore[union-attr]
    assert urov.get_page("controller_input").origin == "topside_node"  # type: ignore[union-attr]
    left, right = urov.get_data("thrust")
    assert right > left


@pytest.mark.slow
def test_the_dive_runs_as_two_processes_whichever_starts_first(free_ports: Any) -> None:
    for first, second in (("urov", "topside"), ("topside", "urov")):
        ports = free_ports(2)
        running = {role: start(role, ports) for role in (first, second)}
        try:
            printed, failures = running["topside"].communicate(timeout=120.0)
            assert running["topside"].returncode == 0, failures
            assert "process_data 'depth'" in printed
            running["urov"].terminate()
            assert running["urov"].wait(timeout=120.0) == 0  # a signal is a reason to end, not a crash
        finally:
            for process in running.values():
                process.kill()
                process.communicate()


def start(role: str, ports: Sequence[int]) -> subprocess.Popen[str]:
    command = [sys.executable, str(Path(__file__)), role]
    environment = os.environ | {"UROV_PORTS": " ".join(map(str, ports))}
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


if __name__ == "__main__":
    CliRunner(components(*map(int, os.environ.get("UROV_PORTS", "54321 54322").split()))).run()
