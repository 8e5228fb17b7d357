"""A fraction of the input of `fuzz_console.py`; a full run has 1 000 000 inputs."""

import random

import pytest

from .fuzz_console import FUZZERS

INPUTS = 4_000


@pytest.mark.slow
@pytest.mark.parametrize("name", FUZZERS)
def test_no_input_ends_a_node_changes_what_it_should_not_or_fills_memory(name: str) -> None:
    fuzz, share = FUZZERS[name]
    fuzz(random.Random(20211121), int(INPUTS * share))
