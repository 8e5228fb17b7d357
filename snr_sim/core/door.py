"""The door: the one place where threads meet a node. Everything from outside enters here, in one order."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue
from typing import Any

from snr_sim.core.lookout import Call, Lookout
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.task import Task, TaskType

# Even a wait without a limit looks up this often. A signal that arrives in the instant before Python falls asleep does
# not wake it, so a wait that only the signal's handler could end would never end (seen: 2 of 300 interrupted nodes).
LOOK_UP_S = 0.2


class Door:
    """A queue that any thread may put into and one thread takes from; waiting at it costs nothing.

    `deque.append` and `SimpleQueue.put` are single steps that no other thread and no signal handler can cut in two.
    So nothing enters through a lock that an interrupt could leave held, which is how a node hangs at Ctrl-C.
    """

    def __init__(self) -> None:
        self.waiting: deque[tuple[Task, str]] = deque()
        self.failure: SnrError | None = None
        self._wake: SimpleQueue[None] = SimpleQueue()
        self._asleep = False
        self._lookout: Lookout | None = None
        self._opening = threading.Lock()  # of the lookout; links' threads take it, never who waits or puts
        self.visits = 0  # how often the node has come to wait

    @property
    def is_waited_at(self) -> bool:
        """Whether the node's thread waits here now."""
        return self._asleep

    def watch(self, descriptor: int, serve: Callable[[list[Any]], None], what: Any) -> None:
        """Have `serve` called on the node's thread when there is something to read, while it waits at the door.

        One call gets `what` of all descriptors with this `serve` that can be read: it decides whose turn it is.
        What comes for a node that has nothing else to do costs no change of threads then. A node that has much to do
        does not come to its door, so who watches needs another way to read in the long run.
        """
        with self._opening:  # two links may come up at one moment, each on its own thread
            if self._lookout is None:
                self._lookout = Lookout()
                self._wake.put(None)  # whoever waits already waits for this
        self._lookout.watch(descriptor, serve, what)

    def unwatch(self, descriptor: int) -> None:
        """End watching; from any thread."""
        if self._lookout is not None:
            self._lookout.unwatch(descriptor)

    def close(self) -> None:
        """Let go of what waiting for descriptors needs; nobody waits here any more."""
        if self._lookout is not None:
            self._lookout.close()

    def put(self, task: Task, source: str) -> None:
        """Let a task in; `source` is the name of the loop, link or person that brought it."""
        self.waiting.append((task, source))
        if self._asleep:
            self._asleep = False  # one call is enough, however many tasks come before it is heard
            if self._lookout is None:
                self._wake.put(None)
            else:
                self._lookout.wake()

    def fail(self, failure: SnrError) -> None:
        """Tell the node that something outside its thread has failed; the first one counts."""
        if self.failure is None:
            self.failure = failure
        self.put(Task(TaskType.terminate, "failure"), "failure")  # so that a busy node looks up from its queue

    def wait(self, timeout_s: float | None = None) -> None:
        """Return when something is at the door, or after the timeout; now and then also before."""
        timeout_s = LOOK_UP_S if timeout_s is None else min(timeout_s, LOOK_UP_S)
        self.visits += 1
        lookout = self._lookout
        seen: Sequence[Call] = ()
        self._asleep = True  # before the last look, so that what comes after the look wakes us
        try:
            if not self.waiting:
                if lookout is None:
                    self._wake.get(timeout=timeout_s)
                else:
                    seen = lookout.wait(timeout_s)
        except Empty:
            pass
        finally:
            self._asleep = False
        for serve, what in seen:
            serve(what)
