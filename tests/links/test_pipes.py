"""Links over pipes: between threads here, between processes in tests/links/test_processes.py."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing import Pipe
from typing import Any

import pytest

from snr_sim import PipeLoopFactory, PipesPair
from snr_sim.links.pipes import port_of
from snr_sim.prelude.errors import LinkError

from .conftest import simulate, ticks


@pytest.mark.slow
def test_pipe_carries_pages_in_both_directions_and_reports_its_end(start: Callable[..., Any]) -> None:
    ours, theirs = Pipe()
    a = start("a", [PipeLoopFactory(ours, "x")])
    b = start("b", [PipeLoopFactory(theirs, ["y"])])
    a.store("x", *range(100))
    b.store("y", (1, 2))
    a.until_link("pipe")
    b.until_link("pipe")
    assert a.until_stored("y") == [(1, 2)]
    b.until(lambda: b.stored["x"] and b.stored["x"][-1] == 99)
    assert a.until_link("pipe", up=True)["has_left"] is False
    b.end()
    gone = a.until_link("pipe", up=False)
    assert (gone["has_left"], gone["reason"]) == (True, "'b_node' left: node 'b_node' ended: test is over.")


def test_pipes_pair_runs_in_lock_step() -> None:
    pair = PipesPair()
    runner = simulate({"a": [ticks("x"), pair.client("x")], "b": [pair.server()]}, until_s=1.01)
    assert runner.nodes["b"].get_data("x") == 10


def test_one_way_pipe_raises_link_error() -> None:
    reader, writer = Pipe(duplex=False)
    with pytest.raises(LinkError, match="needs a pipe for both directions"):
        port_of(reader)
    reader.close()
    writer.close()


@pytest.mark.slow
def test_failed_pipe_link_stays_down_and_keeps_the_node(
    start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = PipesPair()
    a, b = start("a", [pair.client("x")]), start("b", [pair.server()])
    a.until_link("pipe")
    b.until_link("pipe")
    monkeypatch.setattr(a.node.components["link_pipe"].transport, "_until_s", lambda now_s: 1 / 0)
    assert "ZeroDivisionError" in a.until_link("pipe", up=False)["reason"]
    assert "closed" in b.until_link("pipe", up=False)["reason"]
    monkeypatch.undo()
    a.store("x", 1)
    a.until_stored("x")
    page = a.until_link("pipe", up=False, failures=a.node.components["link_pipe"].failures)
    assert "ZeroDivisionError" in page["reason"]
