"""`snr doctor` and wires: only required devices count as missing, and the device at a port is identified."""

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import msgspec
import pytest

from snr_sim.cli.doctor import drives_only, landing, packages
from snr_sim.cli.doctor_hardware import answers, wires
from snr_sim.devices.host_ports import HostInfo
from snr_sim.devices.wire.mcu_messages import Ident, McuFault, McuState, ResetCause, Telemetry
from snr_sim.devices.wire.permission import FileOwner
from snr_sim.prelude.errors import MissingExtraError
from snr_sim.prelude.io import parse_io
from snr_sim.testing.fake_mcu import FakeMcu

Snr = Callable[..., Any]
IDENT = Ident(
    frame_count=0, session=1, protocol=1, firmware=(1, 2), channels=8, lowest_us=1100.0, neutral_us=1500.0,
    highest_us=1900.0, dead_band_us=25.0, resolution_ns=500, period_us=8000, max_lease_ms=200, esc_start_ms=2000,
    slew_us_per_100ms=400, dwell_ms=40, mcu="atmega328p", name="snr_sim esc",
)  # fmt: skip
TELEMETRY = Telemetry(
    frame_count=1, session=1, seq=0, uptime_ms=2500, state=McuState.DISARMED, faults=McuFault(0),
    reset_cause=ResetCause.EXTERNAL, command_age_ms=0xFFFF, crc_errors=0, battery_pin_mv=0, current_pin_mv=0,
    widths_us=(1500.0,) * 8,
)  # fmt: skip


def asked(ident: dict[str, Any] | None = None, **telemetry: Any) -> list[tuple[str, str, str]]:
    messages = msgspec.structs.replace(IDENT, **ident or {}), msgspec.structs.replace(TELEMETRY, **telemetry)
    port = FakeMcu(*messages)
    found = list(answers(parse_io("mcu:/dev/ttyUSB0"), lambda: port))
    assert port.is_closed
    return [(one.tag, one.message, one.fix) for one in found]


def test_microcontroller_report_has_version_identity_and_widths() -> None:
    who, state = asked()
    assert who[0] == state[0] == "ok"
    assert (
        "'snr_sim esc' on atmega328p: firmware 1.2, protocol 1, 8 channels, 1100 to 1900 us in steps of 0.5" in who[1]
    )
    assert "neutral 1500, dead band 25" in who[1]
    assert "it is disarmed since 2.5 s, started by EXTERNAL; 1500 1500 1500 1500 1500 1500 1500 1500 us" in state[1]


@pytest.mark.parametrize(
    ("ident", "telemetry", "tag", "expected"),
    [
        ({"neutral_us": 1520.0}, {"widths_us": (1520.0,) * 8}, "MISS", "neutral 1520 us (required: 1500)"),
        ({"channels": 6}, {"widths_us": (1500.0,) * 6}, "MISS", "6 channels (required: 8 at least)"),
        ({"max_lease_ms": 60000}, {}, "MISS", "a lease of 60000 ms at most (required: 1 to 250)"),
        ({"name": "blinky"}, {}, "MISS", "its name is 'blinky' (required: 'snr_sim esc', our firmware's)"),
        ({}, {"widths_us": (1500.0,) * 6 + (1600.0, 1500.0)}, "MISS", "channels 6 are not at neutral"),
        ({}, {"state": McuState.STOPPED, "faults": McuFault.STOPPED}, "MISS", "its emergency stop is on"),
        ({}, {"reset_cause": ResetCause.WATCHDOG}, "note", "its firmware had hung"),
        ({}, {"reset_cause": ResetCause.BROWN_OUT}, "note", "its supply was too low"),
    ],
)
def test_microcontroller_problems_are_reported_with_fix(
    ident: dict[str, Any], telemetry: dict[str, Any], tag: str, expected: str
) -> None:
    (finding,) = [one for one in asked(ident, **telemetry) if expected in one[1]]
    assert finding[0] == tag
    assert finding[2]


def test_firmware_of_other_version_is_reported_with_fix() -> None:
    ((tag, what, fix),) = asked({"protocol": 7})
    assert tag == "MISS"
    assert "protocol 7" in what
    assert "robots/urov/firmware" in fix


def machine(tmp_path: Path, ports: list[str], may: bool = True, model: str = "") -> HostInfo:
    for port in ports:
        (tmp_path / "dev").mkdir(exist_ok=True)
        (tmp_path / port.partition(" ")[0].lstrip("/")).touch()
    if model:
        (tmp_path / "proc/device-tree").mkdir(parents=True)
        (tmp_path / "proc/device-tree/model").write_text(model)
    return HostInfo(tmp_path, lambda: ports, lambda path: may, lambda path: FileOwner("dialout", True))


def test_laptop_without_ports_has_no_miss(tmp_path: Path) -> None:
    assert list(wires(machine(tmp_path, []), None)) == []


@pytest.mark.parametrize(
    ("io", "expected"),
    [
        ("mcu:/dev/ttyUSB0", "there is no serial port /dev/ttyUSB0"),
        ("maestro:/dev/ttyACM0", "there is no serial port /dev/ttyACM0"),
        ("pca9685:1:0x40", "there is no I2C bus 1"),
        ("sysfs", "there is no PWM chip of a Raspberry Pi's header"),
    ],
)
def test_missing_requested_device_is_a_miss(tmp_path: Path, io: str, expected: str) -> None:
    (finding,) = wires(machine(tmp_path, []), parse_io(io))
    assert (finding.tag, finding.message) == ("MISS", expected)
    assert finding.fix


def test_port_without_permission_is_a_miss_only_if_requested(tmp_path: Path) -> None:
    laptop = machine(tmp_path, ["/dev/ttyUSB0 (FT232R)"], may=False)
    for io, tag in ((None, "note"), ("pca9685:1:0x40", "note"), ("mcu:/dev/ttyUSB0", "MISS")):
        finding = next(wires(laptop, parse_io(io) if io else None))
        assert (finding.tag, finding.message) == (tag, "serial port /dev/ttyUSB0 (FT232R)")
        assert "usermod -aG dialout" in finding.fix


def test_address_with_settings_and_bus_file_are_recognised(tmp_path: Path) -> None:
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev/i2c-1").touch()
    laptop = machine(tmp_path, ["/dev/ttyACM0 (Maestro)"])
    for io in ("maestro:/dev/ttyACM0,crc", "pca9685:i2c-1:0x40", "pca9685:1:0x40,oscillator_hz=26e6"):
        assert [one.tag for one in wires(laptop, parse_io(io))] == ["ok", "ok"]


def test_symlink_to_port_is_not_a_miss(tmp_path: Path) -> None:
    laptop = machine(tmp_path, [])
    (tmp_path / "board").touch()
    assert list(wires(laptop, parse_io("mcu:/board"))) == []


def test_raspberry_pi_is_named(tmp_path: Path) -> None:
    (finding,) = wires(machine(tmp_path, [], model="Raspberry Pi 4 Model B Rev 1.4\0"), None)
    assert finding.message == "Raspberry Pi 4 Model B Rev 1.4"


def only(*installed: str) -> Callable[[str], str]:
    def version(name: str) -> str:
        if name not in installed:
            raise PackageNotFoundError(name)
        return "1.0"

    return version


def test_pi_requires_hardware_packages_only() -> None:
    tags = {one.message.split()[0]: one.tag for one in packages(True, only("pyserial", "numpy"))}
    assert (tags["pyserial"], tags["smbus2"], tags["pymunk"], tags["rerun-sdk"]) == ("ok", "MISS", "note", "note")


def test_laptop_requires_physics_packages_only() -> None:
    tags = {one.message.split()[0]: one.tag for one in packages(False, only("pymunk"))}
    assert (tags["pymunk"], tags["gymnasium"]) == ("ok", "MISS")
    assert "pyserial" not in tags


@pytest.mark.parametrize(
    ("is_pi", "installed", "is_so"),
    [
        (True, (), True),
        (True, ("pymunk", "gymnasium", "mujoco-core"), True),
        (False, ("pyserial", "smbus2", "numpy"), True),
        (False, ("pyserial", "smbus2", "numpy", "mujoco-core"), False),
        (False, ("numpy",), False),
        (False, (), False),
    ],
)
def test_pi_or_hardware_packages_without_physics_is_hardware_only(
    is_pi: bool, installed: tuple[str, ...], is_so: bool
) -> None:
    assert drives_only(is_pi, only(*installed)) is is_so


def test_missing_physics_package_is_a_note_on_hardware_computers_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def missing(*given: Any) -> Any:
        raise MissingExtraError("numpy", "sim")

    monkeypatch.setattr("snr_sim.cli.doctor.prepare", missing)
    assert (landing(True).tag, landing(False).tag) == ("note", "MISS")
    assert "numpy" in landing(True).message


def test_outputs_and_sensors_of_each_io_are_opened_and_reported(snr: Snr) -> None:
    answer = snr("doctor", "--io", "loopback", "--json")
    messages = [finding["message"] for finding in answer.json["findings"]]
    assert "outputs 'pwm': inactive, 8 channels, resolution 0 us" in messages
    assert "sensor 'depth' answers" in messages
    assert answer.status == 0


def test_invalid_io_is_rejected(snr: Snr) -> None:
    for io, expected in (
        ("muc:/dev/ttyUSB0", "did you mean 'mcu'"),
        ("mcu:/dev/ttyUSB0,baud=1", "has no setting 'baud'"),
        ("pca9685:1:0x40,oscillator_hz=nan", "23e6 to 27e6 Hz"),
        ("maestro:,crc", "such as maestro:/dev/ttyACM0"),
    ):
        for verb in ("doctor", "io"):
            answer = snr(verb, "--io", io)
            assert (answer.status, expected in answer.err) == (2, True), (verb, io)
