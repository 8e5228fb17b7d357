"""Both engines simulate the same module: same commands, same result. Each tolerance has its reason as a comment.

In flight the two differ by rounding and by the feet, which weigh something in MuJoCo and sag under thrust: the springs
let them by up to a millimetre, and the hull answers by a hundredth of that.
On the ground they differ by what a foot is: MuJoCo stops its 20 kg at once where the plane has none to stop (1 % of the
speed), and lets it spring back with the damper's 0.13 s where the plane's foot is down again as soon as the ground is.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest

from snr_sim.plants.lander.descent import Motion, propagate
from snr_sim.plants.lander.gear import GearLimits
from snr_sim.plants.lander.lander import Lander
from snr_sim.plants.lander.lander_2d import Lander2D
from snr_sim.plants.lander.lander_3d import Lander3D
from snr_sim.plants.lander.legs import BodyPose
from snr_sim.plants.lander.module import LunarModule, PlaneStart
from snr_sim.plants.lander.terrain import FLAT, Terrain, make_terrain
from snr_sim.prelude.errors import MissingExtraError, ParameterError, PlantError, UnknownNameError
from snr_sim.prelude.signals import EngineCommand, InertialReading

Program = Sequence[tuple[float, EngineCommand]]
HILLS = make_terrain(11, relief_m=14.0, pad_slope_rad=0.08)
SLOPE = make_terrain(3, relief_m=0.0, pad_slope_rad=0.1)
# Metres, radians, and these per second.
IN_FLIGHT = BodyPose(5e-4, 5e-4, 5e-5, 3e-4, 3e-4, 5e-5)
IN_CONTACT = BodyPose(0.04, 0.02, 0.005, 0.1, 0.1, 0.1)
each = pytest.mark.parametrize("which", [0, 1], ids=["pymunk", "mujoco"])  # of what `both` returns
AT_REST = BodyPose(0.035, 0.004, 0.003, 0.001, 0.001, 0.001)  # by a centimetre, where in a step a foot touches decides


def both(
    module: LunarModule, x: float = 0.0, z: float = 400.0, vx: float = 0.0, vz: float = 0.0, tilt: float = 0.0,
    rate: float = 0.0, fuel: float = 600.0, ground: Terrain = FLAT,
) -> tuple[Lander, Lander]:  # fmt: skip
    def start(seed: int) -> tuple[PlaneStart, Terrain]:
        return PlaneStart((x, z), (vx, vz), 7500.0, fuel, tilt, rate), ground

    return Lander2D(module, start), Lander3D(module, start)


def pose(plant: Lander) -> BodyPose:
    reading = plant.read("inertial")
    assert isinstance(reading, InertialReading)
    (x, z), (vx, vz) = reading.position_m, reading.velocity_mps
    return BodyPose(x, z, reading.attitude_rad, vx, vz, reading.rate_radps)


def simulate(plants: tuple[Lander, Lander], time_s: float, program: Program = ()) -> BodyPose:
    """The largest difference between the two during the run."""
    max_errors = [0.0] * 6
    commands = {round(at_s / 0.005): command for at_s, command in program}
    for i in range(round(time_s / 0.005)):
        for plant in plants:
            if i in commands:
                plant.write("engine", commands[i])
            plant.step(0.005)
        max_errors = [max(worst, abs(a - b)) for worst, a, b in zip(max_errors, *map(pose, plants), strict=True)]
    return BodyPose(*max_errors)


def go(plant: Lander, time_s: float, command: EngineCommand | None = None) -> BodyPose:
    if command is not None:
        plant.write("engine", command)
    for _ in range(round(time_s / 0.005)):
        plant.step(0.005)
    return pose(plant)


def check(found: BodyPose, allowed: BodyPose) -> None:
    for name, value, limit in zip(BodyPose._fields, found, allowed, strict=True):
        assert value <= limit, f"{name} differs by {value:.2e}"


def test_free_fall_equals_closed_form_in_both(apollo: LunarModule) -> None:
    plants = both(apollo, vx=3.0, rate=0.02)
    # Rounding alone: nothing pushes, so nothing sags.
    check(simulate(plants, 10.0), BodyPose(1e-8, 1e-8, 1e-8, 1e-7, 1e-7, 1e-8))
    for plant in plants:
        assert pose(plant) == pytest.approx((30.0, 319.0, 0.2, 3.0, -16.2, 0.02), abs=1e-6)


def test_burn_equals_closed_form_in_both(apollo: LunarModule) -> None:
    plants = both(apollo)
    check(simulate(plants, 10.0, [(0.0, EngineCommand(1.0))]), IN_FLIGHT)
    exact = propagate(Motion(400.0, 0.0, 7500.0), apollo.thrust_n, apollo.exhaust_mps, 1.62, 10.0)
    for plant in plants:
        lag_s = apollo.throttle_lag_s  # full thrust acts as if it came so much later
        late_mps = apollo.thrust_n / 7500.0 * lag_s
        assert pose(plant).vz_mps == pytest.approx(exact.velocity_mps - late_mps, abs=0.05)
        assert plant.fuel_kg == plants[0].fuel_kg


PROGRAMS = {
    "jets": [(0.0, EngineCommand(attitude=0.3)), (2.0, EngineCommand(attitude=-0.3)), (4.0, EngineCommand())],
    "gimbal": [(0.0, EngineCommand(0.5, 0.02)), (1.5, EngineCommand(0.5, -0.02)), (3.0, EngineCommand(0.3))],
    "all": [
        (0.0, EngineCommand(0.5, 0.02, 0.2)), (1.5, EngineCommand(0.5, -0.02, 0.1)),
        (3.0, EngineCommand(0.3, 0.0, -0.5)), (6.0, EngineCommand(1.0)),
    ],
}  # fmt: skip


@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_turning_flight_is_equal_in_both(apollo: LunarModule, program: Program) -> None:
    check(simulate(both(apollo, vx=3.0, vz=-4.0, tilt=0.05, rate=0.02), 8.0, program), IN_FLIGHT)


def test_full_turn_is_equal_in_both(apollo: LunarModule) -> None:
    plants = both(apollo, rate=1.0)
    # At 1 rad/s the feet of MuJoCo move out by a millimetre: 4e-5 more inertia, of 12 rad.
    check(simulate(plants, 12.0), IN_FLIGHT._replace(attitude_rad=1e-3))
    assert [pose(plant).attitude_rad for plant in plants] == pytest.approx([12.0, 12.0], abs=1e-3)


@pytest.mark.parametrize("body", [Lander2D, Lander3D])
def test_half_step_quarters_error_with_command_jumps(apollo: LunarModule, body: type[Lander2D | Lander3D]) -> None:
    """Throttle, gimbal and jets change at once, four times; a command that acted half a step late would halve it."""
    program = [(0.0, EngineCommand(0.5, 0.02, 0.2)), (0.8, EngineCommand(0.2, -0.02, -0.3)),
               (1.6, EngineCommand(1.0, 0.0, 0.1)), (2.4, EngineCommand(0.3))]  # fmt: skip

    def flight(step_s: float) -> BodyPose:
        start = PlaneStart((0.0, 400.0), (3.0, -4.0), 7500.0, 600.0, 0.05, 0.02)
        plant = body(apollo, lambda seed: (start, FLAT), step_s=step_s)
        commands = {round(at_s / step_s): command for at_s, command in program}
        for i in range(round(3.2 / step_s)):
            if i in commands:
                plant.write("engine", commands[i])
            plant.step(step_s)
        return pose(plant)

    exact, coarse, fine = (flight(step_s) for step_s in (0.00125, 0.02, 0.01))
    for name, a, b, c in zip(BodyPose._fields, coarse, fine, exact, strict=True):
        assert (a - c) / (b - c) == pytest.approx(4.06, abs=0.1), name  # 4, and what the finest still leaves


@each
@pytest.mark.parametrize("steps", [1, 7, 200])
def test_jets_act_from_command_to_next_command(apollo: LunarModule, which: int, steps: int) -> None:
    plant, time_s = both(apollo)[which], 0.005 * steps
    end = go(plant, time_s, EngineCommand(attitude=0.4))
    gains = 0.4 * apollo.jets_nm / (7500.0 * apollo.gyration_m**2)
    # In MuJoCo the feet lag: by 7e-6 rad/s. Half a step late would be 1.6e-4.
    assert (end.rate_radps, end.attitude_rad) == pytest.approx((gains * time_s, 0.5 * gains * time_s**2), abs=1e-5)
    later = go(plant, 1.0, EngineCommand())
    assert later.attitude_rad - end.attitude_rad == pytest.approx(gains * time_s, abs=1e-5)


LANDINGS: dict[str, dict[str, float | Terrain]] = {
    "plumb": {"z": 4.2},
    "askew": {"z": 4.0, "vx": 0.4, "tilt": 0.03, "rate": 0.01},
    "sliding": {"z": 4.0, "vx": -0.8, "vz": -1.0, "tilt": -0.05},
    "on a slope": {"z": 4.7, "ground": SLOPE},
}


@pytest.mark.parametrize("how", LANDINGS.values(), ids=LANDINGS)
def test_touchdown_and_rest_are_equal_in_both(apollo: LunarModule, how: dict[str, float]) -> None:
    plants = both(apollo, **how)  # type: ignore[arg-type]
    check(simulate(plants, 10.0), IN_CONTACT)
    plane, space = plants
    assert plane.outcome == space.outcome == "landed"
    assert plane.touchdown is not None
    # Judged before legs push: as in flight.
    assert space.touchdown == pytest.approx(plane.touchdown, abs=1e-3)
    check(BodyPose(*(abs(a - b) for a, b in zip(pose(plane), pose(space), strict=True))), AT_REST)


@pytest.mark.parametrize(
    "how",
    [{"z": 3.7, "vz": -3.2}, {"z": 3.7, "vx": 1.3}, {"z": 4.2, "tilt": 0.12}, {"z": 3.7, "rate": 0.04},
     {"z": 53.0, "fuel": 0.0}, {"z": 6.0, "tilt": math.pi}, {"z": 200.0, "vx": 100.0}],
    ids=str,
)  # fmt: skip
def test_crash_has_same_reason_in_both(apollo: LunarModule, how: dict[str, float]) -> None:
    plane, space = plants = both(apollo, **how)
    simulate(plants, 10.0)
    assert plane.outcome in ("crashed", "out_of_fuel", "out_of_bounds")
    assert (space.outcome, space.reason.split(" is ")[0]) == (plane.outcome, plane.reason.split(" is ")[0])


@each
def test_truth_is_equal_in_both(apollo: LunarModule, which: int) -> None:
    plants = both(apollo, x=5.0, z=90.0, tilt=0.2)
    simulate(plants, 1.0, [(0.0, EngineCommand(0.5, 0.03, 0.4))])
    plane, shown = plants[0].truth(), plants[which].truth()
    assert shown["values"] == pytest.approx(plane["values"], abs=1e-3)
    assert shown["poses"]["module"] == pytest.approx(plane["poses"]["module"], abs=1e-3)
    assert set(shown["vectors"]) == set(plane["vectors"])
    for name, arrow in plane["vectors"].items():
        assert shown["vectors"][name] == pytest.approx(arrow, rel=1e-4, abs=1e-3)


def test_radar_over_hills_is_equal_in_both(apollo: LunarModule) -> None:
    plants = both(apollo, x=60.0, z=120.0, vx=20.0, ground=make_terrain(5, relief_m=14.0))
    read: list[Callable[[str], object]] = [plant.read for plant in plants]
    for _ in range(5):
        simulate(plants, 1.0)
        plane, space = (radar("radar") for radar in read)
        assert plane.altitude_m == pytest.approx(space.altitude_m, abs=1e-6)  # type: ignore[attr-defined]


@each
@pytest.mark.parametrize(("slope_deg", "outcome"), [(-33.0, "tilted"), (14.0, "tilted"), (10.0, "landed")])
def test_rest_beyond_tilt_limit_is_tilted(apollo: LunarModule, which: int, slope_deg: float, outcome: str) -> None:
    slope = math.radians(slope_deg)
    takes_any_contact = replace(apollo.gear, attitude_rad=math.pi, lateral_mps=9.0, rate_radps=9.0)
    grips = replace(apollo, gear=takes_any_contact, leg=replace(apollo.leg, friction=2.0))
    ground = make_terrain(3, relief_m=0.0, pad_slope_rad=slope)
    plant = both(grips, z=3.8 / math.cos(slope), tilt=slope, ground=ground)[which]
    stands = go(plant, 12.0)
    assert abs(math.degrees(stands.attitude_rad)) == pytest.approx(abs(slope_deg), abs=2.0)
    assert plant.outcome == outcome
    assert plant.reason.startswith("attitude at rest ") == (outcome == "tilted")


@each
def test_sliding_into_slope_tips_over(apollo: LunarModule, which: int) -> None:
    forgiving = replace(apollo, gear=GearLimits(99.0, 99.0, 99.0, math.pi, 9.0))
    steep = make_terrain(3, relief_m=0.0, pad_slope_rad=0.35)
    plant = both(forgiving, z=6.0, vx=4.0, vz=-2.0, rate=-0.5, ground=steep)[which]
    assert abs(go(plant, 15.0).attitude_rad) > 0.5
    assert plant.outcome == "crashed"
    assert plant.reason in ("the hull met the ground", "it tipped over on its legs")


@pytest.mark.parametrize("body", [Lander2D, Lander3D])
def test_half_step_moves_touchdown_little(apollo: LunarModule, body: type[Lander2D | Lander3D]) -> None:
    ends = []
    for step_s in (0.005, 0.0025):
        start = PlaneStart((0.0, 4.6), (0.4, 0.0), 7500.0, 600.0, 0.03, 0.01)
        plant = body(apollo, lambda seed, start=start: (start, FLAT), step_s=step_s)
        for _ in range(round(2.0 / step_s)):
            plant.step(step_s)
        assert plant.touchdown is not None
        ends.append((plant.touchdown, pose(plant)))
    (coarse, stands), (fine, stands_fine) = ends
    assert coarse["vertical_mps"] == pytest.approx(fine["vertical_mps"], abs=0.01)
    assert coarse["lateral_mps"] == pytest.approx(fine["lateral_mps"], abs=0.01)
    assert math.dist(stands[:2], stands_fine[:2]) < 0.01


# -- contract of both --------------------------------------------------------------------------------------------------


@each
def test_snapshot_in_contact_continues_bitwise_in_another_plant(apollo: LunarModule, which: int) -> None:
    plant = both(apollo, z=4.0, vx=0.4, vz=-1.0, tilt=0.03, ground=HILLS)[which]
    for _ in range(600):
        plant.step(0.005)
        if any(plant.read("inertial").contact):
            break
    go(plant, 0.1)
    assert any(plant.read("inertial").contact)
    assert plant.outcome is None
    held = plant.snapshot()

    def go_on(one: Lander) -> list[object]:
        one.restore(held)
        states: list[object] = []
        for i in range(500):
            go(one, 0.005, EngineCommand(0.2 if i < 100 else 0.0, 0.01, 0.05))
            states.append((one.snapshot(), one.truth(), one.read("inertial")))
        return states

    first = go_on(plant)
    assert go_on(plant) == first
    assert go_on(both(apollo)[which]) == first


@each
def test_restored_ended_run_stays_at_rest(apollo: LunarModule, which: int) -> None:
    plant = both(apollo, z=4.1)[which]
    stands = go(plant, 8.0)
    ended = plant.snapshot()
    assert stands[3:] == (0.0, 0.0, 0.0)
    plant.reset(0)
    plant.restore(ended)
    assert pose(plant) == stands
    assert plant.outcome == "landed"


@each
def test_reset_repeats_run(apollo: LunarModule, which: int) -> None:
    plant = both(apollo, z=5.6, vx=0.3, tilt=0.02)[which]
    go(plant, 3.0, EngineCommand(0.2, 0.02, 0.1))
    first = plant.snapshot()
    plant.reset(0)
    assert plant.time_s == 0.0
    go(plant, 3.0, EngineCommand(0.2, 0.02, 0.1))
    assert plant.snapshot() == first


@each
def test_commands_after_end_change_nothing(apollo: LunarModule, which: int) -> None:
    plant = both(apollo, z=4.1)[which]
    go(plant, 8.0)
    before = plant.snapshot()
    go(plant, 1.0, EngineCommand(1.0, 0.1, 1.0))
    assert plant.snapshot().body == before.body
    assert plant.fuel_kg == before.fuel_kg
    assert plant.truth()["vectors"]["thrust"][3:] == [0.0, 0.0, 0.0]


@each
@pytest.mark.parametrize("field", ["throttle", "gimbal_rad", "attitude"])
def test_non_finite_command_raises(apollo: LunarModule, which: int, field: str) -> None:
    with pytest.raises(PlantError, match=r"At 0 s the engine command is not finite: .*nan"):
        both(apollo)[which].write("engine", EngineCommand(**{field: math.nan}))


@each
def test_other_step_length_raises(apollo: LunarModule, which: int) -> None:
    with pytest.raises(ParameterError, match=r"steps of 0\.005 s"):
        both(apollo)[which].step(0.02)


@each
def test_unknown_name_raises_with_nearest_name(apollo: LunarModule, which: int) -> None:
    plant = both(apollo)[which]
    with pytest.raises(UnknownNameError, match="did you mean 'inertial'"):
        plant.read("inertia")
    with pytest.raises(UnknownNameError, match="did you mean 'engine'"):
        plant.write("engines", EngineCommand())


@pytest.mark.parametrize("package", ["pymunk", "mujoco"])
def test_missing_engine_raises_with_install_hint(
    apollo: LunarModule, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=r"snr_sim\[sim\]"):
        both(apollo)
