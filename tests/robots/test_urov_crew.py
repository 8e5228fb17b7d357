"""A controller with components for the surface: their order, their inputs, and the errors if they cannot be made."""

import json
from pathlib import Path
from typing import Any

import pytest

from snr_sim.prelude.errors import ConfigError, ParameterError, UnknownNameError
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.records import PageRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import run_recorded

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


def trace_of_run(folder: Path, until_s: float, **options: str) -> Trace:
    simulation = prepare(Request("urov_gate", 2, controller=written(folder, SURFACE), options=options))
    simulation.scenario.TIME_LIMIT_S = until_s
    result = run_recorded(simulation, folder / FILE_NAME)
    assert result.error == ""
    return read_trace(folder / FILE_NAME)


def pages(trace: Trace, node: str, key: str) -> list[tuple[float, Any]]:
    found = [one for one in trace.records if isinstance(one, PageRecord) and (one.node, one.name) == (node, key)]
    return [(one.t, json.loads(bytes(one.values))[0]["data"]) for one in found]


def test_surface_controller_and_default_vehicle_controller_run(tmp_path: Path) -> None:
    trace = trace_of_run(tmp_path, 6.0, stop="4", reset="5")
    vehicle_pages = pages(trace, "topside_node", "vehicle")
    assert {page["control_state"] for t, page in vehicle_pages if 2.2 < t < 4.0} == {"pilot"}
    assert {page["is_stopped"] for t, page in vehicle_pages if 4.2 < t < 5.0} == {True}, (
        "a short press is a stop that stays"
    )
    assert {page["is_stopped"] for t, page in vehicle_pages if t > 5.4} == {False}
    assert {page["control_state"] for t, page in vehicle_pages if t > 5.5} == {"pilot"}
    panel = [t for t, page in pages(trace, "topside_node", "panel") if page["stop"]]
    assert (panel[0], panel[-1]) == (pytest.approx(4.0), pytest.approx(4.15))
    assert "standard/holds.py" in trace.header.sources


def test_run_with_surface_controller_replays_identically(tmp_path: Path) -> None:
    trace = trace_of_run(tmp_path, 3.0)
    simulation = prepare(Request("urov_gate", 2, controller=trace.trace_info.controller))
    config = simulation.config(None)
    for role in ("urov", "topside"):
        assert replay_node(trace, role, config).is_identical
    assert trace.header.sources == simulation.sources()


def test_unknown_role_raises_error_with_suggestion(tmp_path: Path) -> None:
    path = written(tmp_path, SURFACE.replace('("topside",)', '("topsid",)'))
    with pytest.raises(UnknownNameError, match="no role 'topsid'") as caught:
        prepare(Request("urov_gate", controller=path))
    assert "'topside'" in str(caught.value)


@pytest.mark.parametrize("roles", ['("topside")', "()", "None", "(1,)"])
def test_non_tuple_roles_raise_error(tmp_path: Path, roles: str) -> None:
    path = written(tmp_path, SURFACE.replace('ROLES = ("topside",)', f"ROLES = {roles}"))
    with pytest.raises(ConfigError, match=r"surface\.py: ROLES is .*, not a tuple"):
        prepare(Request("urov_gate", controller=path))


def test_robot_without_controller_slot_raises_config_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = prepare(Request("urov_gate", 2, controller=written(tmp_path, SURFACE)))
    roles = simulation.robot_file.roles

    def without(context: Any, controller: Any) -> Any:
        made = roles(context, controller)
        return {**made, "topside": [one for one in made["topside"] if one not in context.extra_components["topside"]]}

    monkeypatch.setattr(simulation.robot_file, "roles", without)
    with pytest.raises(ConfigError, match="'urov' has no place for a controller in its role 'topside'"):
        simulation.config(simulation.plant())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"stop": "soon"}, "stop=soon is not a time"),
        ({"reset": "-1"}, "reset=-1 is not a time"),
        ({"stop": "nan"}, "stop=nan is not a time"),
        ({"stop": "1,"}, "stop=1, is not a time"),
    ],
)
def test_invalid_press_time_raises_parameter_error(tmp_path: Path, options: dict[str, str], message: str) -> None:
    simulation = prepare(Request("urov_gate", controller=written(tmp_path, SURFACE), options=options))
    with pytest.raises(ParameterError, match=message):
        simulation.config(simulation.plant())


@pytest.mark.parametrize(("scenario", "controller"), [("urov_gate", None), ("urov_depth_hold", STICKS)])
def test_press_without_panel_reader_raises_parameter_error(
    tmp_path: Path, scenario: str, controller: str | None
) -> None:
    path = None if controller is None else written(tmp_path, controller)
    simulation = prepare(Request(scenario, controller=path, options={"stop": "3"}))
    with pytest.raises(ParameterError, match="no component reads the button panel"):
        simulation.config(simulation.plant())
