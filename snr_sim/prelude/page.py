"""Pages: named, stamped data. Loops and handlers store them; the datastore keeps the newest of each key."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import msgspec

from snr_sim.prelude.errors import ValueEncodingError
from snr_sim.prelude.structs import ensure_type_info
from snr_sim.prelude.values import (
    JSON_ERRORS,
    LONG_BYTES,
    TAG,
    decode_value,
    encode_with_tags,
    json_bytes,
    may_have_tags,
    no_garbage_collection,
)

DataKey: TypeAlias = str

_encode = msgspec.json.Encoder().encode


class Page(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field=TAG, tag="page"):
    """Data with a name, origin and time.

    Args:
        key: the page's name in the datastore.
        data: plain JSON types and numpy arrays survive recording and links exactly. A component's `page` and
            `store_data` copy them, so that a page does not change with its owner's list; a page that is made
            directly does not copy its data.
        origin: name of the node that made it.
        created_at_s: node time when it was made.
        process: whether a `process_data` task follows once it is stored.
    """

    key: DataKey
    data: Any
    origin: str
    created_at_s: float
    process: bool = True

    def serialize(self) -> bytes:
        """Return the page as one line of JSON that decodes to equal data: see `prelude/values.py`.

        >>> Page("depth", 1.5, "urov_node", 0.25).serialize()
        b'{"$":"page","key":"depth","data":1.5,"origin":"urov_node","created_at_s":0.25,"process":true}'
        """
        try:
            raw = _encode(self)
            # Values that C cannot encode (NaN, a tuple, ...) decode to unequal ones. Usually the page's "$" is the only
            # one in the text; else its mark must be the only mark.
            if raw.rfind(b"$") == 2 or raw.count(b'"$":') == 1:
                decode = _decode_data if len(raw) < LONG_BYTES else _decode_long_data
                if decode(raw).data == self.data:
                    return raw
        except (TypeError, ValueError, OverflowError, RecursionError):
            pass  # numpy, an unknown object, nested too deeply
        return encode_with_tags(self)

    @staticmethod
    def deserialize(raw: bytes | str, kinds: Mapping[str, Callable[..., Any]] | None = None) -> Page:
        """Return the page that `serialize` wrote; `kinds` as of `decode_value`, by default those of tasks and traces.

        Raises:
            ValueEncodingError: the JSON is not a page.
        """
        data = json_bytes(raw)
        try:
            # In our own format, and without further marks: then C decodes all of it.
            is_plain = data.startswith(_OWN_TAG) and not may_have_tags(data, len(_OWN_TAG))
            page: Any = _decode_page(data) if is_plain else decode_value(data, kinds or KINDS)
        except JSON_ERRORS as error:
            raise ValueEncodingError(f"This is not a page ({error}): {data[:80]!r}", fix=_FIX) from error
        if not isinstance(page, Page):
            raise ValueEncodingError(f"This is not a page: {data[:80]!r}", fix=_FIX)
        return page


_OWN_TAG = b'{"$":"page"'
_FIX = "pages are written by Page.serialize(); PageReader also reads those of the 2021 library."


class _DataOfPage(msgspec.Struct):
    """A page's data alone: decoding the other fields, only to drop them, would take as long again."""

    data: Any


_decode_page = msgspec.json.Decoder(Page).decode
_decode_data = msgspec.json.Decoder(_DataOfPage).decode
_decode_long_data = no_garbage_collection()(_decode_data)


def _page_of(**fields: Any) -> Page:
    return msgspec.convert(fields, ensure_type_info(Page))


# The marks of tasks and traces in addition to the plain ones of prelude/values.py.
KINDS = {"page": _page_of}
