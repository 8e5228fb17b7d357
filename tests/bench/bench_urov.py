"""UROV: cost of hydrodynamics compared with MuJoCo's own step of the same world; and a minute of a dive, both nodes.

Run by `snr bench urov`.
"""

from __future__ import annotations

import math
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from harness import Row, compare, cpu_time_of_process_s

from snr_sim.plants.mujoco_engine import MujocoWorld
from snr_sim.plants.urov.dive import Current, Dive
from snr_sim.plants.urov.pool import BODY, Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.urov import STEP_S, Urov
from snr_sim.plants.urov.urov_state import WrenchCommand
from snr_sim.plants.urov.vehicle_file import read_vehicle
from snr_sim.prelude.signals import PwmCommand
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun, run_recorded
from snr_sim.view.view import VIEW_NAME

VEHICLE = read_vehicle(Path(__file__).parents[2] / "robots" / "urov" / "vehicles" / "benzon2022.toml")
POOL = Pool(depth_m=60.0)
LIMIT_US = 40.0
STEPS = 2000
DIVE, SEED, DIVE_S = "urov_depth_hold", 1, 40.0
MINUTE_LIMIT_S = 2.0
VIEW_LIMIT_S = 2.0


def bare() -> Callable[[], Any]:
    """Return what steps the same world in MuJoCo alone: the body floats, and nothing is done to it."""
    world = MujocoWorld(POOL.mjcf(VEHICLE), STEP_S, (BODY,))
    world.model.opt.gravity[:] = 0.0
    world.data.qpos[2] = -30.0
    step, model, data = world.mujoco.mj_step, world.model, world.data

    def run() -> None:
        for _ in range(STEPS):
            step(model, data)

    return run


def with_wrench(dive: Dive, up_n: float = -1.4) -> Callable[[], Any]:
    """Return what steps the vehicle under a constant wrench."""
    plant = Urov(VEHICLE, POOL, lambda seed: dive)
    plant.write("wrench", WrenchCommand([3.0, 1.0, up_n], [0.02, 0.01, 0.1]))

    def run() -> None:
        for _ in range(STEPS):
            plant.step(STEP_S)

    return run


def with_thrusters(dive: Dive, reads: tuple[str, ...] = ()) -> Callable[[], Any]:
    """Return what steps the vehicle under pulses that change at 50 Hz, and read sensors at 100 Hz."""
    plant = Urov(VEHICLE, POOL, lambda seed: dive, Propulsion(8))
    plant.write("pwm", PwmCommand())
    for _ in range(round(2.0 / STEP_S)):  # the speed controllers arm
        plant.step(STEP_S)

    def run() -> None:
        for i in range(STEPS):
            if i % 4 == 0:
                a, b = 40.0 * math.sin(0.01 * i), 30.0 * math.cos(0.007 * i)
                pulses = [
                    1500.0 + a,
                    1500.0 - a,
                    1500.0 + b,
                    1500.0 - b,
                    1530.0 + b,
                    1470.0 + a,
                    1470.0 - b,
                    1530.0 - a,
                ]
                plant.write("pwm", PwmCommand(pulses))
            plant.step(STEP_S)
            if reads and i % 2 == 0:
                for name in reads:
                    plant.read(name)

    return run


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows: CPU time of one step, compared with MuJoCo's own."""
    rounds = 3 if is_quick else 15
    dive = Dive((0.0, 0.0, -30.0))
    busy = Dive((0.0, 0.0, -30.0), currents=(Current(0.0, (0.1, 0.05, 0.0)),), tether=Tether((0.0, 0.0, 0.0)))
    subjects: list[tuple[str, Callable[[], Callable[[], Any]]]] = [
        ("urov, a step under a wrench", lambda: with_wrench(dive)),
        ("urov, a step with 8 thrusters, ESCs and battery", lambda: with_thrusters(dive)),
        ("urov, the same with current and tether, all outputs read at 100 Hz", lambda: with_thrusters(
            busy, ("depth", "imu", "altitude", "power", "leak")
        )),
        ("urov, a step at the surface", lambda: with_wrench(Dive((0.0, 0.0, -0.13)))),
        ("urov, a step on the floor", lambda: with_wrench(Dive((0.0, 0.0, -59.875)), -20.0)),
    ]  # fmt: skip
    found = compare(bare, *(benchmark for _, benchmark in subjects), rounds=rounds)
    for i, (name, _) in enumerate(subjects, start=1):
        yield Row(
            name,
            1e6 * found.shortest_s[i] / STEPS,
            "us",
            limit=LIMIT_US if i <= 2 else None,
            baseline=1e6 * found.shortest_s[0] / STEPS,
            compared_to="bare mj_step of the same world",
            ratio=found.ratios[i],
        )
    yield from dives(3 if is_quick else 7)
    yield view_of_dive(3 if is_quick else 7)


def view_of_dive(rounds: int) -> Row:
    """Return the CPU time of what `snr view` does before the viewer opens: a process, its imports, and the view."""
    simulation = prepare(Request(DIVE, SEED))
    with tempfile.TemporaryDirectory() as folder:
        result = run_recorded(simulation, Path(folder) / FILE_NAME)
        assert (result.success, round(result.sim_time_s)) == (True, round(DIVE_S)), result
        program = "import sys, pathlib; from snr_sim.view.view import view_of; view_of(pathlib.Path(sys.argv[1]))"
        command = [sys.executable, "-c", program, folder]
        times_s = []
        for _ in range(rounds):
            Path(folder, VIEW_NAME).unlink(missing_ok=True)
            times_s.append(cpu_time_of_process_s(command, Path(folder, "bytecode")))
    return Row(
        f"urov, the view of a dive of {DIVE_S:g} s: from the start of a process to view.rrd",
        min(times_s),
        "s",
        limit=VIEW_LIMIT_S,
        note="CPU time of a process of its own; without the viewer that opens it",
    )


def dives(rounds: int) -> Iterator[Row]:
    """Yield the time of a minute of a dive: both nodes, link, sensors, holds and plant in lock step, and the trace."""
    simulation = prepare(Request(DIVE, SEED))
    folder = Path(tempfile.mkdtemp())

    def with_nodes(is_recorded: bool) -> Callable[[], Any]:
        plant = simulation.plant()
        config = simulation.config(plant)
        recorder = None
        if is_recorded:
            path = Path(tempfile.mkdtemp(dir=folder)) / FILE_NAME
            recorder = TraceWriter(path, simulation.header(plant, config), simulation.trace_info())
        flight = SimulationRun(simulation, plant, config, recorder)

        def run() -> None:
            result = flight.run()
            if recorder is not None:
                recorder.close()
            assert result.success

        return run

    def plant_alone() -> Callable[[], Any]:
        plant = simulation.plant()
        steps = round(DIVE_S / STEP_S)

        def run() -> None:
            for i in range(steps):
                if i % 4 == 0:
                    push = 40.0 * math.sin(0.01 * i)
                    plant.write("pwm", PwmCommand([1500.0 + push] * 8))
                plant.step(STEP_S)

        return run

    try:
        found = compare(plant_alone, lambda: with_nodes(False), lambda: with_nodes(True), rounds=rounds)
    finally:
        shutil.rmtree(folder)
    for i, name in ((1, "urov, 60 s of a dive in lock step"), (2, "urov, the same with the trace")):
        yield Row(
            name,
            60.0 / DIVE_S * found.shortest_s[i],
            "s",
            limit=MINUTE_LIMIT_S if i == 2 else None,
            baseline=60.0 / DIVE_S * found.shortest_s[0],
            compared_to="the plant alone, pulses changing at 50 Hz",
            ratio=found.ratios[i],
            note=f"{DIVE}, of {DIVE_S:g} s, counted for 60",
        )
    yield Row(
        "urov, 60 s of a dive with the trace, beside without",
        60.0 / DIVE_S * found.shortest_s[2],
        "s",
        baseline=60.0 / DIVE_S * found.shortest_s[1],
        compared_to="the same dive without the trace",
        ratio=found.ratios[2] / found.ratios[1],
        ratio_limit=1.35,
    )
