"""Display for the person at the surface: the state of the vehicle.

On a terminal it is a table, a few times a second; in a pipe a line whenever a row of `news` changes, and periodically.
It is a loop and not an endpoint: it only reads pages and stores none, and a replay does not need it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from snr_sim.core.loop import Loop, LoopFactory
from snr_sim.devices.terminal_keys import has_terminal
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.recorder import RECORDING_KEY

Rows = list[tuple[str, str]]

# Age of page "vehicle" from which it is shown as silent; it is sent every 0.1 s. With the time between two drawings, a
# vehicle that has stopped is shown to have within a second.
SILENT_S = 0.5
LINE_PERIOD_S = 10.0  # in a pipe, if nothing of the news changes
NEWS_ROWS = ("manual_input", "vehicle", "recording")
NO_INPUT = "[red]no manual input: there is no game controller and no terminal for keys; start from a terminal[/red]"


class DisplayFactory(LoopFactory):
    """Makes the display.

    Args:
        describe: returns names and texts, for rich to show, of page "vehicle" and the other pages, as they were then.
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
        """Return names and texts, for rich to show.

        Args:
            pages: the newest of each key, or None.
            silence_s: age of the last arrival of page "vehicle".
            has_keys: whether there is a terminal to type at.
        """
        page, gamepad = pages["vehicle"], pages.get("gamepad")
        shown = []
        if gamepad is not None and not gamepad.data["is_connected"]:
            shown = [("manual_input", "[yellow]keyboard: no game controller[/yellow]" if has_keys else NO_INPUT)]
        lost = pages.get(RECORDING_KEY)
        if lost is not None:
            reason = f"lost at {lost.origin} since its t = {lost.data['since_s']:.1f} s: {lost.data['reason']}"
            shown.append(("recording", f"[red]{reason}[/red]"))
        if page is None:
            return [*shown, ("vehicle", f"[red]nothing received yet{_reason_of(pages.get(self.link))}[/red]")]
        try:
            status = self.describe(page.data, pages)
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            # These pages come over a wire, and an error here would end the pilot, too.
            status = [("pages", f"[red]cannot be shown: {type(error).__name__}[/red]")]
        if silence_s <= SILENT_S:
            return [*shown, ("vehicle", f"received {silence_s:.2f} s ago"), *status]
        # The last value is useful, but must not look like a current one.
        then = [(name, f"[dim]last received: {text}[/dim]") for name, text in status]
        return [*shown, ("vehicle", f"[red]silent for {silence_s:.1f} s[/red]"), *then]


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
        from rich.table import Table
        from rich.text import Text

        table = Table(show_header=False, title=f"t = {self.get_time_s():.1f} s")
        table.caption = Text("\n".join(self.factory.lines), justify="left")
        for name, text in shown:
            table.add_row(name, text)
        self.live.update(table, refresh=True)

    def print_line(self, shown: Rows) -> None:
        """Print a line if there is news or the period has passed."""
        from rich.text import Text

        now_s = self.get_time_s()
        plain = [(name, Text.from_markup(text).plain) for name, text in shown]
        news = [text.split()[0] if name == "vehicle" else text for name, text in plain if name in self.factory.news]
        if news == self.printed and now_s - self.printed_s < LINE_PERIOD_S:
            return
        self.printed, self.printed_s = news, now_s
        print(f"t = {now_s:.1f} s: {'; '.join(f'{name} {text}' for name, text in plain)}", file=sys.stderr, flush=True)

    def halt(self) -> None:
        """Restore the terminal."""
        if self.__dict__.get("live") is not None:
            self.live.stop()


def _reason_of(link: Any) -> str:
    """Return why the link is not up."""
    from rich.markup import escape

    return "" if link is None or link.data["up"] else f": the link {escape(link.data['reason'])}"
