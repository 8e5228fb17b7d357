"""A rover with emulated controllers at its motors, in lock step: alone, and under the robot from end to end."""

from pathlib import Path

import pytest

from snr_sim.devices.emulated.emulated_vesc import ScriptedFault
from snr_sim.devices.emulated.vesc_plant import Replug, VescPlant
from snr_sim.devices.wire.serial_port import PortInfo
from snr_sim.plants import RoverVehicle
from snr_sim.prelude.errors import DeviceError, PlantError
from snr_sim.prelude.ground_signals import MotorReading
from snr_sim.recording.reader import read_trace
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun, run_recorded
from snr_sim.testing.fakes import FakePlant
from tests.lanes import nightly

LONG = pytest.param("rover_waypoints", marks=pytest.mark.nightly)
STATE = MotorReading(3.0, 1.5, 0.5, 0.25, 24.0, 7.0, 0.0)


def test_plant_is_driven_by_controllers_only_and_has_no_snapshot() -> None:
    fake = FakePlant({"motor_LF": STATE}, ("motor_LF",))
    plant = VescPlant(fake, ["motor_LF"], 228.0)
    assert plant.engine == "fake, emulated VESC"
    plant.step(0.002)
    assert [(name, command.mode) for name, command in fake.written] == [("motor_LF", "brake")]
    for refused in (lambda: plant.write("motor_LF", None), plant.snapshot, lambda: plant.restore(None)):
        with pytest.raises(PlantError, match=r"[Ee]mulated controllers"):
            refused()


def test_plant_reset_powers_up_new_controllers() -> None:
    plant = VescPlant(FakePlant({"motor_LF": STATE}, ("motor_LF",)), ["motor_LF"], 228.0)
    before = plant._controllers["motor_LF"]
    plant.step(0.002)
    plant.reset(1)
    assert plant.time_s == 0.0
    assert plant._controllers["motor_LF"] is not before
    assert plant._ports["motor_LF"].read() == b""


def test_unplugged_port_is_gone_also_after_it_is_plugged_in_again() -> None:
    plant = VescPlant(FakePlant({"motor_LF": STATE}, ("motor_LF",)), ["motor_LF"], 228.0)
    ports = [plant.open_port("/dev/ttyACM0") for _ in range(2)]
    plant.unplug("motor_LF")
    assert plant.list_ports() == []
    with pytest.raises(DeviceError, match="no serial port /dev/ttyACM0"):
        plant.open_port("/dev/ttyACM0")
    plant.plug_in("motor_LF", "motor_LF")
    for port in ports:
        with pytest.raises(DeviceError, match="/dev/ttyACM0 is gone: it was unplugged"):
            port.read()
    assert plant.open_port("/dev/ttyACM0").read() == b""


def test_scripted_replugs_swap_sockets_and_device_files() -> None:
    names = ["motor_LF", "motor_LM", "motor_LB"]
    replugs = [Replug("motor_LF", 1.0, 3.0, "motor_LM"), Replug("motor_LM", 1.0, 2.0, "motor_LF")]
    plant = VescPlant(FakePlant(dict.fromkeys(names, STATE), tuple(names)), names, 228.0, replugs=replugs)
    sockets = []
    for _ in range(4):
        plant.step(1.0)
        sockets.append({port.path.removeprefix("/dev/tty"): port.usb_path for port in plant.list_ports()})
    assert sockets == [
        {"ACM0": "1-1.1", "ACM1": "1-1.2", "ACM2": "1-1.3"},
        {"ACM2": "1-1.3"},
        {"ACM2": "1-1.3", "ACM0": "1-1.1"},
        {"ACM2": "1-1.3", "ACM0": "1-1.1", "ACM1": "1-1.2"},
    ]
    assert plant._plugged[PortInfo("/dev/ttyACM0", usb_path="1-1.1")] == "motor_LM"


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["rover_hill", nightly("rover_teleop"), LONG])
def test_rover_over_bytes_reaches_its_goal_with_the_same_digest_twice(scenario: str, tmp_path: Path) -> None:
    digests = []
    for i in range(2):
        path = tmp_path / str(i) / FILE_NAME
        path.parent.mkdir()
        result = run_recorded(prepare(Request(scenario, engine="pymunk", io="emulated")), path)
        assert (result.error, result.success) == ("", True), result.notes
        digests.append(read_trace(path).digest)
    assert digests[0] == digests[1]
    config = prepare(Request(scenario, engine="pymunk", io="emulated")).config(None)
    assert replay_node(read_trace(path), "rover", config).is_identical


def climb(**faults: ScriptedFault) -> RunResult:
    """Return the result of a climb, in the plane, in which controllers fail."""
    simulation = prepare(Request("rover_hill", engine="pymunk", io="emulated"))
    made = simulation.plant()
    assert isinstance(made, VescPlant)
    vehicle: RoverVehicle = made.vehicle
    names = [f"motor_{wheel.name}" for wheel in vehicle.motor_wheels]
    plant = VescPlant(made.plant, names, 228.0, {name: [fault] for name, fault in faults.items()}, dialect="seed")
    return SimulationRun(simulation, plant, simulation.config(plant)).run()


@pytest.mark.slow
def test_rover_climbs_while_one_controller_is_mute_and_another_has_no_power() -> None:
    result = climb(motor_LM=ScriptedFault("mute", 5.0, 8.0), motor_RB=ScriptedFault("brown_out", 10.0, 12.0))
    assert (result.error, result.success) == ("", True)
    reported = [note for note in result.notes if note.startswith("Sensor")]
    assert [("motor_LM" in note, "has no reading" in note) for note in reported] == [
        (True, True), (True, False), (False, True), (False, False),
    ]  # fmt: skip
