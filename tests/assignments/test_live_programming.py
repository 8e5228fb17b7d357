"""The lab "live programming": its page, its reference with all points, and wrong ones, each with its own loss.

A flight of five minutes takes some seconds: all that have one are in the slow lane, as few as show each mistake.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from snr_sim.behaviors.language import parse
from snr_sim.grading.lab.lab import Case, find_lab
from snr_sim.grading.lab.student import Student
from snr_sim.scenario.machine_edits import write
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from tests.assignments.live_programming.mistakes import MISTAKES
from tests.assignments.live_programming.record import caught_edits, record

LAB = "12_live_programming"
FOLDER = Path(__file__).parents[2] / "assignments" / LAB
HERE = Path(__file__).parent / "live_programming"
FLIGHTS = ("explores", "explores_late", "replays")
# The flights that a mistake loses, of those mistakes that show only in flight.
IN_FLIGHT = {name: list(mistake.lost) for name, mistake in MISTAKES.items() if set(FLIGHTS).issuperset(mistake.lost)}
BEFORE_THE_NIGHT = ("forged_digest", "late", "fast_at_its_sides")  # one of each flight
BY_ITSELF = [name for name in MISTAKES if name not in IN_FLIGHT]


@pytest.mark.unmeasured
@pytest.mark.nightly  # those of lab 1 and 11 are tried before each landing
def test_commands_of_page_have_documented_results(type_page: Callable[..., dict[str, str]]) -> None:
    printed = type_page(FOLDER / "README.md", {})
    assert any("State 'at_wall' cannot be left" in output for output in printed.values())
    assert any("5 of 100" in output for output in printed.values())
    why = next(output for command, output in printed.items() if "--at 2.56" in command)
    assert "no     robot.ultra.read() = 10.5" in why
    assert "taken  robot.ultra.read() = 5" in why
    assert any("age at a transition" in output for output in printed.values())


@pytest.mark.unmeasured
def test_reference_gets_all_points_on_hidden_cases_without_flight(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(*FLIGHTS)
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.nightly
def test_reference_gets_all_points_on_all_hidden_cases(mark: Callable[..., Any]) -> None:
    assert mark(LAB, is_hidden=True) == ({}, "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("room", "seeds"),
    [
        ("dora_corners", range(200, 201)),
        pytest.param("dora_corners", range(201, 203), marks=pytest.mark.nightly),
        pytest.param("dora_corners", range(100, 150), marks=pytest.mark.nightly),
        pytest.param("dora_room", range(100, 150), marks=pytest.mark.nightly),
    ],
)
def test_reference_has_margin_in_every_room(room: str, seeds: range) -> None:
    for seed in seeds:
        result = run(room, seed, HERE / "reference" / "dora.lrp", wire=("none", "wifi")[seed % 2])
        failures = [note for note in result.notes if " failed " in note]
        assert (result.outcome, result.error, failures) == ("explored", "", []), seed
        assert result.metrics["seen_share"] > 0.75, seed


def run(room: str, seed: int, controller: Path, **options: str) -> Any:
    """Return the result of a run."""
    simulation = prepare(Request(room, seed=seed, controller=str(controller), options=options))
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run()


def test_programs_of_starter_have_no_warnings() -> None:
    for path in (FOLDER / "starter").glob("*.lrp"):
        assert parse(path.read_text()).warnings == (), path.name


@pytest.mark.slow
def test_trap_catches_dora_in_its_corner() -> None:
    result = run("dora_corners", 0, FOLDER / "starter" / "trap.lrp")
    assert (result.outcome, result.metrics["hit_mps"]) == ("incomplete", 0.0)
    assert result.metrics["seen_share"] < 0.2


@pytest.mark.slow
def test_recorded_edits_are_those_of_the_reference(tmp_path: Path) -> None:
    record(tmp_path)
    kept = HERE / "reference" / "edits"
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        path.name: path.read_text() for path in kept.iterdir()
    }


@pytest.mark.nightly
@pytest.mark.usefixtures("warm_children")
def test_edited_run_that_stays_caught_gets_half_of_the_points(tmp_path: Path) -> None:
    write(caught_edits(), tmp_path / "edits")
    checks = {one.name: one for one in find_lab(LAB).checks}
    with Student(tmp_path) as student:
        verdict = checks["replays"].evaluate(student, Case(None, is_visible=True))
    assert verdict.fraction == 0.5
    assert "It replays, but has not explored" in verdict.hint


@pytest.mark.parametrize("name", BY_ITSELF)
def test_wrong_solution_loses_listed_points(mark: Callable[..., Any], leave_out: Any, name: str) -> None:
    leave_out(*FLIGHTS)
    found = mark(LAB, name)
    assert found.lost == {check: lost for check, lost in MISTAKES[name].lost.items() if check not in FLIGHTS}
    assert MISTAKES[name].hint in found.feedback


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    ("name", "flights"),
    [
        *((name, IN_FLIGHT[name][0]) for name in BEFORE_THE_NIGHT),
        *(
            pytest.param(name, " ".join(flights), marks=pytest.mark.nightly)
            for name, flights in IN_FLIGHT.items()
            if name not in BEFORE_THE_NIGHT or flights[1:]
        ),
    ],
)
def test_wrong_solution_loses_listed_points_in_flight(
    mark: Callable[..., Any], leave_out: Any, name: str, flights: str
) -> None:
    leave_out(*set(FLIGHTS).difference(flights.split()))
    found = mark(LAB, name)
    assert found.lost == {check: MISTAKES[name].lost[check] for check in flights.split()}
    assert MISTAKES[name].hint in found.feedback


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("at_s = [1", "edits.toml cannot be read"),
        ("at_s = 5", "Keep what `snr machine edits` has written"),
        (f"at_s = [{10**400}]", "Keep what `snr machine edits` has written"),
        ("at_s = [nan]", "Keep what `snr machine edits` has written"),
        ("at_s = [2.0, 1.0]", "Keep what `snr machine edits` has written"),
        (f"at_s = {[float(one) for one in range(1, 99)]}", "At most 50 edits in one run"),
        ("at_s = [1.0]", "Hand in a file called edits/1.lrp"),
        ("at_s = []\nx = '" + 20_000 * "x" + "'", "Write less"),
    ],
)
def test_table_of_edits_with_nonsense_gets_a_hint(
    mark: Callable[..., Any], leave_out: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, table: str, message: str
) -> None:
    def change(folder: Path) -> None:
        for path in (folder / "edits").glob("[1-9]*"):
            path.unlink()
        begin = 'scenario = "dora_corners"\nseed = 0\nchanges = ""\n'
        (folder / "edits" / "edits.toml").write_text(begin + table)

    leave_out(*(check.name for check in find_lab(LAB).checks if check.name != "edited_in_flight"))
    monkeypatch.setitem(MISTAKES, "nonsense", replace(MISTAKES["two_edits"], changes=[change]))
    found = mark(LAB, "nonsense")
    assert found.lost == {"edited_in_flight": 10.0}
    assert message in found.feedback


def test_long_text_of_an_edit_is_refused(
    mark: Callable[..., Any], leave_out: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def change(folder: Path) -> None:
        (folder / "edits" / "2.lrp").write_text(";" * 20_000)

    leave_out(*FLIGHTS)
    monkeypatch.setitem(MISTAKES, "long", replace(MISTAKES["two_edits"], changes=[change]))
    found = mark(LAB, "long")
    assert found.lost == {"edited_in_flight": 10.0}
    assert "Write less" in found.feedback


def test_starter_fails_with_hints(mark: Callable[..., Any], leave_out: Any) -> None:
    leave_out(*FLIGHTS)
    found = mark(LAB, starter=True)
    assert sum(found.lost.values()) == 45.0
    assert "Hand in a file called edits/edits.toml" in found.feedback
    assert "It must stop at the event `stop`" in found.feedback


@pytest.mark.nightly
@pytest.mark.unmeasured
@pytest.mark.parametrize(("flight", "points"), [("explores", 25.0), ("explores_late", 10.0)])
def test_starter_explores_nothing(mark: Callable[..., Any], try_only: Any, flight: str, points: float) -> None:
    try_only(flight)
    found = mark(LAB, starter=True)
    assert found.lost == {flight: points}
    assert "It has seen too little" in found.feedback
