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
from snr_sim.prelude.errors import ComponentFailedError, DeviceError
from snr_sim.prelude.signals import LOST, NOT_ACTIVE, TOO_OLD
from snr_sim.testing.function_components import FunctionLoopFactory

RATE_HZ = 50.0
STILL, AHEAD = [1500.0, 1500.0], [1600.0, 1700.0]


class Outputs(PwmBackend):
    """Two outputs that record their commands, and can break or disarm themselves at a given time."""

    title = "These outputs"

    def __init__(self, arms_in_s: float = 0.0) -> None:
        super().__init__(lambda: self.clock(), 2)
        self.clock: Callable[[], float] = lambda: 0.0
        self.arms_in_s = arms_in_s
        self.writes: list[tuple[float, list[float], float, float]] = []
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
            self.state, self.reason = "activating", "waiting for speed controllers"

    def on_deactivate(self, reason: str) -> None:
        self.changes.append((self.clock(), f"deactivated: {reason}"))

    def on_close(self) -> None:
        self.changes.append((self.clock(), "closed"))

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, reasons: list[str]) -> list[float]:
        if self.is_broken:
            raise DeviceError("The wire of these outputs is cut.", fix="solder.")
        if self.state == "activating" and self.clock() >= self._armed_s:
            self.state, self.reason = "active", ""
        self.writes.append((self.clock(), pulses_us, stamp_s, lease_s))
        return pulses_us


def run(outputs: Outputs, *factories: Any, end_s: float = 1.0, timeout_s: float = 0.5, clock: Any = SimClock) -> Node:
    loop = PwmLoopFactory("pwm", lambda: outputs, RATE_HZ, timeout_s)
    config = Config(factories={"r": [*factories, loop, TimeoutLoopFactory(seconds=end_s)]})
    node = Node("r", config, clock=clock())
    outputs.clock = node.get_time_s
    node.loop()
    return node


def pilot(command_at: Callable[[float], Any], rate_hz: float = RATE_HZ, arms: bool = True) -> FunctionLoopFactory:
    """Store the result of a function at each tick; None stores no page. `is_armed` is false first, if it is to arm."""

    def store_command(loop: Any) -> None:
        now_s = loop.get_time_s()
        data = command_at(now_s)
        if isinstance(data, list):
            data = {"pulses_us": data, "is_armed": now_s > 0.0 or not arms}
        if data is not None:
            loop.store_data("pwm", data)

    return FunctionLoopFactory(store_command, "pilot", rate_hz)


def test_pwm_loop_writes_once_per_tick_with_time_of_command() -> None:
    outputs = Outputs()
    run(outputs, pilot(lambda t: AHEAD, rate_hz=10.0))
    moments = [t for t, *_ in outputs.writes]
    assert moments == pytest.approx([(i + 5) / RATE_HZ for i in range(len(moments))])  # from when it was armed
    assert len(moments) >= 45
    assert outputs.writes[0][1] == STILL, "armed, and neutral is shown"
    for t, pulses, stamp_s, lease_s in outputs.writes[1:]:
        assert pulses == AHEAD
        made_s = math.floor(t * 10.0 + 1e-6) / 10.0
        assert stamp_s == pytest.approx(made_s)
        assert lease_s == pytest.approx(LEASE_S - (t - made_s))


def test_pwm_loop_without_command_stays_disarmed() -> None:
    outputs = Outputs()
    run(outputs, end_s=3.0)
    assert outputs.writes == []
    assert [what for _, what in outputs.changes if what == "activated"] == []
    assert outputs.applied.pulses_us == STILL


def test_pwm_loop_without_is_armed_requires_neutral_first() -> None:
    outputs = Outputs()
    run(outputs, pilot(lambda t: AHEAD if t < 0.5 or t > 0.6 else STILL, arms=False))
    assert [t for t, what in outputs.changes if what == "activated"] == pytest.approx([0.5])
    assert {t >= 0.5 for t, *_ in outputs.writes} == {True}
    assert outputs.writes[-1][1] == AHEAD


def test_pwm_loop_disarm_is_immediate_and_rearms_on_command() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: {"pulses_us": AHEAD, "is_armed": t > 0.0 and not 0.4 <= t < 0.6}))
    assert [round(t, 2) for t, what in outputs.changes if what == "deactivated: disarmed by the robot"] == [0.4]
    assert [round(t, 2) for t, what in outputs.changes if what == "activated"] == [0.02, 0.6]
    assert [pulses for t, pulses, *_ in outputs.writes if 0.41 < t < 0.615] == [STILL], "shown while it is armed"
    assert node.notes == [], "nothing of that is news"


def test_pwm_loop_emergency_stop_holds_until_cleared() -> None:
    outputs = Outputs()

    def command_at(t: float) -> Any:
        return {"pulses_us": AHEAD, "is_stop": 0.4 <= t < 0.6, "is_armed": 0.0 < t < 0.7 or t > 0.8}

    run(outputs, pilot(command_at))
    assert "deactivated: emergency stop" in [what for t, what in outputs.changes if 0.39 < t < 0.41]
    after = [(round(t, 2), pulses) for t, pulses, *_ in outputs.writes if t > 0.39]
    assert not [t for t, _ in after if t < 0.6]
    assert after[-1][1] == AHEAD
    stopped = Outputs()
    stopped.configure()
    stopped.stop()
    with pytest.raises(DeviceError, match="has its emergency stop set"):
        stopped.activate()
    stopped.clear_stop()
    stopped.activate()


def test_pwm_loop_silent_robot_is_disarmed_and_not_rearmed_by_loop() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: None if 1.0 < t < 3.5 else AHEAD), end_s=6.0, timeout_s=TIMEOUT_S)
    assert [round(t, 1) for t, what in outputs.changes if "commanded nothing for 1 s" in what] == [2.0]
    assert [what for t, what in outputs.changes if t > 0.1 and what == "activated"] == []
    assert max(t for t, *_ in outputs.writes) < 2.1
    assert [note for note in node.notes if "inactive. the robot has commanded nothing for 1 s" in note]


def test_pwm_loop_expired_lease_writes_neutral() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: AHEAD if t < 0.1 else None), timeout_s=0.5)
    last_s = 0.08
    for t, pulses, stamp_s, lease_s in outputs.writes[1:]:
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


def test_pwm_loop_late_robot_gets_neutral_before_lease_expires() -> None:
    """By default: so outputs with their own lease need not be armed again."""
    outputs = Outputs()
    factory = PwmLoopFactory("pwm", lambda: outputs, RATE_HZ)
    command_at = pilot(lambda t: AHEAD if t < 0.1 else None)
    node = Node("r", Config(factories={"r": [command_at, factory, TimeoutLoopFactory(seconds=1.0)]}), clock=SimClock())
    outputs.clock = node.get_time_s
    node.loop()
    last_s = 0.08
    first = next((t, stamp_s) for t, pulses, stamp_s, _ in outputs.writes if t > last_s and pulses == STILL)
    assert last_s < first[0] < last_s + LEASE_S - 1e-6
    assert first[0] == first[1], "neutral is a new command"


def test_pwm_loop_off_or_empty_page_writes_neutral() -> None:
    for data in ({"pulses_us": AHEAD, "is_on": False}, {"pulses_us": []}, {}):
        outputs = Outputs()
        run(outputs, pilot(lambda t, data=data: {**data, "is_armed": t > 0.0}), end_s=0.1)
        assert outputs.writes
        assert {tuple(pulses) for _, pulses, _, _ in outputs.writes} == {tuple(STILL)}


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"pulses_us": [math.nan, 1500.0]}, r"pulses_us\[0\] must be finite, not nan"),
        ({"pulses_us": [1500.0, math.inf]}, r"pulses_us\[1\] must be finite, not inf"),
        ({"pulses_us": [1500.0]}, "1 pulses for 2 channels"),
        ({"pulses_us": [1500.0, None]}, "pulses_us"),
        ({"pulses_us": "1500"}, "pulses_us"),
        ({"pulse_us": [1500.0, 1500.0]}, "does not know"),
        (7, "must be a dict"),
    ],
)
def test_pwm_loop_invalid_page_in_lock_step_raises_with_source_line(bad: Any, message: str) -> None:
    outputs = Outputs()
    with pytest.raises(
        ComponentFailedError, match=rf"(?s)test_pwm_loop.py.*Page 'pwm' is not a valid command.*{message}"
    ):
        run(outputs, pilot(lambda t: bad if t > 0.05 else AHEAD), end_s=30.0)
    assert any("deactivated" in what for _, what in outputs.changes)
    assert outputs.health().state == "closed"
    assert [pulses for t, pulses, *_ in outputs.writes if t > 0.1] == []


@pytest.mark.slow
def test_h6_pwm_loop_invalid_page_on_wall_clock_is_neutral_and_logged() -> None:
    outputs = Outputs()
    bad = {"pulses_us": [math.nan, 1500.0]}
    before_s: list[float] = []
    bad_s: list[float] = []
    after_s: list[float] = []

    def command_at(t: float) -> Any:
        """Arm until it goes ahead; then invalid pages until it is neutral, and then ahead for some more ticks.

        Repeated, because a loop whose thread starts a little later does not receive a page of one tick alone.
        """
        if AHEAD not in [pulses for _, pulses, *_ in outputs.writes]:
            before_s.append(t)
        elif len(bad_s) < 10 or STILL not in [pulses for at_s, pulses, *_ in outputs.writes if at_s > bad_s[0]]:
            bad_s.append(t)
            return bad
        else:
            after_s.append(t)
        return {"pulses_us": AHEAD, "is_armed": bool(bad_s) or len(before_s) % 20 > 9}

    def end(loop: Any) -> None:
        if len(after_s) > 10:
            loop.schedule(tasks.terminate("seen"))

    node = run(outputs, pilot(command_at), FunctionLoopFactory(end, "ender"), end_s=60.0, clock=WallClock)
    assert node.exit_reason == "seen", "it is neutral after some invalid pages"
    (note,) = [note for note in node.notes if "is not a valid command" in note]
    assert "test_pwm_loop.py" in note
    assert "must be finite, not nan" in note
    # A write that was in progress when the first was stored may still complete; then neutral until the next command.
    meanwhile = [pulses for t, pulses, *_ in outputs.writes if bad_s[0] < t < after_s[0]]
    assert [pulses for pulses in meanwhile[meanwhile.index(STILL) :] if pulses != STILL] == []


def test_pwm_loop_lost_outputs_reopen_and_rearm_after_neutral() -> None:
    outputs = Outputs()

    def command_at(t: float) -> list[float]:
        outputs.is_broken = 0.5 <= t < 2.2
        return STILL if t < 0.1 or 4.0 <= t < 4.0 + 2 * REARM_AFTER_S + 1.0 else AHEAD

    node = run(outputs, pilot(command_at, arms=False), end_s=8.0)
    configured = [t for t, what in outputs.changes if what == "configured" and t > 0.2]
    activated = [t for t, what in outputs.changes if what == "activated" and t > 0.2]
    assert 2.2 < configured[-1] < 3.6
    assert all(gap > 0.99 for gap in map(lambda a, b: b - a, configured, configured[1:])), "once a second"
    assert len(activated) == 1
    assert 4.0 + REARM_AFTER_S <= activated[0] <= 4.0 + REARM_AFTER_S + 1.1
    silent = [t for t, *_ in outputs.writes if 0.51 < t < activated[0]]
    assert silent == [], "nothing was put to outputs that are not armed"
    assert [re.sub(r"t = [\d.]+ s", "t", note) for note in node.notes] == [
        "Outputs of 'pwm', t: error. The wire of these outputs is cut.\n  Try: solder.",
        "Outputs of 'pwm', t: found again, and inactive.\n"
        "  Neutral until the robot disarms and arms, or has commanded neutral for 0.5 s.",
        "Outputs of 'pwm', t: active.",
    ]


def test_pwm_loop_self_disarmed_outputs_stay_disarmed_under_thrust() -> None:
    outputs = Outputs()

    def command_at(t: float) -> list[float]:
        if 0.5 <= t < 0.51:
            outputs.state, outputs.reason = "inactive", "the command was not renewed"
        return AHEAD

    node = run(outputs, pilot(command_at), end_s=4.0)
    assert [round(t, 2) for t, what in outputs.changes if what == "activated"] == [0.02]
    assert max(t for t, *_ in outputs.writes) < 0.53
    (note,) = node.notes
    assert note.endswith(
        "inactive. the command was not renewed\n"
        "  Neutral until the robot disarms and arms, or has commanded neutral for 0.5 s."
    )


def test_pwm_loop_reports_changes_at_once_and_else_twice_per_second() -> None:
    outputs = Outputs(arms_in_s=0.3)
    seen: list[Any] = []

    def command_at(t: float) -> list[float]:
        return AHEAD

    def look(loop: Any) -> None:
        page = loop.parent.get_page("pwm_applied")
        if page is not None and (not seen or seen[-1] is not page):
            seen.append(page)

    run(outputs, pilot(command_at), FunctionLoopFactory(look, "looker", RATE_HZ), end_s=1.6)
    assert [page.data["state"] for page in seen][:3] == ["inactive", "activating", "active"]
    assert seen[1].data["fault"] == "waiting for speed controllers"
    assert seen[1].data["reason"] == [NOT_ACTIVE]
    assert seen[1].data["pulses_us"] == STILL
    assert seen[2].data["pulses_us"] in (STILL, AHEAD)
    gaps = [b.created_at_s - a.created_at_s for a, b in pairwise(seen)]
    assert gaps
    assert all(gap <= 0.5 + 1e-6 for gap in gaps)
    assert len(seen) < 10
    assert set(seen[-1].data) == {"pulses_us", "stamp_s", "reason", "state", "fault"}


def test_pwm_loop_clamps_pulses_and_logs_limits_once() -> None:
    outputs = Outputs()
    node = run(outputs, pilot(lambda t: [99.0, 1900.5]), end_s=0.3)
    assert {tuple(pulses) for _, pulses, _, _ in outputs.writes} == {tuple(STILL), (1100.0, 1900.0)}
    assert len(node.notes) == 1
    assert "'pwm.pulses_us' = [99, 1900.5] is outside (1100.0, 1900.0) and was clamped to [1100, 1900]" in node.notes[0]


def test_pwm_loop_at_end_closes_outputs_at_neutral() -> None:
    outputs = Outputs()
    run(outputs, pilot(lambda t: AHEAD), end_s=0.1)
    assert [what for _, what in outputs.changes][-2:] == ["deactivated: closed", "closed"]
    assert "deactivated: the robot's program ends" in [what for _, what in outputs.changes]


def test_pwm_loop_open_failure_ends_run_before_begin() -> None:
    outputs = Outputs()
    outputs.is_broken = True
    with pytest.raises(ComponentFailedError, match="wire of these outputs is cut"):
        run(outputs)
    assert outputs.writes == []


def test_pwm_loop_non_device_raises_component_error() -> None:
    config = Config(factories={"r": [PwmLoopFactory("pwm", lambda: object(), RATE_HZ)]})  # type: ignore[arg-type]
    with pytest.raises(ComponentFailedError, match=r"lacks one of configure(.|\n)*snr_sim.LifeCycle"):
        Node("r", config, clock=SimClock()).loop()


class Servos(Outputs):
    """Three of them."""

    def __init__(self) -> None:
        super().__init__()
        self.channels, self.still_us = 3, [1500.0] * 3


def run_engine(command_at: Callable[[float], Any], end_s: float = 0.3) -> tuple[Node, Servos]:
    servos = Servos()
    loop = EnginePwmLoopFactory("engine", EngineServos(0.1), lambda: servos, RATE_HZ)
    ticker = FunctionLoopFactory(
        lambda loop: loop.store_data("engine", command_at(loop.get_time_s())), "guidance", 10.0
    )
    node = Node("r", Config(factories={"r": [ticker, loop, TimeoutLoopFactory(seconds=end_s)]}), clock=SimClock())
    servos.clock = node.get_time_s
    node.loop()
    return node, servos


def test_engine_loop_writes_commands_as_pulses_with_age() -> None:
    node, servos = run_engine(lambda t: {"throttle": 0.5, "attitude": -1.0})
    assert [pulses for _, pulses, _, _ in servos.writes] == [[1500.0] * 3, *[[1700.0, 1500.0, 1100.0]] * 15]
    assert servos.writes[4][2] == pytest.approx(0.0)  # written at 0.08 s, computed at 0
    assert node.notes == []


def test_engine_loop_clamps_commands_and_logs_engine_fields() -> None:
    node, servos = run_engine(lambda t: {"throttle": 2.0, "gimbal_rad": -0.2})
    assert {tuple(pulses) for _, pulses, _, _ in servos.writes[1:]} == {(1900.0, 1100.0, 1500.0)}
    assert [note.splitlines()[-1].strip().split(" (reported")[0] for note in node.notes] == [
        "Command 'engine.throttle' = 2 is outside (0.0, 1.0) and was clamped to 1",
        "Command 'engine.gimbal_rad' = -0.2 is outside (-0.1, 0.1) and was clamped to -0.1",
    ]


@pytest.mark.parametrize("bad", [{"throttle": math.nan}, {"attitude": math.inf}, {"thrust": 1.0}])
def test_engine_loop_invalid_command_raises_component_error(bad: Any) -> None:
    with pytest.raises(ComponentFailedError, match=r"(?s)test_pwm_loop.py.*Page 'engine' is not a valid command"):
        run_engine(lambda t: bad)


def test_applied_reason_is_too_old_when_age_exceeds_lease() -> None:
    outputs = Outputs()
    outputs.configure()
    outputs.activate()
    assert TOO_OLD in outputs.write_us(AHEAD, -1.0).reason
    outputs.is_broken = True
    assert LOST in outputs.write_us(AHEAD, 0.0).reason
