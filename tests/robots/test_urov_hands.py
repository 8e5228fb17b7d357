"""A person at the surface: game controller, keyboard, what they are made into, and what the person sees."""

import math
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from snr_sim import Config, Mode, SimRunner, TaskType, TestRunner, TimeoutLoopFactory, tasks
from snr_sim.devices.pad import PadLoopFactory
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtra, SensorLost
from snr_sim.prelude.page import Page
from snr_sim.prelude.signals import PadReading
from snr_sim.scenario import library
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.parts import Part, PartFactory, TickerFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov import display  # noqa: E402
from snr_sim_robot_urov.controls import MODES, controls_of  # noqa: E402
from snr_sim_robot_urov.display import rows  # noqa: E402
from snr_sim_robot_urov.keyboard import BUTTON_KEYS, KEPT_S, LEGEND, STICK_KEYS, Hands, Keyboard  # noqa: E402
from snr_sim_robot_urov.pad_pilot import AXES, BUTTONS, Held, PadPilotFactory, eased, pressed  # noqa: E402

RATE_HZ = 20.0


def pad(*down: str, **sticks: float) -> PadReading:
    """A reading with some buttons down and some axes moved."""
    axes, buttons = [0.0] * 6, [False] * 8
    for stick, value in sticks.items():
        axes[AXES[stick]] = value
    for name in down:
        buttons[BUTTONS[name]] = True
    return PadReading(axes, buttons, [])


def at(stamp_s: float, reading: PadReading) -> PadReading:
    """The same of another time."""
    return msgspec.structs.replace(reading, stamp_s=stamp_s)


def flown(readings: list[Any], vehicle_stopped: list[bool] | None = None) -> list[dict[str, Any]]:
    """The controls that a pilot makes of readings, one after the other.

    Args:
        readings: of the pad.
        vehicle_stopped: what the vehicle says, at each of them.
    """
    told: list[dict[str, Any]] = []
    said = list(vehicle_stopped or [])
    parts: list[Part] = []

    def hear(task: Any, task_id: Any) -> Any:
        told.append(dict(parts[0].get_data("controls")))
        return parts[0].store_data_task("vehicle", {"is_stopped": said.pop(0)}) if said else None

    listener = PartFactory({(TaskType.process_data, "controls"): hear}, begin=parts.append)
    hand = PadLoopFactory("pad", lambda: FakeSensor(readings), RATE_HZ)
    config = Config(Mode.TEST, {"topside": [hand, PadPilotFactory(), listener]})
    SimRunner(config, until_s=(len(readings) - 0.5) / RATE_HZ).run()
    return told


def test_sticks_are_forward_left_and_up_whatever_a_pad_thinks() -> None:
    (ahead, left, up, turn) = flown([pad(surge=-1.0), pad(sway=-1.0), pad(heave=-1.0), pad(yaw=-1.0)])
    for controls, stick in ((ahead, "surge"), (left, "sway"), (up, "heave"), (turn, "yaw")):
        assert controls[stick] == 1.0
        assert controls_of(controls).number > 0


def test_a_stick_that_is_not_quite_at_rest_is_at_rest_and_the_rest_is_smooth() -> None:
    assert eased(0.079) == 0.0
    course = [eased(i / 100 - 1.0) for i in range(201)]
    assert course == sorted(course)
    assert (course[0], course[-1]) == (-1.0, 1.0)
    assert max(b - a for a, b in pairwise(course)) < 0.03


def test_buttons_count_when_they_go_down_and_not_while_they_are_held() -> None:
    told = flown([pad(), pad("mode_up"), pad("mode_up"), pad(), pad("mode_up"), pad("arm"), pad("disarm")])
    assert [MODES.index(one["mode"]) for one in told] == [0, 1, 1, 1, 2, 2, 2]
    assert [one["is_armed"] for one in told] == [False] * 5 + [True, False]


def test_a_button_that_is_down_at_the_first_reading_does_nothing() -> None:
    assert [one["is_armed"] for one in flown([pad("arm"), pad("arm")])] == [False, False]


def test_a_stop_counts_also_in_the_first_reading_and_in_that_in_which_a_pad_is_unplugged() -> None:
    assert [one["is_stop"] for one in flown([pad("stop", "arm"), pad()])] == [True, True]
    of_eleven = PadReading([0.0] * 6, [False] * 11, [])
    told = flown([of_eleven, pad("stop", "arm"), pad("arm"), pad()])
    assert [one["is_stop"] for one in told] == [False, True, True, True]
    assert not told[-1]["is_armed"]


def test_modes_end_at_both_ends() -> None:
    assert pressed(Held(mode=0), ["mode_down"]).mode == 0
    assert pressed(Held(mode=len(MODES) - 1), ["mode_up"]).mode == len(MODES) - 1


def test_a_stop_disarms_and_only_clear_ends_it() -> None:
    stopped = pressed(Held(2, is_armed=True), ["stop", "arm"])
    assert stopped == Held(2, is_armed=False, is_stop=True)
    assert pressed(stopped, ["arm"]) == stopped
    assert pressed(stopped, ["clear"]) == Held(2)


def test_clearing_a_stop_is_asked_for_until_the_vehicle_says_it_is_done_and_unarmed_till_then() -> None:
    readings = [pad(), pad("stop"), pad(), pad("clear"), pad(), pad("arm"), pad(), pad()]
    told = flown(readings, [False, True, True, True, True, True, False, False])
    assert [one["is_stop"] for one in told] == [False, True, True, False, False, False, False, False]
    assert [one["clears_stop"] for one in told] == [False, False, False, True, True, True, True, False]
    assert [one["is_armed"] for one in told] == [False] * 7 + [True]


def test_a_pad_that_is_unplugged_lets_go_of_the_sticks_and_the_controls_go_on() -> None:
    told = flown([pad(), pad("arm"), pad(surge=-1.0), Stale("gone"), Stale("gone"), pad()])
    assert [one["surge"] for one in told] == [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert told[-1]["number"] == 6
    assert told[-1]["is_armed"]


class Typist:
    """Types what it is told to, by a clock of its own."""

    def __init__(self) -> None:
        self.keys, self.time_s = "", 0.0

    def typed(self) -> str:
        keys, self.keys = self.keys, ""
        return keys

    def now_s(self) -> float:
        return self.time_s


def test_the_keyboard_keeps_the_promise_of_sensors() -> None:
    check_sensor(lambda: Keyboard(lambda: ""))


def test_a_key_holds_its_stick_until_it_is_no_longer_repeated() -> None:
    typist = Typist()
    keyboard = Keyboard(typist.typed, typist.now_s)
    typist.keys = "wJ"
    assert keyboard.read() == pad(surge=-1.0, yaw=-1.0)
    typist.time_s = KEPT_S - 0.01
    assert keyboard.read() == at(typist.time_s, pad(surge=-1.0, yaw=-1.0))
    typist.time_s = KEPT_S + 0.01
    assert keyboard.read() == at(typist.time_s, pad())


def test_opposite_keys_cancel_and_others_mean_nothing() -> None:
    typist = Typist()
    keyboard = Keyboard(typist.typed, typist.now_s)
    typist.keys = "wsx?\n"
    assert keyboard.read() == pad()


def test_space_is_the_emergency_stop() -> None:
    typist = Typist()
    keyboard = Keyboard(typist.typed, typist.now_s)
    typist.keys = "+1c "
    assert keyboard.read() == pad("stop"), "before all that was typed before it"
    assert [keyboard.read() for _ in range(3)] == [pad("mode_up"), pad(), pad()], "which neither arms nor clears"


def test_each_press_of_a_key_counts_however_fast_it_is_typed() -> None:
    typist = Typist()
    keyboard = Keyboard(typist.typed, typist.now_s)
    typist.keys = "+++-1"
    readings = [pad(), *(keyboard.read() for _ in range(10))]
    told = flown(readings)
    modes = [MODES.index(one["mode"]) for one in told]
    assert max(modes) == 3
    assert modes[-1] == 2
    assert told[-1]["is_armed"]


def test_whoever_disarms_in_haste_is_disarmed_at_once_and_whoever_arms_after_it_is_armed() -> None:
    typist = Typist()
    keyboard = Keyboard(typist.typed, typist.now_s)
    typist.keys = "1++++2"
    assert keyboard.read() == pad("disarm")
    typist.keys = "21"
    told = flown([pad(), *(keyboard.read() for _ in range(20))])
    assert told[-1]["is_armed"]


def test_a_key_that_is_leant_on_is_not_obeyed_for_seconds_afterwards() -> None:
    typist = Typist()
    keyboard = Keyboard(typist.typed, typist.now_s)
    typist.keys = "+" * 100
    readings = [keyboard.read() for _ in range(40)]
    assert readings[0] == pad("mode_up")
    assert readings[20:] == [pad()] * 20, "a second at 20 Hz"


def test_hands_take_the_pad_if_there_is_one_and_the_keyboard_else_and_stamp_by_the_runs_clock() -> None:
    keys = FakeSensor([pad("arm")])
    there = Hands(lambda: FakeSensor([pad(surge=0.5), Stale("unplugged"), pad(yaw=0.5)]), lambda: keys, lambda: 7.5)
    assert [there.read() for _ in range(3)] == [
        at(7.5, pad("arm", surge=0.5)),
        at(7.5, msgspec.structs.replace(pad("arm"), is_connected=False)),
        at(7.5, pad("arm", yaw=0.5)),
    ]

    def not_installed() -> Any:
        raise MissingExtra("pygame-ce", "pad")

    without = Hands(not_installed, lambda: keys, lambda: 7.5)
    assert without.read() == at(7.5, pad("arm"))
    without.close()
    with pytest.raises(SensorLost):
        without.read()


def test_space_stops_the_vehicle_also_while_a_pad_is_plugged_in() -> None:
    typist, plugged = Typist(), FakeSensor([pad("mode_up"), PadReading([], [], [])])
    hands = Hands(lambda: plugged, lambda: Keyboard(typist.typed, typist.now_s), typist.now_s)
    typist.keys = "w "
    assert hands.read() == pad("mode_up", "stop")
    typist.keys = " "
    assert hands.read().buttons[BUTTONS["stop"]]


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
    return dict(rows({key: Page(key, value, "urov", 10.0, True) for key, value in data.items()}, heard_s))


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
    pulled = Page("pad", {"is_connected": False}, "topside", 1.0, True)
    assert rows({"vehicle": None, "pad": pulled}, 1.0)[0] == ("hands", "[yellow]keyboard: no game controller[/yellow]")
    assert "WATER" in shown(wet=True)["leak"]
    lost = Page("recording", {"since_s": 5.5, "lost": 90, "reason": "No space left on device"}, "urov_node", 6.0)
    told = "[red]lost at urov_node since its t = 5.5 s: No space left on device[/red]"
    assert ("recording", told) in rows({"vehicle": None, "recording": lost}, 1.0)
    assert "40%" in shown(share=0.4)["thrusters"]
    assert "warp" in shown(refused="There is no mode 'warp'.")["refused"]
    nothing: dict[str, Any] = dict.fromkeys(("vehicle", "depth", "altitude", "power", "leak"))
    assert "not heard yet" in dict(rows(nothing, 1.0))["vehicle"]


def test_display_of_a_pilot_says_what_to_press_and_where_the_vehicle_is() -> None:
    pages = {
        "vehicle": Page("vehicle", {**VEHICLE, "is_armed": False}, "urov", 10.0, True),
        "pad": Page("pad", {"is_connected": True}, "topside", 1.0, True),
        "place": Page("place", {"position_m": [-9.0, 0.25, -1.5]}, "topside", 1.0, True),
        **dict.fromkeys(("depth", "altitude", "power", "leak")),
    }
    told = dict(rows(pages, 0.1))
    assert told["state"] == "disarmed: 1 (start) arms, depth_hold, obeys: pilot"
    assert told["place"] == "-9.0 m east, 0.2 m north, 1.5 m deep"
    assert "arms" not in shown(is_armed=False)["state"]  # of a script


def test_display_without_pad_and_terminal_says_that_nobody_can_steer() -> None:
    pulled = Page("pad", {"is_connected": False}, "topside", 1.0, True)
    assert "nobody can steer" in rows({"vehicle": None, "pad": pulled}, 1.0, has_keys=False)[0][1]


def test_display_says_what_the_link_waits_for_before_the_vehicle_is_heard() -> None:
    down = {"up": False, "reason": "waits for 127.0.0.1:9120: Connection refused."}
    told = rows({"vehicle": None, "link_tether": Page("link_tether", down, "topside", 1.0, True)}, 1.0)
    assert "not heard yet: the link waits for 127.0.0.1:9120: Connection refused." in dict(told)["vehicle"]


def test_legend_of_the_display_names_every_key() -> None:
    words = " ".join(LEGEND).split()
    for key in [*STICK_KEYS, *BUTTON_KEYS]:
        assert {" ": "space", "=": "+"}.get(key, key) in words


def test_display_shows_what_has_failed_and_what_is_done_then() -> None:
    failed = {"leak": "water in the hull; surface"}
    assert shown(failsafes=failed, rules="surface")["failsafe"] == "[red]leak: water in the hull; surface[/red]"
    assert "failsafe" not in shown()
    assert "failsafe" in display.NEWS
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
    told = dict(rows({name: Page(name, value, "urov", 10.0, True) for name, value in pages.items()}, 0.1))
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

    parts = [display.DisplayFactory(2.0, lines=lines), TickerFactory(takes_the_screen, "screen")]
    TestRunner(Config(factories={"test": parts}), until_s=2.0).run()
    assert tables[-1].caption.plain.splitlines() == lines


def test_what_a_vehicle_told_that_is_silent_now_is_grey_and_said_to_be_old() -> None:
    silent = shown(heard_s=1.5)
    assert silent.pop("vehicle") == "[red]silent for 1.5 s[/red]"
    assert silent["state"] == "[dim]last heard: armed, depth_hold, obeys: pilot[/dim]"
    assert {"depth", "attitude", "floor", "battery"} < silent.keys()
    assert all(text.startswith("[dim]last heard: ") for text in silent.values())
    assert not any("last heard" in text for text in shown().values())


def said(pages: list[tuple[float, Any]], capfd: pytest.CaptureFixture[str], **options: Any) -> list[str]:
    """The lines of a display without a terminal, that hears these pages 'vehicle' at these times, within 20 s."""
    heard = [
        TimeoutLoopFactory(seconds=at_s, task=tasks.store_page(Page("vehicle", data, "urov_node", 0.0)), name=f"{at_s}")
        for at_s, data in pages
    ]
    config = Config(factories={"test": [display.DisplayFactory(5.0, **options), *heard]})
    TestRunner(config, until_s=20.0).run()
    return capfd.readouterr().err.splitlines()


def test_in_a_pipe_the_display_is_a_line_when_there_is_news_and_now_and_then(
    capfd: pytest.CaptureFixture[str],
) -> None:
    ticks = [(1.0 + 0.25 * i, VEHICLE) for i in range(30)]
    lines = said([*ticks, (8.5, {**VEHICLE, "is_stopped": True})], capfd)
    assert [line.split(":")[0] for line in lines] == ["t = 0.0 s", "t = 1.2 s", "t = 8.6 s", "t = 9.2 s", "t = 19.2 s"]
    assert lines[0].endswith(": vehicle not heard yet")
    assert "heard 0.20 s ago; state armed, depth_hold, obeys: pilot; attitude roll 0" in lines[1]
    assert "EMERGENCY STOP" in lines[2]
    assert "vehicle silent for 0.7 s" in lines[3]


def test_a_run_on_a_virtual_clock_that_nobody_watches_prints_no_lines(capfd: pytest.CaptureFixture[str]) -> None:
    assert said([(1.0, VEHICLE)], capfd, in_lock_step=False) == []


def test_the_display_goes_by_when_the_vehicle_was_heard_and_not_by_its_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle has been on for 500 s when the surface starts; then it is heard no more."""
    drawn: list[float] = []
    monkeypatch.setattr(display, "rows", lambda pages, heard_s, has_keys: drawn.append(round(heard_s, 6)) or [])
    screen = SimpleNamespace(update=lambda table, refresh: None, stop=lambda: None)

    def takes_the_screen(part: Any) -> None:
        part.parent.components["display"].live = screen

    page = Page("vehicle", VEHICLE, "urov_node", 500.0)
    heard = TimeoutLoopFactory(seconds=0.5, task=tasks.store_page(page), name="heard")
    TestRunner(
        Config(factories={"test": [display.DisplayFactory(2.0), heard, TickerFactory(takes_the_screen, "screen")]}),
        until_s=2.0,
    ).run()
    assert drawn[-3:] == [0.5, 1.0, 1.5]
