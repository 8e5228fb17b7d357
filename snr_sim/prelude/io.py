"""Choice of a robot's devices in one string: `--io`, or the environment's SNR_SIM_IO.

sim                 all in the simulated world
mirror              outputs without hardware: the requested pulses are the applied ones
emulated            outputs and power sensor on an emulated microcontroller, in lock step with the simulated world
mcu:PORT            real outputs behind a microcontroller; the vehicle around them is simulated, in real time
maestro:PORT        the same, behind a Pololu Maestro
pca9685:BUS:ADDR    the same, behind a PCA9685 on I2C
sysfs               the same, at the PWM pins of a Raspberry Pi
replay:RUN          sensors return the readings of a recorded run; outputs as with mirror
pi                  all real: the robot's own table of ports, in its robot.py
"""

from __future__ import annotations

from dataclasses import dataclass

from snr_sim.prelude.errors import UnknownName, nearest

ENVIRONMENT = "SNR_SIM_IO"
_WHERE = {
    "sim": "",
    "mirror": "",
    "emulated": "",
    "mcu": "PORT",
    "maestro": "PORT",
    "pca9685": "BUS:ADDR",
    "sysfs": "",
    "replay": "RUN",
    "pi": "",
}
REFUSED = {
    "gpiozero": (
        "gpiozero's servos are not for speed controllers: on a Raspberry Pi (lgpio) they have steps of 200 us at "
        "50 Hz. Measured: of 1100 to 1900 us only 1000, 1200, 1400, 1600 and 1800 come out, so neutral, 1500, becomes "
        "1400, which is reverse thrust, and the lowest is beyond the limit (gpiozero#1209)."
    ),
}
BENCH = ("mcu", "maestro", "pca9685", "sysfs")  # real outputs, and the rest simulated, in real time
ON_SERIAL_PORTS = ("mcu", "maestro")
_EXAMPLES = {
    "PORT": "/dev/ttyUSB0",
    "BUS:ADDR": "1:0x40",
    "RUN": "runs/urov_depth_hold-0-...",
}


@dataclass(frozen=True)
class Io:
    """A choice of devices.

    Args:
        kind: row of the robot's device table.
        where: the part after the kind: a port, a bus and an address, a run folder; empty for most.
    """

    kind: str
    where: str = ""

    def __str__(self) -> str:
        return f"{self.kind}:{self.where}" if self.where else self.kind

    @property
    def has_wires(self) -> bool:
        """Whether any of the devices is real: then outputs move hardware, and time is real."""
        return self.kind in (*BENCH, "pi")


def parse_io(text: str) -> Io:
    """Return the choice that a string names.

    Raises:
        UnknownName: there is no such kind of devices, or the port or address is missing.
    """
    kind, _, where = text.partition(":")
    if kind in REFUSED:
        raise UnknownName(REFUSED[kind], fix="--io mcu:PORT, a microcontroller; or maestro, pca9685, sysfs.")
    if kind not in _WHERE:
        raise UnknownName(f"--io {text}: there are no devices of the kind '{kind}'.", fix=nearest(kind, _WHERE))
    wanted = _WHERE[kind]
    if wanted and not where:
        raise UnknownName(
            f"--io {text} does not say where.", fix=f"--io {kind}:{wanted}, such as {kind}:{_EXAMPLES[wanted]}."
        )
    if where and not wanted:
        raise UnknownName(f"--io {text}: '{kind}' takes nothing after it, but found ':{where}'.", fix=f"--io {kind}")
    if wanted == "BUS:ADDR":
        bus_and_address(where.partition(",")[0])
    return Io(kind, where)


def bus_and_address(where: str) -> tuple[int, int]:
    """Return the number of an I2C bus and an address on it.

    Raises:
        UnknownName: the text is not a bus and an address.

    >>> bus_and_address("1:0x40"), bus_and_address("i2c-1:64")
    ((1, 64), (1, 64))
    """
    bus, _, address = where.partition(":")
    number = bus.removeprefix("/dev/").removeprefix("i2c-")
    try:
        at = int(address, 0)
        if number.isdecimal() and 0x08 <= at <= 0x77:
            return int(number), at
    except ValueError:
        pass
    raise UnknownName(
        f"'{where}' is no I2C bus and address.", fix="BUS:ADDR, such as 1:0x40; addresses go from 0x08 to 0x77."
    )
