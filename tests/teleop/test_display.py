"""What the display shows of any vehicle: silence, lines in a pipe, the state of the link."""

from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim import Config, TestRunner, TimeoutLoopFactory, tasks
from snr_sim.prelude.page import Page
from snr_sim.teleop.display import DisplayFactory
from snr_sim.testing.parts import TickerFactory

VEHICLE = {"state": "armed"}


def display(**options: Any) -> DisplayFactory:
    """The display of a vehicle that tells its state, and nothing else."""
    return DisplayFactory(
        lambda vehicle, pages: [("state", vehicle["state"])], ["vehicle"], "link", ["state"], **options
    )


def rows(heard_s: float = 0.1, has_keys: bool = True, **pages: Page | None) -> dict[str, str]:
    return dict(display().rows({"vehicle": None, **pages}, heard_s, has_keys))


def test_display_shows_what_is_wrong_at_the_surface() -> None:
    pulled = Page("pad", {"is_connected": False}, "topside", 1.0, True)
    assert rows(pad=pulled)["hands"] == "[yellow]keyboard: no game controller[/yellow]"
    assert "nobody can steer" in rows(has_keys=False, pad=pulled)["hands"]
    lost = Page("recording", {"since_s": 5.5, "lost": 90, "reason": "No space left on device"}, "rover", 6.0)
    assert rows(recording=lost)["recording"] == "[red]lost at rover since its t = 5.5 s: No space left on device[/red]"
    assert rows() == {"vehicle": "[red]not heard yet[/red]"}


def test_display_shows_what_the_link_waits_for_before_the_vehicle_is_heard() -> None:
    down = {"up": False, "reason": "waits for 127.0.0.1:9120: Connection refused."}
    told = rows(link=Page("link", down, "topside", 1.0, True))["vehicle"]
    assert "not heard yet: the link waits for 127.0.0.1:9120: Connection refused." in told


def test_status_of_a_silent_vehicle_is_grey_and_marked_as_old() -> None:
    page = Page("vehicle", VEHICLE, "rover", 10.0, True)
    assert rows(vehicle=page) == {"vehicle": "heard 0.10 s ago", "state": "armed"}
    silent = {"vehicle": "[red]silent for 1.5 s[/red]", "state": "[dim]last heard: armed[/dim]"}
    assert rows(1.5, vehicle=page) == silent


def said(pages: list[tuple[float, Any]], capfd: pytest.CaptureFixture[str], **options: Any) -> list[str]:
    """The lines of a display without a terminal, that hears these pages 'vehicle' at these times, within 20 s."""
    heard = [
        TimeoutLoopFactory(seconds=at_s, task=tasks.store_page(Page("vehicle", data, "rover", 0.0)), name=f"{at_s}")
        for at_s, data in pages
    ]
    config = Config(factories={"test": [display(rate_hz=5.0, **options), *heard]})
    TestRunner(config, until_s=20.0).run()
    return capfd.readouterr().err.splitlines()


def test_in_a_pipe_the_display_is_a_line_when_there_is_news_and_now_and_then(
    capfd: pytest.CaptureFixture[str],
) -> None:
    ticks = [(1.0 + 0.25 * i, VEHICLE) for i in range(30)]
    lines = said([*ticks, (8.5, {"state": "EMERGENCY STOP"})], capfd)
    assert [line.split(":")[0] for line in lines] == ["t = 0.0 s", "t = 1.2 s", "t = 8.6 s", "t = 9.2 s", "t = 19.2 s"]
    assert lines[0].endswith(": vehicle not heard yet")
    assert lines[1].endswith("vehicle heard 0.20 s ago; state armed")
    assert "EMERGENCY STOP" in lines[2]
    assert "vehicle silent for 0.7 s" in lines[3]


def test_a_run_on_a_virtual_clock_that_nobody_watches_prints_no_lines(capfd: pytest.CaptureFixture[str]) -> None:
    assert said([(1.0, VEHICLE)], capfd, in_lock_step=False) == []


def test_the_display_goes_by_when_the_vehicle_was_heard_and_not_by_its_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle has been on for 500 s when the surface starts; then it is heard no more."""
    drawn: list[float] = []
    monkeypatch.setattr(DisplayFactory, "rows", lambda self, pages, heard_s, has_keys: drawn.append(heard_s) or [])
    screen = SimpleNamespace(update=lambda table, refresh: None, stop=lambda: None)

    def takes_the_screen(part: Any) -> None:
        part.parent.components["display"].live = screen

    page = Page("vehicle", VEHICLE, "rover", 500.0)
    heard = TimeoutLoopFactory(seconds=0.5, task=tasks.store_page(page), name="heard")
    TestRunner(
        Config(factories={"test": [display(rate_hz=2.0), heard, TickerFactory(takes_the_screen, "screen")]}),
        until_s=2.0,
    ).run()
    assert drawn[-3:] == pytest.approx([0.5, 1.0, 1.5])
