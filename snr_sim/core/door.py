"""The door: the one place where threads meet a node. Everything from outside enters here, in one order."""

from __future__ import annotations

from collections import deque
from queue import Empty, SimpleQueue

from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Task, TaskType

# Even a wait without a limit looks up this often. A signal that arrives in the instant before Python falls asleep does
# not wake it, so a wait that only the signal's handler could end would never end (seen: 2 of 300 interrupted nodes).
LOOK_UP_S = 0.2


class Door:
    """A queue that any thread may put into and one thread takes from; waiting at it costs nothing.

    `deque.append` and `SimpleQueue.put` are single steps that no other thread and no signal handler can cut in two.
    So there is no lock here that an interrupt could leave held, which is how a node hangs at Ctrl-C.
    """

    def __init__(self) -> None:
        self.waiting: deque[tuple[Task, str]] = deque()
        self.failure: SnrError | None = None
        self._wake: SimpleQueue[None] = SimpleQueue()
        self._asleep = False

    def put(self, task: Task, source: str) -> None:
        """Lets a task in; `source` is the name of the loop, link or person that brought it."""
        self.waiting.append((task, source))
        if self._asleep:
            self._wake.put(None)

    def fail(self, failure: SnrError) -> None:
        """Tells the node that something outside its thread has failed; the first one counts."""
        if self.failure is None:
            self.failure = failure
        self.put(Task(TaskType.terminate, "failure"), "failure")  # so that a busy node looks up from its queue

    def wait(self, timeout_s: float | None = None) -> None:
        """Returns when something is at the door, or after the timeout; now and then also before."""
        self._asleep = True  # before the last look, so that what comes after the look wakes us
        try:
            if not self.waiting:
                self._wake.get(timeout=LOOK_UP_S if timeout_s is None else min(timeout_s, LOOK_UP_S))
        except Empty:
            pass
        finally:
            self._asleep = False
