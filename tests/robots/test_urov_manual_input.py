"""A person who commands the underwater vehicle: which stick does what, and what the display shows of its pages."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim import Config, SimRunner, TaskType, TestRunner
from snr_sim.devices.gamepad import GamepadLoopFactory
from snr_sim.prelude.page import Page
from snr_sim.prelude.signals import GamepadReading
from snr_sim.scenario import library
from snr_sim.teleop.gamepad_pilot import AXIS_COUNT, BUTTON_COUNT
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.function_components import FunctionEndpoint, FunctionEndpointFactory, FunctionLoopFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.controls import LEGEND, STICKS, controls_of, gamepad_pilot  # noqa: E402
from snr_sim_robot_urov.display import NEWS, display  # noqa: E402


@pytest.mark.parametrize("name", ["surge", "sway", "heave", "yaw"])
def test_sticks_equal_body_axes_of_vehicle(name: str) -> None:
    axes = [0.0] * AXIS_COUNT
    axes[STICKS[name].axis] = -1.0
    controls_pages: list[Any] = []
    parts: list[FunctionEndpoint] = []
    handlers = {
        (TaskType.process_data, "controls"): lambda task, task_id: controls_pages.append(parts[0].get_data("controls"))
    }
    gamepad = GamepadLoopFactory(
        "gamepad", lambda: FakeSensor([GamepadReading(axes, [False] * BUTTON_COUNT, [])]), 20.0
    )
    config = Config(
        factories={"topside": [gamepad, gamepad_pilot(), FunctionEndpointFactory(handlers, begin=parts.append)]}
    )
    SimRunner(config, until_s=0.01).run()
    controls = controls_of(controls_pages[0])
    assert {stick: getattr(controls, stick) for stick in STICKS} == {stick: float(stick == name) for stick in STICKS}
    assert controls.number > 0


def test_legend_contains_every_stick_key() -> None:
    assert {key for stick in STICKS.values() for key in stick.keys} <= set(" ".join(LEGEND).split())


VEHICLE = {
    "control_state": "pilot", "mode": "depth_hold", "is_armed": True, "is_stopped": False, "rejected_command": "",
    "depth_m": 2.0, "heading_rad": None, "thrust_scale": 1.0, "attitude_rad": [0.0, 0.0, 1.5708],
    "is_leaking": False, "is_battery_low": False,
}  # fmt: skip


def shown(age_s: float = 0.1, wet: bool = False, **changes: Any) -> dict[str, str]:
    data = {
        "vehicle": {**VEHICLE, **changes},
        "depth": {"depth_m": 1.98},
        "altitude": {"distance_m": 2.5, "confidence": 1.0},
        "power": {"voltage_v": 15.9, "current_a": 4.2},
        "leak": {"is_wet": wet},
    }
    return dict(display().rows({key: Page(key, value, "urov", 10.0, True) for key, value in data.items()}, age_s))


def test_display_shows_state_and_setpoints() -> None:
    assert shown()["state"] == "armed, depth_hold, control: pilot"
    assert shown()["depth"] == "1.98 m (holds 2.00 m)"
    assert shown()["attitude"] == "roll 0, pitch 0, yaw 90 deg"
    assert shown()["battery"] == "15.9 V, 4 A"
    assert "leak" not in shown()


def test_display_shows_warnings() -> None:
    assert "silent for 1.5 s" in shown(age_s=1.5)["vehicle"]
    assert "EMERGENCY STOP" in shown(is_stopped=True)["state"]
    assert shown(is_battery_low=True)["low"] == "[red]BATTERY LOW[/red]"
    assert shown(is_battery_low=True, control_state="surface")["low"] == "[red]BATTERY LOW, the vehicle comes up[/red]"
    assert "WATER" in shown(wet=True)["leak"]
    assert "40%" in shown(thrust_scale=0.4)["thrusters"]
    assert "warp" in shown(rejected_command="There is no mode 'warp'.")["rejected"]


def test_display_for_pilot_shows_keys_and_position() -> None:
    pages = {
        "vehicle": Page("vehicle", {**VEHICLE, "is_armed": False}, "urov", 10.0, True),
        "gamepad": Page("gamepad", {"is_connected": True}, "topside", 1.0, True),
        "position_fix": Page("position_fix", {"position_m": [-9.0, 0.25, -1.5]}, "topside", 1.0, True),
        **dict.fromkeys(("depth", "altitude", "power", "leak")),
    }
    rows = dict(display().rows(pages, 0.1))
    assert rows["state"] == "disarmed: 1 (start) arms, depth_hold, control: pilot"
    assert rows["position"] == "-9.0 m east, 0.2 m north, 1.5 m deep"
    assert "arms" not in shown(is_armed=False)["state"]  # of a script


def test_display_shows_failsafes_and_actions() -> None:
    failed = {"leak": "water in the hull; surface"}
    assert shown(failsafes=failed, control_state="surface")["failsafe"] == "[red]leak: water in the hull; surface[/red]"
    assert "failsafe" not in shown()
    assert "failsafe" in NEWS
    assert "[red]disarmed: port [/dev" in shown(output_fault="port [/dev/ttyUSB0] is gone")["outputs"].replace("\\", "")


@pytest.mark.parametrize(
    ("key", "data"),
    [
        ("vehicle", None),
        ("vehicle", {}),
        ("vehicle", {**VEHICLE, "attitude_rad": [math.nan] * 3}),
        ("vehicle", {**VEHICLE, "attitude_rad": [math.inf] * 3}),
        ("vehicle", {**VEHICLE, "depth_m": "deep"}),
        ("vehicle", {**VEHICLE, "failsafes": ["leak"]}),
        ("depth", {"depth_m": 10**400}),
        ("depth", "deep"),
        ("power", {"voltage_v": None}),
        ("altitude", {"confidence": "sure"}),
        ("leak", {}),
    ],
)
def test_display_survives_invalid_pages(key: str, data: Any) -> None:
    pages = {
        "vehicle": VEHICLE,
        "depth": {"depth_m": 1.98},
        "altitude": {"distance_m": 2.5, "confidence": 1.0},
        "power": {"voltage_v": 15.9, "current_a": 4.2},
        "leak": {"is_wet": False},
        key: data,
    }
    rows = dict(display().rows({name: Page(name, value, "urov", 10.0, True) for name, value in pages.items()}, 0.1))
    assert "cannot be shown" in rows["pages"]


def test_display_caption_equals_failsafe_table(monkeypatch: pytest.MonkeyPatch) -> None:
    from snr_sim_robot_urov.failsafes import Failsafes, Rearm

    lines = Failsafes(line_lost=Rearm(5.0)).lines(10.0)
    assert lines == [
        "hold for 10 s, then surface: link_lost, nonsense",
        "neutral, resumes once within 5 s: line_lost",
        "neutral until re-armed: controller_reset, no_rearm",
        "warn only: stale_sensor, disk_full, overloaded",
        "surface: low_battery, leak",
    ]
    tables: list[Any] = []
    screen = SimpleNamespace(update=lambda table, refresh: tables.append(table), stop=lambda: None)

    def takes_the_screen(part: Any) -> None:
        part.parent.components["display"].live = screen

    parts = [display(lines=lines), FunctionLoopFactory(takes_the_screen, "screen")]
    TestRunner(Config(factories={"test": parts}), until_s=2.0).run()
    assert tables[-1].caption.plain.splitlines() == lines
