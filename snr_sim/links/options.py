"""LinkOptions: options of all kinds of links, checked where they are set."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import get_args

from snr_sim.links.faults import Faults
from snr_sim.links.frames import MAX_FRAME_BYTES, MOST_FRAME_BYTES
from snr_sim.links.send_queue import Policy
from snr_sim.prelude.errors import ConfigError, ParameterError
from snr_sim.prelude.page import DataKey

MAX_KEY_CHARS = 256


@dataclass(frozen=True)
class LinkOptions:
    """Options of all kinds of links.

    Args:
        name: the link is `link_<name>`, as a component and as a page.
        keys: pages of these keys are sent.
        accept: keys of the pages to accept; None accepts any.
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
    max_frame_bytes: int = MAX_FRAME_BYTES
    queue_pages: int = 10_000
    policy: Policy = "drop_oldest"
    keep_alive_s: float = 0.5
    timeout_s: float = 3.0
    faults: Faults | None = None

    def __post_init__(self) -> None:
        _check_count("queue_pages", self.queue_pages, None)
        _check_count("max_frame_bytes", self.max_frame_bytes, MOST_FRAME_BYTES)
        if self.policy not in get_args(Policy):
            raise ParameterError(f"A link with policy={self.policy!r}.", fix=f"one of {', '.join(get_args(Policy))}.")
        for name, value in (("keep_alive_s", self.keep_alive_s), ("timeout_s", self.timeout_s)):
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0.0:
                raise ParameterError(f"A link with {name}={value!r}.", fix="a number of seconds above 0.")
        if not self.timeout_s >= 2 * self.keep_alive_s:
            raise ParameterError(
                f"A link with timeout_s={self.timeout_s!r} and keep_alive_s={self.keep_alive_s!r}: the far end would "
                "count as gone between two signs of it.",
                fix=f"timeout_s={2 * self.keep_alive_s:g} or more, or a smaller keep_alive_s.",
            )
        if self.faults is not None and not isinstance(self.faults, Faults):
            raise ParameterError(f"A link with faults={self.faults!r}.", fix="Faults(loss=0.1), or None.")

    def for_end(self, keys: DataKey | Iterable[DataKey], accept: Iterable[DataKey] | None) -> LinkOptions:
        """Return the same for one end, which sends pages of `keys` and accepts those of `accept`; None accepts any."""
        return replace(self, keys=as_keys(keys), accept=None if accept is None else frozenset(as_keys(accept)))


def _check_count(name: str, value: object, most: int | None) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1 or (most is not None and value > most):
        fix = "a whole number, 1 or more." if most is None else f"a whole number from 1 to {most}."
        raise ParameterError(f"A link with {name}={value!r}.", fix=fix)


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
                f"A link's keys hold {repr(key)[:80]}, which is no key.",
                fix=f"text of 1 to {MAX_KEY_CHARS} characters.",
            )
    return tuple(dict.fromkeys(listed))
