"""Structs in threads: what msgspec learns of a type when it is first used, two threads may not learn at once.

It fills it in bit by bit, and lets a second thread read the half of it: msgspec 0.22 then ends the process with a
segmentation fault, for dataclasses, too. A type that is known is safe. So a module makes its decoders once, when it is
imported, and who is given a type by somebody else writes `msgspec.convert(data, learned(kind))`.
"""

from __future__ import annotations

from functools import lru_cache
from threading import RLock
from typing import Any, TypeVar

import msgspec

_MOST_TYPES = 256  # that are kept in mind, and so in memory: reloaded files make new ones
_learning = RLock()  # not a Lock: the collector may run anybody's code meanwhile, also code that comes here

AnyKind = TypeVar("AnyKind")


def learned(kind: AnyKind) -> AnyKind:
    """Return the type, which msgspec then knows with all that is inside: any thread may make values of it.

    Raises:
        TypeError: msgspec cannot make such a type of data.
    """
    _learn(kind)
    return kind


@lru_cache(_MOST_TYPES)
def _learn(kind: Any) -> None:
    with _learning:
        msgspec.json.Decoder(kind)
