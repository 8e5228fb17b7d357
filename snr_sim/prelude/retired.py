"""Names of the 2021 library that this one does not have: their use raises an error that names the replacement."""

from __future__ import annotations

from typing import Any, NoReturn

from snr_sim.prelude.errors import RetiredNameError


class Retired:
    """Placeholder for a retired name: a class or function in a module, or a member in a class.

    A module's can be imported and used in annotations, which do not access it; calling it, inheriting from it or
    reading one of its members raises. A member raises when it is read, unless an object or a subclass sets its own.
    Unused, it has no cost. The fix names the replacement.

    >>> Retired("Consumer", "a Loop.")("printer", print)
    Traceback (most recent call last):
    snr_sim.prelude.errors.RetiredNameError: 'Consumer' of the 2021 library is not in snr_sim.
      Try: a Loop.
    """

    _name = _fix = ""  # a copy is read before its own are set

    def __init__(self, name: str, fix: str) -> None:
        self._name = name
        self._fix = fix

    def _refuse(self, *args: Any, **options: Any) -> NoReturn:
        raise RetiredNameError(f"'{self._name}' of the 2021 library is not in snr_sim.", fix=self._fix)

    __call__ = _refuse
    __get__ = _refuse
    __getattr__ = _refuse
    __mro_entries__ = _refuse
    __instancecheck__ = _refuse

    def __getitem__(self, parameters: object) -> Retired:
        return self
