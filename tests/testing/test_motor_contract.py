"""The contract check accepts motors that meet the contract, and names the rule that others break."""

from collections.abc import Sequence

import msgspec
import pytest

from snr_sim.devices.motors.motor_backend import MotorBackend
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.testing.motor_contract import check_motors

BRAKE = ("brake", 4.0)


class Bench:
    """Motors of one class, in simulated time, with wires."""

    can_unplug = stops_all = True

    def __init__(self, kind: type["Good"]) -> None:
        self.kind, self.time_s, self.unplugged = kind, 10.0, set[int]()
        self.commands, self.until_s = [BRAKE] * 3, 0.0

    def open(self) -> MotorBackend:
        return self.kind(self)

    def now_s(self) -> float:
        return self.time_s

    def advance(self, seconds: float) -> None:
        self.time_s += seconds

    def does(self) -> Sequence[tuple[str, float]]:
        return [BRAKE if self.time_s >= self.until_s else command for command in self.commands]

    def unplug(self, index: int) -> None:
        self.unplugged.add(index)

    def plug_in(self, index: int) -> None:
        self.unplugged.discard(index)


class Good(MotorBackend):
    """Meets the whole contract. Its subclasses break one rule each."""

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench.now_s, 3, {"speed": 18.0, "current": 6.0, "brake": 6.0, "duty": 1.0})
        self.bench = bench

    def put(self, command: DriveCommand, until_s: float) -> bool:
        if self.bench.unplugged:
            self.fail("A wire is out.")
            if command.mode != "off":
                return False
        self.bench.commands = [(command.mode, value) for value in command.values]
        self.bench.until_s = until_s
        return True

    def brake(self) -> None:
        self.bench.commands = [BRAKE] * 3

    def on_configure(self) -> None:
        if self.bench.unplugged:
            raise DeviceError("A wire is out.")


def test_valid_motors_pass() -> None:
    check_motors(Bench(Good))


class DrivesWhileInactive(Good):
    def write(self, command: DriveCommand) -> DriveCommand:
        if self.state == "inactive":
            self.put(command, self.bench.time_s + LEASE_S)
            return command
        return super().write(command)


class RemembersCommands(Good):
    asked: DriveCommand | None = None

    def write(self, command: DriveCommand) -> DriveCommand:
        self.asked = command
        return super().write(command)

    def on_activate(self) -> None:
        if self.asked is not None:
            self.put(self.asked, self.bench.time_s + LEASE_S)


class DoesNotClamp(Good):
    def write(self, command: DriveCommand) -> DriveCommand:
        self._limits = dict.fromkeys(self._limits, 1e301) if self._mode == "duty" else self._limits
        return super().write(command)


class LosesLastOne(Good):
    def write(self, command: DriveCommand) -> DriveCommand:
        try:
            return super().write(command)
        except CommandError:
            self.neutral()
            raise


class RollsFreely(Good):
    def brake(self) -> None:
        self.put(DriveCommand("off", [0.0] * 3), self.bench.time_s + 1e9)


class BrakesAtOnce(Good):
    def neutral(self) -> None:
        self.brake()


class StartsOver(Good):
    def neutral(self) -> None:
        self._is_driven = True
        super().neutral()


class FollowsLateCommands(Good):
    def write(self, command: DriveCommand) -> DriveCommand:
        self._check(command)
        done = super().write(msgspec.structs.replace(command, until_s=self.bench.time_s + LEASE_S))
        return msgspec.structs.replace(done, until_s=command.until_s) if done.values else done


class HasNoLease(Good):
    def put(self, command: DriveCommand, until_s: float) -> bool:
        return super().put(command, until_s if command.mode == "off" else until_s + 1e9)


class SwapsWheels(Good):
    def put(self, command: DriveCommand, until_s: float) -> bool:
        return super().put(msgspec.structs.replace(command, values=command.values[::-1]), until_s)


class ArmsItself(Good):
    def write(self, command: DriveCommand) -> DriveCommand:
        if self.state == "error" and not self.bench.unplugged:
            self.state = "active"
        return super().write(command)


class HidesLoss(Good):
    def fail(self, reason: str) -> None:
        return None


class RaisesWhenUnplugged(Good):
    def brake(self) -> None:
        if self.bench.unplugged:
            raise DeviceError("A wire is out.")
        super().brake()


@pytest.mark.parametrize(
    ("kind", "rule"),
    [
        (DrivesWhileInactive, "before activate.*is answered by .* not by neutral"),
        (RemembersCommands, "activated, and not commanded since, motor 0 does speed"),
        (DoesNotClamp, "limits are|limits of"),
        (LosesLastOne, "was refused, motor 0 does off"),
        (RollsFreely, "after neutral.*motor 0 does off"),
        (BrakesAtOnce, "after neutral.*motor 0 does brake 4.0, and must turn freely"),
        (StartsOver, "0.12 s later, after neutral.*motor 0 does off"),
        (FollowsLateCommands, "a command until .* is answered by"),
        (HasNoLease, "after the last command, motor 0 does speed"),
        (SwapsWheels, "motor 0 does speed 3.0, not speed 2.0"),
        (ArmsItself, "plugged in, DriveCommand.*is answered by"),
        (HidesLoss, "unplugged, it is 'active', not 'error'"),
    ],
)
def test_motors_that_break_a_rule_are_named(kind: type[Good], rule: str) -> None:
    with pytest.raises(AssertionError, match=rule):
        check_motors(Bench(kind))


def test_motors_that_raise_when_unplugged_fail() -> None:
    with pytest.raises(DeviceError, match="A wire is out"):
        check_motors(Bench(RaisesWhenUnplugged))
