import math
from dataclasses import replace
from pathlib import Path

import pytest

from snr_sim.plants.lander.lander_3d import Lander3D
from snr_sim.plants.lander.module import LunarModule
from snr_sim.plants.lander.terrain import FLAT, Terrain, make_terrain
from snr_sim.prelude.errors import ParameterError, PlantError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import EngineCommand, InertialReading
from tests.plants.test_lander_2d import FORGIVING, start

HILLS = make_terrain(11, relief_m=14.0, pad_slope_rad=0.08)


def drop(module: LunarModule, height: float = 0.5, step_s: float = 0.005, **how: object) -> Lander3D:
    return Lander3D(module, start(z=3.6 + height, **how), step_s=step_s)  # type: ignore[arg-type]


def run(plant: Lander3D, time_s: float, command: EngineCommand | None = None) -> InertialReading:
    if command is not None:
        plant.write("engine", command)
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)
    reading = plant.read("inertial")
    assert isinstance(reading, InertialReading)
    return reading


def energy(plant: Lander3D) -> float:
    """Motion, height, and what the springs of the legs hold."""
    motion, poses = run(plant, 0.0), plant.truth()["poses"]
    vx, vz = motion.velocity_mps
    module = plant.module
    turning = (module.gyration_m * motion.rate_radps) ** 2
    total = plant.mass_kg * (0.5 * (vx**2 + vz**2 + turning) + module.gravity_mps2 * motion.position_m[1])
    given = [math.dist(pose[:3], poses["module"][:3]) for name, pose in poses.items() if name != "module"]
    return total + sum(0.25 * module.leg.spring_npm * way**2 for way in given)


def test_lander_3d_implements_plant(apollo: LunarModule) -> None:
    plant = Lander3D(apollo, start())
    assert isinstance(plant, Plant)
    assert plant.engine.startswith("mujoco 4")


def test_landing_among_hills_stays_in_plane(apollo: LunarModule) -> None:
    plant = drop(apollo, height=2.0, vx=0.6, tilt=0.03, rate=0.01, ground=HILLS)
    run(plant, 10.0)
    assert plant.outcome == "landed"
    _, y, _, qx, _, qz, _ = plant.truth()["poses"]["module"]
    assert abs(y) < 1e-6
    assert math.hypot(qx, qz) < 1e-6


def test_springs_at_rest_carry_weight(apollo: LunarModule) -> None:
    plant = drop(apollo, height=1.0)
    reading = run(plant, 8.0)
    assert plant.outcome == "landed"
    assert reading.contact == [True, True]
    sag = 7500.0 * 1.62 / (2.0 * apollo.leg.spring_npm)
    # What the contacts give comes on top: 0.1 mm.
    assert reading.position_m[1] == pytest.approx(3.6 - sag, abs=5e-4)
    feet = [pose for name, pose in plant.truth()["poses"].items() if name.endswith("_leg")]
    module = plant.truth()["poses"]["module"]
    assert len(feet) == 4
    for foot in feet:
        assert foot[2] - module[2] == pytest.approx(sag, abs=0.001)


@pytest.mark.parametrize("ground", [FLAT, HILLS], ids=["flat", "hills"])
@pytest.mark.parametrize("step_s", [0.0025, 0.005, 0.01])
def test_bounces_do_not_gain_energy(apollo: LunarModule, ground: Terrain, step_s: float) -> None:
    springy = replace(apollo, gear=FORGIVING, leg=replace(apollo.leg, damper_nspm=3e3))
    plant = drop(springy, height=1.5, step_s=step_s, ground=ground, vx=0.4, tilt=0.05)

    before = min_energy = energy(plant)
    for _ in range(round(20.0 / step_s)):
        plant.step(step_s)
        if not any(run(plant, 0.0).contact) and plant.outcome is None:
            now = energy(plant)
            assert now <= min_energy + 2e-3 * 7500.0 * 1.62 * 1.5  # of the fall: what the feet's own motion may hold
            min_energy = min(min_energy, now)
    assert plant.outcome == "landed"
    assert min_energy < before - 0.9 * 7500.0 * 1.62 * 1.5


def test_feet_hold_on_slope_and_slide_on_ice(apollo: LunarModule) -> None:
    slope = make_terrain(3, relief_m=0.0, pad_slope_rad=0.15)
    holds = drop(replace(apollo, gear=FORGIVING), height=0.8, ground=slope)
    assert run(holds, 12.0).position_m[0] == pytest.approx(-0.5, abs=0.3)
    assert holds.outcome == "landed"
    ice = drop(replace(apollo, gear=FORGIVING, leg=replace(apollo.leg, friction=0.02)), height=0.8, ground=slope)
    assert run(ice, 4.0).position_m[0] < -1.2


# -- wrong input ------------------------------------------------------------------------------------------------------


def test_non_finite_force_raises_with_time_and_writes_no_log(
    apollo: LunarModule, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # where MuJoCo would write it
    plant = Lander3D(apollo, start(z=1000.0))
    plant.restore(plant.snapshot()._replace(command=(0.0, 0.0, math.inf)))
    with pytest.raises(PlantError, match=r"At 0 s the force on the module is .* -inf"):
        run(plant, 1.0)
    assert not list(tmp_path.iterdir())


def test_non_finite_state_raises_with_time(apollo: LunarModule) -> None:
    plant = Lander3D(apollo, start(z=1000.0))
    run(plant, 0.1)
    held = plant.snapshot()
    body = list(held.body)
    body[3] = math.nan
    with pytest.raises(PlantError, match=r"At 0\.1 s the position of hull\[\d\] is nan"):
        plant.restore(held._replace(body=tuple(body)))


def test_module_too_light_for_feet_raises_with_other_engine(apollo: LunarModule) -> None:
    with pytest.raises(ParameterError, match=r"no room for 4 feet of 20 kg") as caught:
        Lander3D(replace(apollo, gyration_m=0.3), start())
    assert "--engine pymunk" in caught.value.fix
    with pytest.raises(ParameterError, match=r"A module of 60 kg"):
        Lander3D(apollo, start(mass=60.0, fuel=10.0))
