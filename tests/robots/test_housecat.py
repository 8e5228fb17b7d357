"""Housecat clears its yard with two processes that look and one that drives, in the same state at all times."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any, TypeAlias

import numpy as np
import pytest

from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.signals import Ball
from snr_sim.prelude.values import decode_value
from snr_sim.recording.records import PageRecord, TaskRecord
from snr_sim.recording.replay import replay_node
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun
from tests.recording.test_trace import KINDS

RecordScenario: TypeAlias = Callable[..., Any]
HOUSECAT = library.find("robots", "housecat")


def run(scenario: str, seed: int, controller: str | None = None, **options: str) -> RunResult:
    simulation = prepare(Request(scenario, seed, controller=controller, options=options))
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run()


def part(name: str) -> ModuleType:
    """Return a module of the robot."""
    library.load_robot(HOUSECAT)
    return __import__(f"{library.ROBOT_MODULE}housecat.{name}", fromlist=["*"])


# -- clearing ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ranging", "seeds", "at_least"),
    [
        ("lidar", range(1), 1),
        pytest.param("stereo", range(1), 1, marks=pytest.mark.slow),
        pytest.param("stereo", range(100), 90, marks=[pytest.mark.slow, pytest.mark.nightly(minutes=3)]),
        pytest.param("lidar", range(100), 90, marks=[pytest.mark.slow, pytest.mark.nightly(minutes=2)]),
    ],
)
def test_yards_are_cleared(ranging: str, seeds: range, at_least: int) -> None:
    results = [run("housecat_clear", seed, ranging=ranging) for seed in seeds]
    assert [one.error for one in results if one.error] == []
    failures = [(seed, one.outcome, one.notes) for seed, one in zip(seeds, results, strict=True) if not one.success]
    assert len(seeds) - len(failures) >= at_least, failures


@pytest.mark.slow
def test_one_that_stands_clears_nothing(tmp_path: Path) -> None:
    file = tmp_path / "still.py"
    file.write_text(
        "from snr_sim import Endpoint\ndef factories(robot):\n    return [Endpoint.factory(name='still')]\n"
    )
    result = run("housecat_clear", 0, str(file), ranging="lidar")
    assert (result.outcome, result.metrics["cleared_share"]) == ("incomplete", 0.0)


@pytest.mark.slow
def test_template_drives_to_the_edge_and_pushes_some_stones_in() -> None:
    result = run("housecat_clear", 0, str(HOUSECAT.path / "controller_template.py"))
    assert (result.error, result.outcome) == ("", "incomplete")
    assert 0.1 < result.metrics["cleared_share"] < 0.8


@pytest.mark.parametrize(
    ("left", "right", "outcome"),
    [(0.3, 0.3, "fell"), (-0.3, -0.3, "collided")],
)
def test_driver_without_sensors_ends_in_the_pit_or_at_a_wall(
    tmp_path: Path, left: float, right: float, outcome: str
) -> None:
    file = tmp_path / "unaware.py"
    file.write_text(
        "from snr_sim import Endpoint, handles\n"
        "class Unaware(Endpoint):\n"
        "    @handles('pose')\n"
        "    def on_pose(self, pose):\n"
        f"        return self.store_data_task('dozer', {{'left_mps': {left}, 'right_mps': {right}, 'blade': 0.0}})\n"
        "def factories(robot):\n"
        "    return [Unaware.factory()]\n"
    )
    result = run("housecat_clear", 1, str(file), ranging="lidar")
    assert (result.outcome, result.success) == (outcome, False)


def test_unknown_ranging_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ParameterError, match="ranging=stereo, ranging=lidar"):
        run("housecat_clear", 0, ranging="sonar")


# -- together ---------------------------------------------------------------------------------------------------------


def pages(trace: Any, key: str) -> list[tuple[float, Any]]:
    """Return the data of all pages of a key, with their times."""
    found = [one for one in trace.records if isinstance(one, PageRecord) and one.name == key]
    return [(one.t, decode_value(bytes(one.values), KINDS)[0].data) for one in found]


def ended(trace: Any) -> list[tuple[float, str, int]]:
    """Return which process has reported the end of which epoch, and when."""
    found = [one for one in trace.records if isinstance(one, TaskRecord) and one.name == "reference.ended"]
    return [(one.t, *decode_value(bytes(one.values))) for one in found]


def check_together(trace: Any, processes: set[str]) -> list[float]:
    """Check that all end each state before the next begins; return how long each change took [s]."""
    lasted, begun_s = [], 0.0
    reports = ended(trace)
    for t, data in pages(trace, "reference"):
        if data["phase"] == "ending":
            begun_s = t
        elif data["epoch"] > 1:
            of_epoch = [(at, name) for at, name, epoch in reports if epoch == data["epoch"] - 1]
            assert sorted(name for _, name in of_epoch) == sorted(processes)
            assert max(at for at, _ in of_epoch) <= t
            lasted.append(t - begun_s)
    return lasted


def test_two_processes_go_through_the_states_together(record_scenario: RecordScenario) -> None:
    """Sixteen events, of which two are without effect; both processes count again in each state."""
    trace = record_scenario("housecat_echo")
    states = [data["state"][-1] for _, data in pages(trace, "reference") if data["phase"] == "running"]
    assert "".join(states) == "ABCABABA" + "BCABABA"
    check_together(trace, {"Process1", "Process2"})
    first, second = pages(trace, "Process1"), pages(trace, "Process2")
    assert first == second
    assert len(first) == 66
    assert all(data["turns"] == 0 for (_, before), (_, data) in pairwise(first) if before["state"] != data["state"])


@pytest.mark.slow
def test_change_of_state_takes_as_long_as_the_slowest_process(record_scenario: RecordScenario) -> None:
    trace = record_scenario("housecat_slow_vision")
    lasted = check_together(trace, {"process_2d", "process_3d", "driver"})
    assert len(lasted) > 6
    assert max(lasted) <= 0.3 + 0.06, "a picture's work, and a look at it twenty times a second"
    assert any(one > 0.2 for one in lasted)


@pytest.mark.slow
def test_recorded_clearing_is_replayed_without_a_difference(record_scenario: RecordScenario) -> None:
    trace = record_scenario("housecat_clear", None, 1)
    config = prepare(Request("housecat_clear", 1)).config(None)
    found = replay_node(trace, "housecat", config)
    assert found.divergences == []
    assert found.executed > 500


MOVER = """
from snr_sim import TimeoutLoopFactory
from snr_sim.behaviors.flow import wait
from snr_sim.behaviors.processes import ControlProcessFactory, ObserverState, reference_parts
from snr_sim_robot_housecat.movement import move_parts

class Move(ObserverState):
    def run_state(self):
        is_reached = yield from self.move(grab=(1.0, 0.8), lift=(1.0, 0.3), turn=(0.5, 1.0), move=(0.2, 1.6))
        self.store_data("reached", [round(self.get_time_s(), 2), is_reached])
        yield wait(100.0)

def factories(robot):
    return [
        *move_parts(),
        TimeoutLoopFactory(2.5),
        *reference_parts({"move": {"AGAIN": "move"}}, observers=["driver"]),
        ControlProcessFactory("driver", of="reference", states={"move": Move}),
    ]
"""


def test_four_requests_of_a_movement_overlap_and_each_ends_with_its_motor_at_zero(
    tmp_path: Path, record_scenario: RecordScenario
) -> None:
    file = tmp_path / "mover.py"
    file.write_text(MOVER)
    trace = record_scenario("housecat_clear", str(file), 1)
    stored = [(t, data["left_mps"], data["right_mps"], data["blade"]) for t, data in pages(trace, "dozer")]
    changes = [new for old, new in pairwise([(0.0,) * 4, *stored]) if new[1:] != old[1:]]
    assert changes == [
        pytest.approx(row)
        for row in ((0.0, 0.115, 0.285, 0), (0.3, 0.115, 0.285, 1), (0.8, 0.115, 0.285, 0), (1.0, 0.2, 0.2, 0),
                    (1.6, 0, 0, 0))
    ]  # fmt: skip
    assert pages(trace, "reached")[0][1] == [pytest.approx(1.6, abs=0.011), True]
    places = [np.array(data["position_m"]) for _, data in pages(trace, "pose")]
    assert np.linalg.norm(places[-1] - places[0]) == pytest.approx(0.3, abs=0.03), "0.2 m/s for 1.6 s, in a bend"


# -- vision-----------------------------------------------------------------------------------------------------------


def stones_at(distance_m: float, left_m: float = 0.0) -> list[Ball]:
    """Return a small heap in front of the cameras: browns of several brightnesses."""
    mount = part("parameters").CAMERA_M
    rgbs = [(int(150 * one), int(105 * one), int(60 * one)) for one in (0.8, 1.4, 1.0, 1.5, 0.9)]
    return [Ball((mount[0] + distance_m, left_m + 0.06 * (i - 2), 0.03), 0.03, rgb) for i, rgb in enumerate(rgbs)]


FLOOR = {"floor": {"kind": "box", "half_size_m": [9.0, 9.0, 0.005], "center_m": [0, 0, -0.01], "rgb": [206, 198, 182]}}


@pytest.mark.parametrize(("distance_m", "share"), [(1.0, 0.05), (1.5, 0.08), (3.0, 0.15)])
def test_stereo_distance_is_that_of_the_stones(distance_m: float, share: float) -> None:
    vision, stereo = part("vision"), part("parameters").STEREO
    camera, half = stereo.camera, 0.5 * stereo.baseline_m
    mounts = [(camera.mount_position_m[0], side, camera.mount_position_m[2]) for side in (half, -half)]
    measured = []
    for left_m in (0.0, 0.01, 0.02, 0.03):
        left, right = (
            replace(camera, mount_position_m=mount).picture(
                FLOOR, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], balls=stones_at(distance_m, left_m)
            )
            for mount in mounts
        )
        found = vision.stereo_distances(left, right, stereo.baseline_m, camera.field_of_view_rad)
        measured.append(vision.distance_at(0.0, found))
    assert sorted(measured)[1:3] == pytest.approx([distance_m] * 2, rel=share)


def test_bearing_is_that_of_the_nearest_stones() -> None:
    vision, mono = part("vision"), part("parameters").MONO
    balls = [*stones_at(1.0, 0.3), *stones_at(2.0, -0.5)]
    rgb = mono.picture(FLOOR, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], balls=balls)
    assert vision.nearest_bearing_rad(rgb, mono.field_of_view_rad) == pytest.approx(math.atan(0.3), abs=0.06)


def test_vision_finds_no_stones_in_a_yard_without() -> None:
    vision, parameters = part("vision"), part("parameters")
    plant = prepare(Request("housecat_clear", 3)).plant()
    statics = plant.scene()["statics"]  # with walls, brown posts and the pit
    for heading in np.linspace(-math.pi, math.pi, 9):
        attitude = [math.cos(0.5 * heading), 0.0, 0.0, math.sin(0.5 * heading)]
        rgb = parameters.MONO.picture(statics, [0.0, 0.0, 0.0], attitude)
        assert vision.nearest_bearing_rad(rgb, parameters.MONO.field_of_view_rad) is None
        assert vision.stereo_distances(rgb, rgb, 0.12, 1.0) == []


def test_distance_next_to_a_bearing_is_found_and_none_far_from_it() -> None:
    vision = part("vision")
    found = [(-0.2, 1.0), (0.1, 2.0), (0.15, 3.0)]
    assert (vision.distance_at(0.12, found), vision.distance_at(0.5, found)) == (2.0, None)
