"""Invalid input of all landers: implausible numbers, and starts in the ground. Each is rejected where it is made."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from snr_sim.plants.lander.descent import Engine
from snr_sim.plants.lander.gear import GearLimits
from snr_sim.plants.lander.lander import Lander
from snr_sim.plants.lander.lander_1d import Lander1D, VerticalStart
from snr_sim.plants.lander.lander_2d import Lander2D
from snr_sim.plants.lander.lander_3d import Lander3D
from snr_sim.plants.lander.module import Leg, LunarModule, PlaneStart, Throttle
from snr_sim.plants.lander.terrain import FLAT, Terrain, make_terrain
from snr_sim.prelude.errors import ParameterError

NAN, INF = math.nan, math.inf
ENGINE = Engine(45040.0, 3049.9)
VERTICAL: dict[str, Any] = {"height_m": 100.0, "velocity_mps": -5.0, "mass_kg": 7500.0, "fuel_kg": 600.0}
PLANE: dict[str, Any] = {
    "position_m": (0.0, 100.0), "velocity_mps": (0.0, 0.0), "mass_kg": 7500.0, "fuel_kg": 600.0,
    "attitude_rad": 0.0, "rate_radps": 0.0,
}  # fmt: skip
SLOPE = make_terrain(3, relief_m=0.0, pad_slope_rad=0.35)


def vertical(engine: Engine = ENGINE, **how: Any) -> Lander1D:
    return Lander1D(lambda seed: VerticalStart(**VERTICAL), engine, **how)


def in_plane(body: Callable[..., Lander], module: LunarModule, ground: Terrain = FLAT, **how: Any) -> Lander:
    start = PlaneStart(**(PLANE | how))
    return body(module, lambda seed: (start, ground))


@pytest.mark.parametrize("field", VERTICAL)
@pytest.mark.parametrize("value", [NAN, INF, "7", None, True], ids=repr)
def test_non_finite_vertical_start_raises_with_name(field: str, value: Any) -> None:
    with pytest.raises(ParameterError, match=f"The start's {field} is"):
        VerticalStart(**VERTICAL | {field: value})


@pytest.mark.parametrize("field", PLANE)
@pytest.mark.parametrize("value", [NAN, "7", None, (NAN, 0.0), (1.0, 2.0, 3.0)], ids=repr)
def test_non_finite_plane_start_raises_with_name(field: str, value: Any) -> None:
    with pytest.raises(ParameterError, match=f"The start's {field}"):
        PlaneStart(**PLANE | {field: value})


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ({"height_m": -0.1}, "height_m is -0.1"),
        ({"mass_kg": -7500.0}, "mass_kg is -7500"),
        ({"mass_kg": 0.0}, "mass_kg is 0"),
        ({"fuel_kg": -1.0}, "fuel_kg is -1"),
        ({"fuel_kg": 7500.0}, "fuel_kg is 7500, its mass_kg 7500"),
    ],
)
def test_invalid_start_raises_in_both(how: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        VerticalStart(**VERTICAL | how)
    if "height_m" not in how:
        with pytest.raises(ParameterError, match=message):
            PlaneStart(**PLANE | how)


@pytest.mark.parametrize("body", [Lander2D, Lander3D])
@pytest.mark.parametrize(
    ("how", "ground"),
    [
        ({"position_m": (0.0, 3.5)}, FLAT),
        ({"position_m": (0.0, -50.0)}, FLAT),
        ({"position_m": (0.0, 3.7), "attitude_rad": 0.12}, FLAT),  # one foot
        ({"position_m": (0.0, 3.0), "attitude_rad": math.pi}, FLAT),  # the roof
        ({"position_m": (5.0, 5.4)}, SLOPE),
    ],
)
def test_start_under_ground_raises_with_depth(
    apollo: LunarModule, body: Callable[..., Lander], how: dict[str, Any], ground: Terrain
) -> None:
    with pytest.raises(ParameterError, match=r"the module is [0-9.]+ m under ground") as caught:
        in_plane(body, apollo, ground, **how)
    assert "begin higher" in caught.value.fix


@pytest.mark.parametrize("body", [Lander2D, Lander3D])
@pytest.mark.parametrize("given", [None, 7.0, VerticalStart(**VERTICAL), (PlaneStart(**PLANE), None)], ids=str)
def test_start_of_other_type_raises(apollo: LunarModule, body: Callable[..., Lander], given: Any) -> None:
    with pytest.raises(ParameterError, match="return a PlaneStart and a Terrain"):
        body(apollo, lambda seed: given)
    with pytest.raises(ParameterError, match="return a VerticalStart"):
        Lander1D(lambda seed: (PlaneStart(**PLANE), FLAT), ENGINE)  # type: ignore[arg-type, return-value]


@pytest.mark.parametrize("step_s", [0.0, -0.1, NAN, INF])
def test_invalid_vertical_step_raises_and_changes_nothing(step_s: float) -> None:
    plant = vertical()
    before = plant.snapshot()
    with pytest.raises(ParameterError, match="This plant moves on, and not by"):
        plant.step(step_s)
    assert plant.snapshot() == before


@pytest.mark.parametrize("body", [Lander2D, Lander3D])
@pytest.mark.parametrize("step_s", [0.0, -0.005, NAN, INF, 1.0, "short"])
def test_invalid_plane_step_raises(apollo: LunarModule, body: Callable[..., Lander], step_s: Any) -> None:
    with pytest.raises(ParameterError, match="The lander's step_s is"):
        body(apollo, lambda seed: (PlaneStart(**PLANE), FLAT), step_s=step_s)
    if step_s != "short":
        plant = in_plane(body, apollo)
        with pytest.raises(ParameterError, match=r"moves in steps of 0\.005 s"):
            plant.step(step_s)
        assert plant.time_s == 0.0


@pytest.mark.parametrize("field", ["thrust_n", "exhaust_mps", "gravity_mps2"])
@pytest.mark.parametrize("value", [NAN, INF, 0.0, -1.0])
def test_invalid_engine_raises(apollo: LunarModule, field: str, value: float) -> None:
    with pytest.raises(ParameterError, match=f"The engine's {field} is"):
        vertical(ENGINE._replace(**{field: value}))
    with pytest.raises(ParameterError, match=f"The module's {field} is"):
        replace(apollo, **{field: value})


@pytest.mark.parametrize("how", [{"min_throttle": 1.1}, {"min_throttle": NAN}, {"ceiling_m": NAN}], ids=str)
def test_non_finite_vertical_lander_raises(how: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=f"The lander's {next(iter(how))} is"):
        vertical(**how)


@pytest.mark.parametrize(
    "how",
    [{"throttle_lag_s": -0.1}, {"gimbal_rad": NAN}, {"gimbal_rate_radps": -1.0}, {"jets_nm": INF}, {"gyration_m": 0.0}],
    ids=str,
)
def test_non_finite_module_raises(apollo: LunarModule, how: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=f"The module's {next(iter(how))} is"):
        replace(apollo, **how)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Throttle(0.6, 0.1), "from 0.6 to 0.1"),
        (lambda: Throttle(NAN, 0.1), "The throttle's lowest is nan"),
        (lambda: Leg(0.0, 1.0, 0.7), "The leg's spring_npm is 0"),
        (lambda: Leg(1.0, -1.0, 0.7), "The leg's damper_nspm is -1"),
        (lambda: Leg(1.0, 1.0, NAN), "The leg's friction is nan"),
        (lambda: GearLimits(vertical_mps=NAN), "The gear's vertical_mps is nan"),
        (lambda: GearLimits(attitude_rad=6.0), "The gear's attitude_rad is 6.0: degrees?"),
        (lambda: Terrain((0.0, 1.0)), "A terrain of 2 heights"),
        (lambda: make_terrain(1, relief_m=NAN), "A terrain has the height nan"),
    ],
)
def test_non_finite_part_raises(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        make()
    assert message in str(caught.value)


def test_unit_mistake_is_named(apollo: LunarModule) -> None:
    for make, slip in (
        (lambda: replace(apollo, exhaust_mps=311.0), "a specific impulse in seconds"),
        (lambda: replace(apollo, gimbal_rad=6.0), "degrees"),
        (lambda: PlaneStart(**PLANE | {"mass_kg": 7.5e6}), "grams"),
    ):
        with pytest.raises(ParameterError, match=f": {slip}\\?"):
            make()
