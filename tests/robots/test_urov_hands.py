"""A person who commands the underwater vehicle: which stick does what, and what the display shows of its pages."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim import Config, SimRunner, TaskType, TestRunner
from snr_sim.devices.pad import PadLoopFactory
from snr_sim.prelude.page import Page
from snr_sim.prelude.signals import PadReading
from snr_sim.scenario import library
from snr_sim.teleop.gamepad_pilot import AXIS_COUNT, BUTTON_COUNT
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.parts import Part, PartFactory, TickerFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.controls import LEGEND, STICKS, controls_of, gamepad_pilot  # noqa: E402
from snr_sim_robot_urov.display import NEWS, display  # noqa: E402


@pytest.mark.parametrize("name", ["surge", "sway", "heave", "yaw"])
def test_sticks_are_forward_left_and_up_whatever_a_pad_thinks(name: str) -> None:
    axes = [0.0] * AXIS_COUNT
    axes[STICKS[name].axis] = -1.0
    told: list[Any] = []
    parts: list[Part] = []
    hear = {(TaskType.process_data, "controls"): lambda task, task_id: told.append(parts[0].get_data("controls"))}
    pad = PadLoopFactory("pad", lambda: FakeSensor([PadReading(axes, [False] * BUTTON_COUNT, [])]), 20.0)
    config = Config(factories={"topside": [pad, gamepad_pilot(), PartFactory(hear, begin=parts.append)]})
    SimRunner(config, until_s=0.01).run()
    controls = controls_of(told[0])
    assert {stick: getattr(controls, stick) for stick in STICKS} == {stick: float(stick == name) for stick in STICKS}
    assert controls.number > 0


def test_legend_names_every_key_of_a_stick() -> None:
    assert {key for stick in STICKS.values() for key in stick.keys} <= set(" ".join(LEGEND).split())


VEHICLE = {
    "rules": "pilot", "mode": "depth_hold", "is_armed": True, "is_stopped": False, "refused": "", "depth_m": 2.0,
    "heading_rad": None, "share": 1.0, "attitude_rad": [0.0, 0.0, 1.5708], "is_wet": False, "is_low": False,
}  # fmt: skip


def shown(heard_s: float = 0.1, wet: bool = False, **changes: Any) -> dict[str, str]:
    data = {
        "vehicle": {**VEHICLE, **changes},
        "depth": {"depth_m": 1.98},
        "altitude": {"distance_m": 2.5, "confidence": 1.0},
        "power": {"voltage_v": 15.9, "current_a": 4.2},
        "leak": {"is_wet": wet},
    }
    return dict(display().rows({key: Page(key, value, "urov", 10.0, True) for key, value in data.items()}, heard_s))


def test_the_display_says_what_the_vehicle_does_and_holds() -> None:
    assert shown()["state"] == "armed, depth_hold, obeys: pilot"
    assert shown()["depth"] == "1.98 m (holds 2.00 m)"
    assert shown()["attitude"] == "roll 0, pitch 0, yaw 90 deg"
    assert shown()["battery"] == "15.9 V, 4 A"
    assert "leak" not in shown()


def test_the_display_says_what_is_wrong() -> None:
    assert "silent for 1.5 s" in shown(heard_s=1.5)["vehicle"]
    assert "EMERGENCY STOP" in shown(is_stopped=True)["state"]
    assert shown(is_low=True)["low"] == "[red]BATTERY LOW[/red]"
    assert shown(is_low=True, rules="surface")["low"] == "[red]BATTERY LOW, the vehicle comes up[/red]"
    assert "WATER" in shown(wet=True)["leak"]
    assert "40%" in shown(share=0.4)["thrusters"]
    assert "warp" in shown(refused="There is no mode 'warp'.")["refused"]


def test_display_of_a_pilot_says_what_to_press_and_where_the_vehicle_is() -> None:
    pages = {
        "vehicle": Page("vehicle", {**VEHICLE, "is_armed": False}, "urov", 10.0, True),
        "pad": Page("pad", {"is_connected": True}, "topside", 1.0, True),
        "place": Page("place", {"position_m": [-9.0, 0.25, -1.5]}, "topside", 1.0, True),
        **dict.fromkeys(("depth", "altitude", "power", "leak")),
    }
    told = dict(display().rows(pages, 0.1))
    assert told["state"] == "disarmed: 1 (start) arms, depth_hold, obeys: pilot"
    assert told["place"] == "-9.0 m east, 0.2 m north, 1.5 m deep"
    assert "arms" not in shown(is_armed=False)["state"]  # of a script


def test_display_shows_what_has_failed_and_what_is_done_then() -> None:
    failed = {"leak": "water in the hull; surface"}
    assert shown(failsafes=failed, rules="surface")["failsafe"] == "[red]leak: water in the hull; surface[/red]"
    assert "failsafe" not in shown()
    assert "failsafe" in NEWS
    assert "[red]have let go: port [/dev" in shown(let_go="port [/dev/ttyUSB0] is gone")["outputs"].replace("\\", "")


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
def test_display_lives_whatever_pages_come_over_the_link(key: str, data: Any) -> None:
    pages = {
        "vehicle": VEHICLE,
        "depth": {"depth_m": 1.98},
        "altitude": {"distance_m": 2.5, "confidence": 1.0},
        "power": {"voltage_v": 15.9, "current_a": 4.2},
        "leak": {"is_wet": False},
        key: data,
    }
    told = dict(display().rows({name: Page(name, value, "urov", 10.0, True) for name, value in pages.items()}, 0.1))
    assert "cannot be shown" in told["pages"]


def test_table_of_failsafes_is_below_the_display(monkeypatch: pytest.MonkeyPatch) -> None:
    from snr_sim_robot_urov.failsafes import Failsafes, Rearm

    lines = Failsafes(line_lost=Rearm(5.0)).lines(10.0)
    assert lines == [
        "hold for 10 s, then surface: link_lost, nonsense",
        "neutral, goes on once within 5 s: line_lost",
        "neutral until re-armed: controller_reset, no_rearm",
        "warn only: stale_sensor, disk_full, overloaded",
        "surface: low_battery, leak",
    ]
    tables: list[Any] = []
    screen = SimpleNamespace(update=lambda table, refresh: tables.append(table), stop=lambda: None)

    def takes_the_screen(part: Any) -> None:
        part.parent.components["display"].live = screen

    parts = [display(lines=lines), TickerFactory(takes_the_screen, "screen")]
    TestRunner(Config(factories={"test": parts}), until_s=2.0).run()
    assert tables[-1].caption.plain.splitlines() == lines
