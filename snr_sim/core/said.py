"""What components print and log, for the recorder: `print` and `self.log` in a handler, a loop or anything they call.

Who prints is known by who calls: the innermost method of a component, or the machine that has called a handler which is
no method. So nothing is kept while nobody prints, and what a thread prints is its loop's.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Container, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Any

from snr_sim.core.component import NodeComponent
from snr_sim.core.machine import EventMachine

if TYPE_CHECKING:
    from snr_sim.core.node import Node


LEVELS = ("PRINT", "INFO", "WARNING", "ERROR", "CRITICAL")


@contextmanager
def hearing(nodes: Container[Node]) -> Iterator[None]:
    """Have the recorders of these nodes take down what their components print meanwhile.

    Args:
        nodes: of the run.
    """
    heard = sys.stdout = Heard(sys.stdout, nodes)
    try:
        yield
    finally:
        heard.is_over = True
        # Runs of two threads may end in another order than one within the other: the last puts the stream back.
        while isinstance(sys.stdout, Heard) and sys.stdout.is_over:
            sys.stdout = sys.stdout.target


class Heard(io.TextIOBase):
    """Passes on what is written, and tells the node of the component that writes.

    Args:
        target: the stream; None where the program was started without one.
        nodes: those that are told.

    Attributes:
        is_over: whether the run has ended. Then it only passes on.
    """

    def __init__(self, target: Any, nodes: Container[Node]) -> None:
        self.is_over = False
        self.target = target
        self._nodes = nodes

    def write(self, text: str) -> int:
        """Pass it on."""
        written = len(text) if self.target is None else int(self.target.write(text))
        if self.is_over:
            return written
        component = _speaker(sys._getframe(1))
        # One that prints before its super().__init__() has no node yet, and its words are in no trace.
        node: Node | None = getattr(component, "parent", None)
        if component is not None and node is not None and node in self._nodes:
            node.said(component.name, "PRINT", text)
        return written

    def flush(self) -> None:
        """Pass it on."""
        if self.target is not None:
            self.target.flush()

    def close(self) -> None:
        """Leave everything open: the stream is only lent."""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Return the stream's, which libraries ask for before they draw."""
        return getattr(self.target, "encoding", None) or "utf-8"

    def __getattr__(self, name: str) -> Any:  # buffer, reconfigure: what is written there is not recorded
        return getattr(self.target, name)

    def fileno(self) -> int:
        """Return the descriptor, as some libraries ask for it."""
        return int(self.target.fileno())

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return bool(self.target.isatty())


def _speaker(frame: FrameType | None) -> NodeComponent | None:
    while frame is not None:
        owner = frame.f_locals.get("self") if "self" in frame.f_code.co_varnames else None
        if isinstance(owner, EventMachine):  # it has called a handler that is no method
            owner = owner.running
        if isinstance(owner, NodeComponent):
            return owner
        frame = frame.f_back
    return None
