"""smbus2's real ioctls between our drivers and our emulated parts: umockdev replaces the kernel.

Needs Debian's umockdev with its Python bindings, which only the system's Python has: that one plays the kernel.
"""

import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from snr_sim.testing.fake_i2c import FakeBus, FakePca9685
from snr_sim.testing.fake_ms5837 import FakeMs5837

HERE = Path(__file__).parent
SYSTEM = "/usr/bin/python3"
PACKAGES = "umockdev gir1.2-umockdev-1.0 python3-gi"
HAS = "import gi; gi.require_version('UMockdev', '1.0'); from gi.repository import UMockdev"


def need_umockdev() -> str:
    """Return umockdev-wrapper; skip where it is absent, but not in CI."""
    wrapper = shutil.which("umockdev-wrapper")
    has_bindings = Path(SYSTEM).exists() and subprocess.run([SYSTEM, "-c", HAS], capture_output=True).returncode == 0
    if wrapper is None or not has_bindings:
        message = f"umockdev is not here: apt-get install --no-install-recommends {PACKAGES}"
        if os.environ.get("SNR_REQUIRE_EMULATORS"):
            raise RuntimeError(message)
        pytest.skip(message)
    return wrapper


def answer_of(bus: FakeBus, call: list[object]) -> object:
    """Return the answer of the parts to one call: bytes, or the number of an error."""
    address, what, register, rest = call
    assert isinstance(address, int)
    try:
        if register is None:
            return [bus.read_byte(address)]
        assert isinstance(register, int)
        if what == "read":
            assert isinstance(rest, int)
            return bus.read_i2c_block_data(address, register, rest)
        assert isinstance(rest, list)
        if rest:
            bus.write_i2c_block_data(address, register, rest)
        else:
            bus.write_byte(address, register)
    except OSError as error:
        return error.errno
    return []


@contextmanager
def kernel_with(bus: FakeBus, tick: Callable[[], None]) -> Iterator[dict[str, str]]:
    """Attach the parts of a bus to /dev/i2c-1 of processes under umockdev-wrapper with this environment."""
    script = [need_umockdev(), SYSTEM, str(HERE / "i2c_kernel.py")]
    with subprocess.Popen(script, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as kernel:
        calls, answers = kernel.stdout, kernel.stdin
        assert calls is not None
        assert answers is not None

        def serve() -> None:
            for line in calls:
                tick()
                print(json.dumps(answer_of(bus, json.loads(line))), file=answers, flush=True)

        try:
            root = json.loads(calls.readline())
            threading.Thread(target=serve, daemon=True).start()
            yield {**os.environ, "UMOCKDEV_DIR": root}
        finally:
            kernel.terminate()


@pytest.mark.slow
def test_drivers_reach_fake_parts_through_smbus2_ioctls() -> None:
    chip, clock = FakePca9685(), [0.0]
    depth = FakeMs5837(lambda: clock[0], pressure_pa=123_456.0, temperature_c=12.34)

    def tick() -> None:
        clock[0] += 1.0  # so any conversion has ended

    with kernel_with(FakeBus({0x40: chip, 0x76: depth}), tick) as environment:
        output = subprocess.run(
            [need_umockdev(), sys.executable, str(HERE / "drivers.py")],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            timeout=60.0,
            check=True,
        ).stdout
    pulses_us, reasons, pressure_pa, temperature_c, missing = json.loads(output)
    assert reasons == []
    assert pulses_us == chip.pins_us(8) == [pytest.approx(1698.2, abs=0.1)] * 8
    assert (pressure_pa, temperature_c) == (pytest.approx(123_456.0, abs=1.0), pytest.approx(12.34, abs=0.01))
    assert missing == "No device answers at 0x41 on /dev/i2c-1; devices on that bus: 0x40, 0x76."
