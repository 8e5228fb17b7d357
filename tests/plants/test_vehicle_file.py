from pathlib import Path

import numpy as np
import pytest

from snr_sim.plants.vehicle_file import read_vehicle
from snr_sim.prelude.errors import ParameterError

VEHICLES = Path(__file__).parents[2] / "robots" / "urov" / "vehicles"
TEXT = (VEHICLES / "benzon2022.toml").read_text(encoding="utf-8")


def changed(tmp_path: Path, old: str, new: str) -> Path:
    """The default set with one thing changed."""
    assert old in TEXT
    path = tmp_path / "mine.toml"
    path.write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["benzon2022", "wu2018", "classic"])
def test_each_number_of_each_set_has_a_source(name: str) -> None:
    vehicle = read_vehicle(VEHICLES / f"{name}.toml")
    assert vehicle.name == name
    assert set(vehicle.sources) == {
        "mass_kg", "inertia_kgm2", "volume_m3", "added_mass", "linear_damping", "quadratic_damping",
        "centre_of_mass_m", "centre_of_buoyancy_m", "size_m", "net_buoyancy_n", "thrusters",
    }  # fmt: skip
    assert all(len(source) > 10 for source in vehicle.sources.values())
    assert vehicle.centre_of_buoyancy_m[2] > vehicle.centre_of_mass_m[2]


def test_vectors_and_matrices_are_turned_from_frd(tmp_path: Path) -> None:
    vehicle = read_vehicle(VEHICLES / "benzon2022.toml")
    assert vehicle.centre_of_buoyancy_m == (0.0, 0.0, 0.01)
    assert vehicle.thrusters[0].position_m == (0.156, -0.111, -0.085)
    assert vehicle.thrusters[0].direction == pytest.approx((0.5**0.5, 0.5**0.5, 0.0))
    rows = [[6.0, 0.5, 0.3, 0, 0.2, 0], [0.5, 7.0, 0, 0, 0, 0], [0.3, 0, 18.0, 0, 0, 0],
            [0, 0, 0, 0.2, 0, 0], [0.2, 0, 0, 0, 0.2, 0], [0, 0, 0, 0, 0, 0.2]]  # fmt: skip
    old = "[6.3567, 7.1206, 18.6863, 0.1858, 0.1348, 0.2215]"
    full = read_vehicle(changed(tmp_path, old, str(rows)))
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
        ("volume_m3", "volum_m3", "has 'volum_m3', which is no number of a vehicle"),
        ("lacks = []", 'lacks = ["pitch"]', "lack authority in no axis, the file says pitch"),
        ("about =", "about", "cannot be read"),
    ],
)
def test_a_mistake_in_a_file_is_told_in_its_words(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        read_vehicle(changed(tmp_path, old, new))
    assert caught.value.fix


def test_a_geometry_without_rank_is_refused_unless_the_file_says_so(tmp_path: Path) -> None:
    level = TEXT[: TEXT.index('[[thruster]]\nname = "T5"')]
    path = tmp_path / "mine.toml"
    path.write_text(level, encoding="utf-8")
    with pytest.raises(ParameterError, match="lack authority in heave, roll, pitch, the file says none"):
        read_vehicle(path)
    path.write_text(level.replace("lacks = []", 'lacks = ["roll", "pitch", "heave"]'), encoding="utf-8")
    assert len(read_vehicle(path).thrusters) == 4


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"nowhere\.toml cannot be read"):
        read_vehicle(tmp_path / "nowhere.toml")
