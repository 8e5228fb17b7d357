"""Three processes that drive a motor at a serial port: `watched_rover.py FOLDER PORT HANG_S HEALTH_PORT`.

Pilot --stick--> Drive --drive--> Motors --telemetry--> Pilot, 20 times a second, through the state manager.
"""

import sys
import time
from pathlib import Path
from typing import Any

from snr_sim.devices.motors.vesc_line import VescLine
from snr_sim.devices.motors.vesc_motors import VescMotors
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.ground_signals import NEUTRAL_BRAKE_A, DriveCommand
from snr_sim.processes import ProcessRunner, RoverProcess
from snr_sim.supervision import Child, Intensity, Supervisor, Timeouts

PERIOD_S = 0.05
SILENCE_S = 0.15  # without a message: three are missing
END_S = 0.5
LIMITS = {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0}
PARTS = ("Pilot", "Drive", "Motors")


class Part(RoverProcess):
    """Prints when messages arrive again; hangs where a file says so: `<name>.handler` or `<name>.loop`."""

    key = ""

    def setup(self, args: dict[str, Any]) -> None:
        self.folder, self.received_s = Path(args["folder"]), 0.0
        self.subscribe(self.key)

    def message_trigger(self, message: Any) -> None:
        before_s, self.received_s = self.received_s, time.monotonic()
        if self.received_s - before_s > SILENCE_S:
            print(f"receives {self.name}")
        self.hang_if_asked("handler")
        self.answer(message.data)

    def answer(self, data: Any) -> None:
        raise NotImplementedError

    def loop(self) -> float:
        self.hang_if_asked("loop")
        return PERIOD_S

    def hang_if_asked(self, where: str) -> None:
        asked = self.folder / f"{self.name}.{where}"
        if asked.exists():
            asked.unlink()
            time.sleep(3600.0)


class Pilot(Part):
    """Holds the stick, and prints what else does not run."""

    key = "telemetry"

    def setup(self, args: dict[str, Any]) -> None:
        super().setup(args)
        self.subscribe("health")

    def on_health(self, data: dict[str, Any]) -> None:
        for part in data["tree"][1:]:
            if part["state"] != "running":
                print(f"{part['name']} does not run")

    def answer(self, data: Any) -> None:
        pass

    def loop(self) -> float:
        self.publish("stick", 0.5)
        return super().loop()


class Drive(Part):
    """Makes a command of each position of the stick."""

    key = "stick"

    def answer(self, data: float) -> None:
        self.publish("drive", DriveCommand("current", [4.0 * data], self.get_time_s() + LEASE_S))


class Motors(Part):
    """Owns the port."""

    key = "drive"

    def setup(self, args: dict[str, Any]) -> None:
        super().setup(args)
        line = VescLine("motor", lambda: SerialPort(args["port"]), self.get_time_s, 228.0, "seed")
        self.motors = VescMotors([line], LIMITS, NEUTRAL_BRAKE_A)
        self.motors.configure()
        self.motors.activate()

    def answer(self, data: dict[str, Any]) -> None:
        self.motors.write(DriveCommand(**data))
        self.publish("telemetry", True)

    def cleanup(self) -> None:
        self.motors.close()


def main(folder: str, port: str, hang_s: str, health_port: str) -> None:
    timeouts = Timeouts(setup_s=60.0, hang_s=float(hang_s), end_s=END_S)
    children = [Child("state_manager", "on_failure", timeouts, ends_all=True)]
    children += [Child(name, "on_failure", timeouts) for name in PARTS]
    plan = Supervisor("root", children, intensity=Intensity(restarts=1000, within_s=600.0))
    parts = [kind.with_args(folder=folder, port=port) for kind in (Pilot, Drive, Motors)]
    ProcessRunner(parts, plan=plan, health_at=("127.0.0.1", int(health_port))).run(Path(folder))


if __name__ == "__main__":
    main(*sys.argv[1:])
