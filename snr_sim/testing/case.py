"""SNRTestCase: a unittest.TestCase that knows nodes. Time in it is virtual, so no test sleeps."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest import TestCase

from snr_sim.core.clocks import SimClock
from snr_sim.core.config import AnyFactory, Config, Mode
from snr_sim.core.node import Node
from snr_sim.core.runners import TEST_ROLE, TestRunner
from snr_sim.prelude.retired import Retired
from snr_sim.prelude.task import DataKey, Page, TaskId
from snr_sim.prelude.values import encode_value
from snr_sim.testing.expector import Expector, OrderedExpector, TaskExpectations


class SNRTestCase(TestCase):
    """Test case with nodes, expectors and files at hand.

    Example: three values go in, three averages come out.

        class TestFilter(SNRTestCase):
            def test_each_value_gives_an_average(self):
                with self.expector({(TaskType.process_data, "smooth"): 3}) as expector:
                    self.run_test_node([
                        ListReplayerFactory([1.0, 2.0, 3.0], "raw"),
                        MovingAvgFilterFactory("raw", "smooth", 2),
                        ExpectorEndpointFactory(expector),
                    ])
    """

    get_context: Any = Retired("get_context", "self.mock_node(), for what wants a node; TextReader(file) wants none.")
    create_server: Any = Retired("create_server", "links=[MemoryLink()] of a SimRunner: links run in lock step.")
    wrap_socket: Any = Retired("wrap_socket", "links=[MemoryLink()] of a SimRunner: links run in lock step.")

    def expector(self, expected: TaskExpectations) -> Expector:
        """Return an expector that counts; use it in a `with`."""
        return Expector(expected, self)

    def ordered_expector(self, expected: Sequence[TaskId]) -> OrderedExpector:
        """Return an expector that checks the order; use it in a `with`."""
        return OrderedExpector(expected, self)

    def get_config(self, factories: Sequence[AnyFactory] = (), mode: Mode = Mode.TEST) -> Config:
        """Return a config with these factories in the role 'test'."""
        return Config(mode, {TEST_ROLE: list(factories)})

    def get_test_node(self, factories: Sequence[AnyFactory] = (), mode: Mode = Mode.TEST, *, seed: int = 0) -> Node:
        """Return a node of these factories under a virtual clock; `node.loop()` runs it."""
        return Node(TEST_ROLE, self.get_config(factories, mode), clock=SimClock(), seed=seed)

    def run_test_node(
        self, factories: Sequence[AnyFactory], mode: Mode = Mode.TEST, *, seed: int = 0, until_s: float = 3600.0
    ) -> Node:
        """Run a node of these factories to its end and return it, with its datastore, notes and exit_reason.

        It ends at a terminate task, when nothing is left to do, or when virtual time has come to `until_s`.
        """
        runner = TestRunner(self.get_config(factories, mode), seed=seed, until_s=until_s)
        runner.run()
        return runner.node

    def mock_node(self) -> Node:
        """Return a node without components: the parent for a component that is tested by itself."""
        return self.get_test_node()

    def temp_file(self, name: str = "test_file", contents: str | bytes = b"") -> Path:
        """Return the path of a file that is gone when the test ends; it exists if `contents` are given."""
        folder = Path(tempfile.mkdtemp(prefix="snr_test_"))
        self.addCleanup(shutil.rmtree, folder, ignore_errors=True)
        path = folder / name
        if contents:
            path.write_bytes(contents.encode() if isinstance(contents, str) else contents)
        return path

    def assertPage(  # noqa: N802 - unittest's way of naming, and the thesis'
        self,
        page: Page | None,
        key: DataKey,
        data: Any,
        origin: str | None = None,
        created_at_s: float | None = None,
        process: bool | None = None,
    ) -> None:
        """Fail unless the page has this key and data, and the given values; NaN equals NaN, arrays compare whole."""
        if page is None:
            self.fail(f"There is no page where '{key}' = {data!r} was expected: nothing has stored it.")
        # By encoding, because NaN is not equal to itself and arrays have no one answer.
        if encode_value(page.data) != encode_value(data) and page.data != data:
            self.fail(f"Page '{page.key}' holds {page.data!r}, expected {data!r}.")
        others = {"key": key, "origin": origin, "created_at_s": created_at_s, "process": process}
        for name, expected in others.items():
            if expected is not None and getattr(page, name) != expected:
                self.fail(f"Page '{page.key}' has {name} = {getattr(page, name)!r}, expected {expected!r}.")
