"""StateManager: the broker, an endpoint that passes each message on to the processes that subscribe to its key.

It also knows which process reports that its loop works. On the wall clock it sends one that has been silent a page, so
that it fails, and is started again. In lock step nothing is started again: a silence is noted, and the page `health`,
which the supervisor of real processes makes, is made here, by the virtual time.

Its node stores each page before it handles it, so the last value of each key is there. The link carries a message to
the peers that the broker names, with a bounded queue for each: `peers` in page `link_processes` counts what waits and
what was dropped.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from typing import Any

import msgspec
from msgspec.structs import replace

from snr_sim.core.endpoint import Endpoint, EndpointFactory
from snr_sim.core.loop import Loop
from snr_sim.links.link import Link
from snr_sim.prelude import tasks
from snr_sim.prelude.errors import suggest
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import Page, SomeTasks, Task, TaskId, TaskType
from snr_sim.processes.message import EXTEND, LINK_PAGE, PET, QUIT, RESET, SILENT, SUBSCRIPTIONS, TERMINATE
from snr_sim.processes.seed_names import SeedNames
from snr_sim.processes.subscriptions import Subscriptions
from snr_sim.supervision.health import HEALTH, PERIOD_S, HealthReports
from snr_sim.supervision.plan import Supervisor
from snr_sim.supervision.role_process import SUPERVISOR
from snr_sim.supervision.tree import Tree
from snr_sim.supervision.watch import Watch

REPORT_EVENT = "report"


class ReportLoop(Loop):
    """Asks the state manager for its reports."""

    max_tick_rate_hz = 1.0 / PERIOD_S

    def loop(self) -> SomeTasks:
        """Send the event."""
        return tasks.event(REPORT_EVENT)


class StateManager(SeedNames, Endpoint):
    """Passes messages on, keeps the last value of each key, and watches which process hangs.

    Attributes:
        plan: of the processes and the broker.
        table: who subscribes to what.
        watch: the deadlines of the processes, of which none has connected at first.
    """

    plan: Supervisor

    def __init__(self, factory: EndpointFactory, parent: NodeApi, name: str) -> None:
        super().__init__(factory, parent, name)
        self.table: Subscriptions = Subscriptions()
        self._tree = Tree(self.plan)
        self._health = HealthReports(self._tree)
        self.watch: Watch = self._tree.watch
        self._published: Counter[tuple[str, str]] = Counter()  # by key and process
        self._own = {
            SUBSCRIPTIONS: self._set_subscriptions,
            TERMINATE: lambda name, data: self.terminate_state(),
            PET: lambda name, data: self.watch.pet(name, self.get_time_s()),
            EXTEND: lambda name, data: self.watch.extend(name, data),
            RESET: self._reset_watch,
        }
        self.task_handlers = {TaskType.store_page: self.on_stored, (TaskType.event, REPORT_EVENT): self.on_report}

    def begin(self) -> SomeTasks:
        """Expect all processes."""
        self._tree.begin(self.get_time_s())
        link = self._link
        if link is not None:
            link.forwards = True
        return None

    def on_stored(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Do what a process asks for, or pass its message on."""
        page = task.page
        assert page is not None
        if page.origin in (self.parent.name, SUPERVISOR):
            if page.key == HEALTH:
                self._send(self.table.of(HEALTH), page)
            return None
        name = page.origin.removesuffix("_node")
        subscribers: list[str] = []
        if name in self._health.usages:
            self._take(name, page)
            subscribers = [f"{other}_node" for other in self.table.of(page.key) if other != name]
        if self._link is not None:
            self._link.forward(page, subscribers)
        return None

    def _take(self, name: str, page: Page) -> None:
        """Do what a process asks for, or count its message."""
        if self._tree.process(name).life == "starting":  # its first page
            self._tree.petted(name, self.get_time_s())
        own: Any = self._own.get(page.key)
        if own is not None:
            own(name, page.data)
        else:
            self._published[page.key, name] += 1

    @property
    def _link(self) -> Link | None:
        """The link to the processes; there is none in a replay."""
        link = self.parent.components.get(LINK_PAGE)
        return link if isinstance(link, Link) else None

    def _send(self, names: Collection[str], page: Page) -> None:
        link = self._link
        if names and link is not None:
            link.send(replace(page, process=True), [f"{name}_node" for name in names])

    def _set_subscriptions(self, name: str, data: dict[str, Any]) -> None:
        self.table.set_keys(name, data["keys"])
        if data["timeouts_s"] is not None:  # a new connection, perhaps of a process that was started again
            now_s = self.get_time_s()
            self.watch.add(name, self._tree.process(name).child.timeouts.hang_s, now_s)
            for timeout_s in data["timeouts_s"]:
                self.watch.extend(name, timeout_s)
        for key in data["last"]:
            page = self.parent.datastore.pages.get(key)
            if page is not None:
                # Of this node: a link does not bring a node its own pages, and this one may be older than its process.
                self._send([name], replace(page, origin=self.parent.name))

    def _reset_watch(self, name: str, data: Any) -> None:
        self.watch.reset(self.get_time_s())
        self.log.info("%s has reset the watchdog of all processes.", name)

    def on_report(self, task: Task, task_id: TaskId) -> SomeTasks:
        """Report silent processes; in lock step also the health of all."""
        now_s = self.get_time_s()
        self._tree.petted(self.name, now_s)
        for name in self.watch.take_hanging(now_s):
            timeout_s = self.watch.deadlines[name].timeout_s
            text = f"{name} has not reported for {timeout_s:g} s"
            self.log.warning("%s.", text)
            self.parent.add_note(f"t = {now_s:.3f} s: {text}. A loop that waits longer needs watchdog_extend(seconds).")
            if not self.parent.is_in_lock_step:
                self._send([name], self.page(SILENT, timeout_s))
        health = self._health.take(now_s) if self.parent.is_in_lock_step else None
        if health is None:
            return None
        health = replace(health, supervisor_pid=None)  # a process id would differ from run to run
        return self.store_data_task(HEALTH, msgspec.to_builtins(health))

    # The seed's interface

    def add_subscriber(self, key: str, name: str) -> None:
        """Let a process receive a key until it sends its own list again."""
        self.table.add(key, name)

    def remove_subscriber(self, key: str, name: str) -> None:
        """Let a process receive a key no more, until it sends its own list again."""
        self.table.remove(key, name)

    def dump_subscribers(self) -> str:
        """Return a line for each key, with its subscribers."""
        return self.table.dump()

    def terminate_state(self) -> None:
        """End all processes that have connected, and the broker."""
        self._send([name for name in self.watch.deadlines if name != self.name], self.page(QUIT, ""))
        self.schedule(tasks.finish(QUIT))

    def terminate(self) -> None:
        """Note the keys that were published for no subscriber, and those that were never published."""
        if self.parent.never_ran:
            return
        ever, published = self.table.ever, {key for key, _ in self._published}
        for (key, name), count in sorted(self._published.items()):
            if key not in ever:
                near = suggest(key, ever, "subscribed are")
                of = next(
                    (f" ({', '.join(self.table.of(one))} subscribes to it.)" for one in ever if f"'{one}'?" in near), ""
                )
                what = f"No process subscribed to '{key}', which {name} published {count} times"
                self.parent.add_note(f"{what}; {near}{of}")
        for key in sorted(ever - published - {HEALTH}):
            near = suggest(key, published, "published were")
            names = ", ".join(self.table.of(key)) or "A process"
            self.parent.add_note(f"{names} subscribed to '{key}', never published; {near}")
