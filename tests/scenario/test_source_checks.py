# ruff: noqa: E501 (a table of changes)
"""Checks of a controller's source before it runs: no reports about code that is or may be correct."""

import shutil
from pathlib import Path

import pytest

from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from snr_sim.scenario.source_checks import notes_before, notes_on_files
from tests.assignments.mistakes import LABS as ALL_LABS
from tests.assignments.mistakes import write_solution, write_starter
from tests.cli.student_mistakes import GENTLE

ROOT = Path(__file__).parents[2]
SCENARIOS = {"housecat": "housecat_clear", "lander": "lander_pad", "rover": "rover_hill", "urov": "urov_depth_hold"}
CONTROLLERS = sorted(
    path for path in ROOT.glob("robots/*/controllers/*.py") if path.stem not in ("q",) and path.stem[0] != "_"
)
# The file of a lab that is a controller, and a scenario of its robot.
LABS = {
    "01_hello_thruster": ("hello_thruster.py", "urov_depth_hold"),
    "02_depth_hold": ("depth_hold.py", "urov_depth_hold"),
    "04_pub_sub_graph": ("graph.py", "urov_depth_hold"),
    "05_mission_state_machine": ("mission.py", "urov_gate"),
    "07_two_nodes": ("two_nodes.py", "urov_bad_link"),
    "08_sim_to_pi": ("depth_hold.py", "urov_depth_hold"),
    "09_debug_by_replay": ("repaired.py", "lander_low_gate"),
}


def notes_on(path: Path, scenario: str) -> list[str]:
    simulation = prepare(Request(scenario, controller=str(path)))
    plant = simulation.plant()
    return notes_before(simulation, SimulationRun(simulation, plant, simulation.config(plant)).nodes)


def own(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "mine.py"
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", CONTROLLERS, ids=lambda path: path.stem)
def test_shipped_controllers_have_no_findings(path: Path, tmp_path: Path) -> None:
    shutil.copytree(path.parent, tmp_path / "mine")
    assert notes_on(tmp_path / "mine" / path.name, SCENARIOS[path.parts[-3]]) == []


@pytest.mark.parametrize("lab", LABS)
def test_lab_references_have_no_findings(lab: str, tmp_path: Path) -> None:
    file, scenario = LABS[lab]
    assert notes_on(write_solution(lab, tmp_path / "mine") / file, scenario) == []


@pytest.mark.parametrize("is_solved", [True, False])
def test_lab_files_have_no_findings(is_solved: bool, tmp_path: Path) -> None:
    for lab in ALL_LABS:
        folder = (write_solution if is_solved else write_starter)(lab, tmp_path / lab)
        assert notes_on_files(sorted(folder.glob("*.py"))) == [], lab


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('self.get_data("radar")', 'self.get_data("ra" + "dar")'),
        ("radar[", 'radar.get("altitude_m", 0.0) + radar['),
        ("        radar =", '        key = "wind"\n        self.store_data(key, 1.0)\n        self.get_data("wind")\n        radar ='),
        ("        radar =", '        self.store_data("wind", 1.0)\n        self.get_data("wind")\n        radar ='),
        ("        radar =", '        self.get_data("radar_prev")\n        self.get_data("link_tether")\n        radar ='),
        ("        radar =", "        vars(self)['gain'] = 1.0\n        setattr(self, 'gian', 2.0)\n        self.gian\n        radar ="),
        ("        radar =", '        radar = {"here": 1}\n        radar["here"]\n        radar ='),
        ("class Gentle(", "class Base:\n    gain = 1.0\n\n    def twice(self):\n        return self.of_both\n\n\nclass Gentle("),
        ("    def on_radar", "    max_tick_rate_hz = 10\n\n    def begin(self):\n        self.period_s = 1.0 / self.max_tick_rate_hz\n\n    def on_radar"),
        ("        radar =", "        self.parent.name, self.rng, self.log, self.factory\n        radar ="),
    ],
)  # fmt: skip
def test_ambiguous_code_has_no_findings(tmp_path: Path, old: str, new: str) -> None:
    assert old in GENTLE
    assert notes_on(own(tmp_path, GENTLE.replace(old, new, 1)), "lander_vertical") == []


def test_event_of_a_component_that_is_added_later_has_no_findings(tmp_path: Path) -> None:
    text = GENTLE.replace("EndpointFactory, TaskType", "EndpointFactory, TaskType, handles, tasks")
    later = 'class Later(Endpoint):\n    @handles(event="go")\n    def on_go(self, task):\n        pass\n\n\n'
    begin = '    def begin(self):\n        return [tasks.add_component(Later.factory()), tasks.event("go")]\n\n    def on_radar'
    text = text.replace("    def on_radar", begin).replace("class Gentle(", f"{later}class Gentle(")
    assert notes_on(own(tmp_path, text), "lander_vertical") == []
    assert len(notes_on(own(tmp_path, text.replace('event="go"', 'event="goo"')), "lander_vertical")) == 1


def test_misspelt_name_that_is_used_often_is_one_finding(tmp_path: Path) -> None:
    text = "def pulse_us(heave):\n    return heave\n\n\nONE = pulses_us(0)\nTWO = pulses_us(1)\nTHREE = pulses_us(2)\n"
    (note,) = notes_on_files([own(tmp_path, text)])
    assert "line 5: ONE = pulses_us(0)" in note
    assert "Nothing gives pulses_us a value. It is used in line 6, 7, too." in note
    assert "did you mean 'pulse_us'?" in note


def test_deeply_nested_source_has_no_findings(tmp_path: Path) -> None:
    deep = "DEEP = " + " + ".join(["1"] * 700) + "\n"
    assert notes_on(own(tmp_path, deep + GENTLE.replace("altitude_m", "altitude_n")), "lander_vertical") == []


def test_source_checks_do_not_change_the_run(tmp_path: Path) -> None:
    path = own(tmp_path, GENTLE.replace("min(max(throttle, 0.0), 1.0)", "0.25"))
    ends = []
    for is_looked_at in (False, True):
        simulation = prepare(Request("lander_vertical", controller=str(path)))
        plant = simulation.plant()
        flight = SimulationRun(simulation, plant, simulation.config(plant))
        if is_looked_at:
            assert notes_before(simulation, flight.nodes) == []
        ends.append((flight.run().metrics, plant.snapshot()))
    assert repr(ends[0]) == repr(ends[1])
