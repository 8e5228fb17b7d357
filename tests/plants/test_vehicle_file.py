from pathlib import Path

import numpy as np
import pytest

from snr_sim.plants.urov.vehicle_file import read_vehicle
from snr_sim.prelude.errors import ParameterError
from tests.plants.vehicles import HEAVY, VEHICLES

ADDED = "[6.3567, 7.1206, 18.6863, 0.1858, 0.1348, 0.2215]"
ASKEW = str([[float(i == j) for j in range(6)] for i in range(5)] + [[0.2, 0.0, 0.0, 0.0, 0.0, 1.0]])
TEXT = (VEHICLES / "benzon2022.toml").read_text(encoding="utf-8")


def changed(tmp_path: Path, old: str, new: str) -> Path:
    """The default set with one entry changed."""
    assert old in TEXT
    path = tmp_path / "mine.toml"
    path.write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["benzon2022", "wu2018", "classic"])
def test_each_number_of_each_file_has_a_source(name: str) -> None:
    vehicle = read_vehicle(VEHICLES / f"{name}.toml")
    assert vehicle.name == name
    assert set(vehicle.sources) == {
        "mass_kg", "inertia_kgm2", "volume_m3", "added_mass", "linear_damping", "quadratic_damping",
        "centre_of_mass_m", "centre_of_buoyancy_m", "size_m", "net_buoyancy_n", "thrusters",
    }  # fmt: skip
    assert all(len(source) > 10 for source in vehicle.sources.values())
    assert vehicle.centre_of_buoyancy_m[2] > vehicle.centre_of_mass_m[2]


def test_vectors_and_matrices_are_converted_from_frd(tmp_path: Path) -> None:
    vehicle = HEAVY
    assert vehicle.centre_of_buoyancy_m == (0.0, 0.0, 0.01)
    assert vehicle.thrusters[0].position_m == (0.156, -0.111, -0.085)
    assert vehicle.thrusters[0].direction == pytest.approx((0.5**0.5, 0.5**0.5, 0.0))
    rows = [[6.0, 0.5, 0.3, 0, 0.2, 0], [0.5, 7.0, 0, 0, 0, 0], [0.3, 0, 18.0, 0, 0, 0],
            [0, 0, 0, 0.2, 0, 0], [0.2, 0, 0, 0, 0.2, 0], [0, 0, 0, 0, 0, 0.2]]  # fmt: skip
    full = read_vehicle(changed(tmp_path, ADDED, str(rows)))
    signs = np.array([1, -1, -1, 1, -1, -1])
    assert full.added_mass == pytest.approx(np.array(rows) * np.outer(signs, signs))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("6.3567", "-6.3567", "added_mass of surge is -6.3567"),
        ("value = 13.5,", "value = -13.5,", "mass_kg is -13.5"),
        ("-0.01]", "0.01]", r"buoyancy 0\.01 m below its mass: it would turn over"),
        ('name = "T8"', 'name = "T7"', "more than one thruster named 'T7'"),
        ("direction = [0.70710678, -0.70710678, 0.0]", "direction = [0.0, 0.0, 0.0]", "Thruster 'T1'.* is 0 long"),
        ('mass_kg = { value = 13.5, source = "paper" }', "", "lacks mass_kg"),
        ('{ value = 13.5, source = "paper" }', "13.5", "which is not a value with a source"),
        ('{ value = 13.5, source = "paper" }', '{ value = 13.5, source = "rumour" }', "not a value with a source"),
        ('thrusters_source = "paper"', "", "the thrusters have no source"),
        ('frame = "FRD"', 'frame = "NED"', "has the frame 'NED'"),
        ("volume_m3", "volum_m3", "has 'volum_m3', which is not a key of a vehicle file"),
        ("lacks = []", 'lacks = ["pitch"]', "lack authority in no axis, the file says pitch"),
        ("about =", "about", "cannot be read"),
        ("value = 13.5,", "value = [13.5],", r"mine\.toml: mass_kg is \[13\.5\], which is not a number"),
        ("value = 13.5,", 'value = "13.5",', r"mine\.toml: mass_kg is '13\.5', which is not a number"),
        ("value = 13.5,", "value = true,", "mass_kg is True, which is not a number"),
        ("value = 13.5,", "value = inf,", "mass_kg is inf"),
        ("value = 13.5,", "value = 13500,", r"mine\.toml: .* mass_kg is 13500\.0: grams\?"),
        ("value = 13.5,", f"value = 1{400 * '0'},", "mass_kg is 1000.*which is not a number"),
        ("value = 13.5,", "value = 20,", r"mine\.toml: .*mass_kg 20; .* must weigh 13\.25 kg"),
        ("value = 13.5,", "valeu = 13.5,", "mass_kg has 'valeu', which is not a key of a value"),
        (ADDED, "[6.4, 7.1, 18.7]", r"added_mass is \[6\.4, 7\.1, 18\.7\]: 3 numbers, not 6"),
        (ADDED, "6.4", r"added_mass is 6\.4, which is not a list of numbers"),
        (ADDED, "{ surge = 6.4 }", "added_mass is {'surge': 6.4}, which is not a list of numbers"),
        (ADDED, "[6.4, 'x', 18.7, 0.2, 0.1, 0.2]", "added_mass of sway is 'x', which is not a number"),
        (ADDED, "[[1, 2], [3, 4]]", r"added_mass is \[\[1, 2\], \[3, 4\]\]"),
        (ADDED, str([[1.0] * 6] * 5 + [[1.0]]), r"added_mass \(row of yaw\) is \[1\.0\]: 1 numbers, not 6"),
        (ADDED, ASKEW, "added_mass has 0 at surge, yaw, but 0.2 at yaw, surge"),
        ("-0.01]", "-10]", r"centre_of_buoyancy_m of z is 10\.0: millimetres"),
        ("-0.01]", "nan]", "centre_of_buoyancy_m of z is nan"),
        ("[0.457, 0.575, 0.254]", "[0.457, 0.575]", "size_m is .* 2 numbers, not 3"),
        ("lacks = []", 'lacks = "pitch"', "lacks is 'pitch', which is not a list"),
        ("lacks = []", 'lacks = ["pich"]', "lacks has 'pich', which is not an axis"),
        ('frame = "FRD"', 'frame = ["FRD"]', r"has the frame \['FRD'\]"),
        ('frame = "FRD"', "", "lacks frame"),
        ('about = "', 'about = 3 # "', "about is 3, which is not text"),
        ('paper = "von', 'paper = 3 # "von', "sources: paper is 3, which does not name"),
        ('thrusters_source = "paper"', 'thrusters_source = ["paper"]', r"thrusters_source is \['paper'\]"),
        ('name = "T1"', "name = 1", "thruster 1: name is 1, which is not text"),
        ('name = "T1"', "", "thruster 1 lacks name"),
        (
            'name = "T1"',
            'name = "T1"\ncolour = "red"',
            r"thruster 1 \('T1'\) has 'colour', which is not a key of a thruster",
        ),
        ("position_m = [0.156, 0.111, 0.085]", "", r"thruster 1 \('T1'\) lacks position_m"),
        ("position_m = [0.156, 0.111, 0.085]", "position_m = 3", r"thruster 1 \('T1'\): position_m is 3"),
        ("position_m = [0.156, 0.111, 0.085]", "position_m = [nan, 0, 0]", r"\('T1'\): position_m of x is nan"),
        (
            "position_m = [0.156, 0.111, 0.085]",
            "position_m = [156, 111, 85]",
            r"position_m of x is 156\.0: millimetres",
        ),
        ("direction = [0.70710678, -0.70710678, 0.0]", "direction = [1, 0]", "direction is .* 2 numbers, not 3"),
    ],
)
def test_file_mistake_raises_with_file_and_field(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        read_vehicle(changed(tmp_path, old, new))
    assert caught.value.fix


def test_geometry_without_rank_raises_unless_declared(tmp_path: Path) -> None:
    level = TEXT[: TEXT.index('[[thruster]]\nname = "T5"')]
    path = tmp_path / "mine.toml"
    path.write_text(level, encoding="utf-8")
    with pytest.raises(ParameterError, match="lack authority in heave, roll, pitch, the file says none"):
        read_vehicle(path)
    path.write_text(level.replace("lacks = []", 'lacks = ["roll", "pitch", "heave"]'), encoding="utf-8")
    assert len(read_vehicle(path).thrusters) == 4


def test_missing_file_raises(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"nowhere\.toml cannot be read"):
        read_vehicle(tmp_path / "nowhere.toml")


def test_misspelt_key_raises_with_nearest_name(tmp_path: Path) -> None:
    for old, new, meant in (
        ("volume_m3", "volum_m3", "volume_m3"),
        ("position_m", "positon_m", "position_m"),
        ("value = 13.5", "valeu = 13.5", "value"),
        ("lacks", "lack", "lacks"),
    ):
        with pytest.raises(ParameterError) as caught:
            read_vehicle(changed(tmp_path, old, new))
        assert f"did you mean '{meant}'?" in caught.value.fix


def test_thruster_table_without_list_raises_with_syntax(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    one = '[thruster]\nname = "T1"\nposition_m = [0.0, 0.0, 0.0]\ndirection = [1.0, 0.0, 0.0]\n'
    path.write_text(TEXT[: TEXT.index("[[thruster]]")] + one, encoding="utf-8")
    with pytest.raises(ParameterError, match=r"mine\.toml: thruster is {'name': 'T1'") as caught:
        read_vehicle(path)
    assert "[[thruster]]" in caught.value.fix


def test_non_utf8_bytes_raise_with_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(TEXT.replace("von Benzon", "von B\xe9nzon", 1).encode("latin-1"))
    with pytest.raises(
        ParameterError, match=r"mine\.toml cannot be read: line 4 has the byte 0xe9, which is not UTF-8"
    ):
        read_vehicle(path)
    path.write_text(TEXT.replace("[141.0", 3000 * "[" + "141.0"), encoding="utf-8")
    with pytest.raises(ParameterError, match="cannot be read"):
        read_vehicle(path)


def test_file_with_byte_order_mark_is_read(tmp_path: Path) -> None:
    path = tmp_path / "benzon2022.toml"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    assert read_vehicle(path).linear_damping == HEAVY.linear_damping


LINEAR, QUADRATIC = "[13.7, 0.0, 33.0, 0.0, 0.8, 0.0]", "[141.0, 217.0, 190.0, 1.192, 0.470, 1.5]"


@pytest.mark.parametrize(
    ("linear", "quadratic", "message"),
    [
        (QUADRATIC, LINEAR, r"adds up to 548, .*(.|\n)*are the two swapped"),
        (
            "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
            "[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]",
            "of surge, sway, heave, roll, pitch, yaw are 0",
        ),
        (LINEAR, "[141.0, 0.0, 190.0, 0.0, 0.470, 0.0]", "of sway, roll, yaw are 0: nothing would slow it down"),
    ],
)
def test_missing_or_implausible_drag_raises(tmp_path: Path, linear: str, quadratic: str, message: str) -> None:
    path = tmp_path / "mine.toml"
    text = TEXT.replace(QUADRATIC, "QUADRATIC").replace(LINEAR, linear).replace("QUADRATIC", quadratic)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=rf"mine\.toml: .*{message}"):
        read_vehicle(path)
