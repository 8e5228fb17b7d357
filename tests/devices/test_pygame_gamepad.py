"""A real pad's driver, with a virtual pad that SDL takes for a real one."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

pytest.importorskip("pygame", reason="the extra 'pad' is not installed")

from snr_sim.devices.pygame_gamepad import PygameGamepad
from snr_sim.prelude.device import Stale
from snr_sim.prelude.errors import MissingExtraError, SensorLostError
from snr_sim.testing.contracts import check_sensor
from snr_sim.testing.virtual_gamepad import VirtualGamepad


@pytest.fixture
def virtual() -> Iterator[VirtualGamepad]:
    pad = VirtualGamepad()
    yield pad
    pad.unplug()


def test_pygame_gamepad_passes_sensor_contract(virtual: VirtualGamepad) -> None:
    check_sensor(PygameGamepad)


def test_pygame_gamepad_returns_stick_and_button_positions(virtual: VirtualGamepad) -> None:
    pad = PygameGamepad(now_s=lambda: 7.5)
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


def test_pygame_gamepad_unplugged_is_stale_and_replugged_recovers(virtual: VirtualGamepad) -> None:
    pad = PygameGamepad()
    for _ in range(3):
        virtual.move(0, 1.0)
        assert pad.read().axes[0] == pytest.approx(1.0, abs=1e-3)
        virtual.unplug()
        gone = pad.read()
        assert isinstance(gone, Stale)
        assert "is not connected (0 are)" in gone.reason
        virtual.plug_in()


def test_pygame_gamepad_closed_raises_sensor_lost(virtual: VirtualGamepad) -> None:
    pad = PygameGamepad()
    pad.close()
    with pytest.raises(SensorLostError, match="closed"):
        pad.read()


def test_pygame_gamepad_without_package_names_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(MissingExtraError, match=r"snr_sim\[pad\]"):
        PygameGamepad()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGTERM to wait for")
def test_pygame_gamepad_keeps_sigterm_handler() -> None:
    """SDL would convert it to an event that no code reads, and the program would continue."""
    code = (
        "from snr_sim.devices.pygame_gamepad import PygameGamepad; import signal\n"
        "PygameGamepad(); print('ready', flush=True); signal.pause()"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"  # and nothing before it
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=120.0) == -signal.SIGTERM
    process.stdout.close()
