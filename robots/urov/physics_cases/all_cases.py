"""All cases, in the order of the page."""

from __future__ import annotations

from .along_an_axis import steps
from .case import Case
from .contact import contact
from .entering import entries
from .flow import current
from .meeting import meeting
from .pulled import tether
from .pulses import pushed
from .sliding import friction
from .together import together
from .turning import conserved, munk
from .weight import righting

GROUPS = (steps, pushed, righting, entries, conserved, current, munk, together, contact, meeting, friction, tether)


def cases() -> list[Case]:
    """Returns all cases."""
    found = [case for group in GROUPS for case in group()]
    headings = list(dict.fromkeys(case.group for case in found))
    return sorted(found, key=lambda case: headings.index(case.group))
