"""Checks before the first arming: a fault is reported, and nothing arms until a person arms again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from snr_sim import SimRunner
from snr_sim.core.config import Config
from snr_sim.prelude.signals import DepthReading, ImuReading, LeakReading, PowerReading
from snr_sim.prelude.task import Page, Task, TaskType
from snr_sim.scenario import library
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import AutopilotFactory, Watch  # noqa: E402
from snr_sim_robot_urov.controls import Controls  # noqa: E402
from snr_sim_robot_urov.parameters import UrovParameters, vehicle  # noqa: E402

ARM_S, WELL_S, AGAIN_S = 3.0, 4.0, 5.0


def healthy(now_s: float) -> dict[str, Any]:
    readings = {
        "depth": DepthReading(0.95, 110_000.0, 18.0, now_s),
        "power": PowerReading(15.9, 4.0, now_s),
        "leak": LeakReading(False, now_s),
        "imu": ImuReading([0.0] * 3, [0.0, 0.0, 9.81], [0.0, 20.0, -40.0], 0.0, 0.0, 0.0, now_s),
    }
    outputs = {"state": "inactive", "fault": "", "reason": []}
    return {name: msgspec.to_builtins(one) for name, one in readings.items()} | {"pwm_applied": outputs}


def dived(
    change: Callable[[dict[str, Any], float], Any], until_s: float = 6.0, arms: Callable[[float], bool] | None = None
) -> list[dict[str, Any]]:
    """Pages 'vehicle' of a dive in which something is wrong until WELL_S; armed at ARM_S, and again at AGAIN_S."""
    states: list[dict[str, Any]] = []
    is_armed = arms or (lambda now_s: now_s >= ARM_S and not AGAIN_S - 0.2 <= now_s < AGAIN_S)

    def bring(loop: Any) -> None:
        now_s = loop.get_time_s()
        pages = healthy(now_s)
        if now_s < WELL_S:
            change(pages, now_s)
        for key, data in pages.items():
            loop.store_data(key, data, process=key in ("power", "leak", "imu"))
        controls = Controls(round(20 * now_s) + 1, is_armed=is_armed(now_s))
        loop.store_data("controls", msgspec.structs.asdict(controls))

    def keep(task: Any, task_id: Any) -> None:
        page = task.val_list[0]
        states.append({**page.data, "t": page.created_at_s})

    parts = [
        FunctionLoopFactory(bring, "bringer", 20.0),
        Watch.factory(),
        AutopilotFactory(UrovParameters(vehicle())),
        FunctionEndpointFactory({(TaskType.store_page, "vehicle"): keep}),
    ]
    SimRunner(Config(factories={"urov": parts}), until_s=until_s, log_notes=False).run()
    return states


def put(key: str, **fields: Any) -> Callable[[dict[str, Any], float], Any]:
    return lambda pages, now_s: pages.__setitem__(key, {**pages.get(key, {}), **fields})


def leave_out(key: str) -> Callable[[dict[str, Any], float], Any]:
    return lambda pages, now_s: pages.pop(key)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (leave_out("depth"), "depth: no reading yet"),
        (leave_out("imu"), "imu: no reading yet"),
        (lambda pages, now_s: pages.pop("depth") if now_s > 1.0 else None, "depth: newest reading 2.0 s old"),
        (lambda pages, now_s: pages.pop("power") if now_s > 1.0 else None, "power: newest reading 2.0 s old"),
        (put("depth", depth_m="deep"), "sensors: depth: depth_m is the text 'deep'"),
        (put("power", voltage_v=12.0), "battery: 12.1 V at rest, less than 13 V"),
        (
            put("recording", since_s=1.0, lost=3, reason="no space left on device"),
            "disk: not recorded: no space left on device",
        ),
        (put("depth", stamp_s=-30.0), "clock: depth is stamped 33.0 s before it came"),
        (put("depth", stamp_s=90.0), "sensors: depth: stamp_s is 90.0, and the vehicle's clock shows"),
        (
            put("pwm_applied", state="error", fault="ttyUSB0: firmware 0.9 speaks protocol 0.\nTry: flash it."),
            "outputs and their firmware: ttyUSB0: firmware 0.9 speaks protocol 0.",
        ),
    ],
)
def test_first_arming_is_refused_with_reason(change: Callable[[dict[str, Any], float], Any], message: str) -> None:
    states = dived(change)
    rejected = [one for one in states if ARM_S + 0.1 < one["t"] < WELL_S - 0.2]
    assert rejected, "reported also if there are no readings"
    assert {one["control_state"] for one in rejected} == {"idle"}
    assert {one["is_armed"] for one in rejected} == {False}
    (reason,) = {one["rejected_command"] for one in rejected}
    assert reason.startswith("Not armed: ")
    assert message in reason
    later = [one for one in states if WELL_S + 0.5 < one["t"] < AGAIN_S - 0.3]
    assert {one["control_state"] for one in later} == {"idle"}, "all is well by now, but it must not start on its own"
    if "disk" not in message:  # its page stays as it is
        assert states[-1]["control_state"] == "pilot", "a person has disarmed and armed"
        assert states[-1]["rejected_command"] == ""


def test_leak_before_dive_rejects_arming() -> None:
    states = dived(put("leak", is_wet=True))
    assert "leak: water in the hull" in states[-1]["rejected_command"]
    assert states[-1]["control_state"] == "idle"


def test_arming_at_start_waits_for_sensors() -> None:
    states = dived(lambda pages, now_s: pages.clear() if now_s < 1.0 else None, 2.0, arms=lambda now_s: True)
    assert states[-1]["control_state"] == "pilot"
    assert {one["rejected_command"] for one in states} == {""}


def test_rearming_skips_prearm_checks() -> None:
    def low(pages: dict[str, Any], now_s: float) -> None:
        if now_s > 2.0:
            pages["power"]["voltage_v"] = 12.0

    states = dived(low, WELL_S - 0.1, arms=lambda now_s: now_s > 1.0 and not 2.5 < now_s < 3.0)
    assert [one["control_state"] for one in states if 2.6 < one["t"] < 2.9][-1] == "idle"
    assert states[-1]["control_state"] == "pilot", "in the water a person who arms has a reason"


def test_controls_of_unknown_age_are_rejected_with_reason() -> None:
    states: list[dict[str, Any]] = []

    def bring(loop: Any) -> None:
        for key, data in healthy(loop.get_time_s()).items():
            loop.store_data(key, data, process=key == "imu")
        data = msgspec.structs.asdict(Controls(1, is_armed=True))
        page = Page("controls", data, "topside_node", -float("inf"), True)
        loop.schedule(Task(TaskType.store_page, "controls", [page]))

    def keep(task: Any, task_id: Any) -> None:
        states.append(task.val_list[0].data)

    parts = [
        FunctionLoopFactory(bring, "bringer", 20.0),
        AutopilotFactory(UrovParameters(vehicle())),
        FunctionEndpointFactory({(TaskType.store_page, "vehicle"): keep}),
    ]
    SimRunner(Config(factories={"urov": parts}), until_s=1.0, log_notes=False).run()
    assert states[-1]["control_state"] == "idle"
    assert "clock: how far the surface's clock is" in states[-1]["rejected_command"]
