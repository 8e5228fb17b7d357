"""The programs of docs/machines.md and docs/control_processes.md do what these say."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from snr_sim.behaviors import MachineFactory
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

PAGE = Path(__file__).parents[2] / "docs" / "machines.md"


def programs() -> list[str]:
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_program_in_lrp_lands_as_well(tmp_path: Path, seed: int) -> None:
    (text,) = re.findall(r"```lrp\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "landing.lrp").write_text(text)
    simulation = prepare(Request("lander_vertical", seed=seed, controller=str(tmp_path / "landing.lrp")))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (result.error, result.outcome) == ("", "landed")


def test_second_program_runs() -> None:
    exec(programs()[1], {})


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 6))])
def test_first_program_lands_with_about_1_9_times_the_least_fuel(tmp_path: Path, seed: int) -> None:
    (tmp_path / "landing.py").write_text(programs()[0])
    simulation = prepare(Request("lander_vertical", seed=seed, controller=str(tmp_path / "landing.py")))
    plant = simulation.plant()
    result = SimulationRun(simulation, plant, simulation.config(plant)).run()
    assert (result.error, result.outcome) == ("", "landed")
    assert 1.85 < result.metrics["fuel_ratio"] < 1.95


def test_machine_may_react_to_one_page_given_as_text() -> None:
    names: dict[str, object] = {}
    exec(programs()[0], names)
    factory = MachineFactory(names["LANDING"], "landing", reacts_to="radar")  # type: ignore[arg-type]
    assert factory.reacts_to == ("radar",)


def run_on_lander(text: str, folder: Path) -> tuple[SimulationRun, Any]:
    """Run a program as the controller of a lander; return the run and the node."""
    (folder / "program.py").write_text(text)
    simulation = prepare(Request("lander_vertical", controller=str(folder / "program.py")))
    plant = simulation.plant()
    run = SimulationRun(simulation, plant, simulation.config(plant))
    assert run.run().error == ""
    return run, run.nodes[0]


def test_flow_climbs_and_rests(tmp_path: Path) -> None:
    _, node = run_on_lander(programs()[2], tmp_path)
    page = node.get_data("mission")
    assert page["outcome"] == "done"
    assert page["last"]["source"] == "REST"


def test_control_processes_change_their_state_together(tmp_path: Path) -> None:
    page = Path(PAGE).with_name("control_processes.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    _, node = run_on_lander(text, tmp_path)
    reference = node.get_data("reference")
    assert (reference["state"], reference["epoch"], reference["phase"]) == ("approaching", 2, "running")
