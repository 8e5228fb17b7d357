"""Structs in threads: two threads must not use a type with msgspec for the first time at once.

At first use msgspec fills its type information step by step, and a second thread may read it half filled: msgspec 0.22
then crashes with a segmentation fault, for dataclasses, too. Later uses are safe. So a module makes its decoders once,
at import, and code that gets a type as an argument calls `msgspec.convert(data, ensure_type_info(kind))`.
"""

from __future__ import annotations

from functools import lru_cache
from threading import RLock
from typing import Any, TypeVar

import msgspec

_MAX_TYPES = 256  # that are remembered, and so kept in memory: reloaded files make new ones
_lock = RLock()  # not a Lock: the garbage collector may run any code meanwhile, even this function

AnyKind = TypeVar("AnyKind")


def ensure_type_info(kind: AnyKind) -> AnyKind:
    """Make msgspec's information of a type and all types inside complete, and return the type: then it is thread-safe.

    Raises:
        TypeError: msgspec does not support the type.
    """
    _build_decoder(kind)
    return kind


@lru_cache(_MAX_TYPES)
def _build_decoder(kind: Any) -> None:
    with _lock:
        msgspec.json.Decoder(kind)
