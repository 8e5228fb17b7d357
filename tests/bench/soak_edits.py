"""Soak test: a machine on the wall clock is edited from its live page twice a second, by browsers that are killed.

Memory, descriptors and threads must not grow, no step may be lost, and each edit that a browser has seen the effect of
must be a program of the machine. Run: python tests/bench/soak_edits.py [--minutes 30]
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from bench_web import Flight
from soak_links import option, use_of_this_process

from snr_sim import TaskType
from snr_sim.testing.function_components import FunctionEndpointFactory

EDITS_PER_S = 2.0
BROWSER_S = 20.0  # how long a browser edits; every second one is killed in its midst
USE_PERIOD_S = 1.0
# Until a page has all the programs that it keeps, 200, and the interpreter its caches: five minutes. A shorter run is
# evaluated, too, with a larger allowance.
WARM_UP_S, SPARE_KIB, SPARE_OF_SHORT_KIB = 300.0, 4096, 16384


def run(minutes: float) -> dict[str, Any]:
    """Run it; return what was counted, and what this process held each second."""
    steps = [0]

    def count(task: Any, key: Any) -> None:
        steps[0] += 1

    counter = FunctionEndpointFactory({(TaskType.event, "explorer.step"): count}, "counter")
    uses: list[dict[str, int]] = []
    effects = browsers = 0
    with Flight(True, counter) as flight:
        end_s = time.monotonic() + 60.0 * minutes
        while (now_s := time.monotonic()) < end_s:
            browsers += 1
            is_killed = browsers % 2 == 0
            process = flight.browser(BROWSER_S, EDITS_PER_S)
            over_s = min(end_s, now_s + (0.5 if is_killed else 1.0) * BROWSER_S)
            while time.monotonic() < over_s:
                time.sleep(USE_PERIOD_S)
                uses.append(use_of_this_process())
            if is_killed:
                process.kill()
            shown = process.communicate()[0]
            effects += 0 if is_killed else len(json.loads(shown.splitlines()[-1])["effects_s"])
        machine: Any = flight.node.components["explorer"]
        programs = machine.program_number - 1
    # The node has ended: what its clock has sent was handled.
    return {"minutes": minutes, "browsers": browsers, "effects": effects, "programs": programs, "ticks": flight.ticks,
            "steps": steps[0], "reason": flight.node.exit_reason, "uses": uses}  # fmt: skip


def judge(found: dict[str, Any]) -> list[str]:
    """Return what is wrong, as text."""
    wrong = []
    if found["steps"] != found["ticks"]:
        wrong.append(f"{found['ticks']} steps were sent, and {found['steps']} taken.")
    if found["programs"] < found["effects"] or found["effects"] < 0.4 * EDITS_PER_S * 60.0 * found["minutes"]:
        wrong.append(f"Browsers have seen {found['effects']} edits, of {found['programs']}.")
    if found["reason"] != "enough":
        wrong.append(f"The node has ended: {found['reason']}.")
    is_long = 60.0 * found["minutes"] >= 2.0 * WARM_UP_S
    uses = found["uses"][int(WARM_UP_S if is_long else 10.0) :]
    third = len(uses) // 3
    for what, spare in (
        ("memory_kib", SPARE_KIB if is_long else SPARE_OF_SHORT_KIB),
        ("descriptors", 0),
        ("threads", 0),
    ):
        early, late = max(use[what] for use in uses[:third]), max(use[what] for use in uses[-third:])
        if late > early + spare:
            wrong.append(f"{what} grew from {early} to {late}.")
    return wrong


def main() -> None:
    """Run it and print the findings; the exit status is 1 if something is wrong."""
    found = run(float(option("--minutes", "30")))
    uses = found.pop("uses")
    print(found)
    for use in uses[:: max(1, len(uses) // 10)]:
        print(f"  {use}")
    wrong = judge({**found, "uses": uses})
    print("\n".join(wrong) or f"{found['programs']} edits in {found['minutes']:g} minutes: nothing lost, nothing grew")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
