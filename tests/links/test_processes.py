"""Links between two processes: both kinds carry every page in both directions, and detect that the other was killed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest

from snr_sim import PipeLoopFactory, SocketsPair

pytestmark = pytest.mark.slow

FAR_ROLE = Path(__file__).with_name("far_role.py")
KEYS = ["question", "end"]


@contextmanager
def far_role(start: Callable[..., Any], kind: str) -> Iterator[tuple[Any, subprocess.Popen[bytes]]]:
    """Start a node here, and a process with the remote role on its link."""
    if kind == "tcp":
        pair = SocketsPair(("127.0.0.1", 0), name="t", queue_pages=50_000)
        near = start("near", [pair.server(KEYS)], down="t")
        process = subprocess.Popen([sys.executable, str(FAR_ROLE), kind, str(pair.port)])
    else:
        ours, theirs = Pipe()
        near = start("near", [PipeLoopFactory(ours, KEYS, name="t")])
        number = theirs.fileno()
        process = subprocess.Popen([sys.executable, str(FAR_ROLE), kind, str(number)], pass_fds=[number])
        theirs.close()
    try:
        near.until_link("t")
        yield near, process
    finally:
        process.kill()
        process.wait()


@pytest.mark.skipif(os.name == "nt", reason="hands a descriptor on, as POSIX does")
@pytest.mark.parametrize("kind", ["tcp", "pipe"])
def test_pages_cross_to_another_process_and_back_in_order(start: Callable[..., Any], kind: str) -> None:
    with far_role(start, kind) as (near, process):
        for value in range(3000):
            near.store("question", value)
        assert near.until_stored("answer", 3000) == list(range(3000))
        near.store("end", True)
        assert process.wait(120) == 0
        assert "left" in near.until_link("t", up=False)["reason"]


@pytest.mark.skipif(os.name == "nt", reason="as above")
@pytest.mark.parametrize("kind", ["tcp", "pipe"])
def test_killed_process_takes_only_the_link_down(start: Callable[..., Any], kind: str) -> None:
    with far_role(start, kind) as (near, process):
        process.kill()
        near.until_link("t", up=False)
        near.store("question", 1)
        near.until_stored("question")
        assert near.failure is None
