"""Soak test: two nodes in two processes send each other pages over a bad link, for a given time.

Memory, descriptors and threads must not grow, and every page must be accounted for: it arrived, or was lost by a
simulated fault, or was dropped by the queue. Run: python tests/bench/soak_links.py [--minutes 30]
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import peers

from snr_sim import (
    Config,
    Endpoint,
    EndpointFactory,
    Loop,
    LoopFactory,
    Mode,
    Node,
    SocketsPair,
    SomeTasks,
    Task,
    TaskId,
    TaskType,
    tasks,
)
from snr_sim.links.faults import LinkFaults

RATE_HZ = 500.0
REST_S = 10.0  # the test ends when no page has arrived for this long
POLL_PERIOD_S = 0.5
USE_PERIOD_S = 10.0
WARM_UP_USES = 12  # two minutes, in which caches fill; shorter runs are not evaluated
LINK = "link_soak"
CUT_PERIOD_S = 20.0
CUT_S = 1.0  # shorter than the time after which the other end counts as gone: the connection stays, counts are exact
FAULTS = LinkFaults(0.005, 0.01, loss=0.01, duplication=0.01, reordering=0.02, bandwidth_bps=10e6)


class Source(Loop):
    """Stores numbered pages until it is time to rest."""

    factory: SourceFactory

    def loop(self) -> None:
        factory = self.factory
        if factory.count < factory.max_count:
            self.store_data(f"{self.parent.role}_number", [factory.count, "x" * (factory.count % 200)])
            factory.count += 1


class SourceFactory(LoopFactory):
    """Makes it, and keeps its count."""

    def __init__(self, max_count: int) -> None:
        super().__init__()
        self.max_count = max_count
        self.count = 0

    def get(self, parent: Node) -> Loop:
        return Source(self, parent, "source", RATE_HZ)


class Sink(Endpoint):
    """Records arrivals in one byte per page, preallocated, so that the records do not look like a leak."""

    factory: SinkFactory

    def __init__(self, factory: SinkFactory, parent: Node) -> None:
        super().__init__(factory, parent, "sink")
        self.task_handlers = {(TaskType.store_page, factory.key): self.note}

    def note(self, task: Task, task_id: TaskId) -> SomeTasks:
        self.factory.arrivals[task.val_list[0].data[0]] += 1
        return None


class SinkFactory(EndpointFactory):
    """Makes it, and keeps its notes."""

    def __init__(self, key: str, max_count: int) -> None:
        super().__init__()
        self.key = key
        self.arrivals = bytearray(max_count)

    def get(self, parent: Node) -> Endpoint:
        return Sink(self, parent)


def use_of_this_process() -> dict[str, int]:
    """Return what the process holds: memory [KiB], descriptors, threads."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines() if ":" in line)
    return {
        "memory_kib": int(status["VmRSS"].split()[0]),
        "descriptors": len(os.listdir("/proc/self/fd")),
        "threads": int(status["Threads"]),
    }


def run(role: str, port: int, max_count: int) -> dict[str, Any]:
    """Run one of the nodes; return its counts, and what it held every ten seconds while it stored pages."""
    other = "robot" if role == "topside" else "topside"
    cuts = [CUT_PERIOD_S * i for i in range(1, int(max_count / RATE_HZ / CUT_PERIOD_S) + 1)]
    faults = replace(FAULTS, cut=tuple((cut_s, cut_s + CUT_S) for cut_s in cuts))
    pair = SocketsPair((peers.HOST, port), name="soak", faults=faults)
    key = f"{role}_number"
    source, sink = SourceFactory(max_count), SinkFactory(f"{other}_number", max_count)
    link = pair.server(key) if role == "robot" else pair.client(key)
    node = Node(role, Config(Mode.DEPLOYED, {role: [link, sink, source]}))
    uses: list[dict[str, int]] = []
    begun_s = time.monotonic()

    def watch() -> None:
        rest_s, arrived = 0.0, 0
        while rest_s < REST_S:
            time.sleep(POLL_PERIOD_S)
            if source.count < max_count and len(uses) < int(time.monotonic() - begun_s) // USE_PERIOD_S:
                uses.append(use_of_this_process())
            before, arrived = arrived, sum(sink.arrivals)
            rest_s = rest_s + POLL_PERIOD_S if source.count == max_count and arrived == before else 0.0
        node.enqueue_input(tasks.terminate("the soak is over"), "soak")

    threading.Thread(target=watch, daemon=True).start()
    node.loop()
    state = node.get_data(LINK)
    return {
        "stored": source.count,
        "arrived": sum(map(bool, sink.arrivals)),
        "twice": sum(count - 1 for count in sink.arrivals if count),
        "lost": state["lost"],
        "duplicated": state["duplicated"],
        "dropped": state["dropped"],
        "uses": uses,
    }


def judge(topside: dict[str, Any], robot: dict[str, Any]) -> list[str]:
    """Return what is wrong, as text."""
    wrong = []
    for sender, receiver, way in ((topside, robot, "topside to robot"), (robot, topside, "robot to topside")):
        known = receiver["arrived"] + sender["lost"] + sender["dropped"]
        if known != sender["stored"]:
            wrong.append(f"{way}: {sender['stored']} pages were stored, {known} are accounted for.")
        if receiver["twice"] != sender["duplicated"]:
            wrong.append(f"{way}: {receiver['twice']} came twice, {sender['duplicated']} were sent twice.")
    for role, found in (("topside", topside), ("robot", robot)):
        uses = found["uses"][WARM_UP_USES:]
        third = len(uses) // 3
        for what, spare in (("memory_kib", 2048), ("descriptors", 0), ("threads", 0)) if third else ():
            early = max(use[what] for use in uses[:third])
            late = max(use[what] for use in uses[-third:])
            if late > early + spare:
                wrong.append(f"{role}: {what} grew from {early} to {late}.")
    return wrong


def option(name: str, otherwise: str = "") -> str:
    """Return the word after an option of the command line."""
    return sys.argv[sys.argv.index(name) + 1] if name in sys.argv else otherwise


def main() -> None:
    """Start both and print the findings; the exit status is 1 if something is wrong."""
    if "--role" in sys.argv:
        print(json.dumps(run(option("--role"), int(option("--port")), int(option("--pages")))))
        return
    minutes = float(option("--minutes", "30"))
    command = [
        sys.executable,
        __file__,
        "--port",
        str(peers.free_port()),
        "--pages",
        str(round(minutes * 60 * RATE_HZ)),
    ]
    processes = [
        subprocess.Popen([*command, "--role", role], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        for role in ("topside", "robot")
    ]
    topside, robot = (json.loads(process.communicate()[0]) for process in processes)
    for role, found in (("topside", topside), ("robot", robot)):
        print(f"{role}: { {name: value for name, value in found.items() if name != 'uses'} }")
        for use in found["uses"][WARM_UP_USES :: max(1, len(found["uses"]) // 5)]:
            print(f"  {use}")
    wrong = judge(topside, robot)
    print("\n".join(wrong) or f"all pages of {minutes:g} minutes are accounted for, and nothing grew")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
