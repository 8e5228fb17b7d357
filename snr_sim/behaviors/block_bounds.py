"""What keeps the blocks of an LRP program bounded while they run.

Nothing that a block makes is larger than 1000 elements, 4000 characters or 1024 bits. And a step has an amount of work:
a turn of a loop costs the size of its code, what is made or looked through costs its elements.

The names in `HELPERS` are those that `blocks.py` puts into the code of a block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from snr_sim.behaviors.context import MAX_SIZE, plain_value, size_of
from snr_sim.prelude.sums import number_sum

MIN_WORK = 500  # of one block, also if those before it have left less: an emergency stop is not kept from its condition
MAX_CODE = 10_000  # elements of a block's code, and of the helpers that it calls, as often as it calls them
MAX_BITS = 1024  # of an integer in a computation
MAX_RANGE = 10_000
MAX_DIGITS = 100  # of round(): of more Python would compute a large power
_ATOMS = (float, bool, type(None), range)


class BlockError(Exception):
    """A block has taken more than it may."""


def looked_at(m: Any, value: Any) -> Any:
    """Count the elements of what is looked through, and return it."""
    m.work -= len(value) if type(value) is range else size_of(value)
    if m.work < 0:
        raise BlockError("The blocks of this step compute too much: shorten loops, tuples and texts.")
    return value


def made(m: Any, value: Any) -> Any:
    """Count the elements of what a block has made, and return it."""
    kind = type(value)
    if kind in _ATOMS:
        return value
    if kind is int:
        if value.bit_length() > MAX_BITS:
            raise BlockError(f"An integer has more than {MAX_BITS} bits.")
        return value
    _check_size(size_of(value))
    return looked_at(m, value)


def _check_size(size: int) -> None:
    if size > MAX_SIZE:
        raise BlockError(f"A tuple or text that the block makes has more than {MAX_SIZE} elements.")


def turns(m: Any, cost: int, values: Iterable[Any]) -> Iterator[Any]:
    """Yield the values that a loop goes through, and count its turns by what one costs."""
    for value in values:
        m.work -= cost
        if m.work < 0:
            looked_at(m, ())
        yield value


def counted(m: Any, function: Callable[..., Any], *values: Any, **options: Any) -> Any:
    """Call a function of Python, and count what it looks through and returns."""
    if function is number_sum and (len(values) != 1 or options):
        raise BlockError("sum() takes one value here: numbers.")
    for value in values:
        looked_at(m, value)
    return made(m, function(*values, **options))


def multiply(m: Any, left: Any, right: Any) -> Any:
    """Return a product; repeated text and tuples are counted before they are made."""
    for sequence, times in ((left, right), (right, left)):
        if type(sequence) in (str, tuple, list) and isinstance(times, int):
            _check_size(size_of(sequence) * times)
            if type(sequence) is str:  # its size is 0 if it is short
                _check_size(len(sequence) * times // 4)
    return made(m, left * right)


def power(_m: Any, base: Any, exponent: Any) -> Any:
    """Return a power; an integer is refused before it is computed if it is too large."""
    if isinstance(base, int) and isinstance(exponent, int) and base.bit_length() * exponent > MAX_BITS:
        raise BlockError(f"{base} ** {exponent:.6g} has more than {MAX_BITS} bits.")
    return base**exponent


def shift(_m: Any, value: Any, bits: Any) -> Any:
    """Return a shifted integer; one that would be too large is refused."""
    if isinstance(value, int) and isinstance(bits, int) and value.bit_length() + bits > MAX_BITS:
        raise BlockError(f"The shifted integer has more than {MAX_BITS} bits.")
    return value << bits


def modulo(_m: Any, left: Any, right: Any) -> Any:
    """Return a remainder; formatting by % is refused."""
    if isinstance(left, str):
        raise BlockError("Text is not formatted by % here: use an f-string.")
    return left % right


def bounded_range(*values: Any) -> range:
    """Return a range of at most `MAX_RANGE` numbers."""
    made = range(*values)
    try:
        is_short = len(made) <= MAX_RANGE
    except OverflowError:
        is_short = False
    if not is_short:
        raise BlockError(f"A range has more than {MAX_RANGE} numbers.")
    return made


def bounded_round(value: Any, digits: Any = None) -> Any:
    """Return a rounded number."""
    if digits is not None and not (isinstance(digits, int) and abs(digits) <= MAX_DIGITS):
        raise BlockError(f"round() to {digits!r:.20} digits.")
    return round(value, digits)


def plain_each(names: str, value: Any) -> Any:
    """Return a value as several variables that are assigned at once keep it."""
    return tuple(plain_value(names, one) for one in value) if type(value) is tuple else plain_value(names, value)


HELPERS: dict[str, Any] = {
    "_turns": turns, "_looked_at": looked_at, "_made": made, "_counted": counted, "_multiply": multiply,
    "_power": power, "_shift": shift, "_modulo": modulo, "_plain": plain_value,
    "_plain_each": plain_each,
    "range": bounded_range, "round": bounded_round, "math": math, "tuple": tuple,
}  # fmt: skip
