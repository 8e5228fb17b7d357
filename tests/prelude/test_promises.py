"""Whether an object implements a protocol does not depend on the Python version."""

from typing import Any

import pytest

from snr_sim.devices.loops import configured
from snr_sim.prelude.device import Actuator, Device, PwmOut, Sensor
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.plant import Plant
from snr_sim.prelude.promises import keeps, lacks
from snr_sim.prelude.signals import EngineCommand
from snr_sim.testing.fakes import FakeActuator


class Wrapper:
    """Passes on all that it does not have itself."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)


def test_a_wrapper_has_the_members_of_what_it_wraps() -> None:
    out = FakeActuator(EngineCommand, {"throttle": (0.0, 1.0)})
    assert keeps(out, Actuator)
    assert keeps(Wrapper(out), Actuator)
    assert not keeps(Wrapper(out), PwmOut)
    assert configured(Wrapper(out), "the actuator 'thrust'").health().state == "inactive"


def test_what_is_missing_is_named_with_what_the_promise_inherits() -> None:
    assert lacks(Wrapper(3.5), Sensor) == ["activate", "close", "configure", "deactivate", "health", "read"]
    assert {"command_type", "limits", "write", "neutral", "close"} <= set(lacks(object(), Actuator))
    assert "step" in lacks(Wrapper(FakeActuator(EngineCommand, {"throttle": (0.0, 1.0)})), Plant)
    with pytest.raises(DeviceError, match="lacks one of configure"):
        configured(Wrapper(3.5), "the sensor 'depth'")


@pytest.mark.parametrize("promise", [Device, Sensor, Actuator, PwmOut, Plant])
def test_a_promise_is_not_kept_by_nothing(promise: Any) -> None:
    assert not keeps(None, promise)
    assert all(not name.startswith("_") for name in lacks(None, promise))
