"""Errors with what happened, what was found and what to try. One tree, a class per case worth catching."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from snr_sim.prelude.renamed import old_names


class SnrError(Exception):
    """Base of all errors that this library raises on purpose.

    Args:
        message: what happened and what was found, in terms of the student's own robot.
        fix: one thing to try.
    """

    def __init__(self, message: str, fix: str = "") -> None:
        super().__init__(message)
        self.message: str = message
        self.fix: str = fix

    def __str__(self) -> str:
        return f"{self.message}\n  Try: {self.fix}" if self.fix else self.message


class ConfigError(SnrError):
    """A robot's configuration is wrong: roles, factories, names, handlers."""


class UnknownNameError(ConfigError):
    """A robot, scenario, controller, role, engine or option that is not known."""


class RetiredNameError(SnrError, AttributeError):
    """A name of the 2021 library that this one does not have. The fix names its replacement."""


class TaskError(SnrError):
    """An object that is not a task, or an incomplete task, where a task is required."""


class ComponentFailedError(SnrError):
    """A student's handler or loop raised, or returned an object that is not a task.

    The message has the student's line first; `step` is 'begin', 'setup', 'loop', 'halt' or 'terminate', or empty if a
    handler failed. `suspects` names components of the node that may have caused it by what they stored until
    `stored_at_s` (node time).
    """

    def __init__(
        self,
        message: str,
        node: str = "",
        component: str = "",
        step: str = "",
        suspects: Sequence[str] = (),
        stored_at_s: float = float("inf"),
    ) -> None:
        super().__init__(message)
        self.node: str = node
        self.component: str = component
        self.step: str = step
        self.suspects: tuple[str, ...] = tuple(suspects)
        self.stored_at_s: float = stored_at_s


class ClockError(SnrError):
    """An operation that the clock does not support, such as going back."""


class ParameterError(SnrError):
    """A number or an option is out of range."""


class ValueEncodingError(SnrError):
    """A value that JSON cannot encode without loss."""


class DeviceError(SnrError):
    """A sensor or an actuator cannot execute a request."""


class SensorLostError(DeviceError):
    """The sensor cannot deliver readings any more."""


class CommandError(DeviceError):
    """An invalid command: NaN, infinite, wrong type, unknown field.

    `suspects` names the components of the node that may have stored it, which was at node time `stored_at_s`.
    """

    suspects: tuple[str, ...] = ()
    stored_at_s: float = float("inf")


class PlantError(SnrError):
    """The simulated state is outside the range of the physics."""


class TraceError(SnrError):
    """A recorded run that cannot be written, read or used."""


class LinkError(SnrError):
    """A link between nodes that cannot be made, or a message that it cannot carry."""


class FrameTooLargeError(LinkError):
    """A message longer than the link's maximum frame."""


class RecordingError(SnrError):
    """A file of pages or text, other than the trace, that cannot be read or written."""


class SupervisionError(SnrError):
    """Supervised processes that failed too often, or a table of deadlines that is corrupt."""


class MissingExtraError(SnrError, ImportError):
    """An optional package is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(
            f"This needs the package '{package}', which is not installed.",
            fix=f"pip install 'snr_sim[{extra}]'  (in a checkout: pip install -e '.[{extra}]')",
        )


def suggest(requested: str, known: Iterable[str], listed: str = "one of") -> str:
    """Return a sentence that suggests the nearest known name and lists the known names, after the text `listed`.

    >>> suggest("motor_sped", ["depth", "motor_speed"])
    "did you mean 'motor_speed'? One of: depth, motor_speed."
    >>> suggest("x", ["depth", "imu"], "stored were")
    'stored were: depth, imu.'
    >>> suggest("x", ["depth"])
    "'depth' is the only one."
    """
    import difflib  # slow to import, and only errors need it

    names = sorted(set(known))
    if not names:
        return "there is none to choose from." if listed == "one of" else f"{listed}: none."
    close = difflib.get_close_matches(requested, names, n=1, cutoff=0.5)
    if len(names) == 1 and listed == "one of":
        return f"did you mean '{names[0]}'?" if close else f"'{names[0]}' is the only one."
    listing = ", ".join(names[:20]) + (f" and {len(names) - 20} more." if len(names) > 20 else ".")
    if close:
        return f"did you mean '{close[0]}'? {listed[0].upper()}{listed[1:]}: {listing}"
    return f"{listed}: {listing}"


if not TYPE_CHECKING:  # a type checker would accept any name
    _RENAMED = ("UnknownName", "RetiredName", "ComponentFailed", "SensorLost", "FrameTooLarge", "MissingExtra")
    __getattr__ = old_names(__name__, {name: f"{name}Error" for name in _RENAMED})
