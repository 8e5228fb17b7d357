"""Questions that are answered by executing a run again: at which priority, and with which words they fail."""

from __future__ import annotations

import asyncio
import os
import sys

import pytest

from snr_sim.web import explanation


@pytest.mark.slow
def test_answer_has_the_priority_of_the_page_as_a_user_waits_for_it() -> None:
    print_priority = "import os, time; time.sleep(0.2); print(os.getpriority(os.PRIO_PROCESS, 0))"
    status, out, err = asyncio.run(explanation._output_of([sys.executable, "-c", print_priority]))
    assert (status, int(out), err) == (0, os.getpriority(os.PRIO_PROCESS, 0), b"")
