"""RoverProcess: base class of a part of a robot that runs as a process of its own.

    class Drive(RoverProcess):
        def setup(self, args):
            self.gain = args.get("gain", 1.0)
            self.subscribe("joystick1")

        def on_joystick1(self, data):              # on_<key> is called instead of message_trigger
            self.publish("wheelLF", self.gain * data[1])

        def loop(self):                            # a function, or a generator as here
            self.publish("alive", True)
            yield 4.0                              # waits, also in virtual time, and ends early at quit

`runner.py` starts it, `process_components.py` calls it: handlers on one thread, `loop` on another, in lock step all on
one.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from snr_sim.core.source_location import after_line, location_of
from snr_sim.prelude.errors import ConfigError, ParameterError, suggest
from snr_sim.prelude.rng import rng_for
from snr_sim.prelude.text import one_line
from snr_sim.processes.message import PET, RESET, TERMINATE, RoverMessage, check_key
from snr_sim.processes.seed_names import SeedNames
from snr_sim.processes.uplink import Uplink
from snr_sim.supervision.watch import PREVIOUS

if TYPE_CHECKING:
    import numpy as np

DEFAULT_PERIOD_S = 1.0
LEVELS = ("CRITICAL", "ERROR", "WARNING", "INFO", "DEBUG", "NOTSET")


class RoverProcess(SeedNames):
    """A part of a robot that publishes and subscribes.

    Its author writes some of the first five methods, and `on_<key>(self, data)` for the messages of a key. What both
    handlers and `loop` change needs the lock: `with self.lock:`. Time, `self.get_time_s()`, and random numbers,
    `self.rng`, come from the run: that makes a simulated run repeatable.

    Attributes:
        name: of the process: its class's, or that of `with_args(name=...)`.
        lock: for what handlers and `loop` both change.
    """

    def __init__(self, uplink: Uplink) -> None:
        self.name: str = uplink.name
        self.lock: threading.RLock = threading.RLock()
        self._uplink = uplink

    def __init_subclass__(cls, **options: Any) -> None:
        """Check that the class has no `__init__`."""
        super().__init_subclass__(**options)
        if cls.__init__ is not RoverProcess.__init__:
            message = f"{cls.__name__} has its own __init__."
            raise ConfigError(
                after_line(location_of(cls.__init__), message),
                fix=f"put what it does into setup(self, args): it runs in {cls.__name__}'s process, __init__ would run "
                "in the starter's.",
            )

    @classmethod
    def with_args(cls, *, name: str | None = None, **args: Any) -> ProcessSpec:
        """Return the description of a process of this class.

        Args:
            name: of the process; the class's if not given.
            args: what `setup` gets.
        """
        return ProcessSpec(cls, name or cls.__name__, args)

    # For its author to write

    def setup(self, args: dict[str, Any]) -> None:
        """Prepare; called once, before any message and before `loop`."""

    def loop(self) -> float | Iterator[float] | None:
        """Do what is done again and again; return the time until the next call [s], or yield times to wait [s].

        None, and the end of a generator, call it again at once, but no more than a thousand times a second.
        """
        return DEFAULT_PERIOD_S

    def message_trigger(self, message: RoverMessage) -> None:
        """Handle a message of a key that has no method `on_<key>`."""

    def on_quit(self, data: Any) -> None:
        """Prepare for the end of the process, which follows; here messages can still be published."""

    def cleanup(self) -> None:
        """Close what `setup` has opened; called once at the end, also after an error."""

    # For its author to call

    def publish(self, key: str, value: Any) -> None:
        """Send a value to all processes that subscribe to a key, this one included.

        Raises:
            ConfigError: the key is not text, or is one that the state manager keeps for itself.
            ValueEncodingError: the value cannot be sent to another process.
        """
        check_key(self.name, key, value)
        self._uplink.send(key, value)

    def subscribe(self, key: str, with_last: bool = False) -> None:
        """Receive the messages of a key from now on.

        Args:
            key: of the messages.
            with_last: whether to receive the last one that was published before, too.

        Raises:
            ConfigError: the key is not text, or is one that the state manager keeps for itself.
        """
        check_key(self.name, key, is_subscription=True)
        self._uplink.keys[key] = with_last
        self._uplink.ever.add(key)
        self._uplink.report_keys([key] if with_last else [])

    def unsubscribe(self, key: str) -> None:
        """Receive no more messages of a key: none, once this has returned.

        Raises:
            ConfigError: it is not subscribed to the key.
        """
        if key not in self._uplink.keys:
            fix = suggest(str(key), self._uplink.keys)
            raise ConfigError(f"{self.name} is not subscribed to {key!r}.", fix=fix)
        del self._uplink.keys[key]
        self._uplink.report_keys([])

    @property
    def subscriptions(self) -> list[str]:
        """The keys that it subscribes to."""
        return list(self._uplink.keys)

    def log(self, message: object, level: str = "INFO") -> None:
        """Write one line to stderr and to the log of the process, `<run>/<name>/log.txt`.

        Raises:
            ConfigError: the level is not one of CRITICAL, ERROR, WARNING, INFO, DEBUG, NOTSET.
        """
        if level not in LEVELS:
            raise ConfigError(f"{self.name} logs at the level {level!r}.", fix=suggest(str(level), LEVELS))
        self._uplink.log(level, one_line(str(message), limit=2000))

    def get_time_s(self) -> float:
        """Return the time of the run [s], which is the same in all processes."""
        return self._uplink.node.get_time_s()

    @cached_property
    def rng(self) -> np.random.Generator:
        """The process's random generator, from the seed of the run and its name."""
        return rng_for(self._uplink.node.component_seed, self.name)

    def watchdog_pet(self) -> None:
        """Report that the process works; its loop does this before each call, too."""
        self._uplink.send(PET, None)

    def watchdog_extend(self, timeout_s: float | Literal["PREVIOUS"]) -> None:
        """Set the time for which this process may be silent [s]; "PREVIOUS" sets the one before.

        Raises:
            ParameterError: it is neither a positive number nor "PREVIOUS".
        """
        is_time = isinstance(timeout_s, (int, float)) and 0 < timeout_s < math.inf
        if not (is_time or timeout_s == PREVIOUS):
            raise ParameterError(
                f"{self.name} extends its watchdog by {timeout_s!r}.", fix=f"a number of seconds, or {PREVIOUS!r}."
            )
        self._uplink.extend(timeout_s)

    def watchdog_reset(self) -> None:
        """Begin the time of silence of all processes again."""
        self._uplink.send(RESET, None)

    def terminate_state(self) -> None:
        """End all processes."""
        self._uplink.send(TERMINATE, None)


@dataclass(frozen=True)
class ProcessSpec:
    """Description of one process: its class, its name, and what its `setup` gets."""

    kind: type[RoverProcess]
    name: str
    args: Mapping[str, Any] = field(default_factory=dict)
