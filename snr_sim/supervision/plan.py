"""Plan of a supervised robot: which processes belong together, how often each may fail, and how long it may take.

A `Supervisor` has children, which are processes (`Child`) or further supervisors. `supervision/tree.py` follows it.
The terms are those of supervisors in Erlang/OTP ("Supervisor Behaviour", OTP Design Principles).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from snr_sim.prelude.errors import ConfigError, ParameterError

Restart: TypeAlias = Literal["always", "on_failure", "never"]
Strategy: TypeAlias = Literal["one_for_one", "rest_for_one"]


@dataclass(frozen=True)
class Timeouts:
    """How long a process may take.

    Args:
        setup_s: from its start until it reports for the first time.
        hang_s: from one report to the next; a longer silence is a hang.
        end_s: from the request to end until it is killed.
    """

    setup_s: float = 10.0
    hang_s: float = 5.0
    end_s: float = 3.0

    def __post_init__(self) -> None:
        _check_positive(self)


@dataclass(frozen=True)
class Intensity:
    """How many restarts a supervisor makes within a time. One failure more, and the supervisor itself fails."""

    restarts: int = 3
    within_s: float = 30.0

    def __post_init__(self) -> None:
        if type(self.restarts) is not int or self.restarts < 0:
            raise ParameterError(f"Intensity.restarts must be a whole number from 0 on, not {self.restarts!r}.")
        if not (math.isfinite(self.within_s) and self.within_s > 0):
            raise ParameterError(f"Intensity.within_s must be positive and finite, not {self.within_s!r}.")

    def __str__(self) -> str:
        allowed = "1 restart is" if self.restarts == 1 else f"{self.restarts} restarts are"
        return f"{allowed} allowed in {self.within_s:g} s"


@dataclass(frozen=True)
class Backoff:
    """Delay before a restart, so that what fails at its start takes little processor time and leaves budget to others.

    Args:
        first_s: before the first restart; each further one waits twice as long.
        longest_s: maximum delay.
        healthy_s: after this time without a failure the delay is `first_s` again.
    """

    first_s: float = 0.1
    longest_s: float = 5.0
    healthy_s: float = 60.0

    def __post_init__(self) -> None:
        _check_positive(self)

    def delay_s(self, failures: int) -> float:
        """Return the delay after so many failures before this one.

        >>> [Backoff().delay_s(failures) for failures in (0, 1, 2, 3, 10_000)]
        [0.1, 0.2, 0.4, 0.8, 5.0]
        """
        return min(self.first_s * 2.0 ** min(failures, 100), self.longest_s)


@dataclass(frozen=True)
class Child:
    """A supervised process.

    Args:
        name: of the process; for a role, the role's.
        restart: "always", also after it has ended by itself; "on_failure"; "never".
        timeouts: how long it may take.
        ends_all: whether all others end once it has ended by itself, without a failure; then `restart` is for failures.
    """

    name: str
    restart: Restart = "always"
    timeouts: Timeouts = field(default_factory=Timeouts)
    ends_all: bool = False

    def __post_init__(self) -> None:
        if self.restart not in ("always", "on_failure", "never"):
            raise ConfigError(
                f"Child '{self.name}' has restart={self.restart!r}.", fix="'always', 'on_failure' or 'never'."
            )


@dataclass(frozen=True)
class Supervisor:
    """Children that are started in this order and ended in the reverse order.

    Args:
        name: of the group, for messages and the page `health`.
        children: processes and further supervisors.
        strategy: what is restarted after a failure: "one_for_one" the child alone; "rest_for_one" it and all children
            after it, for a chain in which each one uses those before it.
        intensity: how many restarts are allowed.

    Raises:
        ConfigError: the strategy is unknown, there are no children, or two parts of the tree have one name.
    """

    name: str
    children: Sequence[Child | Supervisor]
    strategy: Strategy = "one_for_one"
    intensity: Intensity = field(default_factory=Intensity)

    def __post_init__(self) -> None:
        if self.strategy not in ("one_for_one", "rest_for_one"):
            raise ConfigError(
                f"Supervisor '{self.name}' has strategy={self.strategy!r}.", fix="'one_for_one' or 'rest_for_one'."
            )
        if not self.children:
            raise ConfigError(f"Supervisor '{self.name}' has no children.", fix="a list of Child(name).")
        names = list(self.names())
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ConfigError(f"Supervisor '{self.name}' has a name twice: {', '.join(twice)}.")

    def names(self) -> Iterator[str]:
        """Yield its name and those of all parts below it."""
        yield self.name
        for child in self.children:
            if isinstance(child, Supervisor):
                yield from child.names()
            else:
                yield child.name

    def processes(self) -> Iterator[Child]:
        """Yield all processes below it, in the order of their start."""
        for child in self.children:
            if isinstance(child, Supervisor):
                yield from child.processes()
            else:
                yield child


def _check_positive(limits: Timeouts | Backoff) -> None:
    for name, value in vars(limits).items():
        if not (math.isfinite(value) and value > 0):
            raise ParameterError(f"{type(limits).__name__}.{name} must be positive and finite, not {value!r}.")
