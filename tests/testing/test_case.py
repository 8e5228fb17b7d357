"""Assertions of SNRTestCase, and the messages of its failures."""

import math
from pathlib import Path

import numpy as np
import pytest

from snr_sim import ListReplayerFactory, Mode, Page, SimClock, SNRTestCase, TimeoutLoopFactory
from snr_sim.prelude.errors import RetiredNameError


class Pages(SNRTestCase):
    page = Page("depth", 1.5, "test_node", 0.25, process=False)

    def test_a_page_is_compared_in_what_is_given(self) -> None:
        self.assertPage(self.page, "depth", 1.5)
        self.assertPage(self.page, "depth", 1.5, origin="test_node", created_at_s=0.25, process=False)

    def test_assert_page_reports_difference(self) -> None:
        for change, expected in (
            ({"key": "dpth"}, "has key = 'depth', expected 'dpth'"),
            ({"data": 2}, "Page 'depth' holds 1.5, expected 2"),
            ({"origin": "x"}, "has origin = 'test_node', expected 'x'"),
            ({"created_at_s": 0.0}, "has created_at_s = 0.25, expected 0.0"),
            ({"process": True}, "has process = False, expected True"),
        ):
            with pytest.raises(AssertionError, match=expected):
                self.assertPage(self.page, **{"key": "depth", "data": 1.5, **change})  # type: ignore[arg-type]

    def test_assert_page_reports_missing_page(self) -> None:
        with pytest.raises(AssertionError, match="nothing has stored it"):
            self.assertPage(None, "depth", 1.5)

    def test_nan_equals_nan_and_arrays_are_compared_whole(self) -> None:
        self.assertPage(Page("x", [math.nan], "n", 0.0), "x", [math.nan])
        self.assertPage(Page("x", np.arange(3), "n", 0.0), "x", np.arange(3))
        self.assertPage(Page("x", 1, "n", 0.0), "x", 1.0)
        with pytest.raises(AssertionError, match="holds"):
            self.assertPage(Page("x", [1, 2], "n", 0.0), "x", [1, 3])


class Nodes(SNRTestCase):
    def test_a_node_runs_in_virtual_time_to_its_end(self) -> None:
        node = self.run_test_node([TimeoutLoopFactory(seconds=1000)])
        assert node.exit_reason == "timeout"
        assert node.get_time_s() == 1000.0
        assert node.role == "test"

    def test_a_run_has_a_limit(self) -> None:
        node = self.run_test_node([TimeoutLoopFactory(seconds=1000)], until_s=10.0)
        assert node.exit_reason == "time limit"

    def test_a_node_to_run_by_hand(self) -> None:
        node = self.get_test_node([ListReplayerFactory([1], "x")], seed=7)
        assert node.seed == 7
        assert isinstance(node.clock, SimClock)
        node.loop()
        self.assertPage(node.get_page("x"), "x", 1)

    def test_a_bare_node_and_a_config(self) -> None:
        assert list(self.mock_node().components) == ["node_core"]
        config = self.get_config([TimeoutLoopFactory()])
        assert (config.mode, len(config.get("test"))) == (Mode.TEST, 1)

    def test_a_node_in_debug_mode_is_profiled(self) -> None:
        assert self.get_test_node([TimeoutLoopFactory()], Mode.DEBUG).profiler is not None
        assert self.run_test_node([TimeoutLoopFactory()], Mode.DEBUG).profiler is not None

    def test_members_of_2021_raise_with_replacement(self) -> None:
        for name in ("get_context", "create_server", "wrap_socket"):
            with pytest.raises(RetiredNameError, match=name):
                getattr(self, name)


class Files(SNRTestCase):
    def test_a_file_lives_as_long_as_the_test(self) -> None:
        inner = SNRTestCase()
        empty, full = inner.temp_file(), inner.temp_file("trace.jsonl", "line\n")
        assert not empty.exists()
        assert full.read_text() == "line\n"
        assert full.name == "trace.jsonl"
        empty.write_bytes(b"x")
        inner.doCleanups()
        assert not full.exists()
        assert not Path(empty).parent.exists()
