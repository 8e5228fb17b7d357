"""Commands in pages: the newest of a key, its conversion, the loop that writes it, and the simulated actuator.

An invalid command raises an error that explains it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Generic, TypeVar, get_args, get_origin

import msgspec

from snr_sim.core.datastore import page_age_s
from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.run_diagnostics import describe_unusable_page
from snr_sim.devices.device_loop import DeviceLoop, start_device
from snr_sim.prelude.device import Device
from snr_sim.prelude.errors import CommandError, DeviceError, ParameterError, suggest
from snr_sim.prelude.life_cycle import LifeCycle
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.task import Page, ensure_type_info

CommandT = TypeVar("CommandT", bound=msgspec.Struct)
Limits = dict[str, tuple[float, float]]

_SHOWN_LENGTH = 80


class CommandInput:
    """Receives the pages of a key for the loop that writes them, and reports where an invalid one was stored.

    On the wall clock each page wakes the loop: otherwise it would wait half a tick on average. In lock step a tick runs
    after everything else at its time, so pages wait less.
    """

    def __init__(self, loop: Loop, key: str) -> None:
        self._loop, self._key = loop, key
        self._page: Page | None = None
        self._is_tapped = False
        self._clamped: set[str] = set()

    def begin(self) -> None:
        """Receive pages from now on."""
        self._page = None  # an older page may be invalid: the loop may have been out of the node meanwhile
        self._is_tapped = True
        self._loop.parent.add_store_listener(self._key, self._receive)

    def end(self) -> None:
        """Stop receiving. Safe to call twice."""
        if self._is_tapped:
            self._is_tapped = False
            self._loop.parent.remove_store_listener(self._key, self._receive)

    def _receive(self, page: Page) -> None:
        self._page = page
        self._loop.wake()

    def newest(self) -> tuple[Page | None, float]:
        """Return the newest page and its age [s]; None and infinity before the first."""
        # The node's own page: from before `begin`, or in another process. The query also reports an unknown key.
        page = self._page or self._loop.parent.get_page(self._key)
        return (None, math.inf) if page is None else (page, page_age_s(self._loop.parent, page))

    def error_with_source(self, page: Page, error: CommandError) -> CommandError:
        """Return the error with the component that stored the page, whose line comes first if it is known."""
        what = f"Page '{page.key}' is not a valid command: {error.message}"
        if isinstance(page.data, dict):
            what += f"\n  It holds {describe_value(page.data)}."
        text, suspects = describe_unusable_page(self._loop.parent, page, what, self._loop.name)
        found = CommandError(text, fix=error.fix)
        found.suspects = suspects
        found.stored_at_s = page.created_at_s
        return found

    def note_clamped(self, command: Any, applied: Any, limits: dict[str, tuple[float, float]]) -> None:
        """Add a note for each field that was clamped, once."""
        for field in command.__struct_fields__:
            asked, got = getattr(command, field), getattr(applied, field)
            if asked != got and field not in self._clamped:
                self._clamped.add(field)
                low, high = limits[field]
                self._loop.parent.add_note(
                    f"Command '{self._key}.{field}' = {_shown(asked)} is outside {limits[field]} "
                    f"and was clamped to {_shown(got)} (reported once; t = {self._loop.get_time_s():.2f} s). "
                    f"Store a value from {low:g} to {high:g}.",
                    self._loop.parent.find_writer(self._key, self._loop.name)[0],
                )


class ActuatorLoopFactory(LoopFactory):
    """Writes the newest command page to an actuator, and neutral when there is none or it is too old.

    Args:
        key: of the command page.
        open_device: opens the actuator.
        rate_hz: how often it is written.
        timeout_s: age from which a command is ignored.
    """

    def __init__(self, key: str, open_device: Callable[[], Device], rate_hz: float, timeout_s: float = 0.5) -> None:
        super().__init__()
        self.key: str = key
        self.open_device: Callable[[], Device] = open_device
        self.rate_hz: float = rate_hz
        self.timeout_s: float = timeout_s

    def get(self, parent: NodeApi) -> CommandLoop:
        """Return the loop `<key>_actuator`."""
        return ActuatorLoop(self, parent, f"{self.key}_actuator", self.rate_hz)


class CommandLoop(DeviceLoop):
    """Owns a device that follows the pages of its factory's key."""

    factory: ActuatorLoopFactory

    def __init__(self, factory: ActuatorLoopFactory, parent: NodeApi, name: str, max_tick_rate_hz: float) -> None:
        super().__init__(factory, parent, name, max_tick_rate_hz)
        self.commands: CommandInput = CommandInput(self, factory.key)

    def begin(self) -> None:
        """Start the ticks, and receive commands from now on."""
        self.commands.begin()
        super().begin()

    def join(self) -> None:
        """Stop the ticks."""
        self.commands.end()
        super().join()


class ActuatorLoop(CommandLoop):
    """Writes commands; an invalid command leaves the actuator at neutral and stops the run."""

    def setup(self) -> None:
        """Open the actuator and go to neutral."""
        self.device: Any = start_device(self.factory.open_device(), f"the actuator '{self.factory.key}'")
        self.device.neutral()
        self._written: Page | None = None

    def loop(self) -> None:
        """Write the newest command once; neutral if it is too old."""
        page, age_s = self.commands.newest()
        if page is None:
            return
        if age_s > self.factory.timeout_s:
            self.device.neutral()  # also if it has just arrived: it was delayed on the way
        elif page is not self._written:
            self._written = page
            self._write(page)

    def _write(self, page: Page) -> None:
        actuator = self.device
        try:
            command = self.read_command(page)
            applied = actuator.write(command)
        except CommandError as error:
            actuator.neutral()
            raise self.commands.error_with_source(page, error) from error
        if applied != command and actuator.health().state == "active":
            self.commands.note_clamped(command, applied, actuator.limits)

    def read_command(self, page: Page) -> Any:
        """Return the command in a page; errors as `command_of`."""
        return command_of(page.data, self.device.command_type, self.device.limits)

    def halt(self) -> None:
        """Go to neutral."""
        if self.device is not None:
            self.device.neutral()
        super().halt()


class SimActuator(LifeCycle, Generic[CommandT]):
    """Writes one input of a plant. Implements `Actuator`.

    Args:
        plant: the driven plant.
        input_name: name of the input.
        command_type: the struct of its commands; made without arguments it must be neutral.
        limits: lowest and highest value of each field; each number of a list is limited.
    """

    def __init__(
        self, plant: Plant, input_name: str, command_type: type[CommandT], limits: dict[str, tuple[float, float]]
    ) -> None:
        for name in limits:
            if name not in command_type.__struct_fields__:
                raise ParameterError(
                    f"{command_type.__name__} has no field '{name}'.", fix=suggest(name, command_type.__struct_fields__)
                )
        self._plant, self._input = plant, input_name
        self.command_type: type[CommandT] = command_type
        self.limits: dict[str, tuple[float, float]] = dict(limits)
        self.title: str = f"The simulated actuator '{input_name}'"

    def write(self, command: CommandT) -> CommandT:
        """Apply a command, clamped to the limits, and return it as applied.

        Raises:
            CommandError: it is not a command of this actuator, or a value is not a finite number. The last applied
                command stays.
        """
        if self.state == "closed":
            raise DeviceError(f"The simulated actuator '{self._input}' was closed.", fix="open it again.")
        if type(command) is not self.command_type:
            expected = self.command_type
            raise CommandError(
                f"'{self._input}' takes {expected.__name__}, not {type(command).__name__}.",
                fix=f"send {expected.__name__}({', '.join(expected.__struct_fields__)}).",
            )
        changed: dict[str, Any] = {}
        for name, (low, high) in self.limits.items():
            value = getattr(command, name)
            if type(value) is not float or not low <= value <= high:
                changed[name] = self._clamp(name, value, low, high)
        if changed:
            command = msgspec.structs.replace(command, **changed)
        self._plant.write(self._input, command)
        return command

    def _clamp(self, name: str, value: Any, low: float, high: float) -> Any:
        if isinstance(value, (list, tuple)):
            return [self._clamp(f"{name}[{i}]", one, low, high) for i, one in enumerate(value)]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise CommandError(
                f"{self._input}.{name} must be a finite number, not {value!r}.",
                fix=f"send a number from {low:g} to {high:g}; look for a division by zero or an overflow before it.",
            )
        return min(high, max(low, value))

    def neutral(self) -> None:
        """Write the neutral command, also after `close`."""
        self._plant.write(self._input, self.command_type())

    def on_deactivate(self, reason: str) -> None:
        """Write the neutral command."""
        self.neutral()

    def on_close(self) -> None:
        """Write the neutral command, also if it was never active."""
        self.neutral()


def command_of(data: Any, command_type: type[Any], limits: Limits) -> Any:
    """Return the command in a page.

    Args:
        data: of the page: the command itself, or a dict of its fields.
        command_type: struct of the actuator's commands.
        limits: lowest and highest value of its fields.

    Raises:
        CommandError: it is not such a command; names the field, its value and what it must be.
    """
    if type(data) is command_type:
        return data
    try:
        return msgspec.convert(_plain(data), ensure_type_info(command_type))
    except msgspec.ValidationError as error:
        raise _command_error(data, command_type, limits) from error


def check_finite(name: str, value: float, limits: tuple[float, float]) -> None:
    """Raise a CommandError if a number of a command is NaN or infinite."""
    if not math.isfinite(value):
        raise CommandError(
            f"{name} must be finite, not {value!r}.",
            fix=f"send a finite number from {limits[0]:g} to {limits[1]:g}; "
            "look for a division by zero or an overflow before it.",
        )


def _plain(value: Any) -> Any:
    """Return a value with numpy's numbers and arrays converted to Python's."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value


def _command_error(data: Any, command_type: type[Any], limits: Limits) -> CommandError:
    fields = msgspec.structs.fields(command_type)
    names = [field.name for field in fields]
    example = ", ".join(f'"{field.name}": {_default(field)}' for field in fields)
    fix = f"store a dict with these fields: {{{example}}}."
    if not isinstance(data, dict):
        return CommandError(f"it is {describe_value(data)}, but must be a dict.", fix)
    for name in data:
        if name not in names:
            return CommandError(
                f"it has the field {name!r}, which this actuator does not know.", suggest(str(name), names)
            )
    for field in fields:
        if field.name not in data:
            if field.required:
                return CommandError(f"it has no field '{field.name}'.", fix)
            continue
        found = _wrong_value(field.name, data[field.name], field.type)
        if found is not None:
            location, value = found
            must_be = _requirement(
                field.type if location == field.name else get_args(field.type)[0], limits.get(field.name)
            )
            return CommandError(f"{location} is {describe_value(value)}, but must be {must_be}.", fix)
    return CommandError(f"it is {describe_value(data)}.", fix)


def _wrong_value(location: str, value: Any, kind: Any) -> tuple[str, Any] | None:
    """Return position and value of the first wrong type in a field; None if it is valid."""
    if get_origin(kind) is list and isinstance(value, (list, tuple)):
        inside = (_wrong_value(f"{location}[{i}]", one, get_args(kind)[0]) for i, one in enumerate(value))
        return next((found for found in inside if found is not None), None)
    try:
        msgspec.convert(_plain(value), ensure_type_info(kind))
    except msgspec.ValidationError:
        return location, value
    return None


def _requirement(kind: Any, limits: tuple[float, float] | None) -> str:
    if get_origin(kind) is list:
        inside = _requirement(get_args(kind)[0], limits)
        return f"a list, each {inside}"
    if kind not in (int, float):
        return f"a {getattr(kind, '__name__', kind)}"
    number = "a whole number" if kind is int else "a number"
    return number if limits is None else f"{number} from {limits[0]:.4g} to {limits[1]:.4g}"


def _default(field: Any) -> str:
    return "..." if field.default is msgspec.NODEFAULT else repr(field.default)


def describe_value(value: Any) -> str:
    """Return the type and value of a value as text for a student.

    >>> describe_value("full"), describe_value([0.5]), describe_value(None)
    ("the text 'full'", 'the list [0.5]', 'None')
    """
    try:
        shown = repr(value)
    except ValueError:  # Python does not print integers of more than 4300 digits
        shown = "... with more than 4300 digits"
    if len(shown) > _SHOWN_LENGTH:
        shown = shown[: _SHOWN_LENGTH - 3] + "..."
    if isinstance(value, str):
        return f"the text {shown}"
    if value is None or isinstance(value, bool):
        return shown
    if isinstance(value, (int, float)):
        return f"the number {shown}"
    if isinstance(value, (list, tuple, dict, set)):
        return f"the {type(value).__name__} {shown}"
    return f"{shown}, which is of the type {type(value).__name__}"


def _shown(value: Any) -> str:
    """Return a number, or a list of numbers, as short text."""
    return f"[{', '.join(map(_shown, value))}]" if isinstance(value, (list, tuple)) else f"{value:g}"
