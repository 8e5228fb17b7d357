"""Names of the seed, roveberrypy, in camelCase: each works, where it is called and where a class overrides it.

docs/coming_from_roveberrypy.md has every documented name, and what differs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

SEED_NAMES = {
    "messageTrigger": "message_trigger",
    "watchdogPet": "watchdog_pet",
    "watchdogExtend": "watchdog_extend",
    "watchdogReset": "watchdog_reset",
    "spawnThread": "spawn_thread",
    "getDevice": "get_device",
    "getSubscription": "get_subscription",
    "reqSubscription": "req_subscription",
    "listenToDevice": "listen_to_device",
    "readCmd": "read_cmd",
    "sendCmd": "send_cmd",
    "addSubscriber": "add_subscriber",
    "removeSubscriber": "remove_subscriber",
    "dumpSubscribers": "dump_subscribers",
    "terminateState": "terminate_state",
}


class SeedNames:
    """Base of classes whose methods have names in the seed."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Give each method that the class overrides by its old name the present one."""
        super().__init_subclass__(**options)
        for old, new in SEED_NAMES.items():
            if old in cls.__dict__ and new not in cls.__dict__:
                setattr(cls, new, cls.__dict__[old])

    if not TYPE_CHECKING:  # a type checker would accept any name

        def __getattr__(self, name: str) -> Any:
            if name in SEED_NAMES:
                return getattr(self, SEED_NAMES[name])
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'", name=name, obj=self)
