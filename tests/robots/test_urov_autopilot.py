"""The vehicle's response to controls that arrive late."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import pytest

from snr_sim import Page, SimRunner
from snr_sim.core.config import Config
from snr_sim.prelude.signals import DepthReading, ImuReading
from snr_sim.prelude.task import Task, TaskType
from snr_sim.scenario import library
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import Autopilot, AutopilotFactory  # noqa: E402
from snr_sim_robot_urov.controls import Controls  # noqa: E402
from snr_sim_robot_urov.parameters import UrovParameters, vehicle  # noqa: E402


def store_readings(loop: Any, has_depth: bool = True) -> None:
    """Store the readings of a level vehicle, 0.95 m deep."""
    now_s = loop.get_time_s()
    level = ImuReading([0.0, 0.0, 0.0], [0.0, 0.0, 9.81], [0.0, 20.0, -40.0], 0.0, 0.0, 0.0, now_s)
    if has_depth:
        loop.store_data("depth", msgspec.to_builtins(DepthReading(0.95, 110_000.0, 18.0, now_s)), process=False)
    loop.store_data("imu", msgspec.to_builtins(level))


def run(bring: Any, rate_hz: float, until_s: float, keep: Any = None, keys: Sequence[str] = ()) -> Autopilot:
    """Run an autopilot whose pages a function brings; another one keeps its own."""
    factories = [
        FunctionLoopFactory(bring, "bringer", rate_hz),
        AutopilotFactory(UrovParameters(vehicle())),
        FunctionEndpointFactory({(TaskType.store_page, key): keep for key in keys}),
    ]
    runner = SimRunner(Config(factories={"urov": factories}), until_s=until_s, log_notes=False)
    runner.run()
    autopilot = runner.nodes["urov"].components["autopilot"]
    assert isinstance(autopilot, Autopilot)
    return autopilot


def autopilot_after(age_s: float, **controls: Any) -> Autopilot:
    """The autopilot after ten seconds of controls that are so old when they arrive."""
    number = 0

    def bring(loop: Any) -> None:
        nonlocal number
        number += 1
        store_readings(loop)
        data = msgspec.structs.asdict(Controls(number, **controls))
        page = Page("controls", data, "topside_node", loop.get_time_s() - age_s, True)
        loop.schedule(Task(TaskType.store_page, "controls", [page]))

    return run(bring, 100.0, 10.0)


@pytest.mark.parametrize(("age_s", "control_state"), [(0.01, "pilot"), (0.2, "pilot"), (0.3, "idle"), (5.0, "idle")])
def test_controls_older_than_stale_s_are_ignored(age_s: float, control_state: str) -> None:
    assert autopilot_after(age_s, is_armed=True).failsafe.control_state(10.0) == control_state


def test_old_stop_is_applied() -> None:
    assert autopilot_after(5.0, is_stop=True).failsafe.is_stopped


def test_controls_age_counts_from_creation() -> None:
    failsafe = autopilot_after(0.2, is_armed=True).failsafe
    assert failsafe.controls_s is not None
    assert failsafe.control_state(failsafe.controls_s + 0.24) == "pilot"
    assert failsafe.control_state(failsafe.controls_s + 0.26) == "neutral"
    assert failsafe.controls_s <= 9.8 + 1e-9


def run_with_depth_until(depth_until_s: float, controls: Controls) -> tuple[Autopilot, list[list[float]]]:
    """The autopilot of a vehicle whose depth sensor stops, five centimetres above the setpoint, and its pulses."""
    number, pulses = 0, []

    def bring(loop: Any) -> None:
        nonlocal number
        number += 1
        loop.store_data("controls", msgspec.structs.asdict(msgspec.structs.replace(controls, number=number)))
        store_readings(loop, loop.get_time_s() < depth_until_s)

    def keep(task: Task, task_id: Any) -> None:
        pulses.append(task.val_list[0].data["pulses_us"])

    return run(bring, 20.0, 4.0, keep, ["pwm"]), pulses


def test_stale_depth_ends_depth_hold_and_is_noted_once() -> None:
    holds = Controls(is_armed=True, mode="heading_hold", depth_m=1.0, heading_rad=0.0)
    with_depth, pulses = run_with_depth_until(10.0, holds)
    assert not with_depth.is_depth_stale
    assert pulses[-1] != [1500.0] * 8  # five centimetres too high: it pushes down
    without_depth, pulses = run_with_depth_until(2.0, holds)
    assert without_depth.is_depth_stale
    assert without_depth.telemetry(4.0, ImuReading([0.0] * 3, [0.0] * 3, [0.0] * 3, 0.0, 0.0, 0.0, 4.0))[
        "is_depth_stale"
    ]
    assert pulses[-1] == [1500.0] * 8  # the last reading does not push it on indefinitely
    (note,) = [note for note in without_depth.parent.notes if "no fresh reading of depth" in note]
    assert 2.4 < float(note.partition("t = ")[2].partition(" s")[0]) < 2.6


def test_stale_depth_keeps_sticks_active() -> None:
    _, pulses = run_with_depth_until(1.0, Controls(is_armed=True, mode="depth_hold", heave=1.0))
    assert pulses[-1] != [1500.0] * 8


def test_output_fault_is_reported_and_rearms_only_after_disarm() -> None:
    state, vehicle_pages, commands = {"state": "inactive", "fault": "", "reason": ["not active"]}, [], []

    def bring(loop: Any) -> None:
        now_s = loop.get_time_s()
        controls = Controls(number=round(now_s * 20) + 1, is_armed=not 2.0 <= now_s < 2.2, mode="manual", surge=1.0)
        loop.store_data("controls", msgspec.structs.asdict(controls))
        if now_s >= 0.5 and state["state"] == "inactive" and not state["fault"]:
            state["state"] = "active"
        if 1.0 <= now_s < 1.05:
            state.update(state="inactive", fault="the command was not renewed")
        if 2.3 <= now_s < 2.35:
            state.update(state="active", fault="")
        loop.store_data("pwm_applied", dict(state), process=False)
        store_readings(loop)

    def keep(task: Task, task_id: Any) -> None:
        page = task.val_list[0]
        (commands if page.key == "pwm" else vehicle_pages).append((page.created_at_s, page.data))

    run(bring, 20.0, 3.0, keep, ["pwm", "vehicle"])
    armed = [(round(t, 2), data["is_armed"]) for t, data in commands]
    assert {is_armed for t, is_armed in armed if 0.1 < t < 0.95} == {True}
    assert {is_armed for t, is_armed in armed if 1.1 < t < 2.15} == {False}, "though the surface still says armed"
    assert {is_armed for t, is_armed in armed if t > 2.3} == {True}
    (fault,) = {data["output_fault"] for t, data in vehicle_pages if 1.1 < t < 1.95}
    assert fault == "the command was not renewed"
    assert {data["is_armed"] for t, data in vehicle_pages if 1.1 < t < 1.95} == {False}
    assert {data["output_fault"] for t, data in vehicle_pages if t > 2.3} == {""}


def test_surface_emergency_stop_reaches_outputs() -> None:
    for is_stop in (True, False):
        autopilot, _ = run_with_depth_until(10.0, Controls(is_armed=True, is_stop=is_stop))
        page = autopilot.parent.get_page("pwm")
        assert page is not None
        assert (page.data["is_stop"], page.data["is_armed"]) == (is_stop, not is_stop)
