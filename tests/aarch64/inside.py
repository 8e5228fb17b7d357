"""What has to hold on a Raspberry Pi with `snr_sim[hardware]` and no physics; `run` executes it on an emulated CPU.

Prints a line for each check. The conformance suite is not here: pytest runs that on the tests of the checkout.
"""

from __future__ import annotations

import json
import platform
import socket
import subprocess
import sys
import time
from collections.abc import Callable

import snr_sim
import snr_sim.devices.mcu.mcu
import snr_sim.devices.pwm.pca9685
import snr_sim.devices.pwm.pwm_loop
import snr_sim.devices.pwm.sysfs_pwm
import snr_sim.scenario.role_run
from snr_sim.devices.pwm.pwm_backend import LoopbackPwm
from snr_sim.prelude.device import PwmOut
from snr_sim.testing.pwm_contract import check_pwm_out

PHYSICS = ("mujoco", "pymunk", "gymnasium", "rerun", "pygame")
NOT_ON_IMPORT = ("numpy", "serial", "smbus2")


def imports_without_the_heavy_ones() -> str:
    """`import snr_sim`, and all that wires need, bring neither physics nor arrays."""
    found = [name for name in (*PHYSICS, *NOT_ON_IMPORT) if name in sys.modules]
    assert not found, f"importing snr_sim and its devices brought {found}"
    return f"snr_sim {snr_sim.__version__}"


def has_what_wires_need() -> str:
    """The extra 'hardware' is there: serial ports, I2C, and numpy, by which the vehicle shares out its thrust."""
    import numpy
    import serial
    import smbus2

    inverse = numpy.linalg.pinv(numpy.array([[2.0, 0.0, 0.0], [0.0, 4.0, 0.0]]))
    assert abs(inverse[1][1] - 0.25) < 1e-15
    return f"pyserial {serial.VERSION}, smbus2 {smbus2.__version__}, numpy {numpy.__version__}"


def prints_help() -> str:
    """`snr --help` answers."""
    done = subprocess.run(["snr", "--help"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "snr run SCENARIO" in done.stdout or "run" in done.stdout, done.stdout
    return f"{len(done.stdout.splitlines())} lines"


def doctor_reports_missing() -> str:
    """`snr doctor` notes that there is no physics, which what drives hardware does not need, and misses nothing."""
    done = subprocess.run(["snr", "doctor", "--json"], capture_output=True, text=True)
    findings = json.loads(done.stdout)["findings"]
    misses = [finding["message"] for finding in findings if not finding["is_ok"]]
    noted = [finding["message"] for finding in findings if finding["is_ok"] and finding["fix"]]
    assert (done.returncode, misses) == (0, []), misses
    assert any("mujoco" in what for what in noted), noted
    assert not any("Traceback" in json.dumps(finding) for finding in findings), findings
    return f"{len(findings)} findings, noted: {'; '.join(what.splitlines()[0] for what in noted)}"


def the_vehicle_is_wired_without_physics() -> str:
    """Both roles of robots/urov can be put together, and its thrusts shared out, with numpy alone."""
    from snr_sim.scenario.simulation import Request, prepare

    simulation = prepare(Request("urov_teleop", role="urov"))
    config = simulation.config(None)
    from snr_sim.plants.urov.t200 import curve
    from snr_sim.std_mods.allocation import Allocation
    from snr_sim.std_mods.thrust_curve import ThrustCurve

    parameters = simulation.scenario.parameters(0)
    limits = ThrustCurve(*curve(parameters.nominal_v)[:2]).limits_n
    allocation = Allocation(parameters.vehicle.thruster_matrix(), limits, priority_axes=parameters.priority_axes)
    wrench = [10.0, -5.0, 20.0, 0.0, 0.0, 1.0]
    thrusts, share, _ = allocation.allocate(wrench)
    given = allocation.wrench_of(thrusts)
    assert share == 1.0, share
    assert max(abs(one - other) for one, other in zip(given, wrench, strict=True)) < 1e-9, given
    found = [name for name in PHYSICS if name in sys.modules]
    assert not found, f"wiring the vehicle brought {found}"
    return f"{len(config.get('urov'))} components at the vehicle, {len(thrusts)} thrusters"


def the_vehicle_looks_for_its_real_devices() -> str:
    """`snr run ... --io pi` asks for no physics; it finds no I2C bus here, and says what to do about it."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = ["snr", "run", "urov_teleop", "--role", "urov", "--io", "pi", "--option", f"port={port}"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Traceback" not in done.stderr, done.stderr
    assert "There is no I2C bus /dev/i2c-1" in done.stderr, done.stderr
    assert "raspi-config" in done.stderr, done.stderr
    return "There is no I2C bus /dev/i2c-1, and what to do"


class LoopbackBench:
    """Outputs that read back the commanded pulses, on a clock of their own."""

    can_unplug = False

    def __init__(self) -> None:
        self.time_s = 0.0

    def open(self) -> PwmOut:
        return LoopbackPwm(self.now_s, 8)

    def now_s(self) -> float:
        return self.time_s

    def advance(self, seconds: float) -> None:
        self.time_s += seconds

    def pins_us(self) -> None:
        return None

    def unplug(self) -> None:
        pass

    def plug_in(self) -> None:
        pass


def loopback_passes_pwm_contract() -> str:
    """The conformance suite, on the backend that tutorials use."""
    check_pwm_out(LoopbackBench())
    return "all of it"


CHECKS: tuple[Callable[[], str], ...] = (
    imports_without_the_heavy_ones,
    has_what_wires_need,
    prints_help,
    doctor_reports_missing,
    the_vehicle_is_wired_without_physics,
    the_vehicle_looks_for_its_real_devices,
    loopback_passes_pwm_contract,
)

if __name__ == "__main__":
    print(f"     Python {platform.python_version()} on {platform.machine()}", flush=True)
    for check in CHECKS:
        start_s = time.perf_counter()
        output = check()
        print(f"ok   {check.__name__.replace('_', ' ')}: {output} ({time.perf_counter() - start_s:.1f} s)", flush=True)
