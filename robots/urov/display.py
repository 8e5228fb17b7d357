"""What the person at the surface is shown: what the vehicle is doing.

On a terminal that is a table, a few times a second; in a pipe a line whenever something else than numbers changes, and
now and then. A loop and no endpoint: it looks at pages that are there and stores none, and a replay does without it.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

from snr_sim import Loop, LoopFactory
from snr_sim.devices.terminal_keys import has_terminal
from snr_sim.prelude.node_api import NodeApi
from snr_sim.prelude.recorder import RECORDING_KEY

# A vehicle that was not heard for so long is told to be silent; it tells of itself every 0.1 s. With the time between
# two drawings, a vehicle that has died or stands still is told within a second.
SILENT_S = 0.5
LINE_EVERY_S = 10.0  # in a pipe, if nothing else than numbers changes


class DisplayFactory(LoopFactory):
    """Makes the display.

    Args:
        rate_hz: how often it is drawn.
        in_lock_step: whether it shows anything under a virtual clock; no, if nobody watches that run as it goes.
        has_pad: whether a person flies.
        lines: what stands below the table.
    """

    def __init__(
        self, rate_hz: float = 5.0, in_lock_step: bool = True, has_pad: bool = False, lines: Sequence[str] = ()
    ) -> None:
        super().__init__()
        self.rate_hz = rate_hz
        self.in_lock_step = in_lock_step
        self.keys = (*KEYS, "pad", "place") if has_pad else KEYS
        self.lines = tuple(lines)

    def get(self, parent: NodeApi) -> Display:
        """Returns the loop 'display'."""
        return Display(self, parent, "display", self.rate_hz)


class Display(Loop):
    """Shows rows in a terminal, or lines where there is none."""

    factory: DisplayFactory

    def setup(self) -> None:
        """Takes the terminal, if standard error is one."""
        self.live: Any = None
        self.is_off = self.parent.is_in_lock_step and not self.factory.in_lock_step
        self.has_keys = has_terminal()
        self.said: list[str] = []
        self.said_s = -math.inf
        if sys.stderr.isatty() and not self.is_off:
            from rich.console import Console
            from rich.live import Live

            self.live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)
            self.live.start()

    def loop(self) -> None:
        """Shows what is known now."""
        if self.is_off:
            return
        # By when it came here: what the vehicle's own clock shows, another computer cannot compare with.
        heard_s = self.get_time_s() - self.parent.came_at_s("vehicle")
        shown = rows({key: self.get_page(key) for key in self.factory.keys}, heard_s, self.has_keys)
        if self.live is None:
            self.say(shown)
        else:
            self.draw(shown)

    def draw(self, shown: list[tuple[str, str]]) -> None:
        """Draws the table."""
        from rich.table import Table
        from rich.text import Text

        table = Table(show_header=False, title=f"t = {self.get_time_s():.1f} s")
        table.caption = Text("\n".join(self.factory.lines), justify="left")
        for name, text in shown:
            table.add_row(name, text)
        self.live.update(table, refresh=True)

    def say(self, shown: list[tuple[str, str]]) -> None:
        """Prints a line, if there is news or it is time."""
        from rich.text import Text

        now_s = self.get_time_s()
        plain = [(name, Text.from_markup(text).plain) for name, text in shown]
        news = [text.split()[0] if name == "vehicle" else text for name, text in plain if name in NEWS]
        if news == self.said and now_s - self.said_s < LINE_EVERY_S:
            return
        self.said, self.said_s = news, now_s
        print(f"t = {now_s:.1f} s: {'; '.join(f'{name} {text}' for name, text in plain)}", file=sys.stderr, flush=True)

    def halt(self) -> None:
        """Gives the terminal back."""
        if self.__dict__.get("live") is not None:
            self.live.stop()


KEYS = ("vehicle", "depth", "altitude", "power", "leak", "link_tether", RECORDING_KEY)
NOBODY_STEERS = (
    "[red]nobody can steer: there is no game controller, and no terminal for keys; start it from a terminal[/red]"
)
# Rows that are told as soon as they change.
NEWS = ("hands", "vehicle", "recording", "state", "outputs", "refused", "failsafe", "low", "leak")


def rows(pages: dict[str, Any], heard_s: float, has_keys: bool = True) -> list[tuple[str, str]]:
    """Returns names and texts, for rich to show.

    Args:
        pages: the newest of KEYS, or None; and "pad" and "place", if a person flies.
        heard_s: how long ago the vehicle was heard.
        has_keys: whether there is a terminal to type at.
    """
    page, pad = pages["vehicle"], pages.get("pad")
    shown = []
    if pad is not None and not pad.data["is_connected"]:
        shown = [("hands", "[yellow]keyboard: no game controller[/yellow]" if has_keys else NOBODY_STEERS)]
    lost = pages.get(RECORDING_KEY)
    if lost is not None:
        why = f"lost at {lost.origin} since its t = {lost.data['since_s']:.1f} s: {lost.data['reason']}"
        shown.append(("recording", f"[red]{why}[/red]"))
    if page is None:
        return [*shown, ("vehicle", f"[red]not heard yet{_why_not(pages.get('link_tether'))}[/red]")]
    try:
        told = _told(page.data, pages)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        # These pages come over a wire, and a display that ends takes the pilot with it.
        told = [("pages", f"[red]what was told cannot be shown: {type(error).__name__}[/red]")]
    if heard_s <= SILENT_S:
        return [*shown, ("vehicle", f"heard {heard_s:.2f} s ago"), *told]
    # What it was is worth knowing, but must not look like what it is.
    then = [(name, f"[dim]last heard: {text}[/dim]") for name, text in told]
    return [*shown, ("vehicle", f"[red]silent for {heard_s:.1f} s[/red]"), *then]


def _why_not(link: Any) -> str:
    """Return what the link waits for, while it is not up."""
    from rich.markup import escape

    return "" if link is None or link.data["up"] else f": the link {escape(link.data['reason'])}"


def _told(vehicle: dict[str, Any], pages: dict[str, Any]) -> list[tuple[str, str]]:
    """Returns names and texts of what the vehicle has told, as it was then."""
    from rich.markup import escape

    shown: list[tuple[str, str]] = []
    state = "[red]EMERGENCY STOP[/red]" if vehicle["is_stopped"] else "armed" if vehicle["is_armed"] else "disarmed"
    if pages.get("pad") is not None and not vehicle["is_armed"]:
        state += ": c (Y) clears it, then 1 (start) arms" if vehicle["is_stopped"] else ": 1 (start) arms"
    shown.append(("state", f"{state}, {vehicle['mode']}, obeys: {vehicle['rules']}"))
    if vehicle.get("let_go"):
        why = vehicle["let_go"].splitlines()[0]
        shown.append(("outputs", f"[red]have let go: {escape(why)}[/red]"))
    for cause, text in vehicle.get("failsafes", {}).items():
        shown.append(("failsafe", f"[red]{cause}: {escape(text)}[/red]"))
    if vehicle["refused"]:
        shown.append(("refused", f"[red]{escape(vehicle['refused'])}[/red]"))
    if pages["depth"] is not None:
        held = vehicle["depth_m"]
        wanted = "" if held is None else f" (holds {held:.2f} m)"
        shown.append(("depth", f"{pages['depth'].data['depth_m']:.2f} m{wanted}"))
    if pages.get("place") is not None:
        east, north, up = pages["place"].data["position_m"]
        shown.append(("place", f"{east:.1f} m east, {north:.1f} m north, {-up:.1f} m deep"))
    roll, pitch, yaw = (math.degrees(angle) for angle in vehicle["attitude_rad"])
    held = vehicle["heading_rad"]
    wanted = "" if held is None else f" (holds {round(math.degrees(held))})"
    shown.append(("attitude", f"roll {round(roll)}, pitch {round(pitch)}, yaw {round(yaw)} deg{wanted}"))
    if pages["altitude"] is not None and pages["altitude"].data["confidence"] > 0.0:
        shown.append(("floor", f"{pages['altitude'].data['distance_m']:.2f} m below"))
    if pages["power"] is not None:
        power = pages["power"].data
        shown.append(("battery", f"{power['voltage_v']:.1f} V, {power['current_a']:.0f} A"))
    if vehicle["is_low"]:
        does = ", the vehicle comes up" if vehicle["rules"] == "surface" else ""
        shown.append(("low", f"[red]BATTERY LOW{does}[/red]"))
    if vehicle["share"] < 1.0:
        shown.append(("thrusters", f"[yellow]at their limits: {vehicle['share']:.0%} of what is asked[/yellow]"))
    if pages["leak"] is not None and pages["leak"].data["is_wet"]:
        shown.append(("leak", "[red]WATER IN THE HULL[/red]"))
    return shown
