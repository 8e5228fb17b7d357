"""The contract checks accept devices that meet the contract, and name the rule that a device breaks."""

import math
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from snr_sim import FakeActuator, FakeSensor
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import CommandError, DeviceError, ParameterError, SensorLostError
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.testing.contracts import check_actuator, check_plant, check_sensor


class Depth(msgspec.Struct, frozen=True):
    depth_m: float
    stamp_s: float


class Push(msgspec.Struct, frozen=True):
    thrust_n: float = 0.0
    gimbal_rad: float = 0.0


class Pulses(msgspec.Struct, frozen=True):
    pulses_us: list[float]


class Thawed(msgspec.Struct):
    depth_m: float = 0.0


LIMITS = {"thrust_n": (-5.0, 40.0), "gimbal_rad": (-0.1, 0.1)}


def test_fakes_implement_their_interfaces() -> None:
    check_sensor(lambda: FakeSensor([Depth(1.0, 0.0), Depth(2.0, 0.1)]))
    check_actuator(lambda: FakeActuator(Push, LIMITS), Push(10.0, 0.05))
    check_actuator(lambda: FakeActuator(Pulses, {"pulses_us": (1100.0, 1900.0)}), Pulses([1500.0, 1600.0]))


def test_a_fake_sensor_gives_its_readings_then_the_last_one_again() -> None:
    sensor = FakeSensor([Depth(1.0, 0.0), SensorLostError("wet plug"), Depth(2.0, 0.1)])
    assert sensor.read().depth_m == 1.0
    with pytest.raises(SensorLostError, match="wet plug"):
        sensor.read()
    assert [sensor.read().depth_m for _ in range(3)] == [2.0, 2.0, 2.0]
    sensor.close()
    with pytest.raises(SensorLostError, match="closed"):
        sensor.read()
    with pytest.raises(SensorLostError, match="no readings"):
        FakeSensor([]).read()


def test_a_fake_actuator_remembers_what_was_applied() -> None:
    actuator = FakeActuator(Push, LIMITS)
    assert actuator.is_neutral
    assert actuator.write(Push(100.0, 0.0)) == Push(40.0, 0.0)
    assert not actuator.is_neutral
    with pytest.raises(CommandError, match="thrust_n must be a finite number, not nan"):
        actuator.write(Push(math.nan, 0.0))
    with pytest.raises(CommandError, match="takes Push, not Depth"):
        actuator.write(Depth(1.0, 0.0))  # type: ignore[arg-type]
    assert actuator.written == [Push(40.0, 0.0)]
    actuator.close()
    assert actuator.is_neutral
    with pytest.raises(DeviceError, match="closed"):
        actuator.write(Push())
    with pytest.raises(ParameterError, match="did you mean 'thrust_n'"):
        FakeActuator(Push, {"thrst_n": (0.0, 1.0)})


class Timeless(msgspec.Struct, frozen=True):
    depth_m: float


class Answers(LifeCycle):
    """A sensor that returns given values."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def read(self) -> Any:
        return self.answer


class TurnsBack(Answers):
    """Sensor whose clock goes backwards."""

    def read(self) -> Any:
        self.answer = Depth(1.0, self.answer.stamp_s - 0.1)
        return self.answer


class ClosesOnce(Answers):
    def close(self) -> None:
        if self.state == "closed":
            raise OSError("Bad file descriptor")
        super().close()


class StaysActive(Answers):
    def deactivate(self, reason: str) -> None: ...


class Headless:
    def read(self) -> None: ...


@pytest.mark.parametrize(
    ("sensor", "promise"),
    [
        (lambda: Answers(None), "returned None; it returns Stale"),
        (lambda: Answers(Stale("asleep")), "one that has readings returned Stale"),
        (lambda: Answers({"depth_m": 1}), "a reading is a msgspec Struct"),
        (lambda: Answers(Thawed()), "Thawed is frozen"),
        (lambda: Answers(Timeless(1.0)), r"Timeless.stamp_s must be a finite time in seconds, not None"),
        (lambda: Answers(Depth(1.0, math.nan)), "Depth.stamp_s must be a finite time in seconds, not nan"),
        (lambda: Answers(Depth(1.0, "noon")), "Depth.stamp_s must be a finite time in seconds, not 'noon'"),  # type: ignore[arg-type]
        (lambda: TurnsBack(Depth(1.0, 0.0)), r"a Depth of -0.2 s came after one of -0.1 s"),
        (lambda: Answers(Depth(math.nan, 0.0)), "Depth.depth_m is nan, which is not finite"),
        (lambda: Answers(Depth([0.0, {"a": (math.inf,)}], 0.0)), "Depth.depth_m is .*inf"),  # type: ignore[arg-type]
        (Headless, "lacks read"),
        (lambda: StaysActive(Depth(1.0, 0.0)), r"after deactivate\(\) the state is .*'active'"),
        (lambda: Answers(Depth(1.0, 0.0)), r"read\(\) after close\(\) raises SensorLostError, but returned Depth"),
    ],
)
def test_broken_sensor_raises_with_rule(sensor: Callable[[], Any], promise: str) -> None:
    with pytest.raises(AssertionError, match=f"Contract violated: .*{promise}"):
        check_sensor(sensor)


def test_error_of_second_close_is_raised_unchanged() -> None:
    with pytest.raises(OSError, match="Bad file descriptor"):
        check_sensor(lambda: ClosesOnce(Depth(1.0, 0.0)))


class Unlimited(FakeActuator[Push]):
    def _clamp(self, name: str, value: Any, low: float, high: float) -> Any:
        return value


class TakesNan(FakeActuator[Push]):
    def write(self, command: Push) -> Push:
        return super().write(command) if math.isfinite(command.thrust_n) else Push()


@pytest.mark.parametrize(
    ("actuator", "promise"),
    [
        (lambda: Unlimited(Push, LIMITS), "'thrust_n' = -6.0 was applied, limits are -5.0 .. 40.0"),
        (lambda: TakesNan(Push, LIMITS), r"'thrust_n' = nan was applied as Push\(thrust_n=0.0"),
        (lambda: FakeActuator(Push, {"thrust_n": (0.0, 20.0)}), "leave out a field"),
        (lambda: FakeActuator(Depth, {}), "takes Depth, the command is a Push"),
    ],
)
def test_broken_actuator_raises_with_rule(actuator: Callable[[], Any], promise: str) -> None:
    with pytest.raises(AssertionError, match=promise):
        check_actuator(actuator, Push(10.0, 0.0))


class Cart:
    """A mass with a force on it: the smallest plant that meets the contract. Its subclasses break one rule each."""

    engine = "cart 1"
    step_s: float | None = 0.1
    inputs: tuple[str, ...] = ("push",)
    outputs: tuple[str, ...] = ("depth",)

    def __init__(self) -> None:
        self.reset(0)

    def reset(self, seed: int) -> None:
        self.time_s, self.steps, self.x_m, self.v_mps, self.thrust_n = 0.0, 0, seed * 0.1, 0.0, 0.0

    def step(self, dt_s: float) -> None:
        self.steps += 1
        self.time_s = self.steps * dt_s
        self.v_mps += self.thrust_n * dt_s
        self.x_m += self.v_mps * dt_s

    def write(self, name: str, command: Push) -> None:
        if not math.isfinite(command.thrust_n):
            raise CommandError("no number")
        self.thrust_n = command.thrust_n

    def read(self, name: str) -> Any:
        return Depth(self.x_m, self.time_s)

    def snapshot(self) -> Any:
        return dict(vars(self))

    def restore(self, snapshot: Any) -> None:
        vars(self).update(snapshot)

    def scene(self) -> dict[str, Any]:
        box = {"kind": "box", "half_size_m": [1, 1, 1], "center_m": [0, 0, 0], "rgb": [9, 9, 9]}
        line = {"kind": "polyline", "points_m": [[0, 0, 0], [1, 0, 0]], "rgb": [9, 9, 9], "radius_m": 0.1}
        return {"statics": {"rail": line}, "bodies": {"cart": [box]}}

    def truth(self) -> dict[str, Any]:
        return {
            "poses": {"cart": [self.x_m, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]},
            "vectors": {"push": [self.x_m, 0.0, 0.0, self.thrust_n, 0.0, 0.0]},
            "values": {"x_m": self.x_m},
        }


class ReadsWhatWasRecorded(Cart):
    """A sensor that sees the last step's place, but that of now once the truth was recorded."""

    def reset(self, seed: int) -> None:
        super().reset(seed)
        self.seen_m = self.x_m

    def step(self, dt_s: float) -> None:
        self.seen_m = self.x_m
        super().step(dt_s)

    def read(self, name: str) -> Any:
        return Depth(self.seen_m, self.time_s)

    def truth(self) -> dict[str, Any]:
        self.seen_m = self.x_m
        return super().truth()


class RemembersSpeed(Cart):
    def reset(self, seed: int) -> None:
        speed_mps = getattr(self, "v_mps", 0.0)
        super().reset(seed)
        self.v_mps = speed_mps


class Chancy(Cart):
    made = 0

    def __init__(self) -> None:
        super().__init__()
        Chancy.made += 1
        self.number = Chancy.made

    def step(self, dt_s: float) -> None:
        super().step(dt_s)
        self.x_m += 1e-16 * self.number + 1e-9 * self.number


class HalfSnapshot(Cart):
    def snapshot(self) -> Any:
        return {"x_m": self.x_m}


class ConsumedSnapshot(Cart):
    def restore(self, snapshot: Any) -> None:
        super().restore(snapshot)
        snapshot.clear()


class StandsStill(Cart):
    def step(self, dt_s: float) -> None:
        self.x_m += dt_s


class TakesNanIn(Cart):
    def write(self, name: str, command: Push) -> None:
        self.thrust_n = command.thrust_n


class ShowsNumpy(Cart):
    def truth(self) -> dict[str, Any]:
        return {**super().truth(), "values": {"x_m": math.nan, "position": (1.0, 2.0)}}


class UnknownBody(Cart):
    def scene(self) -> dict[str, Any]:
        return {**super().scene(), "bodies": {}}


class OddShape(Cart):
    def scene(self) -> dict[str, Any]:
        return {"statics": {"ball": {"kind": "sphere"}}, "bodies": {"cart": []}}


class BadQuaternion(Cart):
    def truth(self) -> dict[str, Any]:
        return {**super().truth(), "poses": {"cart": [0.0] * 7}}


class DictReading(Cart):
    def read(self, name: str) -> Any:
        return {"depth_m": self.x_m}


def test_valid_plant_passes() -> None:
    check_plant(Cart, {"push": Push(2.0)})
    check_plant(Cart)


@pytest.mark.parametrize(
    ("plant", "promise"),
    [
        (RemembersSpeed, r"nothing of the run before survives reset\(3\)"),
        (Chancy, "same bits"),
        (ReadsWhatWasRecorded, r"truth\(\) and read\(\) change no output"),
        (HalfSnapshot, "restored once"),
        (ConsumedSnapshot, "restored twice"),
        (StandsStill, "step 0 of 0.1 s moved time by 0.0 s"),
        (TakesNanIn, "after 'push.thrust_n' = NaN the state is no longer finite"),
        (ShowsNumpy, r"truth\(\) is JSON"),
        (UnknownBody, r"a pose of 'cart', which scene\(\) does not show"),
        (OddShape, "a shape"),
        (BadQuaternion, "pose of 'cart'"),
        (DictReading, "output 'depth' is a msgspec Struct"),
        (object, "lacks a member of Plant"),
    ],
)
def test_broken_plant_raises_with_rule(plant: Callable[[], Any], promise: str) -> None:
    with pytest.raises(AssertionError, match=f"Contract violated: (.|\n)*{promise}"):
        check_plant(plant, {"push": Push(2.0)})


def test_command_for_unknown_input_raises() -> None:
    with pytest.raises(AssertionError, match="commands for"):
        check_plant(Cart, {"pull": Push(2.0)})
