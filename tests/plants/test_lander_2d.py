import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from snr_sim.plants.lander.gear import GearLimits
from snr_sim.plants.lander.lander_2d import Lander2D
from snr_sim.plants.lander.legs import FEET_M, BodyPose
from snr_sim.plants.lander.module import LunarModule, PlaneStart
from snr_sim.plants.lander.terrain import FLAT, Terrain, make_terrain
from snr_sim.prelude.errors import PlantError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import EngineCommand

FORGIVING = GearLimits(99.0, 99.0, 99.0, math.pi, 9.0)
SLOPE = make_terrain(3, relief_m=0.0, pad_slope_rad=0.1)


def start(
    x: float = 0.0, z: float = 200.0, vx: float = 0.0, vz: float = 0.0, tilt: float = 0.0, rate: float = 0.0,
    mass: float = 7500.0, fuel: float = 600.0, ground: Terrain = FLAT,
) -> Callable[[int], tuple[PlaneStart, Terrain]]:  # fmt: skip
    return lambda seed: (PlaneStart((x, z), (vx, vz), mass, fuel, tilt, rate), ground)


def run(plant: Lander2D, time_s: float, command: EngineCommand | None = None) -> BodyPose:
    if command is not None:
        plant.write("engine", command)
    for _ in range(round(time_s / plant.step_s)):
        plant.step(plant.step_s)
    return pose(plant)


def pose(plant: Lander2D) -> BodyPose:
    reading = plant.read("inertial")
    (x, z), (vx, vz) = reading.position_m, reading.velocity_mps
    return BodyPose(x, z, reading.attitude_rad, vx, vz, reading.rate_radps)


def drop(module: LunarModule, height: float = 0.5, step_s: float = 0.005, **how: object) -> Lander2D:
    return Lander2D(module, start(z=3.6 + height, **how), step_s=step_s)  # type: ignore[arg-type]


def energy(plant: Lander2D) -> float:
    """Motion, height, and what both legs' springs hold."""
    x, z, tilt, vx, vz, rate = pose(plant)
    module, cos, sin = plant.module, math.cos(tilt), math.sin(tilt)
    total = plant.mass_kg * (0.5 * (vx**2 + vz**2 + (module.gyration_m * rate) ** 2) + module.gravity_mps2 * z)
    for (foot_x, foot_z), grip in zip(FEET_M, plant.snapshot().grips_m, strict=True):
        if grip is not None:
            foot = x + cos * foot_x - sin * foot_z, z + sin * foot_x + cos * foot_z
            height, slope = plant.terrain.ground(foot[0])
            nz = 1.0 / math.hypot(1.0, slope)
            depth = (height - foot[1]) * nz
            bent = (foot[0] - grip[0]) * nz + (foot[1] - grip[1]) * slope * nz
            total += 0.5 * module.leg.spring_npm * (depth**2 + bent**2)
    return total


def test_lander_2d_implements_plant(apollo: LunarModule) -> None:
    plant = Lander2D(apollo, start())
    assert isinstance(plant, Plant)
    assert plant.engine.startswith("pymunk 7")


# -- flight -----------------------------------------------------------------------------------------------------------


def test_free_fall_is_exact_for_any_step(apollo: LunarModule) -> None:
    for step_s in (0.002, 0.005, 0.02):
        end = run(Lander2D(apollo, start(z=500.0, vz=3.0), step_s=step_s), 10.0)
        assert end.z_m == pytest.approx(500.0 + 30.0 - 0.81 * 100.0, abs=1e-9)
        assert end.vz_mps == pytest.approx(3.0 - 16.2, abs=1e-10)


def test_throw_at_45_degrees_reaches_ballistic_range(apollo: LunarModule) -> None:
    speed = 10.0 * math.sqrt(0.5)
    plant = Lander2D(apollo, start(z=100.0, vx=speed, vz=speed))
    apex = max(run(plant, 0.005).z_m for _ in range(1745))
    landing = run(plant, 0.005)
    assert apex == pytest.approx(100.0 + 15.432, abs=0.001)
    assert landing.x_m == pytest.approx(61.728, abs=0.005)  # at 8.7300 s; the arc ends at 8.7297 s
    assert landing.z_m == pytest.approx(100.0, abs=0.005)


def test_free_fall_keeps_rate(apollo: LunarModule) -> None:
    end = run(Lander2D(apollo, start(z=500.0, rate=0.3)), 10.0)
    assert end.rate_radps == pytest.approx(0.3, abs=1e-12)
    assert end.attitude_rad == pytest.approx(3.0, abs=1e-10)


def test_full_thrust_equals_rocket_equation(apollo: LunarModule) -> None:
    # With a small tank: with a full one it would leave the region at 2409 m/s.
    space = replace(apollo, gravity_mps2=1e-9, throttle_lag_s=0.0)
    plant = Lander2D(space, start(z=9_000.0, vz=-200.0, mass=15103.0, fuel=800.0))
    before = pose(plant).vz_mps
    end = run(plant, 60.0, EngineCommand(1.0))
    assert plant.fuel_kg == 0.0
    assert end.vz_mps - before == pytest.approx(apollo.exhaust_mps * math.log(15103.0 / 14303.0), rel=1e-6)


def test_upright_burn_equals_closed_form(apollo: LunarModule) -> None:
    from snr_sim.plants.lander.descent import Motion, propagate

    plant = Lander2D(replace(apollo, throttle_lag_s=0.0), start(z=500.0, vz=-30.0))
    end = run(plant, 10.0, EngineCommand(0.5))
    exact = propagate(Motion(500.0, -30.0, 7500.0), 0.5 * apollo.thrust_n, apollo.exhaust_mps, 1.62, 10.0)
    assert end.z_m == pytest.approx(exact.height_m, abs=1e-5)
    assert end.vz_mps == pytest.approx(exact.velocity_mps, abs=1e-6)


def test_gimbal_and_jets_turn_with_documented_sign(apollo: LunarModule) -> None:
    jets = run(Lander2D(apollo, start()), 1.0, EngineCommand(0.0, 0.0, 0.5))
    assert jets.rate_radps == pytest.approx(0.5 * apollo.jets_nm / (7500.0 * apollo.gyration_m**2), rel=0.01)
    gimbal = run(Lander2D(apollo, start()), 1.0, EngineCommand(0.3, 0.05, 0.0))
    assert gimbal.rate_radps > 0.0
    tilted = run(Lander2D(apollo, start(tilt=0.1)), 1.0, EngineCommand(0.3))
    assert tilted.vx_mps < 0.0  # positive attitude: the nose, and the push, to -x


def test_throttle_snaps_to_allowed_range(apollo: LunarModule) -> None:
    plant = Lander2D(apollo, start())
    for command, runs_at in ((0.04, 0.0), (0.06, 0.1), (0.35, 0.35), (0.79, 0.6), (0.81, 1.0), (7.0, 1.0), (-1.0, 0.0)):
        run(plant, 2.0, EngineCommand(command))
        assert plant.throttle == runs_at


def test_thrust_lags_and_gimbal_is_rate_limited(apollo: LunarModule) -> None:
    plant = Lander2D(apollo, start())
    run(plant, apollo.throttle_lag_s, EngineCommand(0.5, 1.0))
    assert plant.throttle == pytest.approx(0.5 * (1.0 - math.exp(-1.0)), rel=1e-6)
    assert plant.gimbal_rad == pytest.approx(apollo.throttle_lag_s * apollo.gimbal_rate_radps)
    run(plant, 2.0)
    assert plant.gimbal_rad == apollo.gimbal_rad


def test_gimbal_turns_while_engine_is_off(apollo: LunarModule) -> None:
    plant = Lander2D(apollo, start())
    end = run(plant, 2.0, EngineCommand(0.0, -0.05))
    assert plant.gimbal_rad == -0.05
    assert end.rate_radps == 0.0


def test_leaving_region_is_lost(apollo: LunarModule) -> None:
    plant = Lander2D(apollo, start(vx=100.0))
    run(plant, 5.0)
    assert (plant.outcome, plant.reason) == ("out_of_bounds", "it left the region that is simulated")


# -- ground -----------------------------------------------------------------------------------------------------------


def test_gentle_drop_rests_on_both_feet(apollo: LunarModule) -> None:
    plant = drop(apollo, height=1.0)
    run(plant, 8.0)
    assert plant.outcome == "landed"
    assert plant.touchdown is not None
    assert plant.touchdown["vertical_mps"] == pytest.approx(1.8, abs=0.01)
    assert plant.read("inertial").contact == [True, True]
    sag = 7500.0 * 1.62 / (2.0 * apollo.leg.spring_npm)
    assert pose(plant).z_m == pytest.approx(3.6 - sag, abs=0.005)


@pytest.mark.parametrize(
    "how", [{"vz": -3.2}, {"vx": 1.3}, {"vz": -2.5, "vx": 1.2}, {"tilt": 0.12}, {"rate": 0.04}], ids=str
)
def test_touchdown_beyond_gear_limits_is_crashed(apollo: LunarModule, how: dict[str, float]) -> None:
    plant = drop(apollo, height=0.1 + 3.3 * abs(how.get("tilt", 0.0)), **how)
    run(plant, 8.0)
    assert plant.outcome == "crashed"
    assert plant.touchdown is not None
    assert plant.reason == "; ".join(apollo.gear.exceeded_limits(plant.touchdown)) != ""


def test_crash_with_dry_tank_is_out_of_fuel(apollo: LunarModule) -> None:
    plant = drop(apollo, height=50.0, fuel=0.0)
    run(plant, 12.0, EngineCommand(1.0))
    assert plant.outcome == "out_of_fuel"


def test_head_first_contact_of_hull_is_crashed(apollo: LunarModule) -> None:
    plant = drop(replace(apollo, gear=FORGIVING), height=3.0, tilt=math.pi)
    run(plant, 8.0)
    assert (plant.outcome, plant.reason) == ("crashed", "the hull met the ground")
    assert pose(plant).z_m == pytest.approx(3.1, abs=0.05)


def test_rest_on_slope_is_parallel_to_slope(apollo: LunarModule) -> None:
    plant = drop(apollo, height=0.6, ground=SLOPE)
    run(plant, 15.0)
    assert plant.outcome == "landed"
    assert pose(plant).attitude_rad == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize("ground", [FLAT, SLOPE], ids=["flat", "slope"])
@pytest.mark.parametrize("step_s", [0.0025, 0.005, 0.01, 0.02])
@pytest.mark.parametrize(
    "how", [{"vz": -2.0}, {"vz": -1.5, "vx": 1.0, "tilt": 0.08, "rate": 0.03}], ids=["plumb", "askew"]
)
def test_bouncing_leg_does_not_gain_energy(
    apollo: LunarModule, ground: Terrain, step_s: float, how: dict[str, float]
) -> None:
    springy = replace(apollo, gear=FORGIVING, leg=replace(apollo.leg, damper_nspm=3e3))
    plant = drop(springy, height=0.9, step_s=step_s, ground=ground, **how)
    fall = energy(plant) - 7500.0 * 1.62 * 3.5
    min_energy = energy(plant)
    for _ in range(round(12.0 / step_s)):
        plant.step(step_s)
        if plant.outcome:
            break
        now = energy(plant)
        assert now <= min_energy + 5e-5 * fall  # what rounding and the step leave; it does not add up
        min_energy = min(min_energy, now)
    assert min_energy < energy(drop(springy, height=0.9, ground=ground, **how)) - 0.3 * fall


def test_undamped_leg_keeps_energy(apollo: LunarModule) -> None:
    springy = replace(apollo, gear=FORGIVING, leg=replace(apollo.leg, damper_nspm=0.0))
    plant = drop(springy, height=1.0)
    before = energy(plant)
    run(plant, 60.0)
    assert energy(plant) == pytest.approx(before, rel=2e-3)


# -- repeatability ----------------------------------------------------------------------------------------------------


def test_snapshot_before_crash_repeats_crash(apollo: LunarModule) -> None:
    plant = drop(replace(apollo, gear=FORGIVING), height=1.0, tilt=math.pi)
    held = plant.snapshot()
    run(plant, 5.0)
    first = plant.snapshot()
    plant.restore(held)
    run(plant, 5.0)
    assert plant.outcome == "crashed"
    assert plant.snapshot() == first


# -- wrong input ------------------------------------------------------------------------------------------------------


def test_non_finite_state_raises_with_time(apollo: LunarModule) -> None:
    plant = Lander2D(apollo, start(z=1000.0))
    held = plant.snapshot()
    plant.restore(held._replace(body=held.body._replace(rate_radps=math.nan)))
    with pytest.raises(PlantError, match=r"At 0\.\d+ s the state is no longer finite"):
        run(plant, 1.0, EngineCommand(0.5, 0.1, 1.0))
