"""The vehicle's role over an hour: what it keeps does not grow with time, but for the course that is judged.

The thrust at each microsecond and quarter of a volt is kept once computed, 41 652 times 0.5 kB at most. A battery that
gets empty comes to new ones all the time, so they are computed before.
"""

import gc
import sys
from pathlib import Path
from typing import Any

import pytest

from snr_sim.plants.urov.propulsion import STEPS_PER_VOLT, _patch
from snr_sim.plants.urov.t200 import MAX_PULSE_US, MAX_VOLTAGE_V, MIN_PULSE_US, MIN_VOLTAGE_V
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun

HOUR_S = 3600.0
WARM_UP_S = 300.0
MAX_KIB = 512  # 85 were measured
MAX_BLOCKS = 1000  # of Python's allocator; 312 were measured, of 880 000

SCENARIO = f"""
from snr_sim.plants.urov.dive import Dive
from snr_sim.plants.urov.pool import Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.teleop.scripted_pilot import Cue
from snr_sim_robot_urov.evaluation import TrackedUrov
from snr_sim_robot_urov.parameters import UrovParameters, vehicle

ROBOT = "urov"
ENGINES = ("mujoco",)
CONTROLLER = "holds"
TIME_LIMIT_S = {HOUR_S}


def plant(seed, engine):
    start = Dive(tether=Tether((0.0, 0.0, 0.0)))
    return TrackedUrov(vehicle(), Pool(25.0, 12.5, 4.0), lambda seed: start, Propulsion(8), seed)


def parameters(seed):
    legs = [Cue(10.0 + 20.0 * i, surge=0.3 * (-1) ** i, depth_m=1.0 + i % 2) for i in range(int({HOUR_S} / 20.0))]
    return UrovParameters(vehicle(), (Cue(2.0, is_armed=True, mode="heading_hold", depth_m=1.5), *legs))


def verdict(plant):
    return None


def metrics(plant, seed):
    return {{"way_m": sum(abs(b.position_m[0] - a.position_m[0]) for a, b in zip(plant.course, plant.course[1:]))}}
"""


def kept_without(course: Any) -> tuple[int, int]:
    """Return the memory that this process has, without the course [KiB], and the number of blocks in it."""
    gc.collect()
    resident_kib = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * 4
    return resident_kib - sys.getsizeof(course._numbers) // 1024, sys.getallocatedblocks()


@pytest.mark.nightly(minutes=2)
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_stays_constant_over_one_hour(tmp_path: Path) -> None:
    (tmp_path / "hour.py").write_text(SCENARIO, encoding="utf-8")
    simulation = prepare(Request(str(tmp_path / "hour.py")))
    plant = simulation.plant()
    for step in range(int(MIN_VOLTAGE_V * STEPS_PER_VOLT), int(MAX_VOLTAGE_V * STEPS_PER_VOLT)):
        for pulse_us in range(int(MIN_PULSE_US), int(MAX_PULSE_US) + 1):
            _patch(step, pulse_us)
    patches = _patch.cache_info().currsize
    seen: dict[float, tuple[int, int]] = {}

    def look(now_s: float) -> None:
        for due_s in (WARM_UP_S, HOUR_S - 1.0):
            if now_s >= due_s and due_s not in seen:
                seen[due_s] = kept_without(plant.course)

    result = SimulationRun(simulation, plant, simulation.config(plant), on_advance=look).run()
    assert (result.error, result.sim_time_s) == ("", pytest.approx(HOUR_S))
    assert result.metrics["way_m"] > 100.0  # it did dive
    (first_kib, first_blocks), (last_kib, last_blocks) = seen.values()
    print(seen)
    assert _patch.cache_info().currsize == patches == 52 * 801
    assert last_kib - first_kib < MAX_KIB, f"{first_kib} KiB, and {last_kib} KiB after an hour"
    assert last_blocks - first_blocks < MAX_BLOCKS, f"{first_blocks} blocks, and {last_blocks} after an hour"
