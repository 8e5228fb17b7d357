"""The loop between pages of pulses and outputs: one write per tick, with the command's age, and neutral if in doubt."""

import math
import re
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from snr_sim import Config, Node, SimClock, TimeoutLoopFactory, WallClock, tasks
from snr_sim.devices.pwm.engine_pwm import EnginePwmLoopFactory, EngineServos
from snr_sim.devices.pwm.pwm_backend import PwmBackend
from snr_sim.devices.pwm.pwm_loop import REARM_AFTER_S, TIMEOUT_S, PwmLoopFactory
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import ComponentFailed, DeviceError
from snr_sim.prelude.signals import LOST, NOT_ACTIVE, TOO_OLD
from snr_sim.testing.parts import TickerFactory

RATE_HZ = 50.0
STILL, AHEAD = [1500.0, 1500.0], [1600.0, 1700.0]


class Outputs(PwmBackend):
    """Two outputs that record their commands, and can break or disarm themselves at a given time."""

    title = "These outputs"

    def __init__(self, arms_in_s: float = 0.0) -> None:
        super().__init__(lambda: self.clock(), 2)
        self.clock: Callable[[], float] = lambda: 0.0
        self.arms_in_s = arms_in_s
        self.told: list[tuple[float, list[float], float, float]] = []
        self.is_broken = False
        self.changes: list[tuple[float, str]] = []
        self._armed_s = 0.0

    def on_configure(self) -> None:
        self.changes.append((self.clock(), "configured"))
        if self.is_broken:
            raise DeviceError("The wire of these outputs is cut.", fix="solder.")

    def on_activate(self) -> None:
        self.changes.append((self.clock(), "activated"))
        self._armed_s = self.clock() + self.arms_in_s
        if self.arms_in_s:
            self.state, self.why = "activating", "waiting for speed controllers"

    def on_deactivate(self, reason: str) -> None:
        self.changes.append((self.clock(), f"deactivated: {reason}"))

    def on_close(self) -> None:
        self.changes.append((self.clock(), "closed"))

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        if self.is_broken:
            raise DeviceError("The wire of these outputs is cut.", fix="solder.")
        if self.state == "activating" and self.clock() >= self._armed_s:
            self.state, self.why = "active", ""
        self.told.append((self.clock(), pulses_us, stamp_s, lease_s))
        return pulses_us


def run(outputs: Outputs, *factories: Any, end_s: float = 1.0, timeout_s: float = 0.5, clock: Any = SimClock) -> Node:
    loop = PwmLoopFactory("pwm", lambda: outputs, RATE_HZ, timeout_s)
    config = Config(factories={"r": [*factories, loop, TimeoutLoopFactory(seconds=end_s)]})
    node = Node("r", config, clock=clock())
    outputs.clock = node.get_time_s
    node.loop()
    return node


def pilot(says: Callable[[float], Any], rate_hz: float = RATE_HZ, arms: bool = True) -> TickerFactory:
    """Store the result of a function at each tick; None stores no page. `is_armed` is false first, if it is to arm."""

    def say(loop: Any) -> None:
        now_s = loop.get_time_s()
        data = says(now_s)
        if isinstance(data, list):
            data = {"pulses_us": data, "is_armed": now_s > 0.0 or not arms}
        if data is not None:
            loop.store_data("pwm", data)

    return TickerFactory(say, "pilot", rate_hz)


def test_it_writes_once_in_each_tick_with_the_moment_at_which_the_command_was_made() -> None:
    outputs = Outputs()
    run(outputs, pilot(lambda t: AHEAD, rate_hz=10.0))
    moments = [t for t, *_ in outputs.told]
    assert moments == pytest.approx([(i + 5) / RATE_HZ for i in range(len(moments))])  # from when it was armed
    assert len(moments) >= 45
    assert outputs.told[0][1] == STILL, "armed, and neutral is shown"
    for t, pulses, stamp_s, lease_s in outputs.told[1:]:
        assert pulses == AHEAD
        made_s = math.floor(t * 10.0 + 1e-6) / 10.0
        assert stamp_s == pytest.approx(made_s)
        assert lease_s == pytest.approx(LEASE_S - (t - made_s))


def test_without_any_command_nothing_is_armed() -> None:
    outputs = Outputs()
    run(outputs, end_s=3.0)
    assert outputs.told == []
    assert [what for _, what in outputs.changes if what == "activated"] == []
    assert outputs.applied.pulses_us == STILL


def test_a_robot_that_never_says_whether_it_is_armed_must_command_neutral_first() -> None:
    outputs = Outputs()
    run(outputs, pilot(lambda t: AHEAD if t < 0.5 or t > 0.6 else STILL, arms=False))
    assert [t for t, what in outputs.changes if what == "activated"] == pytest.approx([0.5])
    assert {t >= 0.5 for t, *_ in outputs.told} == {True}
    assert outputs.told[-1][1] == AHEAD


def test_a_robot_that_disarms_is_at_neutral_at_once_and_armed_again_when_it_says_so() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: {"pulses_us": AHEAD, "is_armed": t > 0.0 and not 0.4 <= t < 0.6}))
    assert [round(t, 2) for t, what in outputs.changes if what == "deactivated: disarmed by the robot"] == [0.4]
    assert [round(t, 2) for t, what in outputs.changes if what == "activated"] == [0.02, 0.6]
    assert [pulses for t, pulses, *_ in outputs.told if 0.41 < t < 0.615] == [STILL], "shown while it is armed"
    assert node.notes == [], "nothing of that is news"


def test_an_emergency_stop_of_the_robot_reaches_the_outputs_and_holds_until_it_is_taken_back() -> None:
    outputs = Outputs()

    def says(t: float) -> Any:
        return {"pulses_us": AHEAD, "is_stop": 0.4 <= t < 0.6, "is_armed": 0.0 < t < 0.7 or t > 0.8}

    run(outputs, pilot(says))
    assert "deactivated: emergency stop" in [what for t, what in outputs.changes if 0.39 < t < 0.41]
    after = [(round(t, 2), pulses) for t, pulses, *_ in outputs.told if t > 0.39]
    assert not [t for t, _ in after if t < 0.6]
    assert after[-1][1] == AHEAD
    stopped = Outputs()
    stopped.configure()
    stopped.stop()
    with pytest.raises(DeviceError, match="has its emergency stop set"):
        stopped.activate()
    stopped.clear_stop()
    stopped.activate()


def test_a_robot_that_falls_silent_is_disarmed_and_no_neutral_of_the_loops_own_arms_it_again() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: None if 1.0 < t < 3.5 else AHEAD), end_s=6.0, timeout_s=TIMEOUT_S)
    assert [round(t, 1) for t, what in outputs.changes if "commanded nothing for 1 s" in what] == [2.0]
    assert [what for t, what in outputs.changes if t > 0.1 and what == "activated"] == []
    assert max(t for t, *_ in outputs.told) < 2.1
    assert [note for note in node.notes if "inactive. the robot has commanded nothing for 1 s" in note]


def test_the_lease_of_a_robot_that_stopped_thinking_runs_out_and_then_neutral_is_written() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: AHEAD if t < 0.1 else None), timeout_s=0.5)
    last_s = 0.08
    for t, pulses, stamp_s, lease_s in outputs.told[1:]:
        if t < last_s + LEASE_S - 1e-6:
            assert (pulses, lease_s) == (AHEAD, pytest.approx(last_s + LEASE_S - max(t, last_s), abs=0.021)), t
        else:
            assert pulses == STILL, t
        if last_s + LEASE_S + 1e-6 < t <= last_s + 0.5:
            assert (stamp_s, lease_s) == (pytest.approx(last_s), 0.0), "nothing new was computed"
        if t > last_s + 0.5 + 1e-6:
            assert stamp_s == t, "neutral is a new command"
    page = node.get_page("pwm_applied")
    assert page is not None
    assert page.data["state"] == "active"


def test_a_robot_that_hesitates_is_made_neutral_by_the_loop_before_its_lease_runs_out() -> None:
    """By default: so outputs with their own lease need not be armed again."""
    outputs = Outputs()
    factory = PwmLoopFactory("pwm", lambda: outputs, RATE_HZ)
    says = pilot(lambda t: AHEAD if t < 0.1 else None)
    node = Node("r", Config(factories={"r": [says, factory, TimeoutLoopFactory(seconds=1.0)]}), clock=SimClock())
    outputs.clock = node.get_time_s
    node.loop()
    last_s = 0.08
    first = next((t, stamp_s) for t, pulses, stamp_s, _ in outputs.told if t > last_s and pulses == STILL)
    assert last_s < first[0] < last_s + LEASE_S - 1e-6
    assert first[0] == first[1], "neutral is a new command"


def test_a_page_that_says_off_or_nothing_is_neutral() -> None:
    for data in ({"pulses_us": AHEAD, "is_on": False}, {"pulses_us": []}, {}):
        outputs = Outputs()
        run(outputs, pilot(lambda t, data=data: {**data, "is_armed": t > 0.0}), end_s=0.1)
        assert outputs.told
        assert {tuple(pulses) for _, pulses, _, _ in outputs.told} == {tuple(STILL)}


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ({"pulses_us": [math.nan, 1500.0]}, r"pulses_us\[0\] = nan is no finite number"),
        ({"pulses_us": [1500.0, math.inf]}, r"pulses_us\[1\] = inf is no finite number"),
        ({"pulses_us": [1500.0]}, "1 pulses for 2 channels"),
        ({"pulses_us": [1500.0, None]}, "pulses_us"),
        ({"pulses_us": "1500"}, "pulses_us"),
        ({"pulse_us": [1500.0, 1500.0]}, "does not know"),
        (7, "must be a dict"),
    ],
)
def test_a_page_that_is_no_command_ends_a_run_in_lock_step_with_the_line_that_stored_it(bad: Any, said: str) -> None:
    outputs = Outputs()
    with pytest.raises(ComponentFailed, match=rf"(?s)test_pwm_loop.py.*Page 'pwm' is no command.*{said}"):
        run(outputs, pilot(lambda t: bad if t > 0.05 else AHEAD), end_s=30.0)
    assert any("deactivated" in what for _, what in outputs.changes)
    assert outputs.health().state == "closed"
    assert [pulses for t, pulses, *_ in outputs.told if t > 0.1] == []


@pytest.mark.slow
def test_h6_on_the_wall_clock_a_page_that_is_no_command_is_neutral_and_told_and_the_loop_goes_on() -> None:
    outputs = Outputs()
    bad = {"pulses_us": [math.nan, 1500.0]}
    before_s: list[float] = []
    since_s: list[float] = []

    def says(t: float) -> Any:
        """Arm until it goes ahead; then ten invalid pages, and then ahead for some more ticks.

        Repeated, because a loop whose thread starts a little later does not receive a page of one tick alone.
        """
        if AHEAD in [pulses for _, pulses, *_ in outputs.told]:
            since_s.append(t)
        else:
            before_s.append(t)
        if 1 <= len(since_s) <= 10:
            return bad
        return {"pulses_us": AHEAD, "is_armed": bool(since_s) or len(before_s) % 20 > 9}

    def end(loop: Any) -> None:
        if len(since_s) > 20:
            loop.schedule(tasks.terminate("seen"))

    node = run(outputs, pilot(says), TickerFactory(end, "ender"), end_s=60.0, clock=WallClock)
    assert node.exit_reason == "seen"
    (note,) = [note for note in node.notes if "is no command" in note]
    assert "test_pwm_loop.py" in note
    assert "nan is no finite number" in note
    # A write that was in progress when the first was stored may still complete; then neutral until the next command.
    meanwhile = [pulses for t, pulses, *_ in outputs.told if since_s[0] < t < since_s[10]]
    assert STILL in meanwhile
    assert [pulses for pulses in meanwhile[meanwhile.index(STILL) :] if pulses != STILL] == []


def test_outputs_that_were_lost_are_opened_again_and_armed_only_after_half_a_second_of_neutral() -> None:
    outputs = Outputs()

    def says(t: float) -> list[float]:
        outputs.is_broken = 0.5 <= t < 2.2
        return STILL if t < 0.1 or 4.0 <= t < 4.0 + 2 * REARM_AFTER_S + 1.0 else AHEAD

    node = run(outputs, pilot(says, arms=False), end_s=8.0)
    configured = [t for t, what in outputs.changes if what == "configured" and t > 0.2]
    activated = [t for t, what in outputs.changes if what == "activated" and t > 0.2]
    assert 2.2 < configured[-1] < 3.6
    assert all(gap > 0.99 for gap in map(lambda a, b: b - a, configured, configured[1:])), "once a second"
    assert len(activated) == 1
    assert 4.0 + REARM_AFTER_S <= activated[0] <= 4.0 + REARM_AFTER_S + 1.1
    silent = [t for t, *_ in outputs.told if 0.51 < t < activated[0]]
    assert silent == [], "nothing was put to outputs that are not armed"
    assert [re.sub(r"t = [\d.]+ s", "t", note) for note in node.notes] == [
        "Outputs of 'pwm', t: error. The wire of these outputs is cut.\n  Try: solder.",
        "Outputs of 'pwm', t: found again, and inactive.\n"
        "  Neutral until the robot disarms and arms, or has commanded neutral for 0.5 s.",
        "Outputs of 'pwm', t: active.",
    ]


def test_outputs_that_let_go_by_themselves_stay_so_while_the_robot_pushes() -> None:
    outputs = Outputs()

    def says(t: float) -> list[float]:
        if 0.5 <= t < 0.51:
            outputs.state, outputs.why = "inactive", "nobody renewed the command"
        return AHEAD

    node = run(outputs, pilot(says), end_s=4.0)
    assert [round(t, 2) for t, what in outputs.changes if what == "activated"] == [0.02]
    assert max(t for t, *_ in outputs.told) < 0.53
    (note,) = node.notes
    assert note.endswith(
        "inactive. nobody renewed the command\n"
        "  Neutral until the robot disarms and arms, or has commanded neutral for 0.5 s."
    )


def test_what_becomes_of_commands_is_told_at_once_when_it_changes_and_twice_a_second_else() -> None:
    outputs = Outputs(arms_in_s=0.3)
    seen: list[Any] = []

    def says(t: float) -> list[float]:
        return AHEAD

    def look(loop: Any) -> None:
        page = loop.parent.get_page("pwm_applied")
        if page is not None and (not seen or seen[-1] is not page):
            seen.append(page)

    run(outputs, pilot(says), TickerFactory(look, "looker", RATE_HZ), end_s=1.6)
    assert [page.data["state"] for page in seen][:3] == ["inactive", "activating", "active"]
    assert seen[1].data["fault"] == "waiting for speed controllers"
    assert seen[1].data["why"] == [NOT_ACTIVE]
    assert seen[1].data["pulses_us"] == STILL
    assert seen[2].data["pulses_us"] in (STILL, AHEAD)
    gaps = [b.created_at_s - a.created_at_s for a, b in pairwise(seen)]
    assert gaps
    assert all(gap <= 0.5 + 1e-6 for gap in gaps)
    assert len(seen) < 10
    assert set(seen[-1].data) == {"pulses_us", "stamp_s", "why", "state", "fault"}


def test_pulses_outside_the_limits_are_clamped_and_that_is_said_once_with_the_limits() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: [99.0, 1900.5]), end_s=0.3)
    assert {tuple(pulses) for _, pulses, _, _ in outputs.told} == {tuple(STILL), (1100.0, 1900.0)}
    assert len(node.notes) == 1
    assert "'pwm.pulses_us' = [99, 1900.5] is outside (1100.0, 1900.0) and was clamped to [1100, 1900]" in node.notes[0]


def test_at_the_end_outputs_are_neutral_and_closed() -> None:
    outputs = Outputs()
    run(outputs, pilot(lambda t: AHEAD), end_s=0.1)
    assert [what for _, what in outputs.changes][-2:] == ["deactivated: closed", "closed"]
    assert "deactivated: the robot's program ends" in [what for _, what in outputs.changes]


def test_outputs_that_cannot_be_opened_end_the_run_before_it_begins() -> None:
    outputs = Outputs()
    outputs.is_broken = True
    with pytest.raises(ComponentFailed, match="wire of these outputs is cut"):
        run(outputs)
    assert outputs.told == []


def test_what_is_no_device_is_refused() -> None:
    config = Config(factories={"r": [PwmLoopFactory("pwm", lambda: object(), RATE_HZ)]})  # type: ignore[arg-type]
    with pytest.raises(ComponentFailed, match=r"lacks one of configure(.|\n)*snr_sim.LifeCycle"):
        Node("r", config, clock=SimClock()).loop()


class Servos(Outputs):
    """Three of them."""

    def __init__(self) -> None:
        super().__init__()
        self.channels, self.still_us = 3, [1500.0] * 3


def run_engine(says: Callable[[float], Any], end_s: float = 0.3) -> tuple[Node, Servos]:
    servos = Servos()
    loop = EnginePwmLoopFactory("engine", EngineServos(0.1), lambda: servos, RATE_HZ)
    ticker = TickerFactory(lambda loop: loop.store_data("engine", says(loop.get_time_s())), "guidance", 10.0)
    node = Node("r", Config(factories={"r": [ticker, loop, TimeoutLoopFactory(seconds=end_s)]}), clock=SimClock())
    servos.clock = node.get_time_s
    node.loop()
    return node, servos


def test_engine_commands_are_written_as_pulses_with_their_age() -> None:
    node, servos = run_engine(lambda t: {"throttle": 0.5, "attitude": -1.0})
    assert [pulses for _, pulses, _, _ in servos.told] == [[1500.0] * 3, *[[1700.0, 1500.0, 1100.0]] * 15]
    assert servos.told[4][2] == pytest.approx(0.0)  # written at 0.08 s, computed at 0
    assert node.notes == []


def test_engine_commands_beyond_the_engine_are_clamped_and_told_in_its_own_words() -> None:
    node, servos = run_engine(lambda t: {"throttle": 2.0, "gimbal_rad": -0.2})
    assert {tuple(pulses) for _, pulses, _, _ in servos.told[1:]} == {(1900.0, 1100.0, 1500.0)}
    assert [note.splitlines()[-1].strip().split(" (said")[0] for note in node.notes] == [
        "Command 'engine.throttle' = 2 is outside (0.0, 1.0) and was clamped to 1",
        "Command 'engine.gimbal_rad' = -0.2 is outside (-0.1, 0.1) and was clamped to -0.1",
    ]


@pytest.mark.parametrize("bad", [{"throttle": math.nan}, {"attitude": math.inf}, {"thrust": 1.0}])
def test_what_is_no_engine_command_ends_the_run(bad: Any) -> None:
    with pytest.raises(ComponentFailed, match=r"(?s)test_pwm_loop.py.*Page 'engine' is no command"):
        run_engine(lambda t: bad)


def test_why_says_too_old_where_the_age_of_a_command_is_more_than_its_lease() -> None:
    outputs = Outputs()
    outputs.configure()
    outputs.activate()
    assert TOO_OLD in outputs.write_us(AHEAD, -1.0).why
    outputs.is_broken = True
    assert LOST in outputs.write_us(AHEAD, 0.0).why
