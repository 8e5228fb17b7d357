"""LinkOptions: options of all kinds of links, checked where they are set."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import get_args

from snr_sim.links.faults import LinkFaults, invalid_option, is_number
from snr_sim.links.frames import FRAME_BYTES_LIMIT, MAX_FRAME_BYTES
from snr_sim.links.queues import Policy
from snr_sim.prelude.errors import ConfigError, ParameterError
from snr_sim.prelude.task import DataKey

MAX_KEY_CHARS = 256
MAX_KEYS = 1000  # of others, that a link without `accept` takes: each is a page in memory, until the node ends
MAX_HELD_BYTES = 1 << 26


@dataclass(frozen=True)
class LinkOptions:
    """Options of all kinds of links.

    Args:
        name: the link is `link_<name>`, as a component and as a page.
        keys: pages of these keys are sent.
        accept: keys of the pages to accept; None accepts any, but no more than MAX_KEYS different ones.
        max_held_bytes: without `accept`, maximum memory of the newest pages of all keys that arrive. Pages of less than
            4 KiB do not count.
        max_frame_bytes: maximum size of a page, as it is sent.
        queue_pages: maximum number of pages that wait for one peer, and for the first peer to connect.
        policy: what happens when a queue is full.
        keep_alive_s: period between pings.
        timeout_s: silence after which a peer counts as gone.
        faults: faults to inject in what this end sends.

    Raises:
        ParameterError: a number or the policy is invalid; or `timeout_s` is less than two ping periods.
    """

    name: str
    keys: tuple[DataKey, ...] = ()
    accept: frozenset[DataKey] | None = None
    max_held_bytes: int = MAX_HELD_BYTES
    max_frame_bytes: int = MAX_FRAME_BYTES
    queue_pages: int = 10_000
    policy: Policy = "drop_oldest"
    keep_alive_s: float = 0.5
    timeout_s: float = 3.0
    faults: LinkFaults | None = None

    def __post_init__(self) -> None:
        self._check_count("queue_pages", None)
        self._check_count("max_held_bytes", None)
        self._check_count("max_frame_bytes", FRAME_BYTES_LIMIT)
        if self.policy not in get_args(Policy):
            raise invalid_option("policy", self.policy, f"use one of {', '.join(get_args(Policy))}.")
        for name in ("keep_alive_s", "timeout_s"):
            value = getattr(self, name)
            if not (is_number(value) and value > 0.0):
                raise invalid_option(name, value, "use a number of seconds greater than 0.")
        if not self.timeout_s >= 2 * self.keep_alive_s:
            raise ParameterError(
                f"timeout_s={self.timeout_s!r} is too short for keep_alive_s={self.keep_alive_s!r}: the other end "
                "would time out between two messages.",
                fix=f"use timeout_s={2 * self.keep_alive_s:g} or more, or a smaller keep_alive_s.",
            )
        if self.faults is not None and not isinstance(self.faults, LinkFaults):
            raise ParameterError(
                f"faults={self.faults!r} is not a LinkFaults.", fix="use LinkFaults(loss=0.1), or None."
            )

    def _check_count(self, name: str, max_value: int | None) -> None:
        value = getattr(self, name)
        if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= (max_value or value):
            fix = "use an integer of at least 1." if max_value is None else f"use an integer from 1 to {max_value}."
            raise invalid_option(name, value, fix)

    def for_end(self, keys: DataKey | Iterable[DataKey], accept: Iterable[DataKey] | None) -> LinkOptions:
        """Return the same for one end, which sends pages of `keys` and accepts those of `accept`; None accepts any."""
        return replace(self, keys=as_keys(keys), accept=None if accept is None else frozenset(as_keys(accept)))


def as_keys(keys: DataKey | Iterable[DataKey]) -> tuple[DataKey, ...]:
    """Return one key or several as a tuple, each once.

    Raises:
        ConfigError: one is not text, is empty or too long.

    >>> as_keys("depth"), as_keys(["depth", "depth", "heading"])
    (('depth',), ('depth', 'heading'))
    """
    if isinstance(keys, str):
        keys = (keys,)
    if not isinstance(keys, Iterable):
        raise ConfigError(f"A link's keys are {repr(keys)[:80]}.", fix='"depth" or ["depth", "heading"].')
    listed = tuple(keys)
    for key in listed:
        if not isinstance(key, str) or not 0 < len(key) <= MAX_KEY_CHARS:
            raise ConfigError(
                f"{repr(key)[:80]} is not a valid key of a link.",
                fix=f"use a string of 1 to {MAX_KEY_CHARS} characters.",
            )
    return tuple(dict.fromkeys(listed))
