"""The rover loses two motor controllers and gets them back swapped: by names, by sockets, and without being armed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.devices.emulated.vesc_plant import VescPlant
from snr_sim.devices.motors.vesc_line import VescLine
from snr_sim.devices.wire.serial_port import BytePort
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.scenario import RobotContext
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun
from tests.scenarios.recorded import simulate

pytestmark = pytest.mark.slow


def run(simulation: Simulation) -> RunResult:
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run()


def test_rover_drives_with_swapped_controllers_after_it_was_armed(tmp_path: Path) -> None:
    result = simulate("rover_unplug pymunk 0", tmp_path)
    assert (result.outcome, result.success) == ("completed", True)
    assert result.metrics["unplugged"] == ["motor_LF", "motor_RM"]
    assert result.metrics["rolled_m"] < 0.3
    states = [note for note in result.notes if note.startswith("Motors of 'drive'")]
    words = (
        "is gone",
        "'motor_LF'. No controller says it is 'motor_RM'",
        "'motor_LF'.\n",
        "found again",
        "armed again",
    )
    assert [word in note for word, note in zip(words, states, strict=True)] == [True] * len(words)
    config = prepare(Request("rover_unplug")).config(None)
    trace = read_trace(tmp_path / FILE_NAME)
    assert [replay_node(trace, node, config).is_identical for node in ("rover", "topside")] == [True, True]


def test_lines_that_stay_with_their_sockets_turn_the_wrong_wheels(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = prepare(Request("rover_unplug", engine="pymunk"))

    def line_of_socket(context: RobotContext, name: str) -> VescLine:
        plant, names = context.plant, simulation.robot_file.motor_names(context.robot.parameters)
        assert isinstance(plant, VescPlant)

        def open_port() -> BytePort:
            path = next((i.path for i in plant.list_ports() if i.usb_path == f"1-1.{names.index(name) + 1}"), None)
            if path is None:
                raise DeviceError("Nothing is plugged in there.")
            return plant.open_port(path)

        line: VescLine = context.get_or_create(name, lambda: VescLine(name, open_port, context.now_s, 228.0, "seed"))
        return line

    monkeypatch.setattr(simulation.robot_file, "vesc_line", line_of_socket)
    result = run(simulation)
    assert (result.error, result.success) == ("", False)
    assert "failed: it turns to the left, and LF does not do its part" in result.notes[0]


def test_rover_whose_pilot_never_disarms_stays_where_it_was_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = prepare(Request("rover_unplug", engine="pymunk"))
    parameters = simulation.robot.parameters
    held = replace(parameters, script=parameters.script[:2])
    monkeypatch.setattr(simulation, "robot", replace(simulation.robot, parameters=held))
    result = run(simulation)
    assert (result.error, result.success) == ("", False)
    assert "and then 0.0 m" in result.notes[0]
    assert result.metrics["still_m"] == 0.0
