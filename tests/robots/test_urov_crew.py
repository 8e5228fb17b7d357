"""A controller with components for the surface: their order, their inputs, and the errors if they cannot be made."""

import json
from pathlib import Path
from typing import Any

import pytest

from snr_sim.prelude.errors import ConfigError, ParameterError, UnknownName
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.flight import fly_recorded
from snr_sim.scenario.simulation import Request, prepare

# A component at the surface that goes ahead a little, and stops when the buttons require it.
SURFACE = """
from snr_sim import Endpoint, EndpointFactory, TaskType

ROLES = ("topside",)


def factories(robot):
    assert robot.role == "topside"
    return [ButtonsFactory()]


class ButtonsFactory(EndpointFactory):
    def get(self, parent):
        return Buttons(self, parent, "buttons")


class Buttons(Endpoint):
    def __init__(self, factory, parent, name):
        super().__init__(factory, parent, name)
        self.is_stop = False
        self.task_handlers = {(TaskType.process_data, "panel"): self.on_panel}

    def on_panel(self, task, task_id):
        panel = self.get_data("panel")
        self.is_stop = (self.is_stop or panel["stop"]) and not panel["reset"]
        says = {"is_armed": self.get_time_s() > 2.0 and not panel["reset"], "is_stop": self.is_stop}
        says |= {"surge": 0.3, "number": round(self.get_time_s() * 100), "clears_stop": panel["reset"]}
        return self.store_data_task("controls", says)
"""
# The same for the sticks of a scripted pilot.
STICKS = SURFACE.replace('"panel"), self', '"sticks"), self').replace("def on_panel", "def on_sticks")


def written(folder: Path, text: str) -> str:
    path = folder / "surface.py"
    path.write_text(text)
    return str(path)


def flown(folder: Path, until_s: float, **options: str) -> Trace:
    simulation = prepare(Request("urov_gate", 2, controller=written(folder, SURFACE), options=options))
    simulation.scenario.TIME_LIMIT_S = until_s
    result = fly_recorded(simulation, folder / FILE_NAME)
    assert result.error == ""
    return read_trace(folder / FILE_NAME)


def pages(trace: Trace, node: str, key: str) -> list[tuple[float, Any]]:
    found = [one for one in trace.records if isinstance(one, PageRecord) and (one.node, one.name) == (node, key)]
    return [(one.t, json.loads(bytes(one.values))[0]["data"]) for one in found]


def test_the_surface_is_flown_by_the_controller_and_the_vehicle_by_the_scenarios_own(tmp_path: Path) -> None:
    trace = flown(tmp_path, 6.0, stop="4", reset="5")
    told = pages(trace, "topside_node", "vehicle")
    assert {page["rules"] for t, page in told if 2.2 < t < 4.0} == {"pilot"}
    assert {page["is_stopped"] for t, page in told if 4.2 < t < 5.0} == {True}, "a short press is a stop that stays"
    assert {page["is_stopped"] for t, page in told if t > 5.4} == {False}
    assert {page["rules"] for t, page in told if t > 5.5} == {"pilot"}
    panel = [t for t, page in pages(trace, "topside_node", "panel") if page["stop"]]
    assert (panel[0], panel[-1]) == (pytest.approx(4.0), pytest.approx(4.15))
    assert "standard/holds.py" in trace.header.sources


def test_a_run_with_a_controller_at_the_surface_replays_identically(tmp_path: Path) -> None:
    trace = flown(tmp_path, 3.0)
    simulation = prepare(Request("urov_gate", 2, controller=trace.opening.controller))
    config = simulation.config(None)
    for role in ("urov", "topside"):
        assert replay_node(trace, role, config).is_identical
    assert trace.header.sources == simulation.sources()


def test_a_role_that_the_robot_does_not_have_is_refused_with_the_nearest(tmp_path: Path) -> None:
    path = written(tmp_path, SURFACE.replace('("topside",)', '("topsid",)'))
    with pytest.raises(UnknownName, match="no role 'topsid'") as caught:
        prepare(Request("urov_gate", controller=path))
    assert "'topside'" in str(caught.value)


@pytest.mark.parametrize("roles", ['("topside")', "()", "None", "(1,)"])
def test_roles_that_are_no_tuple_of_names_are_refused(tmp_path: Path, roles: str) -> None:
    path = written(tmp_path, SURFACE.replace('ROLES = ("topside",)', f"ROLES = {roles}"))
    with pytest.raises(ConfigError, match=r"surface\.py: ROLES is .*, not a tuple"):
        prepare(Request("urov_gate", controller=path))


def test_a_robot_without_a_place_for_them_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = prepare(Request("urov_gate", 2, controller=written(tmp_path, SURFACE)))
    roles = simulation.robot_file.roles

    def without(rig: Any, controller: Any) -> Any:
        made = roles(rig, controller)
        return {**made, "topside": [one for one in made["topside"] if one not in rig.crew["topside"]]}

    monkeypatch.setattr(simulation.robot_file, "roles", without)
    with pytest.raises(ConfigError, match="'urov' has no place for a controller in its role 'topside'"):
        simulation.config(simulation.plant())


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"stop": "soon"}, "stop=soon is no moment"),
        ({"reset": "-1"}, "reset=-1 is no moment"),
        ({"stop": "nan"}, "stop=nan is no moment"),
        ({"stop": "1,"}, "stop=1, is no moment"),
    ],
)
def test_a_press_at_no_moment_is_refused(tmp_path: Path, options: dict[str, str], says: str) -> None:
    simulation = prepare(Request("urov_gate", controller=written(tmp_path, SURFACE), options=options))
    with pytest.raises(ParameterError, match=says):
        simulation.config(simulation.plant())


@pytest.mark.parametrize(("scenario", "controller"), [("urov_gate", None), ("urov_depth_hold", STICKS)])
def test_a_press_that_nobody_looks_at_is_refused(tmp_path: Path, scenario: str, controller: str | None) -> None:
    path = None if controller is None else written(tmp_path, controller)
    simulation = prepare(Request(scenario, controller=path, options={"stop": "3"}))
    with pytest.raises(ParameterError, match="nobody looks at the panel"):
        simulation.config(simulation.plant())
