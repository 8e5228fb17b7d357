import math
from dataclasses import replace

import numpy as np
import pytest

from snr_sim.plants.urov.vehicle import Thruster, Vehicle
from snr_sim.plants.urov.vehicle_file import read_vehicle
from snr_sim.prelude.errors import ParameterError
from snr_sim.prelude.wrench import AXES, unactuated_axes
from tests.plants.vehicles import HEAVY, VEHICLES


def test_heavy_frame_actuates_all_axes() -> None:
    matrix = HEAVY.thruster_matrix()
    assert matrix.shape == (6, 8)
    assert unactuated_axes(matrix) == ()
    assert np.linalg.cond(matrix) == pytest.approx(8.36, abs=0.01)
    # The first thruster pushes ahead and to the left from low on the right: it rolls right, lifts the nose, turns left.
    expected = [0.7071, 0.7071, 0.0, 0.0601, -0.0601, 0.1888]
    assert matrix[:, 0].tolist() == pytest.approx(expected, abs=5e-5)


def test_six_thruster_frame_lacks_pitch() -> None:
    classic = read_vehicle(VEHICLES / "classic.toml")
    assert unactuated_axes(classic.thruster_matrix()) == ("pitch",)


def test_each_missing_rank_names_one_axis() -> None:
    matrix = HEAVY.thruster_matrix()
    assert unactuated_axes(matrix[:, 4:]) == ("surge", "sway", "yaw")  # the upright ones alone
    assert unactuated_axes(matrix[:, :4]) == ("heave", "roll", "pitch")  # the level ones alone
    assert unactuated_axes(np.zeros((6, 0))) == AXES
    one_down = np.delete(matrix, 4, axis=1)
    assert unactuated_axes(one_down) == ()  # seven can still do it all


def test_trimmed_has_net_buoyancy_in_any_water() -> None:
    for density in (1000.0, 1026.0):
        trimmed = HEAVY.trimmed(density, 9.81)
        assert 9.81 * (density * trimmed.volume_m3 - trimmed.mass_kg) == pytest.approx(1.5)
    as_printed = replace(HEAVY, net_buoyancy_n=None).trimmed(1000.0, 9.81)
    assert as_printed.mass_kg == 13.5


def test_trim_beyond_a_tenth_of_mass_raises() -> None:
    """The mass follows from the net buoyancy, so a mass far from that would be ignored silently."""
    wrong = replace(HEAVY, mass_kg=20.0)
    with pytest.raises(ParameterError, match=r"mass_kg 20; .* net_buoyancy_n 1\.5 .* 13\.4 l must weigh 13\.25 kg"):
        wrong.trimmed(1000.0, 9.81)
    with pytest.raises(ParameterError, match="The gravity is 0"):
        HEAVY.trimmed(1000.0, 0.0)
    with pytest.raises(ParameterError, match=r"The density of the water is 1\.0: kg/l\?"):
        HEAVY.trimmed(1.0, 9.81)
    heavy = replace(wrong, net_buoyancy_n=None).trimmed(1000.0, 9.81)
    assert heavy.mass_kg == 20.0  # without a stated net buoyancy the mass is kept


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_kg": -13.5}, "mass_kg is -13.5"),
        ({"volume_m3": 0.0}, "volume_m3 is 0.0"),
        ({"mass_kg": float("nan")}, "mass_kg is nan"),
        ({"linear_damping": (13.7, 0.0, -33.0, 0.0, 0.8, 0.0)}, "linear_damping of heave is -33.0"),
        ({"quadratic_damping": (1.0, 1.0, 1.0, 1.0, 1.0, -1.5)}, "quadratic_damping of yaw is -1.5"),
        ({"quadratic_damping": (1.0, 1.0, 1.0)}, "quadratic_damping is"),
        ({"added_mass": np.diag([-6.4, 7.1, 18.7, 0.2, 0.1, 0.2])}, "added_mass of surge is -6.4"),
        ({"added_mass": np.eye(3)}, "added_mass is"),
        ({"added_mass": np.eye(6) + 0.1 * np.eye(6, k=1)}, r"added_mass has 0\.1 at surge, sway, but 0 at sway, surge"),
        ({"added_mass": np.eye(6) - 2.0 * np.fliplr(np.eye(6))}, "added_mass is"),
        ({"inertia_kgm2": np.diag([0.1, -0.1, 0.1])}, "inertia_kgm2 is"),
        ({"inertia_kgm2": np.diag([0.1, 0.1, 0.9])}, "inertia_kgm2 is"),
        ({"added_mass": "heavy"}, "added_mass is 'heavy'"),
        ({"added_mass": 1e3 * np.diag([6.4, 7.1, 18.7, 0.2, 0.1, 0.2])}, r"added_mass of surge is 6400\.0: grams\?"),
        ({"inertia_kgm2": np.diag([5.25, 7.94, 6.91])}, r"inertia_kgm2 has 7\.94 kg m2, 4\.4 times the most"),
        ({"inertia_kgm2": 1e-6 * np.diag([0.26, 0.23, 0.37])}, r"inertia_kgm2 has 2\.3e-07 kg m2 about one axis"),
        ({"mass_kg": 13500.0}, r"mass_kg is 13500\.0: grams\?"),
        ({"mass_kg": math.inf}, "mass_kg is inf"),
        ({"mass_kg": True}, "mass_kg is True, which is not a number"),
        ({"mass_kg": "13.5"}, "mass_kg is '13.5', which is not a number"),
        ({"mass_kg": 150.0}, r"mass by volume is 11194\."),
        ({"volume_m3": 13.4}, r"volume_m3 is 13\.4: litres\?"),
        ({"volume_m3": 13400}, r"volume_m3 is 13400: cubic centimetres\?"),
        ({"net_buoyancy_n": 1500.0}, r"net_buoyancy_n is 1500\.0: millinewtons\?"),
        ({"net_buoyancy_n": math.nan}, "net_buoyancy_n is nan"),
        ({"centre_of_buoyancy_m": (0.0, 0.0, 10.0)}, r"centre_of_buoyancy_m of z is 10\.0: millimetres\?"),
        ({"centre_of_mass_m": (0.0, -0.3, 0.0)}, r"centre_of_mass_m, off the middle in y, is 0\.3"),
        ({"centre_of_mass_m": (0.0, 0.0)}, r"centre_of_mass_m is \(0\.0, 0\.0\): 2 numbers, not 3"),
        ({"thrusters": HEAVY.thrusters[0]}, "thrusters is one Thruster, not a row of them"),
        ({"thrusters": ("T1",)}, "thrusters has 'T1' where a Thruster is due"),
        ({"size_m": (457.0, 575.0, 254.0)}, r"size_m of length is 457\.0: millimetres\?"),
        ({"size_m": (0.4, 0.0, 0.2)}, "size_m of width is 0.0"),
    ],
)
def test_invalid_number_raises_with_name(change: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=rf"Vehicle 'benzon2022': {message}") as caught:
        replace(HEAVY, **change)  # type: ignore[arg-type]
    assert caught.value.fix


def test_duplicate_name_or_zero_direction_of_thruster_raises() -> None:
    first = HEAVY.thrusters[0]
    with pytest.raises(ParameterError, match="more than one thruster named 'T1'"):
        replace(HEAVY, thrusters=(first, first))
    with pytest.raises(ParameterError, match=r"more than one thruster named 'T1'.*\n.*more than blanks"):
        replace(HEAVY, thrusters=(first, replace(first, name="T 1 ")))
    with pytest.raises(ParameterError, match=r"Thruster 'T1': position_m, off the middle in x, is 0\.9(.|\n)*outside"):
        replace(HEAVY, thrusters=(replace(first, position_m=(0.9, 0.0, 0.0)),))
    with pytest.raises(ParameterError, match=r"Thruster 'T1'.* is 0\.5 long"):
        Thruster("T1", (0.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    with pytest.raises(ParameterError, match="Thruster 'T1': position_m of y is nan"):
        Thruster("T1", (0.0, float("nan"), 0.0), (1.0, 0.0, 0.0))
    with pytest.raises(ParameterError, match=r"position_m of x is 156\.0: millimetres\?"):
        Thruster("T1", (156.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    with pytest.raises(ParameterError, match="A thruster is named ''"):
        Thruster("", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))


def test_vehicle_without_thrusters_is_valid() -> None:
    none: Vehicle = replace(HEAVY, thrusters=())
    assert none.thruster_matrix().shape == (6, 0)
