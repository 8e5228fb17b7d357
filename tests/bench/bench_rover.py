"""Rover: a step in MuJoCo and in the plane, compared with MuJoCo's own of the same world; a climb; processes.

Run by `snr bench rover`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import rover_processes
from harness import Row, compare

from snr_sim.plants import DRY_SAND, HeightMap, Rover, Rover2D, RoverStart, make_hills, read_rover
from snr_sim.plants.ground.height_map import flat
from snr_sim.plants.ground.rover import STEP_S
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.recording.trace import FILE_NAME
from snr_sim.scenario.simulation import Request, Simulation, prepare
from snr_sim.scenario.simulation_run import SimulationRun, run_recorded

VEHICLE = read_rover(Path(__file__).parents[2] / "robots" / "rover" / "vehicles" / "competition.toml")
AHEAD = DriveCommand("speed", [4.0] * 3 + [5.0] * 3)
STEPS = 2000
HILLS_LIMIT_US, SOIL_LIMIT_US, PLANE_LIMIT_US, RATIO_LIMIT = 70.0, 100.0, 20.0, 2.5
EMULATED_RATIO_LIMIT = 2.0
CLIMB, CLIMB_LIMIT_S, RECORDED_LIMIT_S = "rover_hill", 4.0, 5.0


def driving(ground: HeightMap, soil: Any = None, body: type[Rover] | type[Rover2D] = Rover) -> Rover | Rover2D:
    """Return a rover that has driven a curve for a second."""
    rover = body(VEHICLE, ground, lambda seed: RoverStart(), soil)
    rover.write("drive", AHEAD)
    for _ in range(round(1.0 / STEP_S)):
        rover.step(STEP_S)
    return rover


def bare() -> Callable[[], Any]:
    """Return what steps the world of a rover on level ground in MuJoCo alone."""
    rover = driving(flat())
    assert isinstance(rover, Rover)
    world = rover._world
    step, model, data = world.mujoco.mj_step, world.model, world.data

    def run() -> None:
        for _ in range(STEPS):
            step(model, data)

    return run


def steps_of(ground: HeightMap, soil: Any = None, body: type[Rover] | type[Rover2D] = Rover) -> Callable[[], Any]:
    """Return what steps a rover."""
    rover = driving(ground, soil, body)

    def run() -> None:
        for _ in range(STEPS):
            rover.step(STEP_S)

    return run


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows: CPU time of one step, and of a minute with its node."""
    hills = make_hills(3, 0.5)
    found = compare(
        bare,
        lambda: steps_of(flat()),
        lambda: steps_of(hills),
        lambda: steps_of(hills, DRY_SAND),
        lambda: steps_of(hills, body=Rover2D),
        rounds=3 if is_quick else 15,
    )
    names = ("on level ground", "on hills", "on hills of dry sand", "in the plane, on hills")
    limits_us = (None, HILLS_LIMIT_US, SOIL_LIMIT_US, PLANE_LIMIT_US)
    for i, (name, limit_us) in enumerate(zip(names, limits_us, strict=True), start=1):
        yield Row(
            f"rover, a step {name}, with motors and battery",
            1e6 * found.shortest_s[i] / STEPS,
            "us",
            limit=limit_us,
            baseline=1e6 * found.shortest_s[0] / STEPS,
            compared_to="bare mj_step of the same world on level ground",
            ratio=found.ratios[i],
            ratio_limit=RATIO_LIMIT if i == 2 else None,
        )
    yield from climbs(2 if is_quick else 5)
    yield from rover_processes.measure(is_quick)


def climbs(rounds: int) -> Iterator[Row]:
    """Yield the time of a minute of a climb: node, sensors and plant in lock step; with a trace; over VESC bytes."""
    simulation = prepare(Request(CLIMB))
    times_s: list[float] = []

    def alone(simulation: Simulation = simulation) -> Callable[[], Any]:
        plant = simulation.plant()
        flight = SimulationRun(simulation, plant, simulation.config(plant))

        def run() -> None:
            result = flight.run()
            assert result.success
            times_s.append(result.sim_time_s)

        return run

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / FILE_NAME

        def recorded() -> Callable[[], Any]:
            path.unlink(missing_ok=True)
            return lambda: run_recorded(simulation, path)

        emulated = prepare(Request(CLIMB, io="emulated"))
        found = compare(alone, recorded, lambda: alone(emulated), rounds=rounds)
    per_minute = 60.0 / times_s[0]
    yield Row(f"rover, 60 s of {CLIMB} in lock step", per_minute * found.shortest_s[0], "s", limit=CLIMB_LIMIT_S)
    yield Row(
        "rover, the same with the trace",
        per_minute * found.shortest_s[1],
        "s",
        limit=RECORDED_LIMIT_S,
        baseline=per_minute * found.shortest_s[0],
        compared_to="the same without a trace",
        ratio=found.ratios[1],
    )
    yield Row(
        "rover, the same with its motors over emulated VESC lines",
        per_minute * found.shortest_s[2],
        "s",
        baseline=per_minute * found.shortest_s[0],
        compared_to="the same with --io sim",
        ratio=found.ratios[2],
        ratio_limit=EMULATED_RATIO_LIMIT,
    )
