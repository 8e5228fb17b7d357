"""How old readings were when machines decided by them, and how long commands took: from a recorded run."""

from __future__ import annotations

from typing import Any

from snr_sim.prelude.task import Page
from snr_sim.prelude.values import decode_value
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import Executed, InputRecord, PageRecord

APPLIED = "_applied"  # end of the keys of pages with the result of a command
_TRANSITION = ".transition"


def lag_of(trace: Trace) -> dict[str, Any]:
    """Return the delays of a run, as JSON.

    {"transitions": {machine: count},
     "readings": {page: {"count", "mean_s", "max_s"}},    age of the newest page at each transition
     "commands": {page: {"count", "mean_s", "max_s"}}}    from storing a command until it was applied

    Readings are pages that loops store; commands are known where the device's loop stores a page "<key>_applied".
    """
    made: dict[str, float] = {}
    ages: dict[str, list[float]] = {}
    delays: dict[str, list[float]] = {}
    transitions: dict[str, int] = {}
    inputs = {record.name for record in trace.records if isinstance(record, InputRecord)}
    for record in trace.records:
        if isinstance(record, PageRecord):
            page = decode_value(bytes(record.values), {"page": Page})[0]
            if page.key.endswith(APPLIED) and isinstance(page.data, dict) and "delay_s" in page.data:
                delays.setdefault(page.key.removesuffix(APPLIED), []).append(page.data["delay_s"])
            elif page.key in inputs:
                made[page.key] = page.created_at_s
        elif isinstance(record, Executed) and record.type == "event" and record.name.endswith(_TRANSITION):
            machine = record.name.removesuffix(_TRANSITION)
            transitions[machine] = transitions.get(machine, 0) + 1
            for key, created_s in made.items():
                ages.setdefault(key, []).append(record.t - created_s)
    return {"transitions": transitions, "readings": _summary(ages), "commands": _summary(delays)}


def _summary(found: dict[str, list[float]]) -> dict[str, dict[str, float]]:
    return {
        key: {"count": len(values), "mean_s": sum(values) / len(values), "max_s": max(values)}  # decides no run: shown
        for key, values in found.items()
    }
