import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.plants.dive import Current, Dive, Leak, Load
from snr_sim.plants.pool import Pool
from snr_sim.plants.propulsion import Propulsion
from snr_sim.plants.tether import Tether
from snr_sim.plants.urov import Urov, WrenchCommand
from snr_sim.plants.vehicle import Vehicle
from snr_sim.plants.vehicle_file import read_vehicle
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownName
from snr_sim.prelude.signals import PwmCommand
from snr_sim.testing.contracts import check_plant

VEHICLES = Path(__file__).parents[2] / "robots" / "urov" / "vehicles"
HEAVY = read_vehicle(VEHICLES / "benzon2022.toml")
SEA = Pool(2000.0, 2000.0, 200.0)  # nothing in reach
WRENCH = WrenchCommand([10.0, 2.0, 3.0], [0.1, 0.2, 0.3])
PULSES = PwmCommand([1600.0, 1620.0, 1400.0, 1410.0, 1550.0, 1500.0, 1450.0, 1700.0])


def swim(vehicle: Vehicle = HEAVY, pool: Pool = SEA, step_s: float = 0.005, **how: object) -> Urov:
    """A vehicle in deep water; `how` it begins is as in Dive."""
    dive = Dive(**{"position_m": (0.0, 0.0, -50.0), **how})  # type: ignore[arg-type]
    return Urov(vehicle, pool, lambda seed: dive, step_s=step_s)


def go(plant: Urov, time_s: float, force_n: Sequence[float] = (0.0, 0.0, 0.0)) -> Urov:
    plant.write("wrench", WrenchCommand(list(force_n)))
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)
    return plant


@pytest.mark.parametrize("z_m", [-1.5, 0.02, -3.87], ids=["in the water", "at the surface", "on the floor"])
def test_it_keeps_the_promise_of_a_plant(z_m: float) -> None:
    def start(seed: int) -> Dive:
        return Dive(
            (0.1 * seed, 0.0, z_m),
            currents=(Current(0.05, (0.1, 0.2, 0.0)),),
            loads=(Load(1.0, 0.0001, (0.0, 0.1, 0.0), until_s=0.06),),
            leak=Leak(0.02, 5.0),
            tether=Tether((0.0, 0.0, 0.0), 5.0),
        )

    check_plant(lambda: Urov(HEAVY, Pool(), start), {"wrench": WRENCH})
    check_plant(lambda: Urov(HEAVY, Pool(), start, Propulsion(8)), {"pwm": PULSES})


def test_what_it_shows_and_tells_is_json() -> None:
    plant = Urov(HEAVY, Pool(), lambda seed: Dive(tether=Tether((0.0, 0.0, 0.0))), Propulsion(8))
    plant.step(plant.step_s)
    assert json.loads(json.dumps(plant.scene())) == plant.scene()
    truth = plant.truth()
    assert json.loads(json.dumps(truth)) == truth
    assert {"T1", "T8", "tether"} <= set(truth["arrows"])


def test_surge_follows_the_closed_form() -> None:
    vehicle = replace(HEAVY, net_buoyancy_n=0.0)
    plant = go(swim(vehicle), 1.0, (40.0, 0.0, 0.0))
    a, b, mass = 13.7, 141.0, plant.vehicle.mass_kg + 6.3567
    u1 = (-a + math.sqrt(a * a + 4.0 * b * 40.0)) / (2.0 * b)
    u2 = u1 + a / b
    e = math.exp(-b * (u1 + u2) / mass)
    assert plant.through_water[0] == pytest.approx(u1 * (1.0 - e) / (1.0 + u1 / u2 * e), rel=1e-5)


def test_what_cannot_be_is_refused_in_words() -> None:
    with pytest.raises(ParameterError, match="which is not in the pool"):
        Urov(HEAVY, Pool(depth_m=3.0), lambda seed: Dive((0.0, 0.0, -3.5)))
    with pytest.raises(ParameterError, match="has 8 thrusters, its propulsion 6"):
        Urov(HEAVY, Pool(), lambda seed: Dive(), Propulsion(6))
    with pytest.raises(ParameterError, match=r"in steps of 0\.0 s"):
        swim(step_s=0.0)
    plant = swim()
    with pytest.raises(ParameterError, match=r"steps of 0\.005 s, not 0\.01 s"):
        plant.step(0.01)
    with pytest.raises(UnknownName, match="no input 'pwm'"):
        plant.write("pwm", PULSES)
    with pytest.raises(UnknownName, match="no output 'power'"):
        plant.read("power")
    with pytest.raises(PlantError, match="six finite numbers"):
        plant.write("wrench", WrenchCommand([math.nan, 0.0, 0.0]))


def test_a_state_that_explodes_is_an_error_that_says_what_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    plant = swim(step_s=0.02, velocity_mps=(99.0, 0.0, 0.0))  # drag takes more than all of it in a step
    with pytest.raises(PlantError, match=r"acceleration in surge.* is no longer finite; the velocities .* surge "):
        go(plant, 1.0)
    assert list(tmp_path.iterdir()) == []  # MuJoCo has not seen it, and wrote no log
