"""Lander: cost of node, trace and view compared with direct calls of plant and control law.

Baseline and subject run the same flight: same plant, same simulated devices with the same seeds, same law at the same
times. Before the measurement the final states of the plant are compared, to the last bit.

Run by `snr bench lander`.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from harness import Benchmark, Row, compare, cpu_time_of_process_s

from snr_sim.devices.device_loop import start_device
from snr_sim.prelude.errors import MissingExtraError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.scenario import RobotContext, RobotInfo
from snr_sim.recording.reader import read_trace
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario import library, simulation_run
from snr_sim.scenario.simulation import Request, Simulation, prepare

SEED = 7
PACE_SEED = 0  # of lander_vertical: the reference case

# One tick of a flight without a node: reads, decides, writes.
Tick = Callable[[float], None]


def opened(robot: ModuleType, context: RobotContext, *names: str) -> list[Any]:
    """Return devices of the robot as its loops open them; the last one is the engine, at neutral."""
    *sensors, engine = (robot.DEVICES["sim"][name](context) for name in names)
    devices = [start_device(device, name) for device, name in zip([*sensors, engine.open_device()], names, strict=True)]
    devices[-1].neutral()
    return devices


def pad_tick(robot: ModuleType, law: Any, context: RobotContext) -> tuple[Tick, Callable[[], None]]:
    """Return one tick of lander_pad through the same devices, and a function that ends the flight."""
    radar, inertial, engine = opened(robot, context, "radar", "inertial", "engine")

    def tick(time_s: float) -> None:
        radar_reading = radar.read()
        engine.write(law.update(radar_reading, inertial.read(), time_s))

    return tick, engine.neutral


def pad_tick_without_devices(robot: ModuleType, law: Any, context: RobotContext) -> tuple[Tick, Callable[[], None]]:
    """Return one tick of lander_pad on true values: another flight, a little shorter of work."""
    plant: Any = context.plant

    def tick(time_s: float) -> None:
        plant.write("engine", law.update(plant.read("radar"), plant.read("inertial"), time_s))

    return tick, lambda: None


def vertical_tick(robot: ModuleType, law: Any, context: RobotContext) -> tuple[Tick, Callable[[], None]]:
    """Return one tick of lander_vertical through the same devices, and a function that ends the flight."""
    radar, engine = opened(robot, context, "radar", "engine")

    def tick(time_s: float) -> None:
        engine.write(law.update(radar.read(), time_s))

    return tick, engine.neutral


class Flight:
    """One scenario with its own controller, run with and without a node.

    Args:
        scenario: its name.
        seed: of the start and of all random numbers.
        law: name of the law's class in the controller's file.
    """

    def __init__(self, scenario: str, seed: int, law: str) -> None:
        self.simulation: Simulation = prepare(Request(scenario, seed))
        self.seed = seed
        file = self.simulation.scenario
        found = library.find("robots", file.ROBOT)
        self.robot = library.load_robot(found)
        # The scenario and its controller again, next to the robot just loaded: all share one set of classes.
        file = library.load_scenario(library.find("scenarios", scenario))
        controller = library.load_controller(found, file.CONTROLLER)
        self.simulation = Simulation(self.simulation.request, file, self.robot, controller, [])
        self.law = getattr(controller, law)
        self.parameters = file.parameters(seed)

    def context(self, plant: Plant) -> RobotContext:
        """Return what the robot's table of devices needs to open one on this plant."""
        name = self.simulation.scenario_name
        robot = RobotInfo(self.simulation.scenario.ROBOT, "lander", name, "", self.parameters, {})
        return RobotContext(robot, "sim", self.seed, plant)

    def bare(self, tick_of: Callable[..., tuple[Tick, Callable[[], None]]]) -> Callable[[], Any]:
        """Return a function that runs the scenario without a node and returns the plant."""
        plant: Any = self.simulation.plant()
        tick, end = tick_of(self.robot, self.law(self.parameters), self.context(plant))
        rate_hz, step_s = self.parameters.engine_hz, plant.step_s
        steps = 1 if step_s is None else round(1.0 / (rate_hz * step_s))
        every = round(rate_hz / self.parameters.radar.rate_hz)  # the engine may be looked after more often

        def simulate() -> Any:
            ticks, time_s = 0, 0.0
            step = plant.step
            while True:
                if ticks % every == 0:
                    tick(time_s)
                ticks += 1
                time_s = ticks / rate_hz
                for _ in range(steps):
                    step(step_s or time_s - plant.time_s)
                if plant.outcome is not None:
                    end()
                    return plant

        return simulate

    def in_node(self, folder: Path | None = None, finish: Callable[[Path], None] | None = None) -> Callable[[], Any]:
        """Return a function that runs the scenario with a node and returns the plant.

        Args:
            folder: for the trace, a new file; None runs without a trace.
            finish: called with the trace's path at the end of the flight, within its time.
        """
        plant = self.simulation.plant()
        config = self.simulation.config(plant)
        if folder is None:
            return lambda: (simulation_run.SimulationRun(self.simulation, plant, config).run(), plant)[1]
        path = Path(tempfile.mkdtemp(dir=folder)) / FILE_NAME
        header = self.simulation.header(plant, config)

        def simulate() -> Any:
            recorder = TraceWriter(path, header)
            simulation_run.SimulationRun(self.simulation, plant, config, recorder).run()
            recorder.close()
            if finish is not None:
                finish(path)
            path.unlink()
            return plant

        return simulate


def check_same(flight: Flight, tick_of: Callable[..., Any], folder: Path) -> None:
    """Stop the benchmark if bare flight, node and recorded node do not end in the same state, bit by bit."""
    ends = [simulate().snapshot() for simulate in (flight.bare(tick_of), flight.in_node(), flight.in_node(folder))]
    assert ends[0] == ends[1] == ends[2], f"the flights differ: {ends}"


def write_view_of(path: Path) -> None:
    """Write view.rrd as `snr view` does."""
    from snr_sim.view.view import write_view

    trace = read_trace(path)
    view = path.parent / "view.rrd"
    write_view(trace.header, trace.records, view, path.stat().st_size)
    view.unlink()


def measure(is_quick: bool) -> Iterator[Row]:
    """Yield the rows."""
    rounds = 3 if is_quick else 15
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield from measure_pad(folder, rounds)
        yield from measure_vertical(folder, rounds)


def measure_pad(folder: Path, rounds: int) -> Iterator[Row]:
    """Yield the rows of lander_pad: CPU time per simulated second, compared with the bare flight's."""
    flight = Flight("lander_pad", SEED, "PadLaw")
    check_same(flight, pad_tick, folder)
    sim_s = flight.bare(pad_tick)().time_s
    bare: Benchmark = lambda: flight.bare(pad_tick)  # noqa: E731
    subjects: list[tuple[str, float, Benchmark, str]] = [
        ("lander_pad in lock step", 1.5, lambda: flight.in_node(), ""),
        ("lander_pad with trace", 2.0, lambda: flight.in_node(folder), ""),
    ]
    note = "the import of rerun is not counted"
    try:
        flight.in_node(folder, write_view_of)()  # opens rerun, before anything is timed
        subjects.append(
            ("lander_pad with trace and view.rrd", 3.0, lambda: flight.in_node(folder, write_view_of), note)
        )
    except MissingExtraError:
        pass
    found = compare(bare, *(benchmark for _, _, benchmark, _ in subjects), rounds=rounds)
    for i, (name, limit, _, note) in enumerate(subjects, start=1):
        yield Row(
            name,
            1e3 * found.shortest_s[i] / sim_s,
            "ms/sim s",
            baseline=1e3 * found.shortest_s[0] / sim_s,
            compared_to="plant, devices, law",
            ratio=found.ratios[i],
            ratio_limit=limit,
            note=note,
        )
    yield Row(
        "lander_pad with trace, beside without",
        1e3 * found.shortest_s[2] / sim_s,
        "ms/sim s",
        baseline=1e3 * found.shortest_s[1] / sim_s,
        compared_to="lander_pad in lock step",
        ratio=found.ratios[2] / found.ratios[1],
        ratio_limit=1.6,
    )
    command = [sys.executable, "-m", "snr_sim", "run", "lander_pad", "--json", "--out", str(folder / "runs")]
    yield Row(
        "snr run lander_pad, from the start of its process to the end",
        min(cpu_time_of_process_s(command, folder / "bytecode") for _ in range(rounds)),
        "s",
        limit=0.45,
        note="CPU time, which is the wall time if a core is free",
    )
    truly_s = flight.bare(pad_tick_without_devices)().time_s
    true: Benchmark = lambda: flight.bare(pad_tick_without_devices)  # noqa: E731
    found = compare(true, *(benchmark for _, _, benchmark, _ in subjects[:2]), rounds=rounds)
    for i, (name, _, _, _) in enumerate(subjects[:2], start=1):
        yield Row(
            f"{name}, sensors counted as ours",
            1e3 * found.shortest_s[i] / sim_s,
            "ms/sim s",
            baseline=1e3 * found.shortest_s[0] / truly_s,
            compared_to="plant and law alone",
            ratio=found.ratios[i] * truly_s / sim_s,
            note="per simulated second: without noise it is not the same flight",
        )


def measure_vertical(folder: Path, rounds: int) -> Iterator[Row]:
    """Yield the rows of lander_vertical: simulated time per CPU time."""
    flight = Flight("lander_vertical", PACE_SEED, "OptimalLaw")
    check_same(flight, vertical_tick, folder)
    sim_s = flight.bare(vertical_tick)().time_s
    found = compare(
        lambda: flight.bare(vertical_tick), lambda: flight.in_node(), lambda: flight.in_node(folder), rounds=3 * rounds
    )
    for i, name, limit in ((1, "lander_vertical in lock step", None), (2, "lander_vertical with trace", 2000.0)):
        yield Row(
            name,
            sim_s / found.shortest_s[i],
            "x real time",
            limit=limit,
            more_is_better=True,
            baseline=sim_s / found.shortest_s[0],
            compared_to="plant, devices, law",
            ratio=found.ratios[i],
        )
