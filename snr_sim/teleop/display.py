"""Display for the person at the surface: the state of the vehicle.

On a terminal it is a table, a few times a second; in a pipe a line whenever a row of `news` changes, and periodically.
It is a loop and not an endpoint: it only reads pages and stores none, and a replay does not need it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.core.standard_streams import print_line
from snr_sim.devices.terminal_keys import has_terminal
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.recorder import RECORDING_KEY
from snr_sim.prelude.text import one_line

# Of each row its name, its text, and rich's style of the text or "": texts come over a wire, so none is markup.
Rows = list[tuple[str, str, str]]

# Age of page "vehicle" from which it is shown as silent; it is sent every 0.1 s. With the time between two drawings, a
# vehicle that has stopped is shown to have within a second.
SILENT_S = 0.5
LINE_PERIOD_S = 10.0  # in a pipe, if nothing of the news changes
NEWS_ROWS = ("manual_input", "vehicle", "recording")
NO_INPUT = "no manual input: there is no game controller and no terminal for keys; start from a terminal"
_LOST = suppress(OSError, ValueError)  # the terminal has gone, which must not end the pilot
MAX_ROWS = 50  # and a row has at most 300 characters, so that no page of a peer fills the terminal


class DisplayFactory(LoopFactory):
    """Makes the display.

    Args:
        describe: returns names, texts and styles of rows for the data of page "vehicle" and the other pages, as they
            were then. If it raises, because a peer has sent something else, the display shows that.
        keys: of the pages that are shown: "vehicle" first; "gamepad", if a person commands.
        link: key of the status page of the link to the vehicle.
        news: names of rows that are printed as soon as they change.
        rate_hz: how often it is drawn.
        in_lock_step: whether it shows anything under a virtual clock; false if the user does not watch that run live.
        lines: what is below the table.
    """

    def __init__(
        self,
        describe: Callable[[dict[str, Any], Mapping[str, Any]], Rows],
        keys: Sequence[str],
        link: str,
        news: Sequence[str] = (),
        rate_hz: float = 5.0,
        in_lock_step: bool = True,
        lines: Sequence[str] = (),
    ) -> None:
        super().__init__()
        self.describe: Callable[[dict[str, Any], Mapping[str, Any]], Rows] = describe
        self.keys: tuple[str, ...] = (*keys, link, RECORDING_KEY)
        self.link: str = link
        self.news: tuple[str, ...] = (*NEWS_ROWS, *news)
        self.rate_hz: float = rate_hz
        self.in_lock_step: bool = in_lock_step
        self.lines: tuple[str, ...] = tuple(lines)

    def get(self, parent: NodeApi) -> Display:
        """Return the loop 'display'."""
        return Display(self, parent, "display", self.rate_hz)

    def rows(self, pages: Mapping[str, Any], silence_s: float, has_keys: bool = True) -> Rows:
        """Return names, texts and styles of the rows, whatever is in the pages.

        Args:
            pages: the newest of each key, or None.
            silence_s: age of the last arrival of page "vehicle".
            has_keys: whether there is a terminal to type at.
        """
        page, link = pages["vehicle"], pages.get(self.link)
        shown = [
            *_rows_of("manual_input", pages.get("gamepad"), lambda it: _manual_input(it, has_keys)),
            *_rows_of("recording", pages.get(RECORDING_KEY), _recording),
        ]
        if page is None:
            shown += _rows_of("vehicle", link, _link) or [("vehicle", "nothing received yet", "red")]
        else:
            status = _rows_of("pages", page, lambda it: self.describe(it.data, pages))
            if silence_s <= SILENT_S:
                shown += [("vehicle", f"received {silence_s:.2f} s ago", ""), *status]
            else:
                # The last value is useful, but must not look like a current one.
                then = [(name, f"last received: {text}", "dim") for name, text, _ in status]
                shown += [("vehicle", f"silent for {silence_s:.1f} s", "red"), *then]
        return shown[:MAX_ROWS]


def _rows_of(name: str, page: Any, describe: Callable[[Any], Rows]) -> Rows:
    """Return the rows about a page, or one of this name that it cannot be shown; none if there is no page."""
    if page is None:
        return []
    try:
        return [(one_line(row), one_line(text), style) for row, text, style in describe(page)]
    except Exception as error:  # pages come over a wire, and an error here would end the pilot, too
        return [(name, f"cannot be shown: {type(error).__name__}", "red")]


def _manual_input(gamepad: Any, has_keys: bool) -> Rows:
    if gamepad.data["is_connected"]:
        return []
    return [("manual_input", *(("keyboard: no game controller", "yellow") if has_keys else (NO_INPUT, "red")))]


def _recording(lost: Any) -> Rows:
    return [
        ("recording", f"lost at {lost.origin} since its t = {lost.data['since_s']:.1f} s: {lost.data['reason']}", "red")
    ]


def _link(link: Any) -> Rows:
    """Return why nothing has come over the link."""
    return [] if link.data["up"] else [("vehicle", f"nothing received yet; link: {link.data['reason']}", "red")]


class Display(Loop):
    """Shows rows in a terminal, or lines where there is none."""

    factory: DisplayFactory

    def setup(self) -> None:
        """Take the terminal, if standard error is one."""
        self.live: Any = None
        self.is_off: bool = self.parent.is_in_lock_step and not self.factory.in_lock_step
        self.has_keys: bool = has_terminal()
        self.printed: list[str] = []
        self.printed_s: float = -math.inf
        if sys.stderr.isatty() and not self.is_off:
            from rich.console import Console
            from rich.live import Live

            self.live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)
            with _LOST:
                self.live.start()

    def loop(self) -> None:
        """Show the current state."""
        if self.is_off:
            return
        # By its arrival time here: the vehicle's own clock cannot be compared with this computer's.
        silence_s = self.get_time_s() - self.parent.received_at_s("vehicle")
        shown = self.factory.rows({key: self.get_page(key) for key in self.factory.keys}, silence_s, self.has_keys)
        if self.live is None:
            self.print_line(shown)
        else:
            self.draw(shown)

    def draw(self, shown: Rows) -> None:
        """Draw the table."""
        table = table_of(shown, f"t = {self.get_time_s():.1f} s", self.factory.lines)
        with _LOST:
            self.live.update(table, refresh=True)

    def print_line(self, shown: Rows) -> None:
        """Print a line if there is news or the period has passed."""
        now_s = self.get_time_s()
        news = [
            text.split(" ")[0] if name == "vehicle" else text for name, text, _ in shown if name in self.factory.news
        ]
        if news == self.printed and now_s - self.printed_s < LINE_PERIOD_S:
            return
        self.printed, self.printed_s = news, now_s
        print_line(sys.stderr, f"t = {now_s:.1f} s: {'; '.join(f'{name} {text}' for name, text, _ in shown)}")

    def halt(self) -> None:
        """Restore the terminal."""
        if self.__dict__.get("live") is not None:
            with _LOST:
                self.live.stop()


def table_of(shown: Rows, title: str, lines: Sequence[str]) -> Any:
    """Return the table of rich with these rows, its title, and what is below it."""
    from rich.table import Table
    from rich.text import Text

    table = Table(show_header=False, title=title)
    table.caption = Text("\n".join(lines), justify="left")
    for name, text, style in shown:
        table.add_row(Text(name), Text(text, style))
    return table
