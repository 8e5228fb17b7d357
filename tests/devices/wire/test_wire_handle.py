from types import SimpleNamespace
from typing import Any

import pytest

from snr_sim.devices.wire.wire_handle import WireHandle
from snr_sim.prelude.errors import DeviceError


def test_wire_handle_closes_wire_once_before_opening_again() -> None:
    events: list[str] = []

    def open_wire() -> Any:
        events.append("open")
        return SimpleNamespace(close=lambda: events.append("close"))

    handle = WireHandle(open_wire, SimpleNamespace(title="The sonar"))
    assert handle.open() is handle.get()
    handle.open()
    handle.close()
    handle.close()
    assert events == ["open", "close", "open", "close"]


def test_wire_handle_not_open_raises_device_error_with_current_title() -> None:
    device = SimpleNamespace(title="The sonar")
    handle = WireHandle(lambda: SimpleNamespace(close=lambda: None), device)
    device.title = "The sonar on /dev/ttyS0"
    with pytest.raises(DeviceError, match="The sonar on /dev/ttyS0 is not open") as e:
        handle.get()
    assert "configure" in e.value.fix
