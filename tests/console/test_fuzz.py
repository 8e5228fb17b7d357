"""A fraction of the input of `fuzz_console.py`; a full run has 1 000 000 inputs."""

import random

import pytest

from .fuzz_console import FUZZERS

INPUTS = 4_000


@pytest.mark.slow
@pytest.mark.parametrize("name", FUZZERS)
def test_fuzzed_input_keeps_node_running_and_memory_bounded(name: str) -> None:
    fuzz, share = FUZZERS[name]
    fuzz(random.Random(20211121), int(INPUTS * share))
