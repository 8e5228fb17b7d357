"""Members of components and nodes by the names that the thesis gives them.

The listings log with `self.warn("%s is late", name)`, so that works. A name that would duplicate a function raises an
error that names the existing one.
"""

from __future__ import annotations

import logging
from typing import Any

from snr_sim.prelude.retired import Retired

_TIMER = "get_time_s(), which is the same all through one task."
_PROFILE = "leave it out: with Mode.DEBUG the node times each handler and loop by itself."


class LoggingMembers:
    """Shortcuts for `log`: a message, and the values of its `%s`."""

    @property
    def log(self) -> logging.Logger | logging.LoggerAdapter[logging.Logger]:
        """The logger."""
        raise NotImplementedError

    def dbg(self, message: str, *args: object) -> None:
        """Log at level DEBUG."""
        self.log.debug(message, *args)

    def info(self, message: str, *args: object) -> None:
        """Log at level INFO."""
        self.log.info(message, *args)

    def warn(self, message: str, *args: object) -> None:
        """Log at level WARNING."""
        self.log.warning(message, *args)

    def err(self, message: str, *args: object) -> None:
        """Log at level ERROR."""
        self.log.error(message, *args)

    def fatal(self, message: str, *args: object) -> None:
        """Log at level CRITICAL. It does not end the node: a handler that returns `tasks.terminate("reason")` does."""
        self.log.critical(message, *args)

    profile: Any = Retired("profile", _PROFILE)
    check_main_thread: Any = Retired("check_main_thread", "leave it out: any thread may schedule.")


class ComponentMembers(LoggingMembers):
    """Members of endpoints and loops in the thesis."""

    timer: Any = Retired("self.timer", f"self.{_TIMER}")
    profiler: Any = Retired("self.profiler", "self.parent.profiler, which is None unless the mode is DEBUG.")
    task_store_page: Any = Retired("task_store_page", "tasks.store_page(page).")
    task_store_data: Any = Retired("task_store_data", "self.store_data_task(key, data).")
    get_task_handler: Any = Retired("get_task_handler", "self.task_handlers[task_id].")


class LoopMembers(ComponentMembers):
    """Members of loops only in the thesis."""

    delay_s: Any = Retired("self.delay_s", "1 / self.max_tick_rate_hz.")
    set_delay: Any = Retired(
        "set_delay", "max_tick_rate_hz=50 in super().__init__(...); self.next_tick_at_s in loop()."
    )


class NodeMembers(LoggingMembers):
    """Members of nodes in the thesis."""

    timer: Any = Retired("node.timer", f"node.{_TIMER}")
    terminate: Any = Retired("node.terminate", "node.set_terminate_flag('why') ends a run; node.end() is loop()'s.")
    synchronous_store: Any = Retired(
        "synchronous_store", "node.store_page(page), which is stored before it is handled."
    )
    task_store_page: Any = Retired("task_store_page", "tasks.store_page(page).")
    dump_data: Any = Retired("dump_data", "node.datastore.pages, or `dump datastore` on the console.")
    get_task_handlers: Any = Retired("get_task_handlers", "node.machine.lookup.find(task).")
    handle_task: Any = Retired("handle_task", "a call of the handler: handler(task, task.id()).")
    execute_task: Any = Retired("execute_task", "node.schedule(task), then node.loop().")
    get_new_tasks: Any = Retired("get_new_tasks", "a Loop, which brings tasks in by itself.")
