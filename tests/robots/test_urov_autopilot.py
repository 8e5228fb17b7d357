"""The vehicle's response to controls that arrive late."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from snr_sim import Page, SimRunner
from snr_sim.core.config import Config
from snr_sim.prelude.signals import DepthReading, ImuReading
from snr_sim.prelude.task import Task, TaskType
from snr_sim.scenario import library
from snr_sim.testing.parts import PartFactory, TickerFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import Autopilot, AutopilotFactory  # noqa: E402
from snr_sim_robot_urov.controls import Controls  # noqa: E402
from snr_sim_robot_urov.parameters import UrovParameters, vehicle  # noqa: E402


def told(age_s: float, **controls: Any) -> Autopilot:
    """The autopilot after ten seconds of controls that are so old when they arrive."""
    number = 0

    def bring(loop: Any) -> None:
        nonlocal number
        number += 1
        now_s = loop.get_time_s()
        level = ImuReading([0.0, 0.0, 0.0], [0.0, 0.0, 9.81], [0.0, 20.0, -40.0], 0.0, 0.0, 0.0, now_s)
        loop.store_data("depth", msgspec.to_builtins(DepthReading(0.95, 110_000.0, 18.0, now_s)), process=False)
        loop.store_data("imu", msgspec.to_builtins(level))
        data = msgspec.structs.asdict(Controls(number, **controls))
        page = Page("controls", data, "topside_node", loop.get_time_s() - age_s, True)
        loop.schedule(Task(TaskType.store_page, "controls", [page]))

    factories = [TickerFactory(bring, "bringer"), AutopilotFactory(UrovParameters(vehicle()))]
    runner = SimRunner(Config(factories={"urov": factories}), until_s=10.0, tells_notes=False)
    runner.run()
    autopilot = runner.nodes["urov"].components["autopilot"]
    assert isinstance(autopilot, Autopilot)
    return autopilot


@pytest.mark.parametrize(("age_s", "rules"), [(0.01, "pilot"), (0.2, "pilot"), (0.3, "idle"), (5.0, "idle")])
def test_controls_that_are_old_when_they_come_are_not_obeyed(age_s: float, rules: str) -> None:
    assert told(age_s, is_armed=True).failsafe.rules(10.0) == rules


def test_a_stop_is_obeyed_however_long_it_was_on_its_way() -> None:
    assert told(5.0, is_stop=True).failsafe.is_stopped


def test_age_counts_from_when_controls_were_made() -> None:
    failsafe = told(0.2, is_armed=True).failsafe
    assert failsafe.heard_s is not None
    assert failsafe.rules(failsafe.heard_s + 0.24) == "pilot"
    assert failsafe.rules(failsafe.heard_s + 0.26) == "neutral"
    assert failsafe.heard_s <= 9.8 + 1e-9


def blind_from(blind_s: float, controls: Controls) -> tuple[Autopilot, list[list[float]]]:
    """The autopilot of a vehicle whose depth sensor stops, five centimetres above the setpoint, and its pulses."""
    number, pulses = 0, []

    def bring(loop: Any) -> None:
        nonlocal number
        number, now_s = number + 1, loop.get_time_s()
        loop.store_data("controls", msgspec.structs.asdict(msgspec.structs.replace(controls, number=number)))
        if now_s < blind_s:
            loop.store_data("depth", msgspec.to_builtins(DepthReading(0.95, 110_000.0, 18.0, now_s)), process=False)
        level = ImuReading([0.0, 0.0, 0.0], [0.0, 0.0, 9.81], [0.0, 20.0, -40.0], 0.0, 0.0, 0.0, now_s)
        loop.store_data("imu", msgspec.to_builtins(level))

    def keep(task: Task, task_id: Any) -> None:
        pulses.append(task.val_list[0].data["pulses_us"])

    factories = [
        TickerFactory(bring, "bringer", 20.0),
        AutopilotFactory(UrovParameters(vehicle())),
        PartFactory({(TaskType.store_page, "pwm"): keep}),
    ]
    runner = SimRunner(Config(factories={"urov": factories}), until_s=4.0, tells_notes=False)
    runner.run()
    autopilot = runner.nodes["urov"].components["autopilot"]
    assert isinstance(autopilot, Autopilot)
    return autopilot, pulses


def test_depth_that_is_no_longer_measured_is_no_longer_held_and_that_is_said_once() -> None:
    holds = Controls(is_armed=True, mode="heading_hold", depth_m=1.0, heading_rad=0.0)
    seeing, pulses = blind_from(10.0, holds)
    assert not seeing.is_blind
    assert pulses[-1] != [1500.0] * 8  # five centimetres too high: it pushes down
    blind, pulses = blind_from(2.0, holds)
    assert blind.is_blind
    assert blind.told(4.0, ImuReading([0.0] * 3, [0.0] * 3, [0.0] * 3, 0.0, 0.0, 0.0, 4.0))["is_blind"]
    assert pulses[-1] == [1500.0] * 8  # the last reading does not push it on indefinitely
    (note,) = [note for note in blind.parent.notes if "no fresh reading of depth" in note]
    assert 2.4 < float(note.partition("t = ")[2].partition(" s")[0]) < 2.6


def test_a_blind_vehicle_still_obeys_the_sticks() -> None:
    _, pulses = blind_from(1.0, Controls(is_armed=True, mode="depth_hold", heave=1.0))
    assert pulses[-1] != [1500.0] * 8


def test_outputs_that_let_go_are_armed_again_only_by_who_disarms_first_and_the_surface_is_told() -> None:
    state, told, commands = {"state": "inactive", "fault": "", "why": ["not active"]}, [], []

    def bring(loop: Any) -> None:
        now_s = loop.get_time_s()
        controls = Controls(number=round(now_s * 20) + 1, is_armed=not 2.0 <= now_s < 2.2, mode="manual", surge=1.0)
        loop.store_data("controls", msgspec.structs.asdict(controls))
        if now_s >= 0.5 and state["state"] == "inactive" and not state["fault"]:
            state["state"] = "active"
        if 1.0 <= now_s < 1.05:
            state.update(state="inactive", fault="nobody renewed the command")
        if 2.3 <= now_s < 2.35:
            state.update(state="active", fault="")
        loop.store_data("pwm_applied", dict(state), process=False)
        loop.store_data("depth", msgspec.to_builtins(DepthReading(0.95, 110_000.0, 18.0, now_s)), process=False)
        level = ImuReading([0.0, 0.0, 0.0], [0.0, 0.0, 9.81], [0.0, 20.0, -40.0], 0.0, 0.0, 0.0, now_s)
        loop.store_data("imu", msgspec.to_builtins(level))

    def keep(task: Task, task_id: Any) -> None:
        page = task.val_list[0]
        (commands if page.key == "pwm" else told).append((page.created_at_s, page.data))

    factories = [
        TickerFactory(bring, "bringer", 20.0),
        AutopilotFactory(UrovParameters(vehicle())),
        PartFactory({(TaskType.store_page, "pwm"): keep, (TaskType.store_page, "vehicle"): keep}),
    ]
    SimRunner(Config(factories={"urov": factories}), until_s=3.0, tells_notes=False).run()
    armed = [(round(t, 2), data["is_armed"]) for t, data in commands]
    assert {is_armed for t, is_armed in armed if 0.1 < t < 0.95} == {True}
    assert {is_armed for t, is_armed in armed if 1.1 < t < 2.15} == {False}, "though the surface still says armed"
    assert {is_armed for t, is_armed in armed if t > 2.3} == {True}
    (said,) = {data["let_go"] for t, data in told if 1.1 < t < 1.95}
    assert said == "nobody renewed the command"
    assert {data["is_armed"] for t, data in told if 1.1 < t < 1.95} == {False}
    assert {data["let_go"] for t, data in told if t > 2.3} == {""}


def test_an_emergency_stop_of_the_surface_is_one_of_the_outputs() -> None:
    for is_stop in (True, False):
        autopilot, _ = blind_from(10.0, Controls(is_armed=True, is_stop=is_stop))
        page = autopilot.parent.get_page("pwm")
        assert page is not None
        assert (page.data["is_stop"], page.data["is_armed"]) == (is_stop, not is_stop)
