"""A plant whose thrusters hang at the pins of an emulated board."""

from typing import Any

import pytest

from snr_sim.devices.mcu import McuPower
from snr_sim.flight import Flight, Result
from snr_sim.prelude.errors import PlantError, UnknownName
from snr_sim.prelude.signals import PowerReading
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.simulation import Request, prepare

pytestmark = pytest.mark.usefixtures("emulators")


def fly(path: Any, scenario: str = "urov_depth_hold", io: str = "emulated") -> tuple[Result, str]:
    simulation = prepare(Request(scenario, io=io))
    plant = simulation.plant()
    config = simulation.config(plant)
    recorder = TraceWriter(path / FILE_NAME, simulation.header(plant, config), simulation.opening())
    result = Flight(simulation, plant, config, recorder).run()
    recorder.close()
    return result, recorder.digest


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


def test_a_depth_is_held_through_the_firmware_and_twice_with_the_same_bits(tmp_path: Any) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    one, first = fly(tmp_path / "a")
    assert one.error == ""
    assert one.outcome == "held", one.notes
    assert one.success
    other, second = fly(tmp_path / "b")
    assert (first, one.metrics) == (second, other.metrics)


@pytest.mark.parametrize("scenario", ["lander_pad", "lander_vertical"])
def test_a_lander_lands_with_its_engine_at_the_pins(tmp_path: Any, scenario: str) -> None:
    result, _ = fly(tmp_path, scenario)
    assert result.error == ""
    assert result.outcome == "landed", result.notes
    assert [note for note in result.notes if "Outputs" in note] == ["Outputs of 'engine', t = 0.02 s: active."]


def test_one_role_alone_has_no_emulated_board() -> None:
    with pytest.raises(UnknownName, match=r"in lock step with the whole robot(.|\n)*leave out --role urov"):
        prepare(Request("urov_depth_hold", io="emulated", role="urov"))
