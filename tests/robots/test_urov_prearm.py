"""Checks before the first arming: a fault is reported, and nothing arms until a person arms again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from snr_sim import SimRunner
from snr_sim.core.config import Config
from snr_sim.prelude.page import Page
from snr_sim.prelude.signals import DepthReading, ImuReading, LeakReading, PowerReading
from snr_sim.prelude.task import Task, TaskType
from snr_sim.scenario import library
from snr_sim.testing.parts import PartFactory, TickerFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import AutopilotFactory  # noqa: E402
from snr_sim_robot_urov.controls import Controls  # noqa: E402
from snr_sim_robot_urov.parameters import UrovParameters, vehicle  # noqa: E402
from snr_sim_robot_urov.watch import WatchFactory  # noqa: E402

ARM_S, WELL_S, AGAIN_S = 3.0, 4.0, 5.0


def healthy(now_s: float) -> dict[str, Any]:
    readings = {
        "depth": DepthReading(0.95, 110_000.0, 18.0, now_s),
        "power": PowerReading(15.9, 4.0, now_s),
        "leak": LeakReading(False, now_s),
        "imu": ImuReading([0.0] * 3, [0.0, 0.0, 9.81], [0.0, 20.0, -40.0], 0.0, 0.0, 0.0, now_s),
    }
    outputs = {"state": "inactive", "fault": "", "why": []}
    return {name: msgspec.to_builtins(one) for name, one in readings.items()} | {"pwm_applied": outputs}


def dived(
    change: Callable[[dict[str, Any], float], Any], until_s: float = 6.0, arms: Callable[[float], bool] | None = None
) -> list[dict[str, Any]]:
    """Pages 'vehicle' of a dive in which something is wrong until WELL_S; armed at ARM_S, and again at AGAIN_S."""
    told: list[dict[str, Any]] = []
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
        told.append({**page.data, "t": page.created_at_s})

    parts = [
        TickerFactory(bring, "bringer", 20.0),
        WatchFactory(),
        AutopilotFactory(UrovParameters(vehicle())),
        PartFactory({(TaskType.store_page, "vehicle"): keep}),
    ]
    SimRunner(Config(factories={"urov": parts}), until_s=until_s, tells_notes=False).run()
    return told


def put(key: str, **fields: Any) -> Callable[[dict[str, Any], float], Any]:
    return lambda pages, now_s: pages.__setitem__(key, {**pages.get(key, {}), **fields})


def leave_out(key: str) -> Callable[[dict[str, Any], float], Any]:
    return lambda pages, now_s: pages.pop(key)


@pytest.mark.parametrize(
    ("change", "says"),
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
def test_first_arming_is_refused_with_the_reason(change: Callable[[dict[str, Any], float], Any], says: str) -> None:
    told = dived(change)
    refused = [one for one in told if ARM_S + 0.1 < one["t"] < WELL_S - 0.2]
    assert refused, "told also if there are no readings"
    assert {one["rules"] for one in refused} == {"idle"}
    assert {one["is_armed"] for one in refused} == {False}
    (why,) = {one["refused"] for one in refused}
    assert why.startswith("Not armed: ")
    assert says in why
    later = [one for one in told if WELL_S + 0.5 < one["t"] < AGAIN_S - 0.3]
    assert {one["rules"] for one in later} == {"idle"}, "all is well by now, but nobody expects it to start"
    if "disk" not in says:  # its page stays as it is
        assert told[-1]["rules"] == "pilot", "a person has disarmed and armed"
        assert told[-1]["refused"] == ""


def test_leak_before_the_dive_keeps_the_vehicle_from_being_armed() -> None:
    told = dived(put("leak", is_wet=True))
    assert "leak: water in the hull" in told[-1]["refused"]
    assert told[-1]["rules"] == "idle"


def test_program_that_has_just_started_waits_for_its_sensors_and_arms() -> None:
    told = dived(lambda pages, now_s: pages.clear() if now_s < 1.0 else None, 2.0, arms=lambda now_s: True)
    assert told[-1]["rules"] == "pilot"
    assert {one["refused"] for one in told} == {""}


def test_vehicle_that_was_armed_once_is_armed_again_whatever_is_wrong() -> None:
    def low(pages: dict[str, Any], now_s: float) -> None:
        if now_s > 2.0:
            pages["power"]["voltage_v"] = 12.0

    told = dived(low, WELL_S - 0.1, arms=lambda now_s: now_s > 1.0 and not 2.5 < now_s < 3.0)
    assert [one["rules"] for one in told if 2.6 < one["t"] < 2.9][-1] == "idle"
    assert told[-1]["rules"] == "pilot", "in the water a person who arms has a reason"


def test_controls_of_which_nobody_knows_the_age_are_refused_by_name() -> None:
    told: list[dict[str, Any]] = []

    def bring(loop: Any) -> None:
        for key, data in healthy(loop.get_time_s()).items():
            loop.store_data(key, data, process=key == "imu")
        data = msgspec.structs.asdict(Controls(1, is_armed=True))
        page = Page("controls", data, "topside_node", -float("inf"), True)
        loop.schedule(Task(TaskType.store_page, "controls", [page]))

    def keep(task: Any, task_id: Any) -> None:
        told.append(task.val_list[0].data)

    parts = [
        TickerFactory(bring, "bringer", 20.0),
        AutopilotFactory(UrovParameters(vehicle())),
        PartFactory({(TaskType.store_page, "vehicle"): keep}),
    ]
    SimRunner(Config(factories={"urov": parts}), until_s=1.0, tells_notes=False).run()
    assert told[-1]["rules"] == "idle"
    assert "clock: how far the surface's clock is" in told[-1]["refused"]
