"""Data that states hand on: by declared keys, copied where a container begins and ends."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

from snr_sim.prelude.errors import ParameterError, UnknownNameError, suggest
from snr_sim.prelude.task import snapshot


def check_known(name: str, known: Collection[str], message: str, listed: str = "one of") -> None:
    """Check that a name is known.

    Raises:
        UnknownNameError: it is not; with the message and the nearest name, or all of them after `listed`.
    """
    if name not in known:
        raise UnknownNameError(message, fix=suggest(name, known, listed))


class Userdata:
    """What one state sees of its container's data: `userdata.target` reads, `userdata.grip_n = 2.0` writes.

    Args:
        data: of the container.
        inputs, outputs: names that may be read and written, by the names that the container has for them.
        who: the state, for messages.
    """

    __slots__ = ("_data", "_inputs", "_outputs", "_who")

    def __init__(self, data: dict[str, Any], inputs: Mapping[str, str], outputs: Mapping[str, str], who: str) -> None:
        for name, value in (("_data", data), ("_inputs", inputs), ("_outputs", outputs), ("_who", who)):
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Return a value: a copy, and if it may not be written, one that cannot be changed.

        Raises:
            UnknownNameError: it is not among the state's `input_keys`, or has not been set.
        """
        if name.startswith("__"):
            raise AttributeError(name)
        who = f"{self._who} reads userdata.{name},"
        check_known(name, self._inputs, f"{who} which is not among its input_keys.", "they are")
        outer = self._inputs[name]
        check_known(outer, self._data, f"{who} and '{outer}' has not been set.")
        value = self._data[outer]
        return snapshot(value, []) if name in self._outputs else frozen(value)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a value.

        Raises:
            UnknownNameError: it is not among the state's `output_keys`.
            ParameterError: it is not data.
        """
        message = f"{self._who} writes userdata.{name}, which is not among its output_keys."
        check_known(name, self._outputs, message, "they are")
        self._data[self._outputs[name]] = data_copy(f"userdata.{name} of {self._who}", value)


def inputs_of(userdata: Userdata) -> dict[str, Any]:
    """Return a copy of all that may be read and has been set."""
    data: dict[str, Any] = object.__getattribute__(userdata, "_data")
    inputs: Mapping[str, str] = object.__getattribute__(userdata, "_inputs")
    return {name: data_copy(name, data[outer]) for name, outer in inputs.items() if outer in data}


def data_copy(what: str, value: Any) -> Any:
    """Return a copy of data.

    Raises:
        ParameterError: it contains objects.
    """
    objects: list[Any] = []
    try:
        kept = snapshot(value, objects)
    except RecursionError:
        raise ParameterError(f"{what} contains itself.", fix="numbers, text, lists and dicts of these.") from None
    if objects:
        raise ParameterError(
            f"{what} is given an object of the type {type(objects[0]).__name__}.",
            fix="numbers, text, lists and dicts of these; keep objects in the state itself.",
        )
    return kept


def frozen(value: Any) -> Any:
    """Return data whose lists are tuples and whose dicts cannot be written.

    >>> frozen({"way": [1, 2]})["way"]
    (1, 2)
    """
    if isinstance(value, dict):
        return MappingProxyType({key: frozen(item) for key, item in value.items()})
    if isinstance(value, (list, tuple)):
        return tuple(frozen(item) for item in value)
    return value


def keys_of(names: tuple[str, ...], remapping: Mapping[str, str]) -> dict[str, str]:
    """Return the container's name for each key of a state."""
    return {name: remapping.get(name, name) for name in names}


class Scope:
    """The data of one execution of a container: copies of what its own container has.

    Args:
        path: of the container, for messages.
        outer: data of its own container.
        inputs, outputs: keys that it takes and gives back.
        remapping: names of its own container for these, where they are others.
    """

    def __init__(
        self,
        path: str,
        outer: dict[str, Any],
        inputs: tuple[str, ...],
        outputs: tuple[str, ...],
        remapping: Mapping[str, str],
    ) -> None:
        self._outer, self._outputs = outer, keys_of(outputs, remapping)
        self.data: dict[str, Any] = {
            name: data_copy(f"'{name}' of '{path}'", outer[theirs])
            for name, theirs in keys_of(inputs, remapping).items()
            if theirs in outer
        }

    def give_back(self) -> None:
        """Give back what the container has made."""
        self._outer.update({theirs: self.data[name] for name, theirs in self._outputs.items() if name in self.data})
