"""A plant whose thrusters are connected to the pins of an emulated board."""

from typing import Any

import pytest

from snr_sim.devices.emulated.board import Board
from snr_sim.devices.emulated.toolchain import ToolsMissingError
from snr_sim.devices.mcu.mcu import McuPower
from snr_sim.prelude.errors import PlantError, UnknownNameError
from snr_sim.prelude.signals import PowerReading
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare, request_of
from snr_sim.scenario.simulation_run import RunResult, run_recorded

pytestmark = pytest.mark.usefixtures("emulators")


def run_recorded_scenario(path: Any, scenario: str, io: str = "emulated") -> tuple[RunResult, str]:
    result = run_recorded(prepare(Request(scenario, io=io)), path / FILE_NAME)
    return result, read_trace(path / FILE_NAME).digest


def test_lock_step_thrust_follows_pin_pulses() -> None:
    simulation = prepare(Request("urov_depth_hold", io="emulated"))
    plant: Any = simulation.plant()
    with pytest.raises(PlantError, match="driven by the board's pins"):
        plant.write("pwm", None)
    plant.mcu.open(None)
    plant.step(plant.step_s)
    assert [float(one) for one in plant.plant.snapshot().pulses] == [pin.width_us for pin in plant.board.pins()]
    with pytest.raises(PlantError, match="cannot be reset to an earlier state"):
        plant.snapshot()
    first = plant.board
    plant.reset(0)
    assert plant.time_s == 0.0
    assert plant.board is not first
    plant.board.close()


def test_lock_step_first_voltage_equals_battery_voltage() -> None:
    plant: Any = prepare(Request("urov_depth_hold", io="emulated")).plant()
    power = McuPower(plant.mcu)
    power.configure()
    power.activate()
    reading = power.read()
    assert isinstance(reading, PowerReading)
    assert reading.voltage_v == pytest.approx(plant.read("power").voltage_v, abs=0.1)
    power.close()
    plant.board.close()


def test_lock_step_depth_hold_reaches_target(tmp_path: Any) -> None:
    result, _ = run_recorded_scenario(tmp_path, "urov_depth_hold")
    assert result.error == ""
    assert result.outcome == "held", result.notes
    assert result.success


def test_lock_step_run_is_reproducible_and_replays_without_board(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    one, first = run_recorded_scenario(tmp_path / "a", "lander_pad")
    other, second = run_recorded_scenario(tmp_path / "b", "lander_pad")
    assert (first, one.metrics) == (second, other.metrics)
    assert one.outcome == "landed", one.notes
    monkeypatch.setattr(Board, "__init__", lambda *_: pytest.fail("a replay opened a board"))
    trace = read_trace(tmp_path / "a" / FILE_NAME)
    simulation = prepare(request_of(trace.trace_info, trace.header))
    assert replay_node(trace, "lander", simulation.config(None)).divergences == []


def test_lock_step_plant_without_fixed_step_lands(tmp_path: Any) -> None:
    result, _ = run_recorded_scenario(tmp_path, "lander_vertical")
    assert result.error == ""
    assert result.outcome == "landed", result.notes
    assert [note for note in result.notes if "Outputs" in note] == []


def test_emulated_io_without_tools_names_packages(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolsMissingError, match=r"avr-gcc(.|\n)*apt install(.|\n)*gcc-avr"):
        prepare(Request("urov_depth_hold", io="emulated")).plant()


def test_emulated_io_with_one_role_raises_error() -> None:
    with pytest.raises(UnknownNameError, match=r"next to the whole simulated robot(.|\n)*leave out --role urov"):
        prepare(Request("urov_depth_hold", io="emulated", role="urov"))
