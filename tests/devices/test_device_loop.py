"""Loops between devices and pages: store readings, write commands, neutral if in doubt. On both clocks."""

import math
import re
from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from snr_sim import (
    Config,
    FakeActuator,
    FakeSensor,
    Node,
    Page,
    SimClock,
    Task,
    TaskType,
    TimeoutLoopFactory,
    WallClock,
    tasks,
)
from snr_sim.core.lockstep import LockStep
from snr_sim.devices.commands import ActuatorLoopFactory, CommandLoop
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.prelude.errors import ComponentFailedError, DeviceError, SensorLostError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


class Depth(msgspec.Struct, frozen=True):
    depth_m: float
    stamp_s: float


class Push(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    thrust_n: float = 0.0
    gimbal_rad: float = 0.0


LIMITS = {"thrust_n": (0.0, 40.0), "gimbal_rad": (-0.1, 0.1)}


class Pwm(msgspec.Struct, frozen=True):
    pulses_us: list[float]


CLOCKS = pytest.mark.parametrize("clock", [SimClock, WallClock])


def run(*factories: Any, clock: Callable[[], Any] = SimClock, end_s: float = 0.1, is_replay: bool = False) -> Node:
    config = Config(factories={"r": [*factories, TimeoutLoopFactory(seconds=end_s)]})
    node = Node("r", config, clock=clock(), is_replay=is_replay)
    node.loop()
    return node


def ends_when(is_so: Callable[[Node], bool]) -> FunctionLoopFactory:
    """End the run as soon as a condition is true: a run on the wall clock takes as long as its computer needs."""
    return FunctionLoopFactory(
        lambda loop: is_so(loop.parent) and loop.schedule(tasks.terminate("enough")), "ender", 200.0
    )


def commands(*commands: Any, rate_hz: float = 100.0, taken_by: FakeActuator[Any] | None = None) -> FunctionLoopFactory:
    """Store these command pages, one per tick, then stop; with `taken_by`, each only after it applied the last one."""
    left = list(commands)

    def send(loop: Any) -> None:
        if taken_by is not None and len(taken_by.written) < len(commands) - len(left):
            return
        if left:
            command = left.pop(0)
            loop.store_data("engine", command)
        else:
            loop.stop()

    return FunctionLoopFactory(send, "pilot", rate_hz)


def engine(actuator: FakeActuator[Push], rate_hz: float = 100.0, timeout_s: float = 0.5) -> ActuatorLoopFactory:
    return ActuatorLoopFactory("engine", lambda: actuator, rate_hz, timeout_s)


@pytest.mark.slow
@CLOCKS
def test_sensor_loop_stores_each_reading_and_closes_sensor(clock: Callable[[], Any]) -> None:
    sensor = FakeSensor([Depth(1.0, 0.0), Depth(2.0, 0.01)])
    enough = ends_when(lambda node: node.datastore.stored >= 5)
    node = run(SensorLoopFactory("depth", lambda: sensor, 100), enough, clock=clock, end_s=60.0)
    assert node.get_data("depth") == {"depth_m": 2.0, "stamp_s": 0.01}
    assert node.exit_reason == "enough"
    assert sensor.is_closed


@pytest.mark.parametrize("process", [True, False])
def test_sensor_loop_process_false_triggers_no_task(process: bool) -> None:
    seen: list[Any] = []
    sensor = FakeSensor([Depth(1.0, 0.0), Depth(2.0, 0.01)])
    watcher = FunctionEndpointFactory({(TaskType.process_data, "depth"): lambda task, task_id: seen.append(task)})
    node = run(SensorLoopFactory("depth", lambda: sensor, 100, process), watcher)
    assert bool(seen) is process
    assert node.get_data("depth")["depth_m"] == 2.0


def test_lost_sensor_ends_run_with_its_message_and_is_closed() -> None:
    sensor: FakeSensor[Depth] = FakeSensor(
        [Depth(1.0, 0.0), SensorLostError("The depth sensor has not answered for 2 s.")]
    )
    with pytest.raises(ComponentFailedError, match=r"has not answered for 2 s(.|\n)*'depth_sensor'"):
        run(SensorLoopFactory("depth", lambda: sensor, 100))
    assert sensor.is_closed


@pytest.mark.slow
@CLOCKS
def test_actuator_loop_writes_each_command_once_between_neutrals(clock: Callable[[], Any]) -> None:
    actuator = FakeActuator(Push, LIMITS)
    run(
        commands({"thrust_n": 5.0}, {"thrust_n": 6.0, "gimbal_rad": 0.05}, taken_by=actuator),
        engine(actuator, timeout_s=20.0),
        ends_when(lambda node: len(actuator.written) == 2),
        clock=clock,
        end_s=60.0,
    )
    assert actuator.written == [Push(5.0, 0.0), Push(6.0, 0.05)]
    assert actuator.is_neutral
    assert actuator.is_closed
    assert actuator.neutral_count >= 3  # when opened, when halted, when closed


def test_actuator_loop_writes_command_at_time_of_page() -> None:
    actuator = FakeActuator(Push, LIMITS)
    clock = SimClock()
    node = Node("r", Config(factories={"r": [commands({"thrust_n": 5.0}), engine(actuator)]}), clock=clock)
    LockStep([node], clock, until_s=0.0).run()
    assert actuator.written == [Push(5.0, 0.0)]


def test_actuator_loop_is_woken_by_each_command_only() -> None:
    """On the wall clock, so that a command does not wait for a tick: in lock step that changes nothing."""
    wake_times_s: list[float] = []

    class WakeRecordingFactory(ActuatorLoopFactory):
        def get(self, parent: Node) -> CommandLoop:
            loop = super().get(parent)
            loop.wake = lambda: wake_times_s.append(parent.clock.now_s())  # type: ignore[method-assign]
            return loop

    actuator = FakeActuator(Push, LIMITS)
    other = FunctionLoopFactory(lambda loop: loop.store_data("depth", 1.0), "other", 200.0)
    sent = commands({"thrust_n": 5.0}, {"thrust_n": 6.0}, rate_hz=50.0)
    run(other, sent, WakeRecordingFactory("engine", lambda: actuator, 100.0))
    assert wake_times_s == [0.0, 0.02]


def test_actuator_loop_command_too_old_writes_neutral() -> None:
    actuator = FakeActuator(Push, LIMITS)
    neutral_at: list[float] = []

    def watch(loop: Any) -> None:
        if actuator.written and actuator.is_neutral:
            neutral_at.append(loop.get_time_s())

    run(commands({"thrust_n": 5.0}), engine(actuator, timeout_s=0.2), FunctionLoopFactory(watch, "watch"), end_s=1.0)
    assert 0.2 < neutral_at[0] <= 0.2 + 0.011


def test_actuator_loop_command_old_on_arrival_is_ignored() -> None:
    actuator = FakeActuator(Push, LIMITS)
    old = Page("engine", {"thrust_n": 5.0}, "topside_node", 0.0)  # delayed on a link
    late = TimeoutLoopFactory(seconds=0.9, task=tasks.store_page(old), name="late")
    run(late, engine(actuator, timeout_s=0.5), end_s=1.5)
    assert actuator.written == []
    assert actuator.is_neutral


def test_actuator_loop_clamps_command_and_logs_once() -> None:
    actuator = FakeActuator(Push, LIMITS)
    node = run(commands({"thrust_n": 99.0}, {"thrust_n": 98.0}, {"gimbal_rad": -1.0}), engine(actuator))
    assert actuator.written == [Push(40.0, 0.0), Push(40.0, 0.0), Push(0.0, -0.1)]
    assert all("test_device_loop.py, line " in note.splitlines()[0] for note in node.notes)
    assert [note.splitlines()[1].strip().split(" (reported")[0] for note in node.notes] == [
        "Command 'engine.thrust_n' = 99 is outside (0.0, 40.0) and was clamped to 40",
        "Command 'engine.gimbal_rad' = -1 is outside (-0.1, 0.1) and was clamped to -0.1",
    ]


def test_actuator_loop_clamps_each_number_of_list() -> None:
    actuator = FakeActuator(Pwm, {"pulses_us": (1100.0, 1900.0)})
    node = run(commands({"pulses_us": [1500.0, 2000, 0]}), ActuatorLoopFactory("engine", lambda: actuator, 100))
    assert actuator.written == [Pwm([1500.0, 1900.0, 1100.0])]
    assert "= [1500, 2000, 0] is outside (1100.0, 1900.0) and was clamped to [1500, 1900, 1100]" in node.notes[0]


@pytest.mark.slow
@CLOCKS
@pytest.mark.parametrize(
    ("command", "message"),
    [
        ({"thrust_n": math.nan}, "thrust_n"),
        ({"thrust_n": math.inf}, "thrust_n"),
        ({"thrst_n": 1.0}, "did you mean 'thrust_n'"),
        ({"thrust_n": "full"}, "thrust_n is the text 'full', but must be a number from 0 to 40"),
        (5.0, "it is the number 5.0, but must be a dict."),
        (None, 'these fields: {"thrust_n": 0.0, "gimbal_rad": 0.0}'),
    ],
)
def test_invalid_command_leaves_actuator_neutral_and_stops_run(
    command: Any, message: str, clock: Callable[[], Any]
) -> None:
    actuator = FakeActuator(Push, LIMITS)
    with pytest.raises(ComponentFailedError) as caught:
        run(commands({"thrust_n": 5.0}, command, taken_by=actuator), engine(actuator), clock=clock, end_s=20.0)
    assert message in str(caught.value)
    assert "'engine_actuator'" in str(caught.value)
    assert "by send() of component 'pilot'" in str(caught.value)
    assert re.match(
        r".*test_device_loop.py, line \d+: loop.store_data\(.engine., command\)\n  Page 'engine'", str(caught.value)
    )
    assert actuator.written == [Push(5.0, 0.0)]
    assert actuator.is_neutral
    assert actuator.is_closed


def test_invalid_command_from_another_node_names_the_node() -> None:
    far = Page("engine", {"thrust_n": math.nan}, "topside_node", 0.0)
    with pytest.raises(ComponentFailedError, match=r"It was made at t = 0.000 s by node 'topside_node'"):
        run(
            FunctionEndpointFactory(begin=lambda part: part.schedule(tasks.store_page(far))),
            engine(FakeActuator(Push, LIMITS)),
        )


def test_invalid_command_makes_actuator_neutral_before_halt() -> None:
    actuator = FakeActuator(Push, LIMITS)
    neutral_when_others_are_halted: list[bool] = []
    first = FunctionEndpointFactory(halt=lambda part: neutral_when_others_are_halted.append(actuator.is_neutral))
    with pytest.raises(ComponentFailedError):
        run(first, commands({"thrust_n": 5.0}, {"thrust_n": math.nan}), engine(actuator))
    assert neutral_when_others_are_halted == [True]


def fail(task: Task, task_id: Any) -> None:
    raise ValueError("the controller's own mistake")


@pytest.mark.slow
@CLOCKS
def test_component_failure_makes_actuator_neutral(clock: Callable[[], Any]) -> None:
    actuator = FakeActuator(Push, LIMITS)
    with pytest.raises(ComponentFailedError, match="the controller's own mistake"):
        run(
            commands({"thrust_n": 5.0}, {"thrust_n": 6.0}, rate_hz=50),
            engine(actuator),
            FunctionEndpointFactory({TaskType.event: fail}),
            TimeoutLoopFactory(ms=30, task=tasks.event("go"), name="trigger"),
            clock=clock,
            end_s=60.0,
        )
    assert actuator.is_neutral
    assert actuator.is_closed


class Unplugged(FakeActuator[Push]):
    def write(self, command: Push) -> Push:
        raise DeviceError("The port /dev/ttyUSB0 is gone.", fix="check the plug.")


def test_broken_actuator_is_closed_and_reports_error() -> None:
    actuator = Unplugged(Push, LIMITS)
    with pytest.raises(ComponentFailedError, match=r"/dev/ttyUSB0 is gone.(.|\n)*check the plug"):
        run(commands({"thrust_n": 5.0}), engine(actuator))
    assert actuator.is_closed


@pytest.mark.slow
@CLOCKS
def test_device_open_failure_reports_error_and_halts_others(clock: Callable[[], Any]) -> None:
    actuator = FakeActuator(Push, LIMITS)

    def open_nothing() -> Any:
        raise DeviceError("There is no device at /dev/ttyUSB7.", fix="ls /dev/tty*")

    with pytest.raises(ComponentFailedError, match="no device at /dev/ttyUSB7"):
        run(engine(actuator), SensorLoopFactory("depth", open_nothing, 10), clock=clock, end_s=60.0)
    assert actuator.is_neutral
    # In lock step the actuator is opened before the sensor fails; on threads either may come first.
    assert actuator.is_closed or clock is WallClock


def test_replay_opens_no_device() -> None:
    def refuse() -> Any:
        raise AssertionError("opened")

    node = run(SensorLoopFactory("depth", refuse, 10), ActuatorLoopFactory("engine", refuse, 10), is_replay=True)
    assert list(node.components) == ["node_core"]
    assert node.exit_reason == "nothing left to do"
