import math
from typing import Any

import pytest

from snr_sim.plants.urov.dive import Current, Dive, Leak, Payload, ThrusterFault
from snr_sim.plants.urov.tether import Tether
from snr_sim.prelude.errors import ParameterError

CENTRE = (0.0, 0.0, 0.0)
LINE = Tether(CENTRE)


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        (Payload, (math.nan,), "The load's mass_kg is nan"),
        (Payload, (-1.0,), r"The load's mass_kg is -1\.0"),
        (Payload, (500.0,), r"The load's mass_kg is 500\.0: grams\?"),
        (Payload, (1.0, 0.5), r"The load's volume_m3 is 0\.5: litres\?"),
        (Payload, (1.0, 0.0, (0.0, math.nan, 0.0)), "The load's position_m of y is nan"),
        (Payload, (1.0, 0.0, CENTRE, math.nan), "The load's start_s is nan"),
        (Payload, (1.0, 0.0, CENTRE, 0.0, math.nan), "The load's end_s is nan"),
        (Payload, (1.0, 0.0, CENTRE, 5.0, 3.0), r"The load's end_s is 3\.0, and it is taken up at 5 s"),
        (Leak, (math.inf, 0.1), "The leak's start_s is inf"),
        (Leak, (1.0, -0.1), r"The leak's rate_lps is -0\.1"),
        (Leak, (1.0, 0.1, math.nan), "The leak's max_l is nan"),
        (Current, (math.nan, CENTRE), "The current's start_s is nan"),
        (Current, (-1.0, CENTRE), r"The current's start_s is -1\.0"),
        (Current, (0.0, (0.0, math.nan, 0.0)), "The current's velocity_mps of y is nan"),
        (Current, (0.0, 0.3), r"The current's velocity_mps is 0\.3, which is not a list of numbers"),
        (Current, (0.0, (30.0, 0.0, 0.0)), r"The current's velocity_mps of x is 30\.0: centimetres a second\?"),
        (ThrusterFault, (math.nan, 0), "The thruster fault's at_s is nan"),
        (ThrusterFault, (1.0, 0, "weak", 50.0), r"The thruster fault's effectiveness is 50\.0: percent\?"),
        (ThrusterFault, (1.0, 0, "of"), "A thruster cannot be 'of'"),
        (Dive, ((0.0, 0.0, math.nan),), "The dive's position_m of z is nan"),
        (Dive, (2.0,), r"The dive's position_m is 2\.0, which is not a list of numbers"),
        (Dive, ((0.0, 0.0, 200.0),), r"The dive's position_m of z is 200\.0"),
        (Dive, (CENTRE, (0.0, 0.0, 90.0)), r"The dive's attitude_rad of z is 90\.0: degrees\?"),
        (Dive, (CENTRE, CENTRE, (1000.0, 0.0, 0.0)), r"The dive's velocity_mps of x is 1000\.0"),
        (Dive, (CENTRE, CENTRE, CENTRE, (math.nan, 0.0, 0.0)), "The dive's rate_radps of x is nan"),
    ],
)
def test_invalid_number_raises_at_construction(kind: Any, given: tuple[Any, ...], message: str) -> None:
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
        ({"loads": 3}, "The dive's loads has 3 where a Payload is due"),
        ({"faults": None}, "The dive's faults has None where a ThrusterFault is due"),
    ],
)
def test_wrong_member_type_raises(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Dive(**change)


def test_two_tethers_raise_with_allowed_number() -> None:
    with pytest.raises(ParameterError) as caught:
        Dive(tether=(LINE, LINE))  # type: ignore[arg-type]
    assert caught.value.fix == "a dive has one Tether, or None."


def test_thruster_fault_accepts_name_or_index() -> None:
    names = ("T1", "T2", "T3")
    assert ThrusterFault(1.0, "T3").number_in(names) == ThrusterFault(1.0, 2).number_in(names) == 2
    for thruster in (3, -1, 1.5, True, None, "T4"):
        with pytest.raises(
            ParameterError, match=r"The dive has thruster .* fail at 1 s, and there is no such"
        ) as caught:
            ThrusterFault(1.0, thruster).number_in(names)  # type: ignore[arg-type]
        assert "T1, T2, T3" in caught.value.fix
