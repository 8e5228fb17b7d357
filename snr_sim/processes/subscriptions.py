"""Table of subscriptions: which processes get the messages of a key. No time, no link."""

from __future__ import annotations

from collections.abc import Iterable


class Subscriptions:
    """Names of subscribers by key, without duplicates, in the order in which they subscribed.

    >>> table = Subscriptions()
    >>> table.add("joystick1", "Drive")
    >>> table.add("joystick1", "Web")
    >>> table.set_keys("Web", ["gps"])
    >>> print(table.dump())
    joystick1: Drive
    gps: Web
    """

    def __init__(self) -> None:
        self.names: dict[str, dict[str, None]] = {}
        self.ever: set[str] = set()  # keys that had a subscriber at any time

    def add(self, key: str, name: str) -> None:
        """Add a subscriber of a key; do nothing if it is one."""
        self.names.setdefault(key, {})[name] = None
        self.ever.add(key)

    def remove(self, key: str, name: str) -> None:
        """Remove a subscriber of a key; do nothing if it is not one."""
        subscribers = self.names.get(key, {})
        subscribers.pop(name, None)
        if not subscribers:
            self.names.pop(key, None)

    def set_keys(self, name: str, keys: Iterable[str]) -> None:
        """Set all keys of a subscriber, in place of those that it had."""
        listed = list(keys)
        for key in [key for key, names in self.names.items() if name in names and key not in listed]:
            self.remove(key, name)
        for key in listed:
            self.add(key, name)

    def of(self, key: str) -> list[str]:
        """Return the subscribers of a key."""
        return list(self.names.get(key, ()))

    def dump(self) -> str:
        """Return a line for each key, with its subscribers."""
        return "\n".join(f"{key}: {', '.join(names)}" for key, names in self.names.items())
