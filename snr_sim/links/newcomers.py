"""Newcomers: connections that are not authenticated yet: which may greet, and which to close if there are too many.

Any client that can reach a port can open connections to it at any rate. So each address gets a few greetings a second.
Exempt are this machine and addresses that had an accepted session before: an honest client there may have lost its
connection and reconnect, and cannot be distinguished from an attacker until it has greeted.

At most 64 connections may be not up, and 64 up (`tcp_server.py`). One more that is not up displaces one of the address
with most of them; one more that is up displaces the newest of the address and name with most, if these have several.
"""

from __future__ import annotations

import ipaddress
from collections import Counter, OrderedDict
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TypeVar

from snr_sim.links.security import as_host
from snr_sim.links.token_bucket import TokenBucket

GREETINGS_PER_S = 10.0  # per address
GREETINGS_AT_ONCE = 40.0
MAX_ADDRESSES = 1024  # limit of the table; an IPv6 network of 64 bits counts as one address
MAX_KNOWN = 256

One = TypeVar("One")


class Newcomers:
    """Counts greetings by address."""

    def __init__(self) -> None:
        self._greetings: OrderedDict[str, TokenBucket] = OrderedDict()
        self._known: OrderedDict[str, None] = OrderedDict()

    def may_greet(self, address: str, now_s: float) -> bool:
        """Whether a connection from this address may start to greet; counts it if so."""
        source = source_of(address)
        if source in self._known or source == LOOPBACK:
            return True
        token_bucket = self._greetings.get(source)
        if token_bucket is None:
            token_bucket = self._greetings[source] = TokenBucket(GREETINGS_PER_S, GREETINGS_AT_ONCE)
        _keep(self._greetings, source, MAX_ADDRESSES)
        return token_bucket.take(now_s)

    def remember(self, address: str) -> None:
        """Remember that a session from this address was accepted."""
        source = source_of(address)
        self._known[source] = None
        _keep(self._known, source, MAX_KNOWN)


LOOPBACK = "this machine"


@lru_cache(maxsize=MAX_ADDRESSES)
def source_of(address: str) -> str:
    """Return the part of an address that a user of a network cannot choose: of IPv6 the first 64 bits.

    >>> source_of("192.0.2.1"), source_of("::ffff:192.0.2.1"), source_of("2001:db8::1:2:3:4%eth0"), source_of("::1")
    ('192.0.2.1', '192.0.2.1', '2001:db8::', 'this machine')
    """
    host = as_host(address)
    if host is None:
        return address
    if host.is_loopback:
        return LOOPBACK
    if host.version == 6:
        host = ipaddress.IPv6Address(int(host) >> 64 << 64)
    return str(host)


def largest_group(ones: Sequence[One], *traits: Callable[[One], str]) -> list[One]:
    """Return the largest group with one trait in common; for several traits, narrow it down one by one.

    >>> largest_group(["ax", "bx", "by", "bx"], lambda one: one[0], lambda one: one[1])
    ['bx', 'bx']
    """
    crowded = list(ones)
    for trait in traits:
        ((largest, _),) = Counter(map(trait, crowded)).most_common(1)
        crowded = [one for one in crowded if trait(one) == largest]
    return crowded


def _keep(table: OrderedDict[str, One], source: str, max_size: int) -> None:
    table.move_to_end(source)
    if len(table) > max_size:
        table.popitem(last=False)
