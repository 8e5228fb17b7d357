"""A real pad's driver, with a virtual pad that SDL takes for a real one."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

pytest.importorskip("pygame", reason="the extra 'pad' is not installed")

from snr_sim.devices.pygame_pad import PygamePad
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtra, SensorLost
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.virtual_pad import VirtualPad


@pytest.fixture
def virtual() -> Iterator[VirtualPad]:
    pad = VirtualPad()
    yield pad
    pad.unplug()


def test_a_pad_keeps_the_promise_of_a_sensor(virtual: VirtualPad) -> None:
    check_sensor(PygamePad)


def test_sticks_and_buttons_are_where_they_were_moved(virtual: VirtualPad) -> None:
    pad = PygamePad(now_s=lambda: 7.5)
    virtual.move(0, -1.0)
    virtual.move(1, 0.5)
    virtual.press(2)
    reading = pad.read()
    assert reading.axes[:3] == pytest.approx([-1.0, 0.5, 0.0], abs=1e-3)
    assert [i for i, is_down in enumerate(reading.buttons) if is_down] == [2]
    assert (len(reading.axes), len(reading.buttons), reading.hats) == (6, 15, [[0, 0]])
    assert reading.stamp_s == 7.5
    virtual.press(2, is_down=False)
    assert not any(pad.read().buttons)


def test_a_pad_that_is_unplugged_is_lost_at_the_next_reading_and_found_when_it_is_back(virtual: VirtualPad) -> None:
    pad = PygamePad()
    for _ in range(3):
        virtual.move(0, 1.0)
        assert pad.read().axes[0] == pytest.approx(1.0, abs=1e-3)
        virtual.unplug()
        gone = pad.read()
        assert isinstance(gone, Stale)
        assert "0 are plugged in" in gone.why
        virtual.plug_in()


def test_one_that_is_closed_says_so(virtual: VirtualPad) -> None:
    pad = PygamePad()
    pad.close()
    with pytest.raises(SensorLost, match="closed"):
        pad.read()


def test_without_the_package_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtra, match=r"snr_sim\[pad\]"):
        PygamePad()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGTERM to wait for")
def test_the_pad_does_not_take_sigterm_away() -> None:
    """SDL would convert it to an event that no code reads, and the program would continue."""
    code = (
        "from snr_sim.devices.pygame_pad import PygamePad; import signal\n"
        "PygamePad(); print('ready', flush=True); signal.pause()"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"  # and nothing before it
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=120.0) == -signal.SIGTERM
    process.stdout.close()
