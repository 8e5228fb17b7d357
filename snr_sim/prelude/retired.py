"""Names of the 2021 library that this one does not have: using one raises an error that says what to write instead."""

from __future__ import annotations

from typing import Any, NoReturn

from snr_sim.prelude.errors import RetiredName


class Retired:
    """Stands where a retired name stood: a class or function in a module, or a member in a class.

    A module's can be imported and used in annotations, since that asks nothing of it; calling it, inheriting from it
    or asking for one of its members raises. A member raises when it is read, unless an object or a subclass sets its
    own. It costs nothing where it is not used.

    Args:
        name: as the reader of the thesis writes it.
        fix: what to write instead.

    >>> Retired("Consumer", "a Loop.")("printer", print)
    Traceback (most recent call last):
    snr_sim.prelude.errors.RetiredName: 'Consumer' of the 2021 library is not in snr_sim.
      Try: a Loop.
    """

    _name = _fix = ""  # copies are looked at before they have their own

    def __init__(self, name: str, fix: str) -> None:
        self._name = name
        self._fix = fix

    def _refuse(self, *args: Any, **options: Any) -> NoReturn:
        raise RetiredName(f"'{self._name}' of the 2021 library is not in snr_sim.", fix=self._fix)

    __call__ = __get__ = __getattr__ = __mro_entries__ = __instancecheck__ = _refuse

    def __getitem__(self, parameters: object) -> Retired:
        return self
