"""Roster: who is in a net, as far as one of its nodes knows, and which of their pages have come. Knows no Zenoh.

Each node has a place among the net's keys, `snr/<net>/<robot>/<node>/<id>`; see docs/formats.md.
"""

from __future__ import annotations

import threading
from collections import deque
from urllib.parse import quote, unquote

from snr_sim.links.fleet import Member
from snr_sim.links.session import OFFSETS_REMEMBERED

MAX_MEMBERS = 1000  # of a net; more are not listened to
MAX_KEYS = 1000  # of a member, whose pages are counted; of more it is not known what was missed


def encoded(text: str) -> str:
    """Returns a name or a page's key as one part of a key of Zenoh's, which knows some characters as its own.

    >>> encoded("depth/of rov*")
    'depth%2Fof%20rov%2A'
    """
    return quote(text, safe="", errors="replace")


class Far:
    """Another node of the net.

    Args:
        member: which.
        now_s: when it was first heard.
    """

    def __init__(self, member: Member, now_s: float) -> None:
        self.member = member
        self.heard_s = now_s
        self.rtt_s: float | None = None
        self.clock_offset_s: float | None = None  # as of Session
        self._offsets_s: deque[float] = deque(maxlen=OFFSETS_REMEMBERED)
        self.is_here = False  # has shown itself, asked or answered
        self.has_left = False  # has said so, and not shown itself since
        self.received = 0
        self.missed = 0
        self.numbers: dict[str, int] = {}  # of the newest page of each key

    def note_offset(self, offset_s: float) -> None:
        """Takes in how far the clocks are apart, too large by what its answer took to come here."""
        self._offsets_s.append(offset_s)
        self.clock_offset_s = min(self._offsets_s)


class Roster:
    """All other nodes of a net. For several threads at a time.

    Args:
        prefix: with which all places of the net begin.
    """

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.own_place = ""
        self.news = ""  # who left last
        self._fars: dict[str, Far] = {}
        self._missed = 0  # of those forgotten
        self._has_newcomer = False
        self._guard = threading.Lock()

    def place_of(self, member: Member, identity: str) -> str:
        """Returns where a member stands, of those that there may be with its name."""
        return f"{self.prefix}/{encoded(member.robot)}/{encoded(member.node)}/{identity}"

    def shows(self, place: str, now_s: float) -> None:
        """Somebody shows itself."""
        with self._guard:
            far = self._at(place, now_s)
            if far is not None:
                far.has_left = False
                self._hear(far, now_s)

    def leaves(self, place: str) -> None:
        """Somebody leaves, or is cut off. It stays known: it may come back, and send its last page again."""
        with self._guard:
            far = self._fars.get(place)
            if far is not None:
                far.is_here, far.has_left = False, True
                self.news = f"'{far.member.name}' left."

    def cut_off(self, reason: str) -> None:
        """Mark all others as gone: this node has left the net itself, and says why in `news`."""
        with self._guard:
            self.news = reason
            for far in self._fars.values():
                far.is_here = False

    def hears(self, place: str, now_s: float) -> Far | None:
        """Somebody asks or answers, and so is there. What comes from one who has left was on its way."""
        with self._guard:
            far = self._at(place, now_s)
            if far is None or far.has_left:
                return None
            self._hear(far, now_s)
            return far

    def takes(self, place: str, key: str, number: int, now_s: float) -> tuple[Far | None, bool]:
        """Somebody sends a page; returns who, and whether the page is new.

        Args:
            place: of whoever sends it.
            key: of the page.
            number: of the page among those of its key, from 1 on; 0 if it has none.
            now_s: the time.
        """
        with self._guard:
            far = self._at(place, now_s)
            if far is None:
                return None, False
            far.heard_s = now_s
            last = far.numbers.get(key)
            if not number or (last is None and len(far.numbers) >= MAX_KEYS):
                return far, True
            if last is not None:
                if number <= last:
                    return far, False
                far.missed += number - last - 1
            far.numbers[key] = number
            return far, True

    def take_newcomer(self) -> bool:
        """Returns whether somebody has come since this was asked last."""
        with self._guard:
            has_one, self._has_newcomer = self._has_newcomer, False
            return has_one

    def here(self) -> list[Far]:
        """Returns those that are there."""
        with self._guard:
            return [far for far in self._fars.values() if far.is_here]

    @property
    def missed(self) -> int:
        """Pages of others that did not arrive."""
        with self._guard:
            return self._missed + sum(far.missed for far in self._fars.values())  # exact: integers

    def _hear(self, far: Far, now_s: float) -> None:
        far.heard_s = now_s
        self._has_newcomer = self._has_newcomer or not far.is_here
        far.is_here = True

    def _at(self, place: str, now_s: float) -> Far | None:
        """Returns who is at a place, known or new; None if nobody can be there."""
        far = self._fars.get(place)
        if far is not None:
            return far
        parts = place.removeprefix(f"{self.prefix}/").split("/")
        if len(parts) != 3 or "*" in place or not place.startswith(f"{self.prefix}/") or place == self.own_place:
            return None
        if not (unquote(parts[0]) + unquote(parts[1])).isprintable():  # names are shown in terminals
            return None
        if len(self._fars) >= MAX_MEMBERS:
            oldest = next((place for place, far in self._fars.items() if not far.is_here), None)
            if oldest is None:
                return None
            self._missed += self._fars.pop(oldest).missed
        far = self._fars[place] = Far(Member(unquote(parts[0]), unquote(parts[1])), now_s)
        return far
