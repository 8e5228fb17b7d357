"""The rover from end to end: it climbs, it stops when no command comes, and it turns as its numbers say."""

from __future__ import annotations

import math
from pathlib import Path
from types import ModuleType

import pytest

from snr_sim.plants import Rover, RoverStart
from snr_sim.plants.ground.height_map import flat
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.prelude.task import Page
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import read_trace
from snr_sim.recording.records import PageRecord, TruthRecord
from snr_sim.recording.replay import replay_node
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario import library
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import RunResult, SimulationRun
from tests.lanes import nightly, slow
from tests.scenarios.recorded import simulate

ROVER = library.find("robots", "rover")


def run(
    controller: Path | None = None, seed: int = 0, scenario: str = "rover_hill", engine: str | None = None
) -> tuple[RunResult, object]:
    file = None if controller is None else str(controller)
    simulation = prepare(Request(scenario, seed, engine, controller=file))
    plant = simulation.plant()
    return SimulationRun(simulation, plant, simulation.config(plant)).run(), plant


def part(name: str) -> ModuleType:
    """Return a module of the robot."""
    library.load_robot(ROVER)
    return __import__(f"{library.ROBOT_MODULE}rover.{name}", fromlist=["*"])


@pytest.mark.parametrize("run", ["rover_hill pymunk 0", slow("rover_hill mujoco 0")])
def test_rover_climbs_through_sand_and_stands_on_the_slope(run: str, tmp_path: Path) -> None:
    result = simulate(run, tmp_path)
    assert (result.outcome, result.success) == ("stands", True)
    assert result.metrics["back_m"] < 0.05
    assert 15.0 < result.metrics["way_m"] < 20.0
    assert 3000.0 < result.metrics["energy_j"] < 10_000.0
    trace = read_trace(tmp_path / FILE_NAME)
    assert replay_node(trace, "rover", prepare(Request("rover_hill")).config(None)).is_identical


@pytest.mark.nightly(minutes=3)
def test_rover_stands_on_the_slope_from_every_start() -> None:
    results = [run(seed=seed)[0] for seed in range(100)]
    assert [(one.outcome, one.error, one.notes) for one in results if not one.success] == []


def test_controller_that_falls_silent_leaves_the_rover_braked(tmp_path: Path) -> None:
    file = tmp_path / "silent.py"
    file.write_text(
        "from snr_sim import Endpoint, handles\n"
        "class Silent(Endpoint):\n"
        "    @handles('imu')\n"
        "    def on_imu(self, imu):\n"
        "        if imu['stamp_s'] < 3.0:\n"
        "            return self.store_data_task('drive', {'mode': 'speed', 'values': [6.0] * 6})\n"
        "        if imu['stamp_s'] > 6.0:\n"
        "            raise SystemExit\n"
        "def factories(robot):\n"
        "    return [Silent.factory()]\n"
    )
    _, plant = run(file)
    speeds = {round(sample.time_s, 1): sample.speed_mps for sample in plant.course}  # type: ignore[attr-defined]
    assert speeds[3.0] > 0.6
    assert speeds[4.2] < 0.02, "the lease, and a second of brakes"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("{'mode': 'sped', 'values': [1.0] * 6}", "mode"),
        ("{'mode': 'speed', 'values': [1.0] * 5}", "send 6 finite numbers"),
        ("{'mode': 'speed', 'values': [float('nan')] * 6}", "finite number"),
        ("{'mode': 'speed', 'valus': [1.0] * 6}", "valus"),
    ],
)
def test_invalid_command_is_reported(tmp_path: Path, data: str, message: str) -> None:
    file = tmp_path / "odd.py"
    file.write_text(
        "from snr_sim import Endpoint, handles\n"
        "class Odd(Endpoint):\n"
        "    @handles('imu')\n"
        "    def on_imu(self, imu):\n"
        f"        return self.store_data_task('drive', {data})\n"
        "def factories(robot):\n"
        "    return [Odd.factory()]\n"
    )
    result, _ = run(file)
    assert message in result.error


@pytest.mark.parametrize("engine", [slow("pymunk"), nightly("mujoco")])
def test_template_drives_up_into_the_sand(engine: str) -> None:
    result, plant = run(ROVER.path / "controller_template.py", engine=engine)
    assert result.outcome in ("timeout", "off course")
    assert plant.course[-1].position_m[0] > 5.0  # type: ignore[attr-defined]


def test_wheel_rates_turn_the_rover_as_asked() -> None:
    parameters = part("parameters").RoverParameters()
    rates = part("drive").wheel_rates(parameters, 0.4, 0.3)
    left, right = rates[0], rates[3]
    assert left < right
    assert 0.5 * (left + right) * 0.13 == pytest.approx(0.4)
    fast = part("drive").wheel_rates(parameters, 9.0, 1.0)
    assert max(map(abs, fast)) == pytest.approx(parameters.vehicle.motor.top_radps(20.0))
    assert fast[0] / fast[3] == pytest.approx((9.0 - 2.5 * 0.38) / (9.0 + 2.5 * 0.38)), "the curve is the same"


@pytest.mark.parametrize(("speed_mps", "turn_radps"), [(0.5, 0.2), (0.6, -0.1), (0.0, 0.6)])
def test_plant_turns_at_the_rate_that_is_asked_of_its_wheels(speed_mps: float, turn_radps: float) -> None:
    parameters = part("parameters").RoverParameters()
    rover = Rover(parameters.vehicle, flat(), lambda seed: RoverStart())
    rover.write("drive", DriveCommand("speed", part("drive").wheel_rates(parameters, speed_mps, turn_radps)))
    for _ in range(1500):
        rover.step(rover.step_s)
    assert rover.read("imu").rate_radps[2] == pytest.approx(turn_radps, rel=0.25)


def test_unknown_vehicle_is_refused() -> None:
    with pytest.raises(SnrError, match="cannot be read"):
        part("parameters").vehicle("tank")
    assert math.isclose(part("parameters").vehicle().mass_kg, 43.0)


@pytest.mark.slow
def test_rover_drives_along_its_way_points_while_odometry_alone_drifts(tmp_path: Path) -> None:
    result = simulate("rover_waypoints mujoco 0", tmp_path)
    assert (result.outcome, result.success) == ("arrived", True)
    assert max(result.metrics["nearest_m"]) < 3.0
    assert 110.0 < result.metrics["way_m"] < 135.0
    trace = read_trace(tmp_path / FILE_NAME)
    true = {round(one.t, 1): one.poses["chassis"][:2] for one in trace.records if isinstance(one, TruthRecord)}
    off = {}
    for key in ("odometry", "navigation"):
        pages = [
            (round(one.t, 1), decode_value(bytes(one.values), {"page": Page})[0].data["position_m"])
            for one in trace.records
            if isinstance(one, PageRecord) and one.name == key
        ]
        off[key] = [math.dist(true[t_s], place) for t_s, place in pages if t_s in true]
        assert len(off[key]) > 500
    assert max(off["navigation"]) < 3.0
    assert max(off["odometry"]) > max(off["navigation"])
    assert replay_node(trace, "rover", prepare(Request("rover_waypoints")).config(None)).is_identical


@pytest.mark.slow
def test_script_drives_through_three_gates_and_back(tmp_path: Path) -> None:
    result = simulate("rover_teleop mujoco 0", tmp_path)
    assert (result.outcome, result.success) == ("completed", True)
    assert result.metrics["gates"] == [1, 2, 3, -3, -2, -1]
    assert result.metrics["hardest_n"] == 0.0
    trace = read_trace(tmp_path / FILE_NAME)
    for node in ("rover", "topside"):
        assert replay_node(trace, node, prepare(Request("rover_teleop")).config(None)).is_identical


# In parts, so that workers share the longest test of the night.
@pytest.mark.nightly(minutes=5)
@pytest.mark.parametrize("seeds", [range(i, i + 25) for i in range(0, 100, 25)], ids=str)
@pytest.mark.parametrize(
    ("scenario", "engine"),
    [
        ("rover_waypoints", "mujoco"),
        ("rover_teleop", "mujoco"),
        ("rover_lost_link", "pymunk"),
        ("rover_dead_motor", "pymunk"),
        ("rover_obstacle", "pymunk"),
        ("rover_square", "pymunk"),
        ("rover_wheel_up", "mujoco"),
        ("rover_arm", "mujoco"),
    ],
)
def test_rover_succeeds_with_every_seed(scenario: str, engine: str, seeds: range) -> None:
    results = [run(seed=seed, scenario=scenario, engine=engine)[0] for seed in seeds]
    assert [(one.outcome, one.error, one.notes) for one in results if not one.success] == []
