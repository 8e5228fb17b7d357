"""The rover as a plant: its contract, what it meets, and what is refused."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.plants.ground.dc_motor import MODES
from snr_sim.plants.ground.height_map import HeightMap, flat, make_hills, ramp
from snr_sim.plants.ground.rocks import Ledge, Rock
from snr_sim.plants.ground.rover import Rover, RoverStart
from snr_sim.plants.ground.rover_2d import Rover2D
from snr_sim.plants.ground.rover_file import read_rover
from snr_sim.plants.ground.rover_vehicle import RockerBogie, RoverVehicle, Wheel
from snr_sim.plants.ground.terramechanics import DRY_SAND, Coulomb
from snr_sim.prelude.errors import ParameterError, PlantError, UnknownNameError
from snr_sim.prelude.ground_signals import DriveCommand
from snr_sim.testing.contracts import check_plant
from tests.lanes import slow

FILE = Path(__file__).parents[2] / "robots" / "rover" / "vehicles" / "competition.toml"
VEHICLE = read_rover(FILE)
AHEAD = DriveCommand("speed", [5.0] * 6)
ROCKS = (Rock((0.8, 0.38, -0.1), 0.18), Ledge((0.8, -0.38, 0.0), (0.1, 0.1, 0.03)))
BODIES: tuple[Any, ...] = (Rover, Rover2D)
WORLDS: dict[str, Callable[..., Any]] = {
    "hills": lambda body=Rover: made(make_hills(3, 0.4), body=body),
    "sand": lambda body=Rover: made(flat(), soil=DRY_SAND, body=body),
    "rocks": lambda body=Rover: made(flat(), rocks=ROCKS, body=body),
}


def made(
    ground: HeightMap, soil: object = None, rocks: tuple[Rock | Ledge, ...] = (), body: Any = Rover, **start: object
) -> Any:
    return body(
        VEHICLE,
        ground,
        lambda seed: RoverStart(heading_rad=0.1 * seed, **start),
        soil,
        rocks,  # type: ignore[arg-type]
    )


def go(rover: Rover, seconds: float, command: DriveCommand | None = None) -> Rover:
    if command is not None:
        rover.write("drive", command)
    for _ in range(round(seconds / rover.step_s)):
        rover.step(rover.step_s)
    return rover


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("world", WORLDS)
def test_rover_implements_plant(world: str, body: type[Rover]) -> None:
    check_plant(lambda: WORLDS[world](body), {"drive": AHEAD})


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize(
    ("world", "mode"),
    [
        *((world, "speed") for world in WORLDS),
        ("hills", "current"),
        ("hills", "brake"),
        *(slow(world, mode) for world in ("sand", "rocks") for mode in ("current", "brake")),
        *(slow(world, "duty") for world in WORLDS),
    ],
)
def test_restored_run_continues_bit_for_bit(world: str, mode: str, body: type[Rover]) -> None:
    value = {"speed": 8.0, "current": 3.0, "duty": 0.9, "brake": 4.0}[mode]
    rover = go(go(WORLDS[world](body), 0.3, AHEAD), 0.301, DriveCommand(mode, [value] * 5 + [-value]))
    then = rover.snapshot()
    expected = go(rover, 0.4).snapshot(), rover.truth(), rover.read("motor_RB")
    other = WORLDS[world](body)
    go(other, 0.1, DriveCommand("duty", [1.0] * 6))
    other.restore(then)
    assert (go(other, 0.4).snapshot(), other.truth(), other.read("motor_RB")) == expected


@pytest.mark.parametrize("body", BODIES)
def test_motor_that_is_commanded_alone_leaves_the_others_as_they_are(body: type[Rover]) -> None:
    one_by_one, at_once = made(flat(), body=body), go(made(flat(), body=body), 0.1, AHEAD)
    for name, value in zip(one_by_one.inputs[1:], AHEAD.values, strict=True):
        one_by_one.write(name, DriveCommand(AHEAD.mode, [value]))
    assert go(one_by_one, 0.1).snapshot() == at_once.snapshot()
    for rover in (one_by_one, at_once):
        rover.write("motor_LM", DriveCommand())  # it brakes
    then = at_once.snapshot()
    currents_a = [go(one_by_one, 0.1).read(name).current_a for name in at_once.inputs[1:]]
    assert currents_a[1] == 0.0, "a brake is friction"
    assert min(currents_a[:1] + currents_a[2:]) > 0.1, "the others push against it"
    go(at_once, 0.2, AHEAD).restore(then)
    assert go(at_once, 0.6).snapshot() == one_by_one.snapshot()


@pytest.mark.parametrize("body", BODIES)
def test_rover_stands_on_a_slope_without_a_jolt(body: type[Rover]) -> None:
    rover = made(ramp((0.2, -0.1)), position_m=(3.0, 2.0), body=body)
    rover.write("drive", DriveCommand("brake", [6.0] * 6))
    fastest = 0.0
    for _ in range(1000):
        rover.step(rover.step_s)
        fastest = max(fastest, rover.truth()["values"]["speed_mps"])
    assert fastest < 0.02
    assert rover.truth()["values"]["speed_mps"] < 0.01


@pytest.mark.parametrize(("height_m", "is_climbed"), [(0.08, True), (0.2, False)])
def test_rover_climbs_low_ledges_and_is_stopped_by_high_ones(height_m: float, is_climbed: bool) -> None:
    """Its front wheels carry 137 N, and their motors lift 92 N: above about a wheel's radius it stays below."""
    ledge = Ledge((2.0, 0.0, 0.5 * height_m), (1.0, 2.0, 0.5 * height_m))
    rover = go(made(flat(), rocks=(ledge,)), 8.0, DriveCommand("speed", [2.0] * 6))
    x, _, z = rover.read("pose").position_m
    assert (x > 1.5, z > 0.9 * height_m) == (is_climbed, is_climbed)
    assert rover.contacts.hits >= 2
    assert rover.contacts.hit_n > 100.0


def test_slippery_ledge_lets_wheels_spin() -> None:
    """Friction of an obstacle counts, also where it is lower than that of MuJoCo's own default."""
    plate = Ledge((0.0, 0.0, 0.0), (3.0, 3.0, 0.05), friction=0.05)
    rover = go(made(flat(), rocks=(plate,)), 0.5, DriveCommand("current", [6.0] * 6))
    assert rover.speed_mps == pytest.approx(0.05 * 9.81 * 0.5, rel=0.1)


def test_belly_rests_on_a_crest() -> None:
    """Two slopes of 24 degrees meet under a chassis that hangs lower than the hill is high between the wheels."""
    along = [0.25 * i for i in range(-40, 41)]
    crest = HeightMap([[-0.45 * abs(x) for x in along] for _ in along], 0.25, (along[0], along[0]))
    rover = Rover(replace(VEHICLE, center_m=(0.0, 0.0, 0.25)), crest, lambda seed: RoverStart())
    go(rover, 1.0, DriveCommand("brake", [6.0] * 6))
    upwards = zip(rover.contacts.planes, rover.contacts.read_loads(), strict=True)
    carried_n = sum(plane[5] * load_n for plane, load_n in upwards)
    assert carried_n < 0.9 * VEHICLE.mass_kg * 9.81, "the belly carries the rest"
    assert rover.contacts.hits == 0, "the ground is not a rock"
    lowest_m = rover.read("pose").position_m[2] + 0.25 - 0.5 * VEHICLE.size_m[2]
    assert lowest_m > crest.at(0.0, 0.0)[0] - 0.02


@pytest.mark.parametrize("body", BODIES)
def test_soil_changes_where_its_map_says(body: type[Rover]) -> None:
    rover = made(flat(), soil=lambda x_m, y_m: DRY_SAND if x_m > 1.5 else Coulomb(0.8), body=body)
    go(rover, 2.0, AHEAD)
    firm = rover.truth()["values"]["speed_mps"]
    go(rover, 6.0)
    assert rover.read("pose").position_m[0] > 2.5
    assert rover.truth()["values"]["speed_mps"] < 0.8 * firm, "wheels slip in sand"


@pytest.mark.parametrize("body", BODIES)
def test_resistance_of_sand_ends_where_the_sand_ends(body: type[Rover]) -> None:
    slow = DriveCommand("speed", [4.0] * 6)
    out_of_sand = made(flat(), soil=lambda x_m, y_m: DRY_SAND if x_m < 0.7 else Coulomb(0.8), body=body)
    found = [go(rover, 6.0, slow).read("power").current_a for rover in (out_of_sand, made(flat(), body=body))]
    assert out_of_sand.read("pose").position_m[0] > 1.2, "all wheels are on firm ground"
    assert found[0] == pytest.approx(found[1], rel=0.001)


@pytest.mark.parametrize("body", BODIES)
def test_caster_slides_without_friction(body: type[Rover]) -> None:
    wheels = (
        *(replace(wheel, hangs_on="chassis") for wheel in VEHICLE.wheels if wheel.name in ("LM", "RM")),
        Wheel("C", (-0.44, 0.01, 0.13), 0.13, 0.05, 0.5, friction_scale=0.0),
    )
    cart = replace(VEHICLE, wheels=wheels, suspension=None, center_of_mass_m=(-0.1, 0.0, 0.2))
    rover = body(cart, flat(), lambda seed: RoverStart())
    go(rover, 3.0, DriveCommand("speed", [-3.0, 3.0, 0.0]))
    turn = rover.read("imu").rate_radps[2]
    assert turn == pytest.approx(3.0 * 0.1255 / 0.38, rel=0.05), "two wheels alone decide how it turns"


@pytest.mark.parametrize("body", BODIES)
def test_empty_battery_stops_the_motors(body: type[Rover]) -> None:
    rover = made(flat(), charge=1e-5, body=body)
    go(rover, 4.0, AHEAD)
    assert rover.read("power").voltage_v == 0.0
    assert abs(rover.read("motor_LF").current_a) < 1e-6
    assert rover.truth()["values"]["speed_mps"] < 0.3


@pytest.mark.parametrize("body", BODIES)
def test_readings_are_of_the_motion(body: type[Rover]) -> None:
    rover = go(made(flat(), body=body), 4.0, AHEAD)
    left = rover.read("motor_LF")
    assert left.speed_radps == pytest.approx(5.0, rel=0.01)
    assert left.turned_rad == pytest.approx(20.0, rel=0.05)
    assert 0.0 < left.duty < 0.3
    imu = rover.read("imu")
    assert imu.specific_force_mps2 == pytest.approx([0.0, 0.0, 9.80665], abs=0.02)
    assert imu.field_ut == pytest.approx([0.0, 20.0, -44.0], abs=0.1)
    assert rover.read("pose").position_m[0] == pytest.approx(20.0 * 0.1255, rel=0.05)
    assert json.loads(json.dumps(rover.truth()))["values"]["speed_mps"] == pytest.approx(5.0 * 0.1255, rel=0.01)


@pytest.mark.parametrize("body", BODIES)
def test_scene_shows_each_body_of_the_truth(body: type[Rover]) -> None:
    rover = WORLDS["rocks"](body)
    scene = rover.scene()
    assert set(scene["bodies"]) == set(rover.truth()["poses"])
    assert {"ground", "obstacle_0", "obstacle_1"} == set(scene["statics"])
    json.dumps(scene)


commands = st.builds(
    DriveCommand, st.sampled_from(MODES), st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=6) | st.just([])
)


@given(st.lists(commands, max_size=6), st.sampled_from(sorted(WORLDS)), st.sampled_from(BODIES))
def test_any_commands_leave_a_rover_that_moves_as_its_motors_can(
    given_: list[DriveCommand], world: str, body: type[Rover]
) -> None:
    rover = WORLDS[world](body)
    for command in given_:
        charge = rover.read("power").charge
        go(rover, 0.05, command)
        x, y, z = rover.read("pose").position_m
        assert abs(z - rover.ground.at(x, y)[0]) < 0.5
        assert rover.speed_mps < 4.0
        assert max(abs(rover.read(name).current_a) for name in rover.outputs if "motor" in name) < 6.0 + 1e-9
        assert rover.read("power").charge <= charge


# -- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize(
    ("name", "command", "error", "message"),
    [
        ("drve", AHEAD, UnknownNameError, "did you mean 'drive'"),
        ("drive", DriveCommand("sped", [0.0] * 6), UnknownNameError, "did you mean 'speed'"),
        ("drive", DriveCommand("speed", [0.0] * 5), PlantError, "send 6 finite numbers"),
        ("drive", DriveCommand("speed", [math.nan] * 6), PlantError, "send 6 finite numbers"),
        ("drive", DriveCommand("duty", [math.inf] * 6), PlantError, "send 6 finite numbers"),
        ("motor_LF", DriveCommand("speed", [0.0] * 6), PlantError, "send one finite number"),
        ("motor_XF", DriveCommand("speed", [0.0]), UnknownNameError, "did you mean 'motor_"),
    ],
)
def test_invalid_command_is_refused_and_changes_nothing(
    name: str, command: DriveCommand, error: type[Exception], message: str, body: type[Rover]
) -> None:
    rover = go(made(flat(), body=body), 0.1, AHEAD)
    before = rover.snapshot()
    with pytest.raises(error, match=message):
        rover.write(name, command)
    assert rover.snapshot() == before


def test_state_that_is_not_finite_is_reported_with_its_joint() -> None:
    rover = go(made(flat()), 0.1, AHEAD)
    rover._data.qvel[2] = math.inf
    with pytest.raises(PlantError, match="the velocity of"):
        go(rover, 0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wheels": VEHICLE.wheels[:2]}, "at least three"),
        ({"wheels": (*VEHICLE.wheels[:5], VEHICLE.wheels[0])}, "each has its own"),
        ({"wheels": VEHICLE.wheels[:3]}, "list of wheels of the right bogie is"),
        ({"suspension": None}, "Wheel LF hangs on a rocker, and the rover has no suspension"),
        ({"inertia_kgm2": (1.0, 1.0, 3.0)}, "no body has more than the sum of two"),
        ({"chassis_kg": 29_000.0}, "chassis_kg is 29000.0: grams"),
        ({"motor": "strong"}, "The rover's motor is 'strong'"),
    ],
)
def test_impossible_vehicle_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        replace(VEHICLE, **change)  # type: ignore[arg-type]


def test_wheel_and_suspension_are_checked() -> None:
    wheel = VEHICLE.wheels[0]
    for change, message in (
        ({"radius_m": 130}, "radius_m is 130: millimetres"),
        ({"name": "front left"}, 'as "LF"'),
        ({"hangs_on": "bogey"}, '"chassis", "rocker" or "bogie"'),
        ({"position_m": (0.4, 0.0, 0.13)}, "y is not 0"),
    ):
        with pytest.raises(ParameterError, match=message):
            replace(wheel, **change)
    with pytest.raises(ParameterError, match="limit_rad is 30: degrees"):
        RockerBogie((0.1, 0.3), (-0.2, 0.2), 1.0, 1.0, 30)


@pytest.mark.parametrize("body", BODIES)
def test_too_rough_ground_and_odd_starts_are_refused(body: type[Rover]) -> None:
    with pytest.raises(ParameterError, match=r"wheel LF a radius of 0\.13 m"):
        made(make_hills(1, relief_m=1.0, length_m=1.0, spacing_m=0.1), body=body)
    with pytest.raises(ParameterError, match="return a RoverStart"):
        body(VEHICLE, flat(), lambda seed: (0.0, 0.0))  # type: ignore[arg-type, return-value]
    with pytest.raises(ParameterError, match=r"moves in steps of 0\.002 s"):
        made(flat(), body=body).step(0.005)


@pytest.mark.parametrize(
    ("text", "change", "message"),
    [
        ("gear = 19.0", "gaer = 19.0", "motor has 'gaer'. *\n.*did you mean 'gear'"),
        ("gear = 19.0", "", "missing required field `gear`"),
        ("radius_m = 0.13", "radius_m = 130", "radius_m is 130.0: millimetres"),
        ("cells = 6", 'cells = "six"', r"Expected `int`, got `str` - at `\$.battery.cells`"),
        ("[motor]", "[motr]", "the file has 'motr'"),
        ("[suspension]", "[suspension", "cannot be read: Expected ']'"),
        ("limit_a = 6.0", "limit_a = true", "got `bool`"),
    ],
)
def test_mistake_in_a_file_is_reported_with_its_name(tmp_path: Path, text: str, change: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(FILE.read_text(encoding="utf-8").replace(text, change, 1), encoding="utf-8")
    with pytest.raises(ParameterError, match=message) as caught:
        read_rover(path)
    assert "mine.toml" in str(caught.value)


def test_missing_file_and_one_that_is_not_utf8_are_reported(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="No such file"):
        read_rover(tmp_path / "mine.toml")
    (tmp_path / "odd.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ParameterError, match="cannot be read"):
        read_rover(tmp_path / "odd.toml")


def test_file_is_the_vehicle_of_its_numbers() -> None:
    assert isinstance(VEHICLE, RoverVehicle)
    assert VEHICLE.mass_kg == pytest.approx(43.0)
    assert [wheel.name for wheel in VEHICLE.wheels] == ["LF", "LM", "LB", "RF", "RM", "RB"]
