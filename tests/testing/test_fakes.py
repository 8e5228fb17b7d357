import msgspec
import pytest

from snr_sim.prelude.errors import UnknownNameError
from snr_sim.testing.contracts import check_plant
from snr_sim.testing.fakes import FakePlant


class Reading(msgspec.Struct, frozen=True):
    depth_m: float
    stamp_s: float


class Bare(msgspec.Struct, frozen=True):
    depth_m: float


def tank() -> FakePlant:
    return FakePlant({"depth": Reading(1.5, 0.0), "bare": Bare(2.0)}, inputs=("pump",))


def test_fake_plant_implements_plant() -> None:
    check_plant(tank, {"pump": Bare(1.0)})


def test_a_fake_plant_holds_what_it_is_given_at_the_time_it_is_read() -> None:
    plant = tank()
    plant.step(0.25)
    assert plant.read("depth") == Reading(1.5, 0.25)
    assert plant.read("bare") == Bare(2.0)
    plant.write("pump", Bare(3.0))
    assert plant.written == [("pump", Bare(3.0))]


def test_a_fake_plant_knows_its_names() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'depth'"):
        tank().read("dept")
    with pytest.raises(UnknownNameError, match="no input 'valve'"):
        tank().write("valve", Bare(1.0))
