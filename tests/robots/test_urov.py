"""The underwater vehicle's software, part by part, without a node: its inputs, its control state, its holds."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from snr_sim import Config, EndpointFactory, Mode, SimRunner, Task, TaskId, TaskType
from snr_sim.core.clocks import SimClock
from snr_sim.plants.battery import Battery
from snr_sim.plants.stepping import Stepper
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import CommandError, ParameterError, SnrError, UnknownNameError
from snr_sim.prelude.scenario import RobotContext, RobotInfo
from snr_sim.prelude.signals import DepthReading, GamepadReading, ImuReading, PowerReading
from snr_sim.scenario import library
from snr_sim.teleop.gamepad_pilot import BUTTONS
from snr_sim.teleop.keyboard import Keyboard
from snr_sim.teleop.manual_input import ManualInput
from snr_sim.teleop.scripted_pilot import Cue
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoop, FunctionLoopFactory

robot = library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import AutopilotFactory  # noqa: E402
from snr_sim_robot_urov.controls import MODES, STICKS, Controls, controls_of, scripted_pilot  # noqa: E402
from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits, FailsafeMonitor  # noqa: E402
from snr_sim_robot_urov.failsafes import Failsafes  # noqa: E402
from snr_sim_robot_urov.holds import HoldController  # noqa: E402
from snr_sim_robot_urov.parameters import HoldParameters  # noqa: E402
from snr_sim_robot_urov.tether_link import tether_faults  # noqa: E402
from snr_sim_robot_urov.waypoint_pilot import Waypoint, WaypointPilot  # noqa: E402

DT_S = 0.02


# -- controls ---------------------------------------------------------------------------------------------------------


def test_default_controls_are_disarmed() -> None:
    assert controls_of({}) == Controls()
    assert not Controls().is_armed


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        ({"mode": "depth_hld"}, UnknownNameError, "did you mean 'depth_hold'"),
        ({"surge": 1.01}, CommandError, "'surge' must be in -1 to 1, not 1.01"),
        ({"yaw": math.nan}, CommandError, "'yaw' must be in -1 to 1, not nan"),
        ({"depth_m": math.inf}, CommandError, "'depth_m' must be finite or None, not inf"),
        ({"depth_m": -1.0}, CommandError, "positive down"),
        ({"heading_rad": math.nan}, CommandError, "'heading_rad' must be finite or None, not nan"),
        ({"depth_m": 1000.0}, CommandError, "'depth_m' must be in 0 to [0-9]+ m, not 1000"),
        ({"heave": -math.inf}, CommandError, "'heave' must be in -1 to 1, not -inf"),
        ({"is_armed": "yes"}, CommandError, "is_armed"),
        ({"number": None}, CommandError, "number"),
        ({"thrust": 1.0}, CommandError, "unknown field `thrust`"),
        ({"surge": "full"}, CommandError, "surge"),
        ([1.0], CommandError, "The page 'controls' is invalid"),
    ],
)
def test_invalid_controls_raise_error_with_message(data: Any, error: type[SnrError], message: str) -> None:
    with pytest.raises(error, match=message):
        controls_of(data)


def test_invalid_script_raises_error_before_dive() -> None:
    with pytest.raises(ParameterError, match="order"):
        scripted_pilot([Cue(5.0, is_armed=True), Cue(1.0)], 20.0)
    with pytest.raises(CommandError, match="unknown field `armed`"):
        scripted_pilot([Cue(5.0, armed=True)], 20.0)


# -- failsafe monitor ------------------------------------------------------------------------------------------------


def armed(number: int = 1, **changes: Any) -> Controls:
    return Controls(number, is_armed=True, **changes)


def monitor(**limits: Any) -> FailsafeMonitor:
    return FailsafeMonitor(FailsafeLimits(**limits))


def test_unarmed_controls_keep_idle() -> None:
    one = monitor()
    assert one.control_state(0.0) == "idle"
    one.on_controls(Controls(1, surge=1.0), 0.0)
    assert one.control_state(0.0) == "idle"
    one.on_controls(armed(2), 0.1)
    assert one.control_state(0.1) == "pilot"
    one.on_controls(Controls(3), 0.2)
    assert one.control_state(0.2) == "idle"


def test_aging_controls_degrade_from_pilot_to_surface() -> None:
    one = monitor()
    one.on_controls(armed(), 10.0)
    ages = {0.0: "pilot", 0.25: "pilot", 0.26: "neutral", 1.99: "neutral", 2.0: "hold", 11.99: "hold", 12.0: "surface"}
    for age_s, control_state in ages.items():
        assert one.control_state(10.0 + age_s) == control_state
    one.on_controls(armed(2), 100.0)
    assert one.control_state(100.1) == "pilot"


def test_stop_lasts_until_cleared_by_disarmed_controls() -> None:
    one = monitor()
    one.on_controls(armed(1, is_stop=True), 0.0)
    assert (one.control_state(0.0), one.is_stopped) == ("idle", True)
    one.on_controls(armed(2), 0.1)
    assert one.control_state(0.1) == "idle", "releasing the stop button does not clear the stop"
    one.on_controls(armed(3, clears_stop=True), 0.2)
    assert one.is_stopped, "who is armed cannot clear it"
    one.on_controls(Controls(4, is_stop=True, clears_stop=True), 0.3)
    assert one.is_stopped
    one.on_controls(Controls(5, clears_stop=True), 0.4)
    one.on_controls(armed(6), 0.5)
    assert one.control_state(0.5) == "pilot"


def test_stop_keeps_idle_after_link_loss() -> None:
    one = monitor()
    one.on_controls(armed(1, is_stop=True), 0.0)
    for age_s in (0.1, 1.0, 5.0, 50.0):
        assert one.control_state(age_s) == "idle"


def test_overtaken_command_is_ignored() -> None:
    one = monitor()
    one.on_controls(armed(7), 0.0)
    one.on_controls(Controls(6), 0.1)
    assert (one.control_state(0.1), one.age_s(0.1)) == ("pilot", pytest.approx(0.1))


def test_overtaken_stop_is_applied() -> None:
    one = monitor()
    one.on_controls(armed(7), 0.0)
    one.on_controls(Controls(6, is_stop=True), 0.1)
    assert one.control_state(0.1) == "idle"


def test_restarted_surface_with_lower_number_is_accepted() -> None:
    one = monitor()
    one.on_controls(armed(5000), 0.0)
    one.on_controls(armed(1), 9.0)
    assert one.control_state(9.0) == "pilot"


def test_leak_surfaces_unless_action_is_warn() -> None:
    for action, control_state in (("surface", "surface"), ("warn", "pilot")):
        one = FailsafeMonitor(FailsafeLimits(), Failsafes(leak=action))
        one.on_controls(armed(), 0.0)
        one.is_leaking = True
        assert one.control_state(0.0) == control_state


def weak(one: FailsafeMonitor, from_s: float, to_s: float, volts: float, amperes: float = 5.0) -> FailsafeMonitor:
    """Shows it a battery, five times a second."""
    for i in range(round(5 * from_s), round(5 * to_s) + 1):
        one.on_power(PowerReading(volts, amperes, 0.2 * i))
    return one


def test_low_battery_surfaces_after_delay_and_latches() -> None:
    one = monitor(low_v=13.0, low_s=10.0, sag_ohm=0.0)
    one.on_controls(armed(), 20.0)
    assert weak(one, 0.0, 9.8, 12.9).control_state(20.0) == "pilot"
    assert weak(one, 10.0, 10.0, 12.9).control_state(20.0) == "surface"
    assert weak(one, 10.2, 60.0, 15.0).control_state(20.0) == "surface", "without load it looks better than it is"
    one.on_controls(Controls(2), 20.1)
    assert one.control_state(20.1) == "idle", "who has disarmed decides"


def test_voltage_sag_under_load_is_not_low_battery() -> None:
    one = monitor(low_v=13.0, low_s=10.0, sag_ohm=0.03)
    assert not weak(one, 0.0, 60.0, 15.0 - 0.03 * 100.0, 100.0).is_battery_low, "what the load costs is known"
    assert not weak(one, 70.0, 79.0, 11.0, 20.0).is_battery_low, "more than that, but not for long"
    assert not weak(one, 79.2, 80.0, 14.0).is_battery_low
    assert not weak(one, 80.2, 89.0, 11.0, 20.0).is_battery_low, "each time is counted by itself"
    assert weak(one, 89.2, 91.0, 11.0, 20.0).is_battery_low


def test_low_battery_can_warn_only_or_be_disabled() -> None:
    for low_v, is_battery_low in ((13.0, True), (0.0, False)):
        one = weak(FailsafeMonitor(FailsafeLimits(low_v=low_v), Failsafes(low_battery="warn")), 0.0, 20.0, 11.0)
        one.on_controls(armed(), 20.0)
        assert (one.control_state(20.0), one.is_battery_low) == ("pilot", is_battery_low)


# -- holds ------------------------------------------------------------------------------------------------------------


def imu(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, rate: tuple[float, ...] = (0, 0, 0)) -> ImuReading:
    return ImuReading(list(map(float, rate)), [0.0, 0.0, 9.81], [0.0, 20.0, -44.0], roll, pitch, yaw, 0.0)


def depth(depth_m: float, stamp_s: float = 0.0) -> DepthReading:
    return DepthReading(depth_m, 101_325.0 + 9777.0 * depth_m, 18.0, stamp_s)


def holds() -> HoldController:
    return HoldController(HoldParameters(), drag=(33.0, 190.0))


def test_manual_mode_equals_sticks_in_body_frame() -> None:
    controls = Controls(surge=1.0, sway=-0.5, heave=0.25, yaw=1.0)
    wrench = holds().wrench(controls, depth(2.0), imu(roll=0.5, pitch=-0.3, rate=(1, 1, 1)), DT_S)
    numbers = HoldParameters()
    assert wrench == pytest.approx([numbers.sticks_n[0], -0.5 * numbers.sticks_n[1], 15.0, 0.0, 0.0, numbers.yaw_nm])


def test_stabilise_levels_and_heave_stays_vertical() -> None:
    wrench = holds().wrench(Controls(mode="stabilise", heave=1.0), depth(2.0), imu(roll=0.4, pitch=0.3), DT_S)
    assert wrench[3] < 0.0
    assert wrench[4] < 0.0
    push = HoldParameters().sticks_n[2]
    up = [-push * math.sin(0.3), push * math.cos(0.3) * math.sin(0.4), push * math.cos(0.3) * math.cos(0.4)]
    assert wrench[:3] == pytest.approx(up)


def test_depth_hold_keeps_depth_at_mode_change() -> None:
    one = holds()
    one.wrench(Controls(mode="depth_hold"), depth(1.7), imu(), DT_S)
    assert one.depth_m == pytest.approx(1.7)
    assert one.wrench(Controls(mode="depth_hold"), depth(2.0), imu(), DT_S)[2] > 0.0, "too deep: it pushes up"
    assert one.wrench(Controls(mode="depth_hold"), depth(1.4), imu(), DT_S)[2] < 0.0
    one.wrench(Controls(mode="stabilise"), depth(2.6), imu(), DT_S)
    one.wrench(Controls(mode="depth_hold"), depth(2.6), imu(), DT_S)
    assert one.depth_m == pytest.approx(2.6), "chosen again, it is another one"


def test_depth_setpoint_keeps_speed_and_braking_limits() -> None:
    one = holds()
    one.wrench(Controls(mode="depth_hold", depth_m=1.0), depth(1.0), imu(), DT_S)
    one.wrench(Controls(mode="depth_hold", depth_m=3.0), depth(1.0), imu(), DT_S)
    course = [1.0]
    for _ in range(700):
        one.wrench(Controls(mode="depth_hold"), depth(1.0), imu(), DT_S)
        course.append(one.depth_m)
    speeds = [(b - a) / DT_S for a, b in pairwise(course)]
    assert max(speeds[1:]) == pytest.approx(HoldParameters().sink_mps)
    assert max(abs(b - a) / DT_S for a, b in pairwise(speeds[2:])) < 2.0 * HoldParameters().brake_mps2
    assert course[-1] == pytest.approx(3.0)
    assert max(course) <= 3.0


def test_heave_stick_moves_depth_setpoint_up_to_surface() -> None:
    one = holds()
    for heave in [1.0] * 100 + [0.0] * 300:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(1.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(1.0 - 100 * DT_S * HoldParameters().sink_mps)
    for _ in range(800):
        one.wrench(Controls(mode="depth_hold", heave=1.0), depth(1.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(0.0, abs=1e-12)


def test_depth_setpoint_lead_is_limited_on_floor() -> None:
    one = holds()
    for heave in [-1.0] * 1500 + [0.0] * 300:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(3.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(3.0 + HoldParameters().max_lead_m)
    for heave in [1.0] * 150 + [0.0] * 300:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(3.0), imu(), DT_S)
    assert one.depth_m is not None
    assert one.depth_m < 3.0


def test_heave_stick_keeps_commanded_depth() -> None:
    one = holds()
    one.wrench(Controls(mode="depth_hold", depth_m=6.0), depth(1.0), imu(), DT_S)
    for heave in [-0.1] * 10 + [0.0] * 1500:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(1.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(6.0)


def test_heading_hold_turns_shorter_way_and_yaw_moves_setpoint() -> None:
    one = holds()
    one.wrench(Controls(mode="heading_hold", heading_rad=math.radians(170)), depth(1.0), imu(yaw=3.0), DT_S)
    for _ in range(100):
        wrench = one.wrench(Controls(mode="heading_hold"), depth(1.0), imu(yaw=math.radians(-170)), DT_S)
    assert one.heading_rad == pytest.approx(math.radians(170))
    assert wrench[5] < 0.0
    for yaw in [1.0] * 50 + [0.0] * 200:
        one.wrench(Controls(mode="heading_hold", yaw=yaw), depth(1.0), imu(), DT_S)
    assert one.heading_rad == pytest.approx(math.radians(170) + 50 * DT_S * HoldParameters().turn_radps - 2 * math.pi)


def test_unactuated_axis_is_not_controlled() -> None:
    one = HoldController(HoldParameters(), drag=(33.0, 190.0), unactuated=("pitch",))
    for mode in MODES[1:]:
        wrench = one.wrench(Controls(mode=mode), depth(1.0), imu(roll=0.2, pitch=0.2), DT_S)
        assert wrench[4] == 0.0
        assert wrench[3] < 0.0


# -- a pilot who sees --------------------------------------------------------------------------------------------------


def test_waypoint_pilot_steers_to_goal_at_any_heading() -> None:
    for yaw, stick, side in ((0.0, "surge", 1.0), (math.pi / 2, "sway", -1.0), (math.pi, "surge", -1.0)):
        pages = controls_towards(Waypoint(5.0, 0.0, 2.0, 0.0), [(0.0, 0.0, -2.0, yaw)] * 40)
        assert side * pages[-1][stick] > 0.3
        assert not pages[0]["is_armed"]
        assert pages[-1]["is_armed"]
        assert (pages[-1]["mode"], pages[-1]["depth_m"]) == ("heading_hold", 2.0)


def controls_towards(goal: Waypoint, places: list[tuple[float, ...]]) -> list[dict[str, Any]]:
    """The controls of a pilot who gets these positions, ten times a second."""
    pages: list[dict[str, Any]] = []
    left = list(places)

    def store_fix(loop: FunctionLoop) -> None:
        if left:
            x, y, z, yaw = left.pop(0)
            loop.store_data("position_fix", {"position_m": [x, y, z], "yaw_rad": yaw, "stamp_s": loop.get_time_s()})

    pilot = WaypointPilot.factory("pilot", route=[goal])
    parts = [FunctionLoopFactory(store_fix, rate_hz=10.0), pilot, listener("controls", pages)]
    SimRunner(Config(Mode.TEST, {"topside": parts}), until_s=0.1 * len(places)).run()
    return pages


def listener(key: str, pages: list[dict[str, Any]]) -> EndpointFactory:
    """An endpoint that keeps the data of every page of a key."""

    def on_page(task: Task, task_id: TaskId) -> None:
        pages.append(dict(task.page.data))

    return FunctionEndpointFactory({(TaskType.process_data, key): on_page}, "listener")


# -- both roles, with the plant ---------------------------------------------------------------------------------------


def dived(
    script: list[Cue], until_s: float, meddle: Any = None, charge: float = 1.0, pilot: str = "scripted", **changes: Any
) -> list[dict[str, Any]]:
    """Pages that the surface gets, ten times a second, from a vehicle that a pilot drives from 1 m of depth.

    Args:
        script: what the pilot does.
        until_s: how long.
        meddle: makes another component of the surface.
        charge: of the battery from DRAIN_S on, all at once: one that is low before the dive cannot be armed with.
        pilot: factory of the pilot.
        changes: of the parameters.
    """
    scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))
    parameters = replace(scenario.parameters(1), script=tuple(script), **changes)
    plant = scenario.plant(1, "mujoco")
    plant.thrusters.supply = Battery()
    plant.reset(1)
    context = RobotContext(RobotInfo("urov", "urov", "test", "mujoco", parameters, {"pilot": pilot}), "sim", 1, plant)
    pages: list[dict[str, Any]] = []
    parts = robot.roles(context, [AutopilotFactory(parameters)])
    parts["topside"] += [listener("vehicle", pages), *([] if meddle is None else [meddle])]
    left = [charge] if charge < 1.0 else []

    def drain(loop: FunctionLoop) -> None:
        if left and loop.get_time_s() >= DRAIN_S:
            plant.thrusters.supply.restore((left.pop(), 0.0, 0.0, False))

    parts["topside"].append(FunctionLoopFactory(drain, "drain", rate_hz=10.0))
    clock = SimClock()
    clock.follow(Stepper(plant).advance_to)
    SimRunner(Config(Mode.TEST, parts), clock=clock, until_s=until_s).run()
    for one in pages:
        one["thrust_n"] = 0.0
    pages[-1]["thrust_n"] = sum(map(abs, plant.thrusters.forces_n))
    pages[-1]["true_depth_m"] = -plant.position_m[2]
    pages[-1]["charge"] = plant.thrusters.charge
    return pages


ARM = Cue(1.5, is_armed=True, mode="depth_hold")
DRAIN_S = 1.8


def test_emergency_stop_is_reported_and_latched_until_cleared() -> None:
    script = [ARM, Cue(2.5, is_stop=True), Cue(3.0, is_stop=False)]
    pages = dived(script, 4.0)
    stopped = [one["is_stopped"] for one in pages]
    assert stopped == sorted(stopped), "once stopped, it stays stopped"
    assert (pages[-1]["is_stopped"], pages[-1]["control_state"], pages[-1]["is_armed"]) == (True, "idle", False)
    assert pages[-1]["thrust_n"] < 0.01
    script += [Cue(4.0, is_armed=False, clears_stop=True), Cue(4.5, is_armed=True, clears_stop=False)]
    pages = dived(script, 5.5)
    assert (pages[-1]["is_stopped"], pages[-1]["control_state"]) == (False, "pilot")
    assert pages[-1]["thrust_n"] > 1.0


def test_invalid_controls_are_reported_and_ignored() -> None:
    def send_invalid(loop: FunctionLoop) -> None:
        if loop.get_time_s() > 3.0:
            loop.store_data("controls", {"number": 10**6, "is_armed": True, "mode": "warp"})

    pages = dived([ARM], 4.0, FunctionLoopFactory(send_invalid, "spoiler", rate_hz=20.0))
    assert any("no mode 'warp'" in one["rejected_command"] for one in pages)
    assert pages[-1]["control_state"] == "pilot", "the pilot's own still come in between"


def test_nearly_empty_battery_is_reported_and_surfaces() -> None:
    script = [ARM, Cue(2.0, depth_m=2.0)]
    pages = dived(script, 14.0, charge=0.064, failsafe_limits=FailsafeLimits(low_s=4.0))
    low = [one["is_battery_low"] for one in pages]
    assert low == sorted(low), "once low, it stays low"
    assert 50 < low.index(True) < 75, "ten a second: after four seconds, though commands arrive"
    assert (pages[-1]["control_state"], pages[-1]["is_armed"]) == ("surface", True)
    assert pages[-1]["true_depth_m"] < 0.35
    assert pages[-1]["charge"] > 0.05, "with plenty left for the way"


def test_unplugged_gamepad_holds_depth_and_keyboard_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def at(time_s: float, *down: str, surge: float = 0.0) -> list[GamepadReading]:
        buttons, axes = [False] * 11, [0.0] * 6
        for name in down:
            buttons[BUTTONS[name]] = True
        axes[STICKS["surge"].axis] = surge
        return [GamepadReading(axes, buttons, [])] * round(20 * time_s)

    readings = [*at(1.5), *at(0.1, "mode_up"), *at(0.1), *at(0.1, "mode_up", "arm"), *at(2.0, surge=-1.0)]
    stale = [Stale("unplugged")] * 1000

    def manual_input(context: RobotContext) -> ManualInput:
        keys = iter([""] * 130 + [" "] + [""] * 1000)
        return ManualInput(lambda: FakeSensor([*readings, *stale]), lambda: Keyboard(STICKS, lambda: next(keys)))

    monkeypatch.setitem(robot.DEVICES["sim"], "manual_input", manual_input)
    pushing, alone, stopped = (dived([], until_s, pilot="manual")[-1] for until_s in (3.7, 6.2, 7.2))
    assert (pushing["control_state"], pushing["mode"], pushing["thrust_n"] > 50.0) == ("pilot", "depth_hold", True)
    assert (alone["control_state"], alone["mode"], alone["is_armed"]) == ("pilot", "depth_hold", True)
    assert alone["thrust_n"] < 20.0
    assert abs(alone["true_depth_m"] - alone["depth_m"]) < 0.3
    assert (stopped["is_stopped"], stopped["thrust_n"] < 0.01) == (True, True)


def test_full_thrust_on_charged_battery_is_not_low_battery() -> None:
    pages = dived([Cue(1.5, is_armed=True, surge=1.0)], 8.0, charge=0.2, failsafe_limits=FailsafeLimits(low_s=4.0))
    assert {one["is_battery_low"] for one in pages} == {False}
    assert (pages[-1]["control_state"], pages[-1]["thrust_n"] > 50.0) == ("pilot", True)


def test_empty_battery_stops_thrusters_and_is_reported() -> None:
    pages = dived([Cue(1.5, is_armed=True, surge=1.0)], 11.0, charge=0.008, failsafe_limits=FailsafeLimits(low_s=4.0))
    assert pages[-1]["thrust_n"] < 0.01
    assert pages[-1]["is_battery_low"]


def test_unarmed_sticks_produce_no_thrust() -> None:
    pages = dived([Cue(0.0, surge=1.0, heave=-1.0)], 3.0)
    assert {one["control_state"] for one in pages} == {"idle"}
    assert pages[-1]["thrust_n"] < 0.01


def test_manual_full_ahead_equals_stick_thrust() -> None:
    pages = dived([Cue(1.5, is_armed=True, surge=1.0)], 3.0)
    assert pages[-1]["mode"] == "manual"
    assert pages[-1]["thrust_scale"] == 1.0
    # Four thrusters at 45 degrees give 60 N. They sit 8.5 cm low, and the upright ones, 12 cm out, keep the nose down.
    # The battery is fuller than the one that the curve is for, so all of them push a little more.
    assert pages[-1]["thrust_n"] == pytest.approx(60.0 * 2.0**0.5 + 60.0 * 0.085 / 0.12, rel=0.1)


# -- the camera -------------------------------------------------------------------------------------------------------


def rig_with(**options: str) -> RobotContext:
    scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))
    return RobotContext(RobotInfo("urov", "urov", "test", "mujoco", scenario.parameters(1), options), "sim", 1, None)


def test_camera_exists_only_when_requested() -> None:
    def keys(context: RobotContext) -> list[str]:
        return [getattr(part, "key", "") for part in robot.roles(context, [])["urov"]]

    assert "camera" not in keys(rig_with())
    assert keys(rig_with(camera="down")).count("camera") == 1
    with pytest.raises(UnknownNameError, match="camera"):
        robot.roles(rig_with(camera="up"), [])


def test_picture_is_reproducible_per_seed() -> None:
    scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))

    def picture(seed: int) -> bytes:
        plant = scenario.plant(seed, "mujoco")
        Stepper(plant).advance_to(0.5)
        camera = robot.sim_camera(replace(rig_with(camera="down"), plant=plant))
        seen: bytes = camera.read().rgb.tobytes()
        return seen

    assert picture(1) == picture(1)
    assert picture(1) != picture(2)


# -- the link through the tether --------------------------------------------------------------------------------------


def test_longer_tether_has_more_latency_and_less_bandwidth() -> None:
    short, long = tether_faults(10.0), tether_faults(300.0)
    assert 0.0 < short.latency_s < long.latency_s < 0.01
    assert (short.bandwidth_bps or 0.0) > (long.bandwidth_bps or 0.0) > 1e6
    assert tether_faults(35.0, loss=0.1, cut=((5.0, 9.0),)).cut == ((5.0, 9.0),)


@pytest.mark.parametrize("length_m", [-1.0, 301.0, math.nan])
def test_invalid_tether_raises_parameter_error(length_m: float) -> None:
    with pytest.raises(ParameterError, match="tether"):
        tether_faults(length_m)
