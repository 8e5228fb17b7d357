"""Where a robot's devices are, said in one string: `--io`, or the environment's SNR_SIM_IO.

sim                 all in the simulated world
mirror              outputs without anything behind them: what is asked for is what is made
emulated            outputs and power sensor on an emulated microcontroller, in lock step with the simulated world
mcu:PORT            real outputs behind a microcontroller; the vehicle around them is simulated, in real time
maestro:PORT        the same, behind a Pololu Maestro
pca9685:BUS:ADDR    the same, behind a PCA9685 on I2C
sysfs               the same, at the PWM pins of a Raspberry Pi
replay:RUN          sensors read what a recorded run read; outputs as in the mirror
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
BENCH = ("mcu", "maestro", "pca9685", "sysfs")  # real outputs, and the rest simulated: in real time
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
        where: what follows it: a port, a bus and an address, a run folder; empty for most.
    """

    kind: str
    where: str = ""

    def __str__(self) -> str:
        return f"{self.kind}:{self.where}" if self.where else self.kind


def parse_io(text: str) -> Io:
    """Returns the choice that a string names.

    Raises:
        UnknownName: there is no such kind of devices, or it lacks where they are.
    """
    kind, _, where = text.partition(":")
    if kind not in _WHERE:
        raise UnknownName(f"--io {text}: there are no devices of the kind '{kind}'.", fix=nearest(kind, _WHERE))
    wanted = _WHERE[kind]
    if wanted and not where:
        raise UnknownName(
            f"--io {text} does not say where.", fix=f"--io {kind}:{wanted}, such as {kind}:{_EXAMPLES[wanted]}."
        )
    if where and not wanted:
        raise UnknownName(f"--io {text}: '{kind}' takes nothing after it, but found ':{where}'.", fix=f"--io {kind}")
    return Io(kind, where)
