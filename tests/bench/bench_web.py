"""The live page of a machine: what it costs the robot's node, how soon it shows anything, and how fast a run opens.

Run by `snr bench web`. In real time but for the last part: the browser is a program of its own that reads everything
and edits five times a second.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median, quantiles
from typing import Any

from harness import Outcome, Row

from snr_sim import Config, ListReplayerFactory, Node, SimClock, SimRunner, tasks
from snr_sim.behaviors import Bridge, Drive, Read, machine_parts, parse
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header

STEP_HZ = 100.0
EDITS_PER_S = 5.0
BRIDGE = Bridge(
    {"ultra": Read("range", "distance_m", to=lambda m: 100.0 * m, unit="cm", fresh_s=0.5)},
    {"left": Drive("motors", "a", -100.0, 100.0), "right": Drive("motors", "d", -100.0, 100.0)},
)
EXPLORER = """(var speed := [50])
(machine explorer
  (event wall [robot.ultra.read() is not None and robot.ultra.read() < 25])
  (state ahead (onentry [robot.left.start(speed) robot.right.start(speed)]))
  (state back (onentry [robot.left.start(-12) robot.right.start(-12)]))
  (state turn (onentry [robot.left.start(-5) robot.right.start(5)]))
  (on wall ahead -> back)
  (ontime 300 back -> turn)
  (ontime 400 turn -> ahead))
(spawn explorer ahead)
""".replace(") robot", ")\n    robot")
RANGES = [{"distance_m": 0.1 if i % 20 > 17 else 1.0} for i in range(20)]

# What a browser does: it prints the time to its first state, and, of each edit, that until its effect was seen.
BROWSER = """
import json, re, sys, time
from websockets.sync.client import connect
origin, cookie, wall_s, edits_per_s = sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4])
url = origin.replace("http", "ws") + "/machine/explorer/socket"
headers = {"Cookie": cookie}
with connect(url, origin=origin, additional_headers=headers, compression=None, proxy=None) as page:
    hello = json.loads(page.recv())
    text, sha256, seen = hello["text"], hello["sha256"], 0
    speed = re.compile(r"(?<=speed := \\[)\\d+")
    number = int(speed.search(text)[0]) - 50
    while json.loads(page.recv())["kind"] != "state":
        pass
    print("shown", flush=True)
    begun_s = time.monotonic()
    sent_s, effects_s, due_s = None, [], begun_s
    while (now_s := time.monotonic()) - begun_s < wall_s:
        if edits_per_s and sent_s is None and now_s >= due_s:
            number += 1
            changed = speed.sub(str(50 + number % 40), text)
            page.send(json.dumps({"kind": "edit", "number": number, "text": changed, "base_sha256": sha256}))
            sent_s, due_s = now_s, due_s + 1.0 / edits_per_s
        message = json.loads(page.recv())
        seen += message["kind"] == "state"
        if message["kind"] == "edited":
            sha256 = message["sha256"]
        if message["kind"] == "state" and sent_s is not None and message["variables"]["speed"] == 50 + number % 40:
            effects_s.append(time.monotonic() - sent_s)
            sent_s = None
print(json.dumps({"states": seen, "effects_s": effects_s}))
"""


class Flight:
    """A node on the wall clock with an explorer, and a live page if it is to have one; it has readings for an hour."""

    def __init__(self, has_page: bool, *more: Any) -> None:
        explorer = machine_parts(parse(EXPLORER, BRIDGE.parts), "explorer", bridge=BRIDGE, step_hz=STEP_HZ)
        factories: list[Any] = [ListReplayerFactory(RANGES * 3600, "range", rate_hz=20.0), *explorer, *more]
        self.live: Any = None
        if has_page:
            from snr_sim.web.live import LiveLoopFactory

            self.live = LiveLoopFactory()
            factories.insert(0, self.live)
        self.node = Node("r", Config(factories={"r": factories}))
        self._thread = threading.Thread(target=self.node.loop)

    def __enter__(self) -> Flight:
        self._thread.start()
        while self.live is not None and self.live.port == 0:
            time.sleep(0.001)
        return self

    def __exit__(self, *error: object) -> None:
        self.node.enqueue_input(tasks.terminate("enough"), "bench")
        self._thread.join()

    @property
    def ticks(self) -> int:
        """How often the machine's clock has ticked."""
        clock: Any = self.node.components["explorer_clock"]
        return int(clock.caller.ticks)

    def browser(self, wall_s: float, edits_per_s: float) -> subprocess.Popen[str]:
        """Start a browser."""
        access = self.live.access
        words = [access.origin, f"{access.cookie}={access.token}", str(wall_s), str(edits_per_s)]
        return subprocess.Popen([sys.executable, "-c", BROWSER, *words], stdout=subprocess.PIPE, text=True)


def watch(wall_s: float, has_page: bool) -> tuple[float, float, dict[str, Any]]:
    """Run for a while; return percent of a core used, ticks lost of 1000, and what the browser has seen."""
    with Flight(has_page) as flight:
        time.sleep(0.3)
        seen: dict[str, Any] = {}
        process = flight.browser(wall_s + 1.0, EDITS_PER_S) if has_page else None
        if process is not None:
            assert process.stdout is not None
            process.stdout.readline()
        ticks, cpu_s, start_s = flight.ticks, time.process_time(), time.perf_counter()
        time.sleep(wall_s)
        ticks, cpu_s = flight.ticks - ticks, time.process_time() - cpu_s
        passed_s = time.perf_counter() - start_s
        if process is not None:
            seen = json.loads(process.communicate()[0])
    expected = STEP_HZ * passed_s
    return 100.0 * cpu_s / passed_s, 1000.0 * max(0.0, expected - ticks - 1.0) / expected, seen


def first_state() -> tuple[float, float]:
    """Return wall and CPU time from the start of a node, in a new process, to the first state in a browser [s]."""
    code = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r}); import bench_web; bench_web.print_first()"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    wall_s, cpu_s = map(float, shown.split())
    return wall_s, cpu_s


def print_first() -> None:
    """Print wall and CPU time to the first state: of imports, port, the program's drawing, and two messages."""
    from websockets.sync.client import connect

    start_s, cpu_s = time.perf_counter(), time.process_time()
    with Flight(has_page=True) as flight:
        access = flight.live.access
        url = f"ws://{access.netloc}/machine/explorer/socket"
        headers = {"Cookie": f"{access.cookie}={access.token}"}
        with connect(url, origin=access.origin, additional_headers=headers, proxy=None) as page:
            while json.loads(page.recv())["kind"] != "state":
                pass
            print(time.perf_counter() - start_s, time.process_time() - cpu_s)


def record(folder: Path, until_s: float) -> None:
    """Record a flight in lock step."""
    explorer = machine_parts(parse(EXPLORER, BRIDGE.parts), "explorer", bridge=BRIDGE, step_hz=STEP_HZ)
    count = int(until_s) + 1
    config = Config(factories={"r": [ListReplayerFactory(RANGES * count, "range", rate_hz=20.0), *explorer]})
    clock = SimClock()
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
    try:
        SimRunner(config, clock=clock, recorder=writer, until_s=until_s).run()
    finally:
        writer.close()


def opening(until_s: float) -> tuple[float, float, float]:
    """Return CPU times to open a run and to show a moment of it [s], and the size of its trace [MB]."""
    from snr_sim.web.timeline import RecordedTimeline

    with tempfile.TemporaryDirectory() as folder:
        record(Path(folder), until_s)
        start_s = time.process_time()
        timeline = RecordedTimeline(Path(folder), "", BRIDGE)
        timeline.read_all()
        opened_s = time.process_time() - start_s
        moments = [until_s * i / 50 for i in range(50)]
        start_s = time.process_time()
        for t_s in moments:
            timeline.state_at(t_s)
        shown_s = (time.process_time() - start_s) / len(moments)
        timeline.close()
        return opened_s, shown_s, (Path(folder) / FILE_NAME).stat().st_size / 1e6


def measure(is_quick: bool) -> Iterator[Outcome]:
    """Measure what the page costs and how fast it is."""
    firsts = [first_state() for _ in range(1 if is_quick else 5)]
    note = f"of which {median(cpu_s for _, cpu_s in firsts):.2f} s CPU time, with the imports of both ends"
    yield Row("first state of a live page, from the start of its node", median(wall_s for wall_s, _ in firsts), "s",
              limit=0.7, note=note)  # fmt: skip
    rounds, wall_s = (1, 1.0) if is_quick else (5, 6.0)
    pairs = [(watch(wall_s, False), watch(wall_s, True)) for _ in range(rounds)]
    more = median(page[0] - alone[0] for alone, page in pairs)
    alone_percent = median(alone[0] for alone, _ in pairs)
    states = median(page[2]["states"] / (wall_s + 1.0) for _, page in pairs)
    note = f"{states:.0f} messages and {EDITS_PER_S:g} edits a second; without a page {alone_percent:.1f} %"
    yield Row("a browser at a node of 100 Hz: more of a core", more, "%", limit=5.0, note=note)
    lost_alone, lost = (median(row[i][1] for row in pairs) for i in (0, 1))
    note = f"without a page {lost_alone:.1f}"
    yield Row(
        "ticks lost next to it, of 1000, more than without it", max(0.0, lost - lost_alone), "", limit=0.0, note=note
    )
    effects_ms = sorted(1e3 * one for _, page in pairs for one in page[2]["effects_s"])
    yield Row("from an edit to its effect in the browser, 95th percentile", quantiles(effects_ms, n=20)[-1], "ms",
              limit=70.0, note=f"median {median(effects_ms):.0f} ms; the editor waits 30 ms more")  # fmt: skip
    for name, until_s, limit in (("60 s", 60.0, 1.0), *(() if is_quick else (("1 h", 3600.0, 5.0),))):
        opened_s, shown_s, size_mb = opening(until_s)
        yield Row(f"open a recorded run of {name} at 100 Hz", opened_s, "s", limit=limit, note=f"{size_mb:.0f} MB")
        yield Row(f"show a moment of a run of {name}", 1e3 * shown_s, "ms", limit=20.0)
