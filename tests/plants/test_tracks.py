"""Speeds of a tracked vehicle after a step, against impulses that are applied one after another until none changes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from snr_sim.plants.ground.dozer import Dozer
from snr_sim.plants.ground.tracks import Tracks
from snr_sim.plants.ground.traction import GRAVITY_MPS2
from snr_sim.plants.ground.wall_contacts import Speeds
from tests.plants.test_dozer_2d import DOZER

STEP_S = 0.005
MAX_ITERATIONS = 20_000


def by_sequential_impulses(
    dozer: Dozer, speeds: Speeds, left: float, right: float, soil_n: float, soil_m: float
) -> Speeds:
    """Return what `Tracks.drive` returns at heading 0; the method is that of snr_sim/plants/impulses_2d.py."""
    weight_n, half, arm = dozer.mass_kg * GRAVITY_MPS2, 0.5 * dozer.track_m, 0.375 * dozer.track_length_m
    pull = STEP_S * min(dozer.max_pull_n, 0.5 * dozer.grip_along * weight_n)
    across = STEP_S * dozer.grip_across * weight_n / 3.0
    # Share of the forward, sideways and turning speed, goal and limit.
    rows = [(1.0, 0.0, -half, left, pull), (1.0, 0.0, half, right, pull), (1.0, 0.0, -soil_m, 0.0, STEP_S * soil_n)]
    rows += [(0.0, 1.0, one, 0.0, across) for one in (arm, 0.0, -arm)]
    impulses, (ahead, side, turn) = [0.0] * len(rows), speeds
    for _ in range(MAX_ITERATIONS):
        largest = 0.0
        for i, (a, b, c, goal, limit) in enumerate(rows):
            per_ns = (a + b) / dozer.mass_kg + c * c / dozer.inertia_kgm2
            new = impulses[i] + (goal - (a * ahead + b * side + c * turn)) / per_ns
            new = min(limit, max(-limit, new))
            more, impulses[i] = new - impulses[i], new
            ahead += a * more / dozer.mass_kg
            side += b * more / dozer.mass_kg
            turn += c * more / dozer.inertia_kgm2
            largest = max(largest, abs(more))
        if largest / dozer.mass_kg < 1e-15:
            return ahead, side, turn
    return reject()  # where goals nearly agree, they converge slowly


numbers = st.fixed_dictionaries(
    {
        "mass_kg": st.floats(1.0, 40.0),
        "inertia_kgm2": st.floats(0.05, 5.0),
        "track_m": st.floats(0.1, 0.6),
        "track_length_m": st.floats(0.1, 0.8),
        "max_pull_n": st.floats(1.0, 100.0),
        "grip_along": st.floats(0.0, 3.0),
        "grip_across": st.floats(0.0, 2.0),
    }
)
rates = st.integers(-40, 40).map(lambda hundredths: 0.01 * hundredths)  # so that some agree
soils = st.just((0.0, 0.0)) | st.tuples(st.floats(1.0, 60.0), st.integers(-21, 21).map(lambda cm: 0.01 * cm))


@given(numbers, st.tuples(rates, rates, rates.map(lambda rate: 5.0 * rate)), rates, rates, soils)
def test_speeds_equal_those_of_sequential_impulses(
    values: dict[str, Any], speeds: Speeds, left: float, right: float, soil: tuple[float, float]
) -> None:
    dozer = replace(DOZER, **values)
    expected = by_sequential_impulses(dozer, speeds, left, right, *soil)
    assert Tracks(dozer, STEP_S).drive(0.0, speeds, left, right, *soil) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("soil_m", [-0.17, 0.17])
def test_soil_in_front_of_a_track_is_pushed(soil_m: float) -> None:
    """The two then share an arm, so there is no rate of turning at which only both reach their goals."""
    speeds, soil = (0.1, 0.0, 0.0), (20.0, soil_m)
    expected = by_sequential_impulses(DOZER, speeds, 0.2, 0.2, *soil)
    assert Tracks(DOZER, STEP_S).drive(0.0, speeds, 0.2, 0.2, *soil) == pytest.approx(expected, abs=1e-9)
