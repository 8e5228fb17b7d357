"""Runs inside the emulated Pi: looks at its wires, starts the student's robot, and kills it when it gets hot.

Each line that begins with 'PI:' is read by `run`, which says when by warming up the thermometer.
"""

from __future__ import annotations

import hashlib
import os
import platform
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import smbus2

PORT, STUDENTS_FILE = Path("/dev/ttyUSB0"), Path("/pi/compass.py")
THERMOMETER, EEPROM, BAROMETER, COMPASS = 0x48, 0x50, 0x77, 0x1E
HOT_C = 60.0
TIMEOUT_S = 900.0


def print_line(what: object) -> None:
    """Prints a line for `run`."""
    print(f"PI: {what}", flush=True)


def warmth_c(bus: smbus2.SMBus) -> float:
    """Returns the temperature, by the data sheet of the TMP105: sixteenths of a degree in the upper twelve bits."""
    high, low = bus.read_i2c_block_data(THERMOMETER, 0, 2)
    return int.from_bytes(bytes([high, low]), signed=True) / 256.0


def wait_for(what: str, is_so: Callable[[], bool]) -> None:
    """Waits until something is so."""
    until_s = time.monotonic() + TIMEOUT_S
    while not is_so():
        if time.monotonic() > until_s:
            print_line(f"FAILED: {what} did not come")
            sys.exit(1)
        time.sleep(0.05)


def pass_on(lines: Iterable[str]) -> None:
    """Says what the robot says."""
    for line in lines:
        print_line(line.strip())


def main() -> None:
    """Does all of it."""
    model = Path("/proc/device-tree/model").read_text().strip("\0")
    print_line(f"Python {platform.python_version()} on {platform.machine()}, {model}")
    bus = smbus2.SMBus(1)
    found = []
    for address in (COMPASS, THERMOMETER, EEPROM, BAROMETER):
        bus.read_byte(address)  # raises if no device acknowledges
        found.append(f"0x{address:02x}")
    compass = bytes(bus.read_i2c_block_data(COMPASS, 0x0A, 3)).decode()
    print_line(f"I2C {' '.join(found)}; the compass calls itself {compass}; {warmth_c(bus):.2f} degrees")
    bus.write_i2c_block_data(EEPROM, 0x10, [0x5A])
    time.sleep(0.02)
    bus.write_byte(EEPROM, 0x10)
    assert bus.read_byte(EEPROM) == 0x5A
    wait_for(str(PORT), PORT.exists)
    print_line(f"{PORT} is there")
    print_line(f"the student's file is {hashlib.sha256(STUDENTS_FILE.read_bytes()).hexdigest()}")
    robot = subprocess.Popen([sys.executable, STUDENTS_FILE, f"mcu:{PORT}"], stderr=subprocess.PIPE, text=True)
    threading.Thread(target=pass_on, args=[robot.stderr], daemon=True).start()
    wait_for("the heat", lambda: warmth_c(bus) > HOT_C or robot.poll() is not None)
    if robot.poll() is not None:
        print_line(f"FAILED: the robot ended with {robot.returncode}")
        return
    os.kill(robot.pid, signal.SIGKILL)
    robot.wait()
    print_line("killed")


if __name__ == "__main__":
    main()
