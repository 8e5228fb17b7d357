"""Random numbers depend only on the seed and the name."""

import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.prelude.rng import component_seed, rng_for


@given(st.integers(-(2**70), 2**70), st.text(max_size=10))
def test_same_seed_and_name_give_same_numbers(seed: int, name: str) -> None:
    assert rng_for(seed, name).random(3).tolist() == rng_for(seed, name).random(3).tolist()


def test_two_names_or_two_seeds_never_share_a_generator() -> None:
    draws = {rng_for(seed, name).random() for seed in range(20) for name in ("a", "b", "ab", "a ", "")}
    assert len(draws) == 100


@pytest.mark.slow
def test_random_numbers_are_equal_in_every_process() -> None:
    command = "from snr_sim.prelude.rng import rng_for; print(rng_for(7, 'radar').integers(2**62))"
    printed = {subprocess.check_output([sys.executable, "-c", command], text=True) for _ in range(2)}
    assert printed == {f"{rng_for(7, 'radar').integers(2**62)}\n"}  # text hashes differ between processes


def test_component_seed_is_derived_from_seed_and_differs_from_it() -> None:
    assert component_seed(7) == component_seed(7)
    assert len({component_seed(seed) for seed in range(100)} - set(range(100))) == 100
