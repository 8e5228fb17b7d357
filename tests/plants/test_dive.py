import math
from typing import Any

import pytest

from snr_sim.plants.urov.dive import Current, Dive, Leak, Load, ThrusterFault
from snr_sim.plants.urov.tether import Tether
from snr_sim.prelude.errors import ParameterError

CENTRE = (0.0, 0.0, 0.0)
LINE = Tether(CENTRE)


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        (Load, (math.nan,), "The load's mass_kg is nan"),
        (Load, (-1.0,), r"The load's mass_kg is -1\.0"),
        (Load, (500.0,), r"The load's mass_kg is 500\.0: grams\?"),
        (Load, (1.0, 0.5), r"The load's volume_m3 is 0\.5: litres\?"),
        (Load, (1.0, 0.0, (0.0, math.nan, 0.0)), "The load's place_m of y is nan"),
        (Load, (1.0, 0.0, CENTRE, math.nan), "The load's from_s is nan"),
        (Load, (1.0, 0.0, CENTRE, 0.0, math.nan), "The load's until_s is nan"),
        (Load, (1.0, 0.0, CENTRE, 5.0, 3.0), r"The load's until_s is 3\.0, and it is taken up at 5 s"),
        (Leak, (math.inf, 0.1), "The leak's from_s is inf"),
        (Leak, (1.0, -0.1), r"The leak's rate_lps is -0\.1"),
        (Leak, (1.0, 0.1, math.nan), "The leak's most_l is nan"),
        (Current, (math.nan, CENTRE), "The current's from_s is nan"),
        (Current, (-1.0, CENTRE), r"The current's from_s is -1\.0"),
        (Current, (0.0, (0.0, math.nan, 0.0)), "The current's velocity_mps of y is nan"),
        (Current, (0.0, 0.3), r"The current's velocity_mps is 0\.3, which is no row of numbers"),
        (Current, (0.0, (30.0, 0.0, 0.0)), r"The current's velocity_mps of x is 30\.0: centimetres a second\?"),
        (ThrusterFault, (math.nan, 0), "The thruster fault's at_s is nan"),
        (ThrusterFault, (1.0, 0, "weak", 50.0), r"The thruster fault's share is 50\.0: percent\?"),
        (ThrusterFault, (1.0, 0, "of"), "A thruster cannot be 'of'"),
        (Dive, ((0.0, 0.0, math.nan),), "The dive's position_m of z is nan"),
        (Dive, (2.0,), r"The dive's position_m is 2\.0, which is no row of numbers"),
        (Dive, ((0.0, 0.0, 200.0),), r"The dive's position_m of z is 200\.0"),
        (Dive, (CENTRE, (0.0, 0.0, 90.0)), r"The dive's attitude_rad of z is 90\.0: degrees\?"),
        (Dive, (CENTRE, CENTRE, (1000.0, 0.0, 0.0)), r"The dive's velocity_mps of x is 1000\.0"),
        (Dive, (CENTRE, CENTRE, CENTRE, (math.nan, 0.0, 0.0)), "The dive's rate_radps of x is nan"),
    ],
)
def test_a_number_that_cannot_be_is_told_where_it_is_made(kind: Any, given: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ParameterError, match=message) as caught:
        kind(*given)
    assert caught.value.fix


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tether": (LINE, LINE)}, r"The dive's tether is \(Tether"),
        ({"leak": True}, "The dive's leak is True"),
        ({"currents": Current(0.0, CENTRE)}, "The dive's currents is one Current, not a row of them"),
        ({"currents": ((0.3, 0.0, 0.0),)}, "The dive's currents has .* where a Current is due"),
        ({"currents": (Current(5.0, CENTRE), Current(1.0, CENTRE))}, "Currents begin at"),
        ({"loads": 3}, "The dive's loads has 3 where a Load is due"),
        ({"faults": None}, "The dive's faults has None where a ThrusterFault is due"),
    ],
)
def test_a_wrong_part_of_a_dive_is_told(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Dive(**change)


def test_two_tethers_are_answered_with_how_many_there_can_be() -> None:
    with pytest.raises(ParameterError) as caught:
        Dive(tether=(LINE, LINE))  # type: ignore[arg-type]
    assert caught.value.fix == "a dive has one Tether, or None."


def test_a_thruster_fails_by_its_name_or_its_number() -> None:
    names = ("T1", "T2", "T3")
    assert ThrusterFault(1.0, "T3").number_in(names) == ThrusterFault(1.0, 2).number_in(names) == 2
    for thruster in (3, -1, 1.5, True, None, "T4"):
        with pytest.raises(
            ParameterError, match=r"The dive has thruster .* fail at 1 s, and there is no such"
        ) as caught:
            ThrusterFault(1.0, thruster).number_in(names)  # type: ignore[arg-type]
        assert "T1, T2, T3" in caught.value.fix
