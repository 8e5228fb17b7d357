"""A plant whose thrusters are connected to the pins of an emulated board."""

from typing import Any

import pytest

from snr_sim.devices.emulated.board import Board
from snr_sim.devices.emulated.toolchain import ToolsMissing
from snr_sim.devices.mcu.mcu import McuPower
from snr_sim.prelude.errors import PlantError, UnknownName
from snr_sim.prelude.signals import PowerReading
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.flight import Result, fly_recorded
from snr_sim.scenario.simulation import Request, prepare, request_of

pytestmark = pytest.mark.usefixtures("emulators")


def fly(path: Any, scenario: str, io: str = "emulated") -> tuple[Result, str]:
    result = fly_recorded(prepare(Request(scenario, io=io)), path / FILE_NAME)
    return result, read_trace(path / FILE_NAME).digest


def test_thrust_comes_from_the_pulses_at_the_pins_and_not_from_the_command() -> None:
    simulation = prepare(Request("urov_depth_hold", io="emulated"))
    plant: Any = simulation.plant()
    with pytest.raises(PlantError, match="driven by the board's pins"):
        plant.write("pwm", None)
    plant.mcu.open(None)
    plant.step(plant.step_s)
    assert [float(one) for one in plant.plant.snapshot().pulses] == [pin.width_us for pin in plant.board.pins()]
    with pytest.raises(PlantError, match="cannot be put back"):
        plant.snapshot()
    first = plant.board
    plant.reset(0)
    assert plant.time_s == 0.0
    assert plant.board is not first
    plant.board.close()


def test_the_first_voltage_that_the_board_tells_of_is_that_of_the_battery() -> None:
    plant: Any = prepare(Request("urov_depth_hold", io="emulated")).plant()
    power = McuPower(plant.mcu)
    power.configure()
    power.activate()
    reading = power.read()
    assert isinstance(reading, PowerReading)
    assert reading.voltage_v == pytest.approx(plant.read("power").voltage_v, abs=0.1)
    power.close()
    plant.board.close()


def test_a_depth_is_held_through_the_firmware(tmp_path: Any) -> None:
    result, _ = fly(tmp_path, "urov_depth_hold")
    assert result.error == ""
    assert result.outcome == "held", result.notes
    assert result.success


def test_the_same_run_has_the_same_bits_and_replays_without_a_board(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    one, first = fly(tmp_path / "a", "lander_pad")
    other, second = fly(tmp_path / "b", "lander_pad")
    assert (first, one.metrics) == (second, other.metrics)
    assert one.outcome == "landed", one.notes
    monkeypatch.setattr(Board, "__init__", lambda *_: pytest.fail("a replay opened a board"))
    trace = read_trace(tmp_path / "a" / FILE_NAME)
    simulation = prepare(request_of(trace.opening, trace.header))
    assert replay_node(trace, "lander", simulation.config(None)).divergences == []


def test_a_plant_that_takes_any_step_lands_with_its_engine_at_the_pins(tmp_path: Any) -> None:
    result, _ = fly(tmp_path, "lander_vertical")
    assert result.error == ""
    assert result.outcome == "landed", result.notes
    assert [note for note in result.notes if "Outputs" in note] == []


def test_without_the_emulators_packages_it_says_what_to_install(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ToolsMissing, match=r"avr-gcc(.|\n)*apt install(.|\n)*gcc-avr"):
        prepare(Request("urov_depth_hold", io="emulated")).plant()


def test_one_role_alone_has_no_emulated_board() -> None:
    with pytest.raises(UnknownName, match=r"in lock step with the whole robot(.|\n)*leave out --role urov"):
        prepare(Request("urov_depth_hold", io="emulated", role="urov"))
