"""The newest command page of a key, for the loop that writes it to a device."""

from __future__ import annotations

import math
from typing import Any

from snr_sim.core.loop import Loop
from snr_sim.core.page_age import page_age_s
from snr_sim.core.page_writers import find_writer
from snr_sim.devices.commands import describe_value
from snr_sim.prelude.errors import CommandError
from snr_sim.prelude.page import Page


class CommandInput:
    """Receives a loop's command pages, and reports where an invalid one was stored.

    On the wall clock each page wakes the loop: otherwise it would wait half a tick on average. In lock step a tick runs
    after everything else at its time, so pages wait less.

    Args:
        loop: the loop that writes the commands.
        key: of their pages.
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
        when = f"at t = {page.created_at_s:.3f} s"
        if page.origin != self._loop.parent.name:
            return CommandError(f"{what}\n  It was made {when} by node '{page.origin}'.", fix=error.fix)
        lines, who = self._find_writer()
        return CommandError(f"{lines}{what}\n  It was stored {when} by {who}.", fix=error.fix)

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
                    self._find_writer()[0],
                )

    def _find_writer(self) -> tuple[str, str]:
        others = [component for component in self._loop.parent.components.values() if component is not self._loop]
        return find_writer(self._key, others)


def _shown(value: Any) -> str:
    """Return a number, or a list of numbers, as short text."""
    return f"[{', '.join(map(_shown, value))}]" if isinstance(value, (list, tuple)) else f"{value:g}"
