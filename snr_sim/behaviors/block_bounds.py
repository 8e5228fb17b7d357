"""What keeps a block of an LRP program bounded while it runs: loops and large values are counted.

The names in `HELPERS` are those that `blocks.py` puts into the code of a block.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from snr_sim.behaviors.context import plain_value
from snr_sim.prelude.sums import number_sum

MAX_TURNS = 10_000  # of all loops of a block together
MAX_WORK = 65_536  # elements and characters that a block makes or looks through
MAX_BITS = 4096  # of an integer in a computation


class BlockError(Exception):
    """A block has taken more than it may."""


def _charge(m: Any, amount: int) -> None:
    m.work -= amount
    if m.work < 0:
        raise BlockError(f"The block makes or looks through more than {MAX_WORK} elements.")


def turns(m: Any, values: Iterable[Any]) -> Iterator[Any]:
    """Yield the values that a loop goes through, and count them."""
    for value in values:
        m.turns -= 1
        if m.turns < 0:
            raise BlockError(f"The loops of the block have more than {MAX_TURNS} turns.")
        yield value


def sized(m: Any, value: Any) -> Any:
    """Count the elements of a text or a tuple, and return it."""
    if type(value) in (str, tuple, list):
        _charge(m, len(value))
    return value


def weighed(m: Any, value: Any) -> Any:
    """Count the elements of a tuple that is made, and those of tuples inside: a tuple of itself doubles each time."""
    count, inside = 0, [value]
    while inside and count <= MAX_WORK:
        one = inside.pop()
        count += len(one)
        inside += [child for child in one if type(child) in (tuple, list)]
    _charge(m, count)
    return value


def counted(m: Any, function: Callable[..., Any], *values: Any, **options: Any) -> Any:
    """Call a function of Python, and count what it looks through and returns."""
    if function is number_sum and (len(values) != 1 or options):
        raise BlockError("sum() takes one value here: numbers.")
    for value in values:
        sized(m, value)
    return _whole(sized(m, function(*values, **options)))


def _whole(value: Any) -> Any:
    if type(value) is int and value.bit_length() > MAX_BITS:
        raise BlockError(f"An integer has more than {MAX_BITS} bits.")
    return value


def add(m: Any, left: Any, right: Any) -> Any:
    """Return a sum; text and tuples are counted."""
    sized(m, left)
    sized(m, right)
    return _whole(left + right)


def multiply(m: Any, left: Any, right: Any) -> Any:
    """Return a product; repeated text and tuples are counted before they are made."""
    for sequence, times in ((left, right), (right, left)):
        if type(sequence) in (str, tuple, list) and isinstance(times, int):
            _charge(m, len(sequence) * max(0, times))
    return _whole(left * right)


def power(m: Any, base: Any, exponent: Any) -> Any:
    """Return a power; an integer is refused before it is computed if it is too large."""
    if isinstance(base, int) and isinstance(exponent, int) and base.bit_length() * exponent > MAX_BITS:
        raise BlockError(f"{base} ** {exponent:.6g} has more than {MAX_BITS} bits.")
    return base**exponent


def shift(m: Any, value: Any, bits: Any) -> Any:
    """Return a shifted integer; one that would be too large is refused."""
    if isinstance(value, int) and isinstance(bits, int) and value.bit_length() + bits > MAX_BITS:
        raise BlockError(f"The shifted integer has more than {MAX_BITS} bits.")
    return value << bits


def modulo(m: Any, left: Any, right: Any) -> Any:
    """Return a remainder; formatting by % is refused."""
    if isinstance(left, str):
        raise BlockError("Text is not formatted by % here: use an f-string.")
    return left % right


def bounded_range(*values: Any) -> range:
    """Return a range of at most `MAX_TURNS` numbers."""
    made = range(*values)
    try:
        is_short = len(made) <= MAX_TURNS
    except OverflowError:
        is_short = False
    if not is_short:
        raise BlockError(f"A range has more than {MAX_TURNS} numbers.")
    return made


def bounded_round(value: Any, digits: Any = None) -> Any:
    """Return a rounded number; of an integer and many negative digits Python would compute a huge power."""
    if digits is not None and not (isinstance(digits, int) and abs(digits) <= 400):
        raise BlockError(f"round() to {digits!r:.20} digits.")
    return round(value, digits)


def plain(name: str, value: Any) -> Any:
    """Return a value as a variable keeps it; `name` has " and " for several variables that are assigned at once."""
    if type(value) is tuple and " and " in name:  # several variables at once
        return tuple(plain_value(name, one) for one in value)
    return plain_value(name, value)


HELPERS: dict[str, Any] = {
    "_turns": turns, "_sized": sized, "_weighed": weighed, "_counted": counted, "_add": add,
    "_multiply": multiply, "_power": power, "_shift": shift, "_modulo": modulo, "_plain": plain,
    "range": bounded_range, "round": bounded_round, "math": math, "tuple": tuple,
}  # fmt: skip
