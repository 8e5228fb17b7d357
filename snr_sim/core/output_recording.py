"""Records what components print and log: `print` and `self.log` in a handler, a loop or any function they call.

The printing component is found on the call stack: the innermost method of a component, or the machine if the handler
is not a method. So a run without prints has no cost, and a print on a thread belongs to that thread's loop.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Collection, Container, Iterator
from contextlib import contextmanager, nullcontext, suppress
from types import FrameType
from typing import TYPE_CHECKING, Any

from snr_sim.core.component import NodeComponent
from snr_sim.core.machine import EventMachine
from snr_sim.core.unblocked_output import unblocked_output

if TYPE_CHECKING:
    from snr_sim.core.node import Node


LEVELS: tuple[str, ...] = ("PRINT", "INFO", "WARNING", "ERROR", "CRITICAL", "PROGRAM")  # the text of a machine


@contextmanager
def record_output(nodes: Collection[Node]) -> Iterator[None]:
    """Record what the components of these nodes print while active. It does not block those on the wall clock."""
    with nullcontext() if all(node.is_in_lock_step for node in nodes) else unblocked_output():
        stream = sys.stdout = RecordedOutput(sys.stdout, nodes)
        try:
            yield
        finally:
            stream.is_finished = True
            # Runs on two threads need not be nested: the last one to end restores the stream.
            while isinstance(sys.stdout, RecordedOutput) and sys.stdout.is_finished:
                sys.stdout = sys.stdout.target


class RecordedOutput(io.TextIOBase):
    """Stream that forwards text, and records it at the node of the component that writes.

    Args:
        target: the stream; None if the program was started without one.
        nodes: the nodes that record.

    Attributes:
        is_finished: whether the run has ended. Then the stream only forwards.
    """

    def __init__(self, target: Any, nodes: Container[Node]) -> None:
        self.is_finished: bool = False
        self.target: Any = target
        self._nodes = nodes

    def write(self, text: str) -> int:
        """Forward and record text; return the number of characters."""
        if self.target is not None:
            with suppress(OSError):  # as in `print_line`: a robot must not stop because its log is on a full disk
                self.target.write(text)
        if self.is_finished:
            return len(text)
        component = _writing_component(sys._getframe(1))
        # A component that prints before its super().__init__() has no node yet, so its text is not recorded.
        node: Node | None = getattr(component, "parent", None)
        if component is not None and node is not None and node in self._nodes:
            node.record_text(component.name, "PRINT", text)
        return len(text)

    def flush(self) -> None:
        """Flush the target."""
        if self.target is not None:
            with suppress(OSError):
                self.target.flush()

    def close(self) -> None:
        """Do nothing: the target belongs to the program."""

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Return the target's encoding, which libraries read before they draw."""
        return getattr(self.target, "encoding", None) or "utf-8"

    def __getattr__(self, name: str) -> Any:  # buffer, reconfigure: what is written there is not recorded
        return getattr(self.target, name)

    def fileno(self) -> int:
        """Return the descriptor, as some libraries ask for it."""
        return int(self.target.fileno())

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return bool(self.target.isatty())


def _writing_component(frame: FrameType | None) -> NodeComponent | None:
    while frame is not None:
        owner = frame.f_locals.get("self") if "self" in frame.f_code.co_varnames else None
        if isinstance(owner, EventMachine):  # it has called a handler that is not a method
            owner = owner.running
        if isinstance(owner, NodeComponent):
            return owner
        frame = frame.f_back
    return None
