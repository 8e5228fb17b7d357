"""Choice of a robot's devices in one string: `--io`, or the environment's SNR_SIM_IO.

sim                 all in the simulated world
loopback            outputs without hardware: the requested pulses are the applied ones
emulated            emulated boards or motor controllers behind serial lines, in lock step with the simulated world
pty                 the same motor controllers at serial ports of this computer, in a process of their own, in real time
mcu:PORT            real outputs behind a microcontroller; the vehicle around them is simulated, in real time
maestro:PORT        the same, behind a Pololu Maestro
pca9685:BUS:ADDR    the same, behind a PCA9685 on I2C
sysfs               the same, at the PWM pins of a Raspberry Pi
ports:FILE          motor controllers at real serial ports; the vehicle around them is simulated, in real time
replay:RUN          sensors return the readings of a recorded run; outputs as with loopback
pi                  all real: the robot's own table of ports, in its robot.py
"""

from __future__ import annotations

from dataclasses import dataclass

from snr_sim.prelude.errors import UnknownNameError, suggest

ENVIRONMENT = "SNR_SIM_IO"
_KINDS = ("sim", "loopback", "emulated", "pty", "mcu", "maestro", "pca9685", "sysfs", "ports", "replay", "pi")
_ADDRESS_FORMATS = {"mcu": "PORT", "maestro": "PORT", "pca9685": "BUS:ADDR", "ports": "FILE", "replay": "RUN"}
UNSUPPORTED = {
    "gpiozero": (
        "gpiozero's servos are not for speed controllers: on a Raspberry Pi (lgpio) they have steps of 200 us at "
        "50 Hz. Measured: of 1100 to 1900 us only 1000, 1200, 1400, 1600 and 1800 come out, so neutral, 1500, becomes "
        "1400, which is reverse thrust, and the lowest is beyond the limit (gpiozero#1209)."
    )
}
BENCH = ("mcu", "maestro", "pca9685", "sysfs")  # real outputs, and the rest simulated, in real time
ON_SERIAL_PORTS = ("mcu", "maestro")
_EXAMPLES = {"PORT": "/dev/ttyUSB0", "BUS:ADDR": "1:0x40", "RUN": "runs/urov_depth_hold-0-...", "FILE": "ports.toml"}


@dataclass(frozen=True)
class Io:
    """A choice of devices: a row of the robot's device table, and the port, bus and address or run folder after it."""

    kind: str
    address: str = ""

    def __str__(self) -> str:
        return f"{self.kind}:{self.address}" if self.address else self.kind

    @property
    def is_hardware(self) -> bool:
        """Whether any of the devices is real: then outputs move hardware, and time is real."""
        return self.kind in (*BENCH, "ports", "pi")

    @property
    def is_real_time(self) -> bool:
        """Whether any of the devices has a clock of its own."""
        return self.is_hardware or self.kind == "pty"


_RENAMED = {"mirror": "loopback"}  # the old name goes with release 0.3


def parse_io(text: str) -> Io:
    """Return the choice that a string names.

    Raises:
        UnknownNameError: there is no such kind of devices, or the port or address is missing.
    """
    kind, _, address = text.partition(":")
    kind = _RENAMED.get(kind, kind)
    if kind in UNSUPPORTED:
        raise UnknownNameError(UNSUPPORTED[kind], fix="--io mcu:PORT, a microcontroller; or maestro, pca9685, sysfs.")
    if kind not in _KINDS:
        raise UnknownNameError(f"--io {text}: there are no devices of the kind '{kind}'.", fix=suggest(kind, _KINDS))
    expected = _ADDRESS_FORMATS.get(kind)
    if expected and not address:
        raise UnknownNameError(
            f"--io {text} does not say where.", fix=f"--io {kind}:{expected}, such as {kind}:{_EXAMPLES[expected]}."
        )
    if address and not expected:
        raise UnknownNameError(
            f"--io {text}: '{kind}' takes nothing after it, but found ':{address}'.", fix=f"--io {kind}"
        )
    if expected == "BUS:ADDR":
        bus_and_address(address.partition(",")[0])
    return Io(kind, address)


def bus_and_address(text: str) -> tuple[int, int]:
    """Return the number of an I2C bus and an address on it.

    Raises:
        UnknownNameError: the text is not a bus and an address.

    >>> bus_and_address("1:0x40"), bus_and_address("i2c-1:64")
    ((1, 64), (1, 64))
    """
    bus, _, address = text.partition(":")
    number = bus.removeprefix("/dev/").removeprefix("i2c-")
    try:
        at = int(address, 0)
        if number.isdecimal() and 0x08 <= at <= 0x77:
            return int(number), at
    except ValueError:
        pass
    raise UnknownNameError(
        f"'{text}' is not an I2C bus and address.", fix="BUS:ADDR, such as 1:0x40; addresses go from 0x08 to 0x77."
    )
