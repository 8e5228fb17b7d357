"""A diver with a page of its machine: its node stepped by hand, its recorded run, and browsers without a socket."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

from snr_sim import Config, ListReplayerFactory, Node, SimClock, SimRunner, TimeoutLoopFactory, tasks
from snr_sim.behaviors import Bridge, Drive, Read, machine_parts, parse
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header
from snr_sim.web.live_machine import LiveMachine
from snr_sim.web.messages import Rights
from snr_sim.web.session import MachinePage
from tests.behaviors.diver import DEPTHS, DIVER

BRIDGE = Bridge(
    {"depth": Read("depth", "depth_m", unit="m", fresh_s=0.5)}, {"up": Drive("thrust", "up_n", -50.0, 50.0)}
)


SHA = parse(DIVER, BRIDGE.parts).sha256
_COUNT = itertools.count()


def with_push(newtons: int) -> str:
    """Return the program with another push."""
    return DIVER.replace(":= [5]", f":= [{newtons}]")


def event_at(time_s: float, name: str, *values: Any) -> TimeoutLoopFactory:
    """Return what schedules an event, as the live page does: of several at one moment, in their order."""
    count = next(_COUNT)
    return TimeoutLoopFactory(time_s, task=tasks.event(name, list(values)), name=f"{name} at {time_s}, {count}")


def parts(*more: Any) -> list[Any]:
    diver = machine_parts(parse(DIVER, BRIDGE.parts), "diver", bridge=BRIDGE)
    return [ListReplayerFactory(DEPTHS, "depth", rate_hz=10.0), *diver, *more]


class Browser:
    """A connection to a page, with what it was sent."""

    def __init__(self, page: MachinePage, rights: Rights = "change") -> None:
        self.received: list[dict[str, Any]] = []
        self.session = page.open(rights, lambda data: self.received.append(json.loads(data)))

    def send(self, kind: str, **fields: Any) -> None:
        """Send a message."""
        self.session.receive(json.dumps({"kind": kind, **fields}))

    def of(self, kind: str) -> list[dict[str, Any]]:
        """Return the messages of a kind."""
        return [one for one in self.received if one["kind"] == kind]

    def newest(self, kind: str) -> dict[str, Any]:
        """Return the newest message of a kind."""
        return self.of(kind)[-1]


class Live:
    """A running node, stepped by hand, and the page of its machine."""

    def __init__(self, *factories: Any, name: str = "diver", folder: Path | None = None) -> None:
        self.clock = SimClock()
        self.node = Node("r", Config(factories={"r": list(factories) or parts()}), clock=self.clock)
        self.machine = LiveMachine(self.node, name, "a dive", folder)
        self.page = MachinePage(self.machine)
        self.node.begin()
        self.node.run_ready()
        self.wall_s = 0.0

    def browser(self, rights: Rights = "change") -> Browser:
        return Browser(self.page, rights)

    def until(self, time_s: float) -> None:
        """Run until a time, and let the page send what has changed."""
        while self.clock.now_s() < time_s - 1e-9:
            self.clock.run_next()
            self.node.run_ready()
        self.tick()

    def tick(self) -> None:
        self.node.run_ready()
        self.wall_s += 1.0
        self.page.tick(self.wall_s)


def record_dive(folder: Path, factories: list[Any], until_s: float) -> Path:
    """Record a run of components; return its folder."""
    folder.mkdir()
    clock, config = SimClock(), Config(factories={"r": factories})
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
    try:
        SimRunner(config, clock=clock, recorder=writer, until_s=until_s).run()
    finally:
        writer.close()
    return folder


def edit(browser: Browser, number: int, text: str, base: str = SHA) -> None:
    browser.send("edit", number=number, text=text, base_sha256=base)
