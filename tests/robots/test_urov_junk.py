"""Pages without a valid reading: the vehicle enters its failsafe and continues, whatever they contain."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim import SimRunner
from snr_sim.core.config import Config
from snr_sim.prelude.signals import DepthReading, ImuReading, LeakReading, PowerReading
from snr_sim.prelude.task import TaskType
from snr_sim.scenario import library
from snr_sim.testing.function_components import FunctionEndpointFactory, FunctionLoopFactory

library.load_robot(library.find("robots", "urov"))

from snr_sim_robot_urov.autopilot import Autopilot, AutopilotFactory, Watch  # noqa: E402
from snr_sim_robot_urov.controls import Controls  # noqa: E402
from snr_sim_robot_urov.failsafes import Failsafes  # noqa: E402
from snr_sim_robot_urov.parameters import UrovParameters, vehicle  # noqa: E402

HOLDS = Controls(is_armed=True, mode="heading_hold", depth_m=1.0, heading_rad=0.0)
RATES_HZ = {"depth": 20.0, "imu": 50.0, "power": 5.0, "leak": 2.0}
JUNK_S, OVER_S = 2.0, 3.0


def readings(now_s: float) -> dict[str, Any]:
    """What the sensors of a healthy vehicle measure, five centimetres above what it holds."""
    return {
        "depth": DepthReading(0.95, 110_000.0, 18.0, now_s),
        "imu": ImuReading([0.0] * 3, [0.0, 0.0, 9.81], [0.0, 20.0, -40.0], 0.0, 0.0, 0.0, now_s),
        "power": PowerReading(15.9, 4.0, now_s),
        "leak": LeakReading(False, now_s),
    }


class Dive:
    """An autopilot whose sensor `key` sends junk from 2 s to 3 s.

    Attributes:
        control_states: control states, and when.
        pulses: that were commanded, and when.
    """

    def __init__(self, key: str, junk: Any, until_s: float = 5.0, **failsafes: Any) -> None:
        self.control_states: list[tuple[float, str]] = []
        self.pulses: list[tuple[float, list[float]]] = []
        number = 0

        def steer(loop: Any) -> None:
            nonlocal number
            number += 1
            loop.store_data("controls", msgspec.structs.asdict(msgspec.structs.replace(HOLDS, number=number)))

        def measure(name: str) -> Any:
            def store_reading(loop: Any) -> None:
                now_s = loop.get_time_s()
                data = msgspec.to_builtins(readings(now_s)[name])
                if name == key and JUNK_S <= now_s < OVER_S:
                    data = junk(data) if callable(junk) else junk
                loop.store_data(name, data, process=name != "depth")

            return FunctionLoopFactory(store_reading, f"{name}_sensor", RATES_HZ[name])

        def keep(task: Any, task_id: Any) -> None:
            page = task.val_list[0]
            if page.key == "pwm":
                self.pulses.append((page.created_at_s, page.data["pulses_us"]))
            else:
                self.control_states.append((page.created_at_s, page.data["control_state"]))

        factories = [
            *map(measure, ("depth", "power", "leak", "imu")),
            FunctionLoopFactory(steer, "surface", 20.0),
            Watch.factory(),
            AutopilotFactory(UrovParameters(vehicle(), failsafes=Failsafes(**failsafes))),
            FunctionEndpointFactory({(TaskType.store_page, one): keep for one in ("pwm", "vehicle")}),
        ]
        runner = SimRunner(Config(factories={"urov": factories}), until_s=until_s, log_notes=False)
        runner.run()
        autopilot = runner.nodes["urov"].components["autopilot"]
        assert isinstance(autopilot, Autopilot)
        self.autopilot, self.notes = autopilot, autopilot.parent.notes

    def states_between(self, from_s: float, to_s: float) -> set[str]:
        return {control_states for at_s, control_states in self.control_states if from_s <= at_s <= to_s}


def changed(**fields: Any) -> Any:
    return lambda data: {**data, **fields}


def without(name: str) -> Any:
    return lambda data: {field: value for field, value in data.items() if field != name}


JUNK = [
    ("depth", None),
    ("depth", 1.5),
    ("depth", "deep"),
    ("depth", []),
    ("depth", {}),
    ("depth", without("depth_m")),
    ("depth", without("stamp_s")),
    ("depth", changed(depth_m="1.5")),
    ("depth", changed(depth_m=None)),
    ("depth", changed(depth_m=True)),
    ("depth", changed(depth_m=math.nan)),
    ("depth", changed(depth_m=math.inf)),
    ("depth", changed(depth_m=-1e308)),
    ("depth", changed(depth_m=10**400)),
    ("depth", changed(depth_m=10**5000)),
    ("depth", changed(stamp_s=math.nan)),
    ("depth", changed(stamp_s=1e9)),
    ("depth", DepthReading("deep", None, 18.0, 0.0)),  # type: ignore[arg-type]
    ("imu", None),
    ("imu", changed(roll_rad=math.nan)),
    ("imu", changed(yaw_rad=1e6)),
    ("imu", changed(pitch_rad="level")),
    ("imu", changed(rate_radps=[0.0, 0.0])),
    ("imu", changed(rate_radps=[0.0, math.inf, 0.0])),
    ("imu", changed(rate_radps=0.0)),
    ("imu", changed(rate_radps=None)),
    ("imu", without("yaw_rad")),
    ("power", None),
    ("power", changed(voltage_v="full")),
    ("power", changed(voltage_v=math.nan)),
    ("power", changed(current_a=-math.inf)),
    ("power", changed(voltage_v=-1e300)),
    ("power", without("current_a")),
    ("leak", None),
    ("leak", changed(is_wet="no")),
    ("leak", {}),
]


@pytest.mark.parametrize(("key", "junk"), JUNK)
def test_junk_page_triggers_failsafe_and_node_continues(key: str, junk: Any) -> None:
    dive = Dive(key, junk)
    assert dive.states_between(0.5, 1.9) == {"pilot"}
    assert dive.states_between(JUNK_S + 0.6, OVER_S) == {"hold"}, "as the table says for nonsense from a sensor"
    assert dive.states_between(OVER_S + 1.6, 5.0) == {"pilot"}, "and the pilot controls it when it is over"
    (note,) = [note for note in dive.notes if "nonsense" in note]
    assert f"{key}: " in note
    assert "hold for 10 s, then surface" in note


def test_junk_depth_is_ignored_and_last_reading_ages() -> None:
    dive = Dive("depth", changed(depth_m=math.nan))
    at = dict(dive.pulses)
    assert at[2.2] != [1500.0] * 8, "the last good depth is 0.25 s old, and 5 cm too high"
    assert at[2.8] == [1500.0] * 8, "it is 0.85 s old: depth is not held any more"
    assert at[4.8] != [1500.0] * 8


def test_missing_attitude_sends_neutral_pulses() -> None:
    dive = Dive("imu", changed(roll_rad=math.nan))
    between = [(at_s, pulses) for at_s, pulses in dive.pulses if 2.27 < at_s < OVER_S]
    assert {tuple(pulses) for _, pulses in between} == {(1500.0,) * 8}
    assert max(b[0] - a[0] for a, b in pairwise(between)) < 0.15, "or the outputs would disarm"


def test_junk_leak_and_power_pages_set_no_failure() -> None:
    for key in ("leak", "power"):
        failsafe = Dive(key, changed(is_wet="yes", voltage_v=math.nan)).autopilot.failsafe
        assert not failsafe.is_leaking
        assert not failsafe.is_battery_low


def test_nonsense_action_can_be_surface_or_warn() -> None:
    assert Dive("power", None, nonsense="surface").states_between(2.6, 3.0) == {"surface"}
    warned = Dive("power", None, nonsense="warn")
    assert warned.states_between(0.5, 5.0) == {"pilot"}
    assert any("nonsense" in note for note in warned.notes)


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.sampled_from([10**400, -(10**4200), 5e-324, 1.7e308])
    | st.floats()
    | st.text(max_size=5)
    | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@st.composite
def pages(draw: Any) -> tuple[str, Any]:
    """A sensor's key, and anything: or its reading with some fields that are anything, or gone."""
    key = draw(st.sampled_from(sorted(RATES_HZ)))
    if draw(st.booleans()):
        return key, draw(VALUES)
    names = [*readings(0.0)[key].__struct_fields__, "more"]
    spoilt = draw(st.dictionaries(st.sampled_from(names), VALUES | st.lists(st.floats(), min_size=3, max_size=3)))
    gone = draw(st.sets(st.sampled_from(names)))
    return key, lambda data: {name: value for name, value in {**data, **spoilt}.items() if name not in gone}


@given(pages())
def test_junk_pages_never_end_node(page: tuple[str, Any]) -> None:
    """The vehicle continues, each pulse is one, and then the pilot is in control unless the battery is low."""
    dive = Dive(*page, until_s=4.6)
    assert all(1100.0 <= pulse <= 1900.0 for _, pulses in dive.pulses for pulse in pulses)
    assert dive.states_between(4.5, 4.6) == ({"surface"} if dive.autopilot.failsafe.is_leaking else {"pilot"})
