"""What the display shows of any vehicle: silence, lines in a pipe, the state of the link."""

from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim import Config, TestRunner, TimeoutLoopFactory, tasks
from snr_sim.prelude.task import Page
from snr_sim.teleop.display import DisplayFactory
from snr_sim.testing.function_components import FunctionLoopFactory

VEHICLE = {"state": "armed"}


def display(**options: Any) -> DisplayFactory:
    """The display of a vehicle that reports its state and nothing else."""
    return DisplayFactory(
        lambda vehicle, pages: [("state", vehicle["state"], "")], ["vehicle"], "link", ["state"], **options
    )


def rows(silence_s: float = 0.1, has_keys: bool = True, **pages: Page | None) -> dict[str, str]:
    shown = display().rows({"vehicle": None, **pages}, silence_s, has_keys)
    return {name: f"{style}: {text}" if style else text for name, text, style in shown}


def test_display_shows_surface_problems() -> None:
    pulled = Page("gamepad", {"is_connected": False}, "topside", 1.0, True)
    assert rows(gamepad=pulled)["manual_input"] == "yellow: keyboard: no game controller"
    assert "no manual input" in rows(has_keys=False, gamepad=pulled)["manual_input"]
    lost = Page("recording", {"since_s": 5.5, "lost": 90, "reason": "No space left on device"}, "rover", 6.0)
    assert rows(recording=lost)["recording"] == "red: lost at rover since its t = 5.5 s: No space left on device"
    assert rows() == {"vehicle": "red: nothing received yet"}


def test_display_shows_link_reason_before_first_page() -> None:
    down = {"up": False, "reason": "waits for 127.0.0.1:9120: Connection refused."}
    text = rows(link=Page("link", down, "topside", 1.0, True))["vehicle"]
    assert "nothing received yet; link: waits for 127.0.0.1:9120: Connection refused." in text


def test_status_of_silent_vehicle_is_dim_and_marked_as_old() -> None:
    page = Page("vehicle", VEHICLE, "rover", 10.0, True)
    assert rows(vehicle=page) == {"vehicle": "received 0.10 s ago", "state": "armed"}
    silent = {"vehicle": "red: silent for 1.5 s", "state": "dim: last received: armed"}
    assert rows(1.5, vehicle=page) == silent


def printed_lines(pages: list[tuple[float, Any]], capfd: pytest.CaptureFixture[str], **options: Any) -> list[str]:
    """The lines of a display without a terminal that receives these pages 'vehicle' at these times, within 20 s."""
    arrivals = [
        TimeoutLoopFactory(seconds=at_s, task=tasks.store_page(Page("vehicle", data, "rover", 0.0)), name=f"{at_s}")
        for at_s, data in pages
    ]
    config = Config(factories={"test": [display(rate_hz=5.0, **options), *arrivals]})
    TestRunner(config, until_s=20.0).run()
    return capfd.readouterr().err.splitlines()


def test_display_in_pipe_prints_lines_on_news_and_periodically(capfd: pytest.CaptureFixture[str]) -> None:
    ticks = [(1.0 + 0.25 * i, VEHICLE) for i in range(30)]
    lines = printed_lines([*ticks, (8.5, {"state": "EMERGENCY STOP"})], capfd)
    assert [line.split(":")[0] for line in lines] == ["t = 0.0 s", "t = 1.2 s", "t = 8.6 s", "t = 9.2 s", "t = 19.2 s"]
    assert lines[0].endswith(": vehicle nothing received yet")
    assert lines[1].endswith("vehicle received 0.20 s ago; state armed")
    assert "EMERGENCY STOP" in lines[2]
    assert "vehicle silent for 0.7 s" in lines[3]


def test_display_in_lock_step_prints_no_lines(capfd: pytest.CaptureFixture[str]) -> None:
    assert printed_lines([(1.0, VEHICLE)], capfd, in_lock_step=False) == []


def test_display_uses_arrival_time_not_vehicle_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """The vehicle has been on for 500 s when the surface starts; then nothing more arrives from it."""
    drawn: list[float] = []
    monkeypatch.setattr(DisplayFactory, "rows", lambda self, pages, silence_s, has_keys: drawn.append(silence_s) or [])
    screen = SimpleNamespace(update=lambda table, refresh: None, stop=lambda: None)

    def takes_the_screen(part: Any) -> None:
        part.parent.components["display"].live = screen

    page = Page("vehicle", VEHICLE, "rover", 500.0)
    arrivals = TimeoutLoopFactory(seconds=0.5, task=tasks.store_page(page), name="received")
    TestRunner(
        Config(factories={"test": [display(rate_hz=2.0), arrivals, FunctionLoopFactory(takes_the_screen, "screen")]}),
        until_s=2.0,
    ).run()
    assert drawn[-3:] == pytest.approx([0.5, 1.0, 1.5])
