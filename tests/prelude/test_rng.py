"""Random numbers depend only on the seed and the name."""

import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from snr_sim.prelude.rng import chance_of, rng_for


@given(st.integers(-(2**70), 2**70), st.text(max_size=10))
def test_the_same_seed_and_name_give_the_same_chance(seed: int, name: str) -> None:
    assert rng_for(seed, name).random(3).tolist() == rng_for(seed, name).random(3).tolist()


def test_two_names_or_two_seeds_never_share_a_generator() -> None:
    draws = {rng_for(seed, name).random() for seed in range(20) for name in ("a", "b", "ab", "a ", "")}
    assert len(draws) == 100


@pytest.mark.slow
def test_chance_does_not_depend_on_the_process() -> None:
    command = "from snr_sim.prelude.rng import rng_for; print(rng_for(7, 'radar').integers(2**62))"
    printed = {subprocess.check_output([sys.executable, "-c", command], text=True) for _ in range(2)}
    assert printed == {f"{rng_for(7, 'radar').integers(2**62)}\n"}  # text hashes differ between processes


def test_the_chance_of_components_follows_from_the_seed_and_is_not_the_seed() -> None:
    assert chance_of(7) == chance_of(7)
    assert len({chance_of(seed) for seed in range(100)} - set(range(100))) == 100
