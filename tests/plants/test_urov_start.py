from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from snr_sim.plants.urov.dive import Dive, Payload, ThrusterFault
from snr_sim.plants.urov.pool import Gate, Pool
from snr_sim.plants.urov.propulsion import Propulsion
from snr_sim.plants.urov.tether import Tether
from snr_sim.plants.urov.urov import Urov
from snr_sim.plants.urov.urov_2d import Urov2D
from snr_sim.prelude.errors import ParameterError
from tests.plants.vehicles import HEAVY

BELOW = (0.0, 0.0, -2.0)
BOTH = pytest.mark.parametrize("kind", [Urov, Urov2D])


def begin(dive: Any, pool: Pool | None = None, kind: Callable[..., Urov] = Urov, **how: Any) -> Urov:
    return kind(HEAVY, pool or Pool(), lambda seed: dive, Propulsion(8), **how)


@BOTH
@pytest.mark.parametrize(
    ("place", "solid", "deep_cm"),
    [
        ((0.0, 0.0, -3.95), "floor", "7.7"),
        ((12.4, 0.0, -2.0), "wall_east", "12.9"),
        ((-12.4, 0, -2), "wall_west", "12.9"),
    ],
)
def test_start_in_floor_or_wall_raises(
    kind: Callable[..., Urov], place: tuple[float, float, float], solid: str, deep_cm: str
) -> None:
    with pytest.raises(ParameterError, match=f"with the vehicle {deep_cm} cm deep in '{solid}'") as caught:
        begin(Dive(place), kind=kind)
    assert "4 m deep" in caught.value.fix


def test_start_check_uses_tilted_extent() -> None:
    begin(Dive((0.0, 0.0, -3.86)))
    with pytest.raises(ParameterError, match="deep in 'floor'"):
        begin(Dive((0.0, 0.0, -3.86), attitude_rad=(0.5, 0.0, 0.0)))


@BOTH
@pytest.mark.parametrize("bar_z_m", [-2.0, -2.07])
def test_start_across_gate_bar_raises(kind: Callable[..., Urov], bar_z_m: float) -> None:
    """Also where the bar is in the centre of the vehicle, where no direction leads out of it."""
    pool = Pool(gates=(Gate("red", (0.0, 0.0, bar_z_m - 0.5)),))
    with pytest.raises(ParameterError, match="cm deep in 'red"):
        begin(Dive(BELOW), pool, kind)


def test_loads_that_would_float_the_vehicle_raise() -> None:
    foam = Payload(0.5, 0.01, start_s=5.0)
    begin(Dive(BELOW, loads=(foam,)))
    with pytest.raises(
        ParameterError, match=r"At 5 s the dive's loads displace 20 kg of water, more than all weighs: 14\.2 kg"
    ):
        begin(Dive(BELOW, loads=(foam, foam)))
    begin(Dive(BELOW, loads=(foam, replace(foam, start_s=0.0, end_s=5.0))))


def test_start_at_rest_position_of_previous_dive_is_accepted() -> None:
    plant = begin(Dive((0.0, 0.0, -3.88)))
    plant.step(plant.step_s)
    assert plant.contact_n is not None


def test_start_beyond_tether_raises() -> None:
    with pytest.raises(ParameterError, match=r"begins 10\.39 m from where its tether is held, which is 5 m long"):
        begin(Dive(BELOW, tether=Tether((10.0, 0.0, 0.0), 5.0)))
    # Where it is fixed counts, not the vehicle's origin.
    begin(Dive(BELOW, tether=Tether((-5.2, 0.0, -2.0), 5.0)))
    with pytest.raises(ParameterError, match="tether is held"):
        begin(Dive(BELOW, tether=Tether((5.0, 0.0, -2.0), 5.0)))


def test_too_stiff_tether_raises_and_limit_is_stable() -> None:
    def taut(modulus_pa: float) -> Dive:
        return Dive(BELOW, velocity_mps=(0.5, 0.3, 0.1), tether=Tether((0.0, 0.0, 0.0), 2.1, modulus_pa=modulus_pa))

    with pytest.raises(ParameterError, match=r"too stiff for steps of 5 ms: .* swing [\d.]+ times a second"):
        begin(taut(1e11))
    stiffest = 0.99 * 2.1 * 19.5 / (0.005**2 * 1.222 * 4.418e-5)
    with pytest.raises(ParameterError, match="too stiff"):
        begin(taut(1.1 * stiffest))
    plant = begin(taut(stiffest))
    fastest = 0.0
    for _ in range(2000):
        plant.step(plant.step_s)
        fastest = max(fastest, *map(abs, plant.velocity_mps))
    assert fastest < 0.7


@pytest.mark.parametrize("thruster", [99, "bogus", -1])
def test_fault_of_unknown_thruster_raises_with_names(thruster: Any) -> None:
    with pytest.raises(ParameterError, match=f"thruster {thruster!r} fail at 3 s, and there is no such") as caught:
        begin(Dive(BELOW, faults=(ThrusterFault(3.0, thruster),)))
    assert "T1, T2, T3, T4, T5, T6, T7, T8" in caught.value.fix


def test_thruster_fault_by_name_hits_that_thruster() -> None:
    plant = begin(Dive(BELOW, faults=(ThrusterFault(0.0, "T8", "off"),)))
    assert plant.truth()["values"]["broken_T8"] == 1.0
    assert plant.thrusters._effectiveness[7] == (0.0, 0.0)


def test_wrong_type_of_vehicle_pool_or_dive_raises() -> None:
    with pytest.raises(ParameterError, match="The vehicle is 'benzon2022'"):
        Urov("benzon2022", Pool(), lambda seed: Dive())  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="The pool is 4"):
        Urov(HEAVY, 4, lambda seed: Dive())  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="The start is Dive"):
        Urov(HEAVY, Pool(), Dive())  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="The propulsion is 8"):
        Urov(HEAVY, Pool(), lambda seed: Dive(), 8)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="The start of seed 0 is None"):
        begin(None)
    with pytest.raises(ParameterError, match="in steps of nan s"):
        begin(Dive(), step_s=float("nan"))
    with pytest.raises(ParameterError, match="in steps of fast s"):
        begin(Dive(), step_s="fast")
