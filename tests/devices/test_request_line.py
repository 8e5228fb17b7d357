"""A line on which one request at a time is on its way: order, times, ages, commands, failures."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from snr_sim import Config, FakeActuator, FakeSensor, Node, SimClock, TaskType, TimeoutLoopFactory
from snr_sim.devices.request_line import RequestLineFactory
from snr_sim.prelude.errors import CommandError, ComponentFailedError, ParameterError
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory


class Reading(msgspec.Struct, frozen=True):
    value: float
    stamp_s: float


class Push(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    a: float = 0.0
    d: float = 0.0


LIMITS = {"a": (-100.0, 100.0), "d": (-100.0, 100.0)}


class Lab:
    """A line of 30 ms with three sensors, and what comes through it."""

    def __init__(self, *commands: tuple[float, Any], end_s: float = 0.5, **settings: Any) -> None:
        self.asked: list[tuple[float, str]] = []
        self.arrived: list[tuple[float, str, float]] = []
        self.written: list[tuple[float, Any]] = []
        self.actuator = FakeActuator(Push, LIMITS)
        self.sensors = {key: FakeSensor([Reading(1.0, 0.0)]) for key in ("range", "touch", "wheels")}
        line = RequestLineFactory(
            {key: lambda key=key: self._sensor(key) for key in self.sensors},
            "motors",
            self._actuator,
            **{"request_s": 0.03, "timeout_s": 10.0, **settings},
        )
        handlers = {(TaskType.process_data, key): self._note for key in self.sensors}
        commands_left = list(commands)

        def pilot(loop: Any) -> None:
            if commands_left and loop.get_time_s() >= commands_left[0][0] - 1e-9:
                loop.store_data("motors", commands_left.pop(0)[1])

        factories = [
            line,
            FunctionEndpointFactory(handlers, "watcher"),
            FunctionLoopFactory(pilot, "pilot", 1000.0),
            TimeoutLoopFactory(seconds=end_s),
        ]
        self.node = Node("r", Config(factories={"r": factories}), clock=SimClock())

    def _sensor(self, key: str) -> Any:
        sensor, read = self.sensors[key], self.sensors[key].read

        def noted() -> Any:
            self.asked.append((self.node.get_time_s(), key))
            return read()

        sensor.read = noted  # type: ignore[method-assign]
        return sensor

    def _actuator(self) -> Any:
        actuator, write = self.actuator, self.actuator.write

        def noted(command: Any) -> Any:
            self.written.append((self.node.get_time_s(), command))
            return write(command)

        actuator.write = noted  # type: ignore[method-assign]
        return actuator

    def _note(self, task: Any, key: Any) -> None:
        self.arrived.append((self.node.get_time_s(), task.page.key, self.node.get_time_s() - task.page.created_at_s))

    def run(self) -> Lab:
        self.node.loop()
        return self


def near(*values: float) -> Any:
    return pytest.approx(list(values), abs=1e-6)


def test_sensors_are_asked_in_turn_one_request_after_the_other() -> None:
    lab = Lab().run()
    assert [key for _, key in lab.asked[:6]] == ["range", "touch", "wheels"] * 2
    begin = lab.asked[0][0]
    assert [time - begin for time, _ in lab.asked[:6]] == near(0.0, 0.03, 0.06, 0.09, 0.12, 0.15)


def test_reading_is_as_old_as_its_way_back() -> None:
    lab = Lab().run()
    assert len(lab.arrived) > 10
    assert [age for _, _, age in lab.arrived] == near(*[0.015] * len(lab.arrived))
    assert [at - asked for (at, _, _), (asked, _) in zip(lab.arrived, lab.asked, strict=False)] == near(
        *[0.015] * len(lab.arrived)
    )


def test_three_sensors_and_a_command_take_four_requests() -> None:
    """Fabry and Campusano 2014, section 3.2: 30 ms each, 120 ms together."""
    lab = Lab(*[(0.001 * i, {"a": float(i % 100), "d": 0.0}) for i in range(1, 480)]).run()
    # A command changes at each millisecond, so it takes every turn; a reading comes only if there is nothing new.
    assert len(lab.written) > 10
    lab = Lab((0.100, {"a": 50.0, "d": 50.0})).run()
    (time, command), *_ = lab.written
    assert command == Push(50.0, 50.0)
    before = [at for at, _ in lab.asked if at < time]
    after = [at for at, _ in lab.asked if at > time]
    assert after[0] - before[-1] == pytest.approx(0.06, abs=1e-6), "the command took the turn of one request"
    assert 0.015 <= time - 0.100 <= 0.045 + 1e-3


def test_newest_of_several_commands_is_sent_once() -> None:
    lab = Lab(*[(0.101 + 0.001 * i, {"a": float(i), "d": 0.0}) for i in range(1, 9)]).run()
    values = [command.a for _, command in lab.written]
    assert values[-1] == 8.0
    assert len(values) <= 2
    repeated = Lab(*[(0.1 + 0.01 * i, {"a": 20.0, "d": 0.0}) for i in range(20)]).run()
    assert [command.a for _, command in repeated.written] == [20.0], "the same command is not sent again"


def test_applied_command_has_its_delay() -> None:
    lab = Lab((0.100, {"a": 50.0, "d": -300.0})).run()
    page = lab.node.get_data("motors_applied")
    assert page == {"a": 50.0, "d": -100.0, "delay_s": pytest.approx(lab.written[0][0] - 0.100, abs=1e-3)}
    assert any("clamped" in note for note in lab.node.notes)


def test_old_command_is_followed_by_neutral() -> None:
    lab = Lab((0.1, {"a": 50.0, "d": 50.0}), timeout_s=0.1).run()
    assert [command for _, command in lab.written] == [Push(50.0, 50.0), Push()]
    assert lab.written[1][0] - 0.1 == pytest.approx(0.1 + 0.03, abs=0.031)


def test_end_of_run_is_neutral_and_closes_everything() -> None:
    lab = Lab((0.1, {"a": 50.0, "d": 50.0})).run()
    assert lab.actuator.is_closed
    assert all(sensor.is_closed for sensor in lab.sensors.values())
    assert lab.actuator.is_neutral


def test_invalid_command_ends_run_at_neutral() -> None:
    lab = Lab((0.1, {"a": "fast", "d": 0.0}))
    with pytest.raises(ComponentFailedError, match="motors") as caught:
        lab.run()
    assert isinstance(caught.value.__cause__, CommandError)
    assert lab.actuator.is_neutral


def test_jitter_is_chance_of_the_seed() -> None:
    times = []
    for seed in (1, 1, 2):
        lab = Lab(jitter_s=0.01, rng=np.random.default_rng(seed)).run()
        times.append([time for time, _ in lab.asked])
    assert times[0] == times[1] != times[2]
    gaps = np.diff(times[0])
    assert gaps.min() >= 0.03 - 1e-6
    assert gaps.max() <= 0.04 + 1e-6
    assert gaps.std() > 1e-4


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"request_s": 0.0}, "request_s"), ({"timeout_s": -1.0}, "timeout_s"), ({"jitter_s": 0.1}, "chance")],
)
def test_impossible_line_is_refused(settings: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Lab(**settings)


def test_line_needs_a_sensor() -> None:
    with pytest.raises(ParameterError, match="without sensors"):
        RequestLineFactory({}, "motors", lambda: FakeActuator(Push, LIMITS), 0.03)


def test_sensor_that_does_not_open_leaves_motors_closed() -> None:
    lab = Lab()

    def broken() -> Any:
        raise CommandError("no sensor here")

    actuator = FakeActuator(Push, LIMITS)
    line = RequestLineFactory({"range": broken}, "motors", lambda: actuator, 0.03)
    node = Node("r", Config(factories={"r": [line]}), clock=SimClock())
    with pytest.raises(ComponentFailedError, match="no sensor here"):
        node.loop()
    assert actuator.is_closed
    assert actuator.is_neutral
    assert lab.written == []
