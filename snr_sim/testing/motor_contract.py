"""Contract of motors: behaviour common to all backends, checked on one, by its answers and by what the motors do.

Motors are an `Actuator` of `DriveCommand`, with these rules in addition. No interface of their own is needed: a command
holds the end of its lease, each wheel's reading has a sensor, and `neutral` and `deactivate` stop. Neutral of a wheel
that was driven takes away its torque at once, and brakes after `RELEASE_S`.

A backend of your own needs a bench for it, a class with the members of `MotorBench`, and one test:

    def test_it_keeps_the_contract() -> None:
        check_motors(MyBench())
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Protocol

from snr_sim.devices.motors.motor_backend import RELEASE_S
from snr_sim.prelude.device import LEASE_S, Actuator
from snr_sim.prelude.errors import CommandError, DeviceError
from snr_sim.prelude.ground_signals import DriveCommand, DriveMode
from snr_sim.prelude.interfaces import implements
from snr_sim.testing.contracts import require

SILENCE_S = LEASE_S + RELEASE_S  # until a wheel without commands brakes: controllers have a timeout of their own
_MODES: tuple[DriveMode, ...] = ("speed", "current", "duty", "brake")
_LATE_S = 0.02  # of a motor's controller, and of the bench's steps
_OF_A_VALUE = 0.01  # controllers receive whole numbers of small units


class MotorBench(Protocol):
    """A bench with motors on it, in simulated time.

    Attributes:
        can_unplug: whether `unplug` and `plug_in` do something.
        stops_all: whether all brake when one is unplugged.
    """

    can_unplug: bool
    stops_all: bool

    def open(self) -> Actuator[DriveCommand]:
        """Open the motors, as a robot would."""
        ...

    def now_s(self) -> float:
        """Return the time of the motors' clock in seconds."""
        ...

    def advance(self, seconds: float) -> None:
        """Advance the time; read each motor now and then, as a robot does."""
        ...

    def does(self) -> Sequence[tuple[str, float]]:
        """Return what each motor does: mode and value."""
        ...

    def unplug(self, index: int) -> None:
        """Pull the wire of a motor's controller."""
        ...

    def plug_in(self, index: int) -> None:
        """Put it back."""
        ...


def check_motors(bench: MotorBench) -> None:
    """Check motors on a bench: life cycle, arming, clamping, invalid commands, leases, silence, unplugging.

    Raises:
        AssertionError: with a message that names the broken rule.
    """
    checks = [_life, _arm, _commands, _invalid, _lease, _silence]
    if bench.can_unplug:
        checks += [_unplug, _unplug_early, _unplug_last]
    for check in checks:
        motors = bench.open()
        try:
            check(_Driver(bench, motors))
        finally:
            motors.close()
            motors.close()
        require(motors.health().state == "closed", f"after close() the state is '{motors.health().state}'")
        motors.deactivate("checked")  # both are safe at any time
        motors.neutral()


class _Driver:
    """Writes commands, and checks what motors do."""

    def __init__(self, bench: MotorBench, motors: Actuator[DriveCommand]) -> None:
        self.bench, self.motors = bench, motors
        self.count = len(bench.does())
        self.fast = DriveCommand("speed", [2.0 + 0.5 * i for i in range(self.count)])

    def ready(self) -> None:
        """Configure and activate, and drive."""
        self.motors.configure()
        self.motors.activate()
        self.check_follows(self.fast, "active")

    def check_follows(self, command: DriveCommand, when: str) -> None:
        """Check that motors do what a command says, which is inside the limits."""
        applied = self.motors.write(command)
        require(applied == command, f"{when}, {command} is answered by {applied}")
        self.check_does(command, when)

    def check_does(self, command: DriveCommand, when: str) -> None:
        """Check that each motor does its part of a command."""
        for i, ((mode, does), value) in enumerate(zip(self.bench.does(), command.values, strict=True)):
            off = abs(does) - abs(value) if mode == "brake" else does - value  # a brake has no direction
            is_so = mode == command.mode and abs(off) <= _OF_A_VALUE
            require(is_so, f"{when}, motor {i} does {mode} {does}, not {command.mode} {value}")

    def check_brakes(self, when: str, but: Sequence[int] = ()) -> None:
        """Check that motors brake, but those with these indices, which do not."""
        for i, (mode, value) in enumerate(self.bench.does()):
            is_so = (mode == "brake" and value > 0.0) != (i in but)
            require(is_so, f"{when}, motor {i} does {mode} {value}")

    def check_idles(self, when: str) -> None:
        """Check that no motor pushes."""
        for i, (mode, value) in enumerate(self.bench.does()):
            require(mode == "brake" or value == 0.0, f"{when}, motor {i} does {mode} {value}")

    def check_releases(self, when: str) -> None:
        """Check that motors turn freely, until they brake after `RELEASE_S`, in which `neutral` is called again."""
        for seconds in (0.0, RELEASE_S - _LATE_S):
            self.bench.advance(seconds)
            self.motors.neutral()
            for i, (mode, value) in enumerate(self.bench.does()):
                require(
                    mode != "brake" and value == 0.0, f"{when}, motor {i} does {mode} {value}, and must turn freely"
                )
        self.bench.advance(2.0 * _LATE_S)
        self.motors.neutral()
        self.check_brakes(f"{RELEASE_S + _LATE_S:g} s later, {when}")

    def check_refuses(self, when: str, was_driven: bool = False) -> None:
        """Check that a command is answered by neutral, and that all brake, those that were driven after a while."""
        applied = self.motors.write(self.fast)
        require(not applied.values, f"{when}, {self.fast} is answered by {applied}, not by neutral")
        (self.check_releases if was_driven else self.check_brakes)(f"{when}, and commanded")

    def check_state(self, state: str, when: str) -> None:
        """Check the state."""
        health = self.motors.health()
        require(health.state == state, f"{when} it is '{health.state}', not '{state}'")
        require(state != "error" or bool(health.reason), f"{when} the health has no reason")

    def check_raises(self, call: Any, error: type[Exception], what: str) -> None:
        """Check that a call raises."""
        try:
            call()
        except error:
            return
        raise AssertionError(f"Contract violated: {what} raises a {error.__name__}.")


def _life(driver: _Driver) -> None:
    motors = driver.motors
    require(implements(motors, Actuator), f"{motors!r} lacks a member of Actuator")
    require(motors.command_type is DriveCommand, f"motors take DriveCommand, not {motors.command_type}")
    driver.check_raises(motors.activate, DeviceError, "activate() before configure()")
    for step, state in ((motors.configure, "inactive"), (motors.activate, "active")):
        step()
        step()
        driver.check_state(state, f"after {step.__name__}()")
    driver.check_follows(driver.fast, "active")
    motors.neutral()
    driver.check_releases("after neutral()")
    for command in (driver.fast, DriveCommand("brake", driver.fast.values)):
        driver.check_follows(command, "after neutral()")
        motors.neutral()
    driver.check_brakes("after a brake and neutral()")
    driver.check_follows(driver.fast, "after neutral()")
    motors.deactivate("checked")
    motors.deactivate("checked")
    driver.check_state("inactive", "after deactivate()")
    driver.check_releases("after deactivate()")
    motors.activate()
    driver.check_follows(driver.fast, "activated again")
    motors.close()
    driver.bench.advance(SILENCE_S)
    driver.check_brakes(f"{SILENCE_S:g} s after close()")
    driver.check_raises(lambda: motors.write(driver.fast), DeviceError, "write() after close()")
    driver.check_raises(motors.configure, DeviceError, "configure() after close()")


def _arm(driver: _Driver) -> None:
    """Arm from neutral: commands from before `activate` are not done after it."""
    motors = driver.motors
    driver.check_refuses("before configure()")
    motors.configure()
    driver.check_refuses("before activate()")
    motors.activate()
    driver.check_brakes("activated, and not commanded since")
    driver.check_follows(driver.fast, "commanded since")
    motors.deactivate("checked")
    driver.check_refuses("after deactivate()", was_driven=True)
    motors.activate()
    driver.check_brakes("activated again, and not commanded since")


def _commands(driver: _Driver) -> None:
    motors, count = driver.motors, driver.count
    driver.ready()
    for mode in _MODES:
        motors.write(DriveCommand(mode, [0.0] * count))
        low, high = motors.limits["values"]
        require(math.isfinite(low) and math.isfinite(high) and low < high, f"limits of {mode} are {low} to {high}")
        each = [low + (high - low) * (i + 0.37) / count for i in range(count)]
        for values in (each, each[::-1], [low] * count, [high] * count):
            driver.check_follows(DriveCommand(mode, values), f"commanded {mode}")
        for beyond, limit in ((high + 1.0, high), (low - 1.0, low), (1e300, high), (-1e300, low)):
            command, clamped = DriveCommand(mode, [beyond, *each[1:]]), DriveCommand(mode, [limit, *each[1:]])
            applied = motors.write(command)
            require(applied == clamped, f"{command} is answered by {applied}, limits are {low} to {high}")
            driver.check_does(clamped, f"commanded {mode} {beyond}")
    applied = motors.write(DriveCommand("speed"))
    require(not applied.values, f"a command without values is answered by {applied}")
    driver.check_brakes("commanded to brake, and then no values")
    driver.check_follows(driver.fast, "commanded since")
    motors.write(DriveCommand("speed"))
    driver.check_releases("commanded no values")


def _invalid(driver: _Driver) -> None:
    motors, values = driver.motors, driver.fast.values
    driver.ready()
    cases: list[Any] = [DriveCommand("speed", [*values[1:], bad]) for bad in (math.nan, math.inf, -math.inf)]
    cases += [DriveCommand("speed", values[1:]), DriveCommand("speed", [*values, 1.0])]
    cases += [DriveCommand("sped", values), {"mode": "speed", "values": values}, None]  # type: ignore[arg-type]
    for bad in cases:
        driver.check_raises(lambda bad=bad: motors.write(bad), CommandError, f"write({bad})")
        driver.check_does(driver.fast, f"after {bad} was refused")


def _lease(driver: _Driver) -> None:
    """Send commands whose time is over, which are neutral."""
    bench, motors = driver.bench, driver.motors
    bench.advance(0.5)
    for asked_s in (bench.now_s(), bench.now_s() - 0.1, -math.inf, math.nan):
        driver.ready()
        applied = motors.write(DriveCommand("speed", driver.fast.values, until_s=asked_s))
        require(not applied.values, f"at {bench.now_s()} s a command until {asked_s} s is answered by {applied}")
        driver.check_releases(f"commanded until {asked_s} s, at {bench.now_s()} s")
        motors.deactivate("checked")


def _silence(driver: _Driver) -> None:
    """Send nothing more: each wheel brakes, however long the last command claims to be valid."""
    bench, motors = driver.bench, driver.motors
    for valid_s in (math.inf, LEASE_S, 60.0):
        driver.ready()
        motors.write(DriveCommand("speed", driver.fast.values, bench.now_s() + valid_s))
        bench.advance(LEASE_S - 0.05)
        driver.check_does(driver.fast, f"{LEASE_S - 0.05:g} s after a command")
        bench.advance(SILENCE_S - LEASE_S + 0.05)
        driver.check_idles(f"{SILENCE_S:g} s after the last command")
        bench.advance(2.0 * _LATE_S)
        driver.check_brakes(f"{SILENCE_S + 2.0 * _LATE_S:g} s after the last command")
        driver.check_state("active", "after a silence")
        driver.check_follows(driver.fast, "after a silence")
        motors.deactivate("checked")


def _unplug(driver: _Driver) -> None:
    """Lose a wheel, which brakes by itself; all others do, too, or follow; it is driven again only after arming."""
    bench, motors = driver.bench, driver.motors
    lost, others = 1, [i for i in range(driver.count) if i != 1]
    driver.ready()
    bench.unplug(lost)
    for _ in range(round(SILENCE_S / 0.02)):
        bench.advance(0.02)
        motors.write(driver.fast)
    if not bench.stops_all:
        driver.check_brakes("unplugged", but=others)
        bench.plug_in(lost)
        motors.write(driver.fast)
        driver.check_brakes("plugged in, and not armed since", but=others)
        bench.advance(1.0)
        motors.write(DriveCommand())
        driver.check_follows(driver.fast, "plugged in, and commanded neutral since")
        return
    driver.check_state("error", "unplugged,")
    driver.check_refuses("unplugged")
    driver.check_raises(motors.configure, DeviceError, "configure() while one is unplugged")
    driver.check_refuses("unplugged, and tried again")
    bench.plug_in(lost)
    bench.advance(1.0)
    driver.check_refuses("plugged in")
    motors.configure()
    driver.check_state("inactive", "found again,")
    driver.check_refuses("found again")
    motors.activate()
    driver.check_brakes("armed again, and not commanded since")
    driver.check_follows(driver.fast, "armed again")


def _unplug_early(driver: _Driver) -> None:
    """Pull a wire at each step of the life; whatever is called then, only `configure` and `activate` may raise."""
    bench, motors = driver.bench, driver.motors
    for steps in ([], [motors.configure], [motors.configure, motors.activate]):
        for step in steps:
            step()
        bench.unplug(0)
        for call in (motors.neutral, lambda: motors.write(driver.fast), lambda: motors.deactivate("checked")):
            call()
        for step in (motors.configure, motors.activate):
            with suppress(DeviceError):
                step()
        motors.write(driver.fast)
        bench.advance(SILENCE_S)
        driver.check_brakes(f"unplugged after {len(steps)} steps of its life", but=())
        bench.plug_in(0)
        bench.advance(1.0)
        motors.configure()
        motors.deactivate("checked")
    driver.ready()


def _unplug_last(driver: _Driver) -> None:
    """Close it while a wire is out."""
    driver.ready()
    driver.bench.unplug(0)
