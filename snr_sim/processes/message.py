"""Messages between RoverProcesses: pages with a key and plain data, checked where they are published.

The state manager keeps some keys for itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from snr_sim.core.component import plain_data
from snr_sim.links.messages import encode_page
from snr_sim.prelude.errors import ConfigError, SnrError, ValueEncodingError
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.task import Page, snapshot
from snr_sim.supervision.health import HEALTH

BROKER = "state_manager"  # role of the broker, and its component
LINK = "processes"  # name of the link between a process and the broker, at both ends
LINK_PAGE = f"link_{LINK}"  # the link's component, and the page of its state
MAX_KEY_CHARS = 64

# Keys that the broker keeps for itself. A process sends its whole list of subscriptions, at each connect and at each
# change: {"keys": [...], "last": [...], "timeouts_s": [...]}, where "last" has those whose last value it asks for, and
# "timeouts_s", at a connect only, the times for which it has said that it may be silent: the former and the newest one.
SUBSCRIPTIONS = "$subscriptions"
SILENT = "$silent"  # to a process that has been silent for so many seconds, on the wall clock
TERMINATE = "$terminate"  # asks the broker to end all processes
QUIT = "quit"
PET, EXTEND, RESET = "wd_pet", "wd_extend", "wd_reset"
_METHODS = {
    "subscribe": "self.subscribe({0!r})",
    "unsubscribe": "self.unsubscribe({0!r})",
    QUIT: "self.terminate_state()",
    PET: "self.watchdog_pet()",
    EXTEND: "self.watchdog_extend({0!r})",
    RESET: "self.watchdog_reset()",
}


class RoverMessage(NamedTuple):
    """A message: its key, and its data, which are plain values."""

    key: str
    data: Any


def check_key(process: str, key: Any, value: Any = None, *, is_subscription: bool = False) -> None:
    """Raise a ConfigError unless a process can publish a value under a key, or subscribe to it.

    >>> check_key("Drive", "wd_pet")
    Traceback (most recent call last):
    snr_sim.prelude.errors.ConfigError: Drive publishes 'wd_pet', which the state manager keeps for itself.
      Try: self.watchdog_pet().
    """
    verb = "subscribes to" if is_subscription else "publishes"
    if not (isinstance(key, str) and 0 < len(key) <= MAX_KEY_CHARS and key.isprintable()):
        raise ConfigError(
            f"{process} {verb} {repr(key)[:80]}, which is not a key.",
            fix=f"a key is text of 1 to {MAX_KEY_CHARS} characters that can be printed, such as 'joystick1'.",
        )
    if key == HEALTH and not is_subscription:
        fix = "another name: 'my_health'. The supervisor's page has this one."
    elif key == QUIT and is_subscription:
        fix = "leave it out: on_quit(self, data) is called without a subscription."
    elif key in _METHODS:
        fix = f"{_METHODS[key].format(value)}."
    elif key.startswith("$"):
        fix = f"a key without the $: {key.lstrip('$') or 'speed'!r}."
    elif key.startswith(("wd_", "link_")):
        fix = f"another name: {'my_' + key!r}."
    else:
        return
    raise ConfigError(f"{process} {verb} {key!r}, which the state manager keeps for itself.", fix=fix)


def page_of(process: str, node: NodeApi, key: str, value: Any, process_here: bool = False) -> Page:
    """Return a page of a node with a copy of a value, in which each Struct is a dict.

    Args:
        process: its name, for messages.
        node: its node.
        key: of the page.
        value: plain data, or msgspec Structs.
        process_here: whether the node itself handles the page, too.

    Raises:
        ValueEncodingError: the value cannot be sent to another process.
    """
    objects: list[Any] = []
    try:
        page = Page(key, snapshot(plain_data(value), objects), node.name, node.get_time_s(), process_here)
        encode_page(page)
    except (RecursionError, SnrError) as error:
        found = f"<{type(objects[0]).__name__} object>" if objects else getattr(error, "message", "it contains itself.")
        raise ValueEncodingError(
            f"{process} published {key!r} with a value that cannot be sent to another process: {found}",
            fix="send numbers, text, lists, dicts, or a msgspec Struct.",
        ) from error
    return page
