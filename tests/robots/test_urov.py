"""The underwater vehicle's software, part by part, without a node: its inputs, its control state, its holds."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from snr_sim import Config, Endpoint, EndpointFactory, Mode, Node, SimRunner, Task, TaskId, TaskType
from snr_sim.core.clocks import SimClock
from snr_sim.plants.stepping import Stepper
from snr_sim.plants.urov.battery import Battery
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import CommandError, ParameterError, SnrError, UnknownName
from snr_sim.prelude.scenario import Rig, Robot
from snr_sim.prelude.signals import DepthReading, ImuReading, PadReading, PowerReading
from snr_sim.scenario import library
from snr_sim.teleop.gamepad_pilot import BUTTONS
from snr_sim.teleop.keyboard import Keyboard
from snr_sim.teleop.manual_input import ManualInput
from snr_sim.teleop.scripted_pilot import Cue
from snr_sim.testing.fakes import FakeSensor
from snr_sim.testing.parts import Ticker, TickerFactory

robot = library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import AutopilotFactory  # noqa: E402
from snr_sim_robot_urov.controls import MODES, STICKS, Controls, controls_of, scripted_pilot  # noqa: E402
from snr_sim_robot_urov.failsafe_monitor import FailsafeLimits, FailsafeMonitor  # noqa: E402
from snr_sim_robot_urov.failsafes import Failsafes  # noqa: E402
from snr_sim_robot_urov.holds import Holds  # noqa: E402
from snr_sim_robot_urov.parameters import HoldNumbers  # noqa: E402
from snr_sim_robot_urov.seeing_pilot import SeeingPilotFactory, Waypoint  # noqa: E402
from snr_sim_robot_urov.tether_link import tether_faults  # noqa: E402

DT_S = 0.02


# -- controls ---------------------------------------------------------------------------------------------------------


def test_controls_that_ask_for_nothing_are_disarmed() -> None:
    assert controls_of({}) == Controls()
    assert not Controls().is_armed


@pytest.mark.parametrize(
    ("data", "error", "says"),
    [
        ({"mode": "depth_hld"}, UnknownName, "did you mean 'depth_hold'"),
        ({"surge": 1.01}, CommandError, "'surge' is at 1.01"),
        ({"yaw": math.nan}, CommandError, "'yaw' is at nan"),
        ({"depth_m": math.inf}, CommandError, "depth_m = inf"),
        ({"depth_m": -1.0}, CommandError, "positive down"),
        ({"heading_rad": math.nan}, CommandError, "heading_rad = nan"),
        ({"depth_m": 1000.0}, CommandError, "depth_m = 1000"),
        ({"heave": -math.inf}, CommandError, "'heave' is at -inf"),
        ({"is_armed": "yes"}, CommandError, "is_armed"),
        ({"number": None}, CommandError, "number"),
        ({"thrust": 1.0}, CommandError, "unknown field `thrust`"),
        ({"surge": "full"}, CommandError, "surge"),
        ([1.0], CommandError, "no controls"),
    ],
)
def test_controls_that_are_none_are_refused_in_words(data: Any, error: type[SnrError], says: str) -> None:
    with pytest.raises(error, match=says):
        controls_of(data)


def test_a_script_that_cannot_be_flown_is_refused_before_the_dive() -> None:
    with pytest.raises(ParameterError, match="order"):
        scripted_pilot([Cue(5.0, is_armed=True), Cue(1.0)], 20.0)
    with pytest.raises(CommandError, match="unknown field `armed`"):
        scripted_pilot([Cue(5.0, armed=True)], 20.0)


# -- failsafe monitor ------------------------------------------------------------------------------------------------


def armed(number: int = 1, **changes: Any) -> Controls:
    return Controls(number, is_armed=True, **changes)


def monitor(**limits: Any) -> FailsafeMonitor:
    return FailsafeMonitor(FailsafeLimits(**limits))


def test_nobody_is_obeyed_before_somebody_has_armed() -> None:
    one = monitor()
    assert one.rules(0.0) == "idle"
    one.hear(Controls(1, surge=1.0), 0.0)
    assert one.rules(0.0) == "idle"
    one.hear(armed(2), 0.1)
    assert one.rules(0.1) == "pilot"
    one.hear(Controls(3), 0.2)
    assert one.rules(0.2) == "idle"


def test_the_older_the_newest_controls_the_less_is_left_of_them() -> None:
    one = monitor()
    one.hear(armed(), 10.0)
    ages = {0.0: "pilot", 0.25: "pilot", 0.26: "neutral", 1.99: "neutral", 2.0: "hold", 11.99: "hold", 12.0: "surface"}
    for age_s, rules in ages.items():
        assert one.rules(10.0 + age_s) == rules
    one.hear(armed(2), 100.0)
    assert one.rules(100.1) == "pilot"


def test_a_stop_holds_until_it_is_cleared_by_somebody_who_has_disarmed() -> None:
    one = monitor()
    one.hear(armed(1, is_stop=True), 0.0)
    assert (one.rules(0.0), one.is_stopped) == ("idle", True)
    one.hear(armed(2), 0.1)
    assert one.rules(0.1) == "idle", "not to push the stop any more is no clearing"
    one.hear(armed(3, clears_stop=True), 0.2)
    assert one.is_stopped, "who is armed cannot clear it"
    one.hear(Controls(4, is_stop=True, clears_stop=True), 0.3)
    assert one.is_stopped
    one.hear(Controls(5, clears_stop=True), 0.4)
    one.hear(armed(6), 0.5)
    assert one.rules(0.5) == "pilot"


def test_a_stop_survives_the_loss_of_the_link_and_no_failsafe_pushes() -> None:
    one = monitor()
    one.hear(armed(1, is_stop=True), 0.0)
    for age_s in (0.1, 1.0, 5.0, 50.0):
        assert one.rules(age_s) == "idle"


def test_a_command_that_was_overtaken_is_not_obeyed() -> None:
    one = monitor()
    one.hear(armed(7), 0.0)
    one.hear(Controls(6), 0.1)
    assert (one.rules(0.1), one.age_s(0.1)) == ("pilot", pytest.approx(0.1))


def test_a_stop_that_was_overtaken_is_a_stop_all_the_same() -> None:
    one = monitor()
    one.hear(armed(7), 0.0)
    one.hear(Controls(6, is_stop=True), 0.1)
    assert one.rules(0.1) == "idle"


def test_a_surface_that_was_started_again_is_obeyed_though_it_counts_from_one() -> None:
    one = monitor()
    one.hear(armed(5000), 0.0)
    one.hear(armed(1), 9.0)
    assert one.rules(9.0) == "pilot"


def test_water_in_the_hull_sends_it_up_unless_it_is_not_to() -> None:
    for action, rules in (("surface", "surface"), ("warn", "pilot")):
        one = FailsafeMonitor(FailsafeLimits(), Failsafes(leak=action))
        one.hear(armed(), 0.0)
        one.is_wet = True
        assert one.rules(0.0) == rules


def weak(one: FailsafeMonitor, from_s: float, to_s: float, volts: float, amperes: float = 5.0) -> FailsafeMonitor:
    """Shows it a battery, five times a second."""
    for i in range(round(5 * from_s), round(5 * to_s) + 1):
        one.measure(PowerReading(volts, amperes, 0.2 * i))
    return one


def test_a_battery_that_is_low_for_long_enough_sends_it_up_and_stays_low() -> None:
    one = monitor(low_v=13.0, low_s=10.0, sag_ohm=0.0)
    one.hear(armed(), 20.0)
    assert weak(one, 0.0, 9.8, 12.9).rules(20.0) == "pilot"
    assert weak(one, 10.0, 10.0, 12.9).rules(20.0) == "surface"
    assert weak(one, 10.2, 60.0, 15.0).rules(20.0) == "surface", "without load it looks better than it is"
    one.hear(Controls(2), 20.1)
    assert one.rules(20.1) == "idle", "who has disarmed decides"


def test_the_sag_of_a_burst_is_no_low_battery() -> None:
    one = monitor(low_v=13.0, low_s=10.0, sag_ohm=0.03)
    assert not weak(one, 0.0, 60.0, 15.0 - 0.03 * 100.0, 100.0).is_low, "what the load costs is known"
    assert not weak(one, 70.0, 79.0, 11.0, 20.0).is_low, "more than that, but not for long"
    assert not weak(one, 79.2, 80.0, 14.0).is_low
    assert not weak(one, 80.2, 89.0, 11.0, 20.0).is_low, "each time is counted by itself"
    assert weak(one, 89.2, 91.0, 11.0, 20.0).is_low


def test_a_low_battery_can_be_only_told_or_not_be_asked_for() -> None:
    for low_v, is_low in ((13.0, True), (0.0, False)):
        one = weak(FailsafeMonitor(FailsafeLimits(low_v=low_v), Failsafes(low_battery="warn")), 0.0, 20.0, 11.0)
        one.hear(armed(), 20.0)
        assert (one.rules(20.0), one.is_low) == ("pilot", is_low)


# -- holds ------------------------------------------------------------------------------------------------------------


def imu(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, rate: tuple[float, ...] = (0, 0, 0)) -> ImuReading:
    return ImuReading(list(map(float, rate)), [0.0, 0.0, 9.81], [0.0, 20.0, -44.0], roll, pitch, yaw, 0.0)


def depth(depth_m: float, stamp_s: float = 0.0) -> DepthReading:
    return DepthReading(depth_m, 101_325.0 + 9777.0 * depth_m, 18.0, stamp_s)


def holds() -> Holds:
    return Holds(HoldNumbers(), drag=(33.0, 190.0))


def test_manual_is_the_sticks_alone_in_the_vehicles_own_frame() -> None:
    controls = Controls(surge=1.0, sway=-0.5, heave=0.25, yaw=1.0)
    wrench = holds().wrench(controls, depth(2.0), imu(roll=0.5, pitch=-0.3, rate=(1, 1, 1)), DT_S)
    numbers = HoldNumbers()
    assert wrench == pytest.approx([numbers.sticks_n[0], -0.5 * numbers.sticks_n[1], 15.0, 0.0, 0.0, numbers.yaw_nm])


def test_stabilise_pushes_roll_and_pitch_back_and_up_is_up() -> None:
    wrench = holds().wrench(Controls(mode="stabilise", heave=1.0), depth(2.0), imu(roll=0.4, pitch=0.3), DT_S)
    assert wrench[3] < 0.0
    assert wrench[4] < 0.0
    push = HoldNumbers().sticks_n[2]
    up = [-push * math.sin(0.3), push * math.cos(0.3) * math.sin(0.4), push * math.cos(0.3) * math.cos(0.4)]
    assert wrench[:3] == pytest.approx(up)


def test_depth_hold_holds_the_depth_at_which_it_was_chosen() -> None:
    one = holds()
    one.wrench(Controls(mode="depth_hold"), depth(1.7), imu(), DT_S)
    assert one.depth_m == pytest.approx(1.7)
    assert one.wrench(Controls(mode="depth_hold"), depth(2.0), imu(), DT_S)[2] > 0.0, "too deep: it pushes up"
    assert one.wrench(Controls(mode="depth_hold"), depth(1.4), imu(), DT_S)[2] < 0.0
    one.wrench(Controls(mode="stabilise"), depth(2.6), imu(), DT_S)
    one.wrench(Controls(mode="depth_hold"), depth(2.6), imu(), DT_S)
    assert one.depth_m == pytest.approx(2.6), "chosen again, it is another one"


def test_another_depth_is_approached_no_faster_than_the_vehicle_can_follow() -> None:
    one = holds()
    one.wrench(Controls(mode="depth_hold", depth_m=1.0), depth(1.0), imu(), DT_S)
    one.wrench(Controls(mode="depth_hold", depth_m=3.0), depth(1.0), imu(), DT_S)
    course = [1.0]
    for _ in range(700):
        one.wrench(Controls(mode="depth_hold"), depth(1.0), imu(), DT_S)
        course.append(one.depth_m)
    speeds = [(b - a) / DT_S for a, b in pairwise(course)]
    assert max(speeds[1:]) == pytest.approx(HoldNumbers().sink_mps)
    assert max(abs(b - a) / DT_S for a, b in pairwise(speeds[2:])) < 2.0 * HoldNumbers().brake_mps2
    assert course[-1] == pytest.approx(3.0)
    assert max(course) <= 3.0


def test_the_heave_stick_moves_the_depth_that_is_held_and_not_above_the_water() -> None:
    one = holds()
    for heave in [1.0] * 100 + [0.0] * 300:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(1.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(1.0 - 100 * DT_S * HoldNumbers().sink_mps)
    for _ in range(800):
        one.wrench(Controls(mode="depth_hold", heave=1.0), depth(1.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(0.0, abs=1e-12)


def test_a_stick_that_was_held_down_on_the_floor_has_not_to_be_held_up_for_as_long() -> None:
    one = holds()
    for heave in [-1.0] * 1500 + [0.0] * 300:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(3.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(3.0 + HoldNumbers().lead_m)
    for heave in [1.0] * 150 + [0.0] * 300:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(3.0), imu(), DT_S)
    assert one.depth_m is not None
    assert one.depth_m < 3.0


def test_a_stick_does_not_take_back_a_depth_that_was_asked_for_by_number() -> None:
    one = holds()
    one.wrench(Controls(mode="depth_hold", depth_m=6.0), depth(1.0), imu(), DT_S)
    for heave in [-0.1] * 10 + [0.0] * 1500:
        one.wrench(Controls(mode="depth_hold", heave=heave), depth(1.0), imu(), DT_S)
    assert one.depth_m == pytest.approx(6.0)


def test_heading_hold_turns_the_shorter_way_and_the_yaw_stick_moves_the_heading() -> None:
    one = holds()
    one.wrench(Controls(mode="heading_hold", heading_rad=math.radians(170)), depth(1.0), imu(yaw=3.0), DT_S)
    for _ in range(100):
        wrench = one.wrench(Controls(mode="heading_hold"), depth(1.0), imu(yaw=math.radians(-170)), DT_S)
    assert one.heading_rad == pytest.approx(math.radians(170))
    assert wrench[5] < 0.0
    for yaw in [1.0] * 50 + [0.0] * 200:
        one.wrench(Controls(mode="heading_hold", yaw=yaw), depth(1.0), imu(), DT_S)
    assert one.heading_rad == pytest.approx(math.radians(170) + 50 * DT_S * HoldNumbers().turn_radps - 2 * math.pi)


def test_what_the_thrusters_cannot_push_is_not_held() -> None:
    one = Holds(HoldNumbers(), drag=(33.0, 190.0), lacking=("pitch",))
    for mode in MODES[1:]:
        wrench = one.wrench(Controls(mode=mode), depth(1.0), imu(roll=0.2, pitch=0.2), DT_S)
        assert wrench[4] == 0.0
        assert wrench[3] < 0.0


# -- a pilot who sees --------------------------------------------------------------------------------------------------


def test_a_pilot_without_a_route_is_refused() -> None:
    with pytest.raises(ParameterError, match="no waypoints"):
        SeeingPilotFactory(())


def test_a_pilot_pushes_towards_where_he_wants_to_be_whichever_way_the_vehicle_points() -> None:
    for yaw, stick, side in ((0.0, "surge", 1.0), (math.pi / 2, "sway", -1.0), (math.pi, "surge", -1.0)):
        told = look(Waypoint(5.0, 0.0, 2.0, 0.0), [(0.0, 0.0, -2.0, yaw)] * 40)
        assert side * told[-1][stick] > 0.3
        assert not told[0]["is_armed"]
        assert told[-1]["is_armed"]
        assert (told[-1]["mode"], told[-1]["depth_m"]) == ("heading_hold", 2.0)


def look(goal: Waypoint, places: list[tuple[float, ...]]) -> list[dict[str, Any]]:
    """The controls of a pilot who gets these positions, ten times a second."""
    told: list[dict[str, Any]] = []
    left = list(places)

    def see(loop: Ticker) -> None:
        if left:
            x, y, z, yaw = left.pop(0)
            loop.store_data("place", {"position_m": [x, y, z], "yaw_rad": yaw, "stamp_s": loop.get_time_s()})

    parts = [TickerFactory(see, rate_hz=10.0), SeeingPilotFactory([goal]), listener("controls", told)]
    SimRunner(Config(Mode.TEST, {"topside": parts}), until_s=0.1 * len(places)).run()
    return told


def listener(key: str, told: list[dict[str, Any]]) -> EndpointFactory:
    """An endpoint that keeps the data of every page of a key."""

    class Listener(Endpoint):
        def __init__(self, factory: EndpointFactory, parent: Node, name: str) -> None:
            super().__init__(factory, parent, name)
            self.task_handlers = {(TaskType.process_data, key): self.hear}

        def hear(self, task: Task, task_id: TaskId) -> None:
            told.append(dict(self.get_data(key)))

    class ListenerFactory(EndpointFactory):
        def get(self, parent: Node) -> Endpoint:
            return Listener(self, parent, "listener")

    return ListenerFactory()


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
    rig = Rig(Robot("urov", "urov", "test", "mujoco", parameters, {"pilot": pilot}), "sim", 1, plant)
    told: list[dict[str, Any]] = []
    parts = robot.roles(rig, [AutopilotFactory(parameters)])
    parts["topside"] += [listener("vehicle", told), *([] if meddle is None else [meddle])]
    left = [charge] if charge < 1.0 else []

    def drain(loop: Ticker) -> None:
        if left and loop.get_time_s() >= DRAIN_S:
            plant.thrusters.supply.restore((left.pop(), 0.0, 0.0, False))

    parts["topside"].append(TickerFactory(drain, "drain", rate_hz=10.0))
    clock = SimClock()
    clock.follow(Stepper(plant).advance_to)
    SimRunner(Config(Mode.TEST, parts), clock=clock, until_s=until_s).run()
    for one in told:
        one["thrust_n"] = 0.0
    told[-1]["thrust_n"] = sum(map(abs, plant.thrusters.forces_n))
    told[-1]["true_depth_m"] = -plant.position_m[2]
    told[-1]["charge"] = plant.thrusters.charge
    return told


ARM = Cue(1.5, is_armed=True, mode="depth_hold")
DRAIN_S = 1.8


def test_an_emergency_stop_is_acknowledged_and_kept_until_it_is_cleared_and_the_pilot_has_disarmed() -> None:
    script = [ARM, Cue(2.5, is_stop=True), Cue(3.0, is_stop=False)]
    told = dived(script, 4.0)
    stopped = [one["is_stopped"] for one in told]
    assert stopped == sorted(stopped), "once stopped, it stays stopped"
    assert (told[-1]["is_stopped"], told[-1]["rules"], told[-1]["is_armed"]) == (True, "idle", False)
    assert told[-1]["thrust_n"] < 0.01
    script += [Cue(4.0, is_armed=False, clears_stop=True), Cue(4.5, is_armed=True, clears_stop=False)]
    told = dived(script, 5.5)
    assert (told[-1]["is_stopped"], told[-1]["rules"]) == (False, "pilot")
    assert told[-1]["thrust_n"] > 1.0


def test_controls_that_are_none_are_told_and_not_obeyed_and_the_vehicle_lives_on() -> None:
    def spoil(loop: Ticker) -> None:
        if loop.get_time_s() > 3.0:
            loop.store_data("controls", {"number": 10**6, "is_armed": True, "mode": "warp"})

    told = dived([ARM], 4.0, TickerFactory(spoil, "spoiler", rate_hz=20.0))
    assert any("no mode 'warp'" in one["refused"] for one in told)
    assert told[-1]["rules"] == "pilot", "the pilot's own still come in between"


def test_a_vehicle_whose_battery_is_nearly_empty_tells_the_surface_and_comes_up() -> None:
    script = [ARM, Cue(2.0, depth_m=2.0)]
    told = dived(script, 14.0, charge=0.064, failsafe_limits=FailsafeLimits(low_s=4.0))
    low = [one["is_low"] for one in told]
    assert low == sorted(low), "once low, it stays low"
    assert 50 < low.index(True) < 75, "ten a second: after four seconds, though the pilot is heard"
    assert (told[-1]["rules"], told[-1]["is_armed"]) == ("surface", True)
    assert told[-1]["true_depth_m"] < 0.35
    assert told[-1]["charge"] > 0.05, "with plenty left for the way"


def test_a_pad_that_is_unplugged_in_mid_dive_leaves_a_vehicle_that_holds_and_obeys_the_keyboard(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def at(time_s: float, *down: str, surge: float = 0.0) -> list[PadReading]:
        buttons, axes = [False] * 11, [0.0] * 6
        for name in down:
            buttons[BUTTONS[name]] = True
        axes[STICKS["surge"].axis] = surge
        return [PadReading(axes, buttons, [])] * round(20 * time_s)

    readings = [*at(1.5), *at(0.1, "mode_up"), *at(0.1), *at(0.1, "mode_up", "arm"), *at(2.0, surge=-1.0)]
    stale = [Stale("unplugged")] * 1000

    def hands(rig: Rig) -> ManualInput:
        keys = iter([""] * 130 + [" "] + [""] * 1000)
        return ManualInput(lambda: FakeSensor([*readings, *stale]), lambda: Keyboard(STICKS, lambda: next(keys)))

    monkeypatch.setitem(robot.DEVICES["sim"], "hands", hands)
    pushing, alone, stopped = (dived([], until_s, pilot="hands")[-1] for until_s in (3.7, 6.2, 7.2))
    assert (pushing["rules"], pushing["mode"], pushing["thrust_n"] > 50.0) == ("pilot", "depth_hold", True)
    assert (alone["rules"], alone["mode"], alone["is_armed"]) == ("pilot", "depth_hold", True)
    assert alone["thrust_n"] < 20.0
    assert abs(alone["true_depth_m"] - alone["depth_m"]) < 0.3
    assert (stopped["is_stopped"], stopped["thrust_n"] < 0.01) == (True, True)


def test_full_thrust_on_a_battery_that_is_not_empty_is_no_low_battery() -> None:
    told = dived([Cue(1.5, is_armed=True, surge=1.0)], 8.0, charge=0.2, failsafe_limits=FailsafeLimits(low_s=4.0))
    assert {one["is_low"] for one in told} == {False}
    assert (told[-1]["rules"], told[-1]["thrust_n"] > 50.0) == ("pilot", True)


def test_a_battery_that_breaks_down_leaves_thrusters_still_and_the_pilot_is_told() -> None:
    told = dived([Cue(1.5, is_armed=True, surge=1.0)], 11.0, charge=0.008, failsafe_limits=FailsafeLimits(low_s=4.0))
    assert told[-1]["thrust_n"] < 0.01
    assert told[-1]["is_low"]


def test_before_somebody_arms_nothing_pushes_whatever_the_sticks_say() -> None:
    told = dived([Cue(0.0, surge=1.0, heave=-1.0)], 3.0)
    assert {one["rules"] for one in told} == {"idle"}
    assert told[-1]["thrust_n"] < 0.01


def test_manual_full_ahead_pushes_as_the_sticks_say() -> None:
    told = dived([Cue(1.5, is_armed=True, surge=1.0)], 3.0)
    assert told[-1]["mode"] == "manual"
    assert told[-1]["share"] == 1.0
    # Four thrusters at 45 degrees give 60 N. They sit 8.5 cm low, and the upright ones, 12 cm out, keep the nose down.
    # The battery is fuller than the one that the curve is for, so all of them push a little more.
    assert told[-1]["thrust_n"] == pytest.approx(60.0 * 2.0**0.5 + 60.0 * 0.085 / 0.12, rel=0.1)


# -- the camera -------------------------------------------------------------------------------------------------------


def rig_with(**options: str) -> Rig:
    scenario = library.load_scenario(library.find("scenarios", "urov_depth_hold"))
    return Rig(Robot("urov", "urov", "test", "mujoco", scenario.parameters(1), options), "sim", 1, None)


def test_there_is_no_camera_unless_somebody_asks_for_one() -> None:
    def keys(rig: Rig) -> list[str]:
        return [getattr(part, "key", "") for part in robot.roles(rig, [])["urov"]]

    assert "camera" not in keys(rig_with())
    assert keys(rig_with(camera="down")).count("camera") == 1
    with pytest.raises(UnknownName, match="camera"):
        robot.roles(rig_with(camera="up"), [])


def test_the_same_seed_gives_the_same_picture_and_another_one_another() -> None:
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


def test_a_longer_tether_is_slower_and_narrower() -> None:
    short, long = tether_faults(10.0), tether_faults(300.0)
    assert 0.0 < short.latency_s < long.latency_s < 0.01
    assert (short.bandwidth_bps or 0.0) > (long.bandwidth_bps or 0.0) > 1e6
    assert tether_faults(35.0, loss=0.1, cut=((5.0, 9.0),)).cut == ((5.0, 9.0),)


@pytest.mark.parametrize("length_m", [-1.0, 301.0, math.nan])
def test_a_tether_that_is_none_has_no_link(length_m: float) -> None:
    with pytest.raises(ParameterError, match="tether"):
        tether_faults(length_m)
