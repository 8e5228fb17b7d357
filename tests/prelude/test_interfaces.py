"""Whether an object implements a protocol does not depend on the Python version."""

from typing import Any

import pytest

from snr_sim.devices.device_loop import configure_device
from snr_sim.prelude.device import Actuator, Device, PwmOut, Sensor
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.interfaces import implements, missing_members
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.signals import EngineCommand
from snr_sim.testing.fakes import FakeActuator


class Wrapper:
    """Passes on all that it does not have itself."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


def test_wrapper_implements_interface_of_wrapped_object() -> None:
    out = FakeActuator(EngineCommand, {"throttle": (0.0, 1.0)})
    assert implements(out, Actuator)
    assert implements(Wrapper(out), Actuator)
    assert not implements(Wrapper(out), PwmOut)
    assert configure_device(Wrapper(out), "the actuator 'thrust'").health().state == "inactive"


def test_missing_members_include_inherited_ones() -> None:
    assert missing_members(Wrapper(3.5), Sensor) == ["activate", "close", "configure", "deactivate", "health", "read"]
    assert {"command_type", "limits", "write", "neutral", "close"} <= set(missing_members(object(), Actuator))
    assert "step" in missing_members(Wrapper(FakeActuator(EngineCommand, {"throttle": (0.0, 1.0)})), Plant)
    with pytest.raises(DeviceError, match="lacks one of configure"):
        configure_device(Wrapper(3.5), "the sensor 'depth'")


@pytest.mark.parametrize("promise", [Device, Sensor, Actuator, PwmOut, Plant])
def test_empty_object_does_not_implement_interface(promise: Any) -> None:
    assert not implements(None, promise)
    assert all(not name.startswith("_") for name in missing_members(None, promise))
