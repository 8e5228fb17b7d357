"""A person who commands the underwater vehicle: which stick does what, and what the display shows of its pages."""

import io
import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from snr_sim import Config, SimRunner, TaskType, TestRunner
from snr_sim.devices.gamepad import GamepadLoopFactory
from snr_sim.prelude.signals import GamepadReading
from snr_sim.prelude.task import Page
from snr_sim.scenario import library
from snr_sim.teleop.display import table_of
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
    return texts({key: Page(key, value, "urov", 10.0, True) for key, value in data.items()}, age_s)


def texts(pages: dict[str, Page | None], age_s: float) -> dict[str, str]:
    return {name: text for name, text, _ in display().rows(pages, age_s)}


def test_display_shows_state_and_setpoints() -> None:
    assert shown()["state"] == "armed, depth_hold, control: pilot"
    assert shown()["depth"] == "1.98 m (holds 2.00 m)"
    assert shown()["attitude"] == "roll 0, pitch 0, yaw 90 deg"
    assert shown()["battery"] == "15.9 V, 4 A"
    assert "leak" not in shown()


def test_display_shows_warnings() -> None:
    assert "silent for 1.5 s" in shown(age_s=1.5)["vehicle"]
    assert "EMERGENCY STOP" in shown(is_stopped=True)["state"]
    assert shown(is_battery_low=True)["low"] == "BATTERY LOW"
    assert shown(is_battery_low=True, control_state="surface")["low"] == "BATTERY LOW, the vehicle comes up"
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
    rows = texts(pages, 0.1)
    assert rows["state"] == "disarmed: 1 (start) arms, depth_hold, control: pilot"
    assert rows["position"] == "-9.0 m east, 0.2 m north, 1.5 m deep"
    assert "arms" not in shown(is_armed=False)["state"]  # of a script


def test_display_shows_failsafes_and_actions() -> None:
    failed = {"leak": "water in the hull; surface"}
    assert shown(failsafes=failed, control_state="surface")["failsafe"] == "leak: water in the hull; surface"
    assert "failsafe" not in shown()
    assert "failsafe" in NEWS
    assert shown(output_fault="port [/dev/ttyUSB0] is gone")["outputs"] == "disarmed: port [/dev/ttyUSB0] is gone"


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
    rows = texts({name: Page(name, value, "urov", 10.0, True) for name, value in pages.items()}, 0.1)
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


texts_of_a_peer = st.text("[]/\\:x \x1b\x07\x9b\u202e\n", max_size=8) | st.sampled_from(
    ["[/]", "[/x]", "\x1b[2J", "[red]"]
)
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | texts_of_a_peer,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts_of_a_peer, inner, max_size=3),
    max_leaves=5,
)
GOOD: dict[str, dict[str, Any]] = {
    "vehicle": {**VEHICLE, "output_fault": "", "failsafes": {}},
    "recording": {"since_s": 1.0, "lost": 5, "reason": "No space left on device"},
    "link_tether": {"up": False, "reason": "waits"},
    "gamepad": {"is_connected": True},
    "depth": {"depth_m": 1.98},
    "altitude": {"distance_m": 2.5, "confidence": 1.0},
    "power": {"voltage_v": 15.9, "current_a": 4.2},
    "leak": {"is_wet": False},
    "position_fix": {"position_m": [1.0, 2.0, -3.0]},
}


@st.composite
def pages_of_a_peer(draw: st.DrawFn) -> dict[str, Page | None]:
    """Return pages of which some are not there, some are anything, and some have fields that are anything."""
    pages: dict[str, Page | None] = dict.fromkeys(GOOD)
    for key, good in GOOD.items():
        kind = draw(st.sampled_from(["good", "field", "none", "any"]))
        changed = {name: draw(values) for name in draw(st.sets(st.sampled_from(sorted(good))))}
        data = {"good": good, "field": {**good, **changed}, "any": draw(values)}
        if kind != "none":
            pages[key] = Page(key, data[kind], draw(texts_of_a_peer), 10.0, True)
    return pages


@given(pages_of_a_peer(), st.floats(0.0, 2.0), st.booleans())
def test_no_page_of_a_peer_ends_the_display_or_controls_the_terminal(
    pages: dict[str, Page | None], silence_s: float, has_keys: bool
) -> None:
    shown = display(has_gamepad=True).rows(pages, silence_s, has_keys)
    drawn = io.StringIO()
    console = Console(file=drawn, width=400, color_system=None)
    console.print(table_of(shown, "t = 1.0 s", ["1 (start) arms"]))
    assert all(line.isprintable() for line in drawn.getvalue().splitlines())
    assert drawn.getvalue().count("\n") < len(shown) + 8  # and no row has a second line
    for _, text, _ in shown:
        assert text.isprintable()
        assert text in drawn.getvalue()  # literally, whatever markup it looks like


def test_page_with_thousands_of_failsafes_shows_a_screenful() -> None:
    many = {f"cause {i}": "x" * 10_000 for i in range(5000)}
    pages = {key: Page(key, data, "urov", 10.0, True) for key, data in GOOD.items()}
    pages["vehicle"] = Page("vehicle", {**GOOD["vehicle"], "failsafes": many}, "urov", 10.0, True)
    shown = display().rows(pages, 0.1)
    assert len(shown) == 50
    assert max(len(text) for _, text, _ in shown) < 400
