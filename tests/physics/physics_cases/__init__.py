"""Results of the underwater vehicle's motion that are known without a simulation: `case.py` defines a case."""

from __future__ import annotations

from itertools import chain

from . import contacts, entering, open_water, pulses
from .case import Case
from .vehicles import SETS

# In the order of the page.
PER_VEHICLE = (
    open_water.steps, pulses.pushed, open_water.righting, entering.entries, open_water.conserved, open_water.current,
    open_water.munk, open_water.together, contacts.contact, contacts.meeting, contacts.friction,
)  # fmt: skip
OF_ONE = {
    pulses.pushed: pulses.sagging,
    open_water.righting: open_water.lifted_out,
    open_water.together: open_water.lopsided_together,
}


def cases() -> list[Case]:
    """Return all cases."""
    found = []
    for group in PER_VEHICLE:
        found += chain.from_iterable(group(name) for name in SETS)
        found += OF_ONE[group]() if group in OF_ONE else ()
    found += open_water.tether()
    headings = list(dict.fromkeys(case.group for case in found))
    return sorted(found, key=lambda case: headings.index(case.group))
