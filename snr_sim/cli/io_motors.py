"""`snr io --identify` and `--check-timeout`: motor controllers at real ports, one after the other, on the bench."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from snr_sim.cli.confirmation import confirm_motion
from snr_sim.cli.output import print_text
from snr_sim.devices.motors.bench_check import measure_timeout, turn
from snr_sim.devices.motors.controller_line import ControllerLine
from snr_sim.devices.motors.motor_guard import ControllerSettings, can_lines
from snr_sim.devices.motors.ports_file import PortsFile, read_ports
from snr_sim.devices.motors.vesc_line import VescLine
from snr_sim.devices.wire.can_bus import PREFIX
from snr_sim.devices.wire.serial_port import SerialPort, list_links
from snr_sim.prelude.errors import DeviceError, ParameterError
from snr_sim.prelude.io import parse_io
from snr_sim.scenario.device_bench import devices_of

CONFIRMATION = "wheels off the ground"


def check_motors(scenario: str, io: str, identify: bool, check_timeout: bool) -> int:
    """Turn each motor, and write what was found into the file of ports.

    Returns:
        1 if a controller could not be used or drives for too long, else 0.

    Raises:
        ParameterError: other devices are chosen, the file is invalid, or another text was typed than was asked for.
    """
    chosen = parse_io(io)
    simulation = devices_of(scenario, io)
    if chosen.kind != "ports":
        raise ParameterError("--identify and --check-timeout need controllers at ports.", fix="--io ports:FILE")
    path = Path(chosen.address)
    ports, settings = read_ports(path), simulation.robot_file.controller_settings(simulation.context(None))
    found = lines_of(ports, settings)
    if not found:
        raise ParameterError(
            f"There is no serial port in {ports.links}, which {path} is about.",
            fix=f'plug the controllers in, or write into {path}: links = "FOLDER".',
        )
    confirm_motion(
        f"Each wheel turns for a second, one after the other; {path} gets the results. Put the rover on blocks.",
        CONFIRMATION,
    )
    ports.write(path)  # before a motor turns, as its result must have a place
    is_ok = True
    for line in found:
        try:
            with _opened(line):
                if identify:
                    _identify(line, ports, settings.names)
                if check_timeout:
                    ports.timeout_s.pop(line.chip, None)
                    ports.timeout_s[line.chip] = took_s = measure_timeout(line)
                    print_text(f"{line.name}: it stops {took_s:.2f} s after the last command.")
        except DeviceError as error:
            is_ok = False
            print_text(f"{line.name}: {error}")
        finally:
            ports.write(path)  # what is known is kept if the next one is not waited for
    return 0 if is_ok else 1


def lines_of(ports: PortsFile, settings: ControllerSettings) -> Sequence[ControllerLine[Any]]:
    """Return the controllers of a file: at all ports to which a folder has links, or those it names on a CAN bus."""
    if ports.links.startswith(PREFIX):
        return can_lines(settings, ports.links)
    return [
        VescLine(port.path, partial(SerialPort, port.path), time.monotonic, settings.erpm_per_rpm, settings.dialect)
        for port in list_links(Path(ports.links))
    ]


@contextmanager
def _opened(line: ControllerLine[Any]) -> Iterator[None]:
    line.open(line)
    try:
        yield
    finally:
        line.release(line)


def _identify(line: ControllerLine[Any], ports: PortsFile, names: list[str]) -> None:
    turn(line)
    asked = f"{line.name} (chip {line.chip}): which turned? {', '.join(names)}; nothing if none: "
    print_text(asked, end="", flush=True)
    typed = sys.stdin.readline()
    if not typed:
        raise ParameterError("The answers have ended, so no further motor is turned.", fix="answer at a terminal.")
    name = typed.strip()
    if name in names:
        ports.vesc = {chip: motor for chip, motor in ports.vesc.items() if motor != name} | {line.chip: name}
    elif name:
        raise DeviceError(f"There is no motor '{name}'.", fix="run it again.")
