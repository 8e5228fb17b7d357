"""The life cycle of a device: its transitions, rejected steps, and an end that never raises."""

import pytest

from snr_sim.prelude.device import Device, Health, Stale
from snr_sim.prelude.errors import DeviceError, SensorLostError
from snr_sim.prelude.life_cycle import LifeCycle, LifeCycleSensor


class Winch(LifeCycle):
    """Records its steps; those named in `fails` raise."""

    title = "This winch"

    def __init__(self, *fails: str) -> None:
        self.fails = set(fails)
        self.steps: list[str] = []

    def _step(self, name: str) -> None:
        self.steps.append(name)
        if name in self.fails:
            raise DeviceError(f"The rope is stuck at {name}.", fix="pull.")

    def on_configure(self) -> None:
        self._step("configure")

    def on_activate(self) -> None:
        self._step("activate")

    def on_deactivate(self, reason: str) -> None:
        self._step(f"deactivate: {reason}" if "deactivate" not in self.fails else "deactivate")

    def on_close(self) -> None:
        self._step("close")

    def counts(self) -> dict[str, int]:
        return {"turns": len(self.steps)}


def test_repeated_transition_runs_step_once() -> None:
    winch = Winch()
    assert isinstance(winch, Device)
    assert winch.health() == Health("unconfigured", "", {"turns": 0})
    for _ in range(2):
        winch.configure()
        assert winch.health() == Health("inactive", "", {"turns": 1})
    for _ in range(2):
        winch.activate()
        assert winch.health() == Health("active", "", {"turns": 2})
    winch.configure()
    assert winch.state == "active", "configure() while active changes nothing"
    for i in range(2):
        winch.deactivate("lunch")
        assert winch.health() == Health("inactive", "lunch", {"turns": 3 + i})
    for _ in range(2):
        winch.close()
        assert winch.state == "closed"
    assert winch.steps.count("close") == 1


def test_activate_before_configure_raises() -> None:
    winch = Winch()
    with pytest.raises(DeviceError, match="This winch cannot be activated: it is unconfigured"):
        winch.activate()
    winch.configure()
    winch.close()
    with pytest.raises(DeviceError, match="it is closed"):
        winch.activate()
    with pytest.raises(DeviceError, match="This winch was closed"):
        winch.configure()
    assert "activate" not in winch.steps


@pytest.mark.parametrize("step", ["configure", "activate"])
def test_failed_step_sets_reason_and_configure_restarts(step: str) -> None:
    winch = Winch(step)
    if step == "activate":
        winch.configure()
    with pytest.raises(DeviceError, match=f"stuck at {step}"):
        getattr(winch, step)()
    assert winch.state == "error"
    assert "stuck" in winch.reason
    with pytest.raises(DeviceError, match="cannot be activated: it is error"):
        winch.activate()
    winch.fails.clear()
    winch.configure()
    assert (winch.state, winch.reason) == ("inactive", "")
    winch.activate()
    assert winch.state == "active"


def test_slow_activation_is_activating_and_repeatable() -> None:
    class Slow(Winch):
        def on_activate(self) -> None:
            self._step("activate")
            self.state = "activating"

    slow = Slow()
    slow.configure()
    slow.activate()
    slow.activate()
    assert slow.state == "activating"
    assert slow.steps == ["configure", "activate"]
    slow.deactivate("enough")
    assert slow.state == "inactive"


def test_deactivate_and_close_never_raise() -> None:
    winch = Winch("deactivate", "close")
    winch.deactivate("before anything")
    assert winch.steps == []
    winch.configure()
    winch.activate()
    winch.deactivate("now")
    assert winch.state == "error"
    assert "stuck at deactivate" in winch.reason
    winch.close()
    assert winch.state == "closed"
    assert "stuck at close" in winch.reason
    winch.deactivate("after the end")
    winch.close()


def test_failed_device_is_deactivated_and_stays_in_error() -> None:
    winch = Winch()
    winch.configure()
    winch.activate()
    winch.fail("the wire is cut")
    winch.deactivate("now")
    assert winch.steps[-1] == "deactivate: now"
    assert winch.health() == Health("error", "the wire is cut", {"turns": 3})


def test_device_without_own_steps_passes_all_states() -> None:
    plain = LifeCycle()
    plain.configure()
    plain.activate()
    plain.deactivate("done")
    plain.close()
    assert plain.health() == Health("closed", "closed")


class Thermometer(LifeCycleSensor):
    title = "This thermometer"


def test_inactive_sensor_returns_stale_and_closed_sensor_raises() -> None:
    thermometer = Thermometer()
    assert thermometer.idle() == Stale("This thermometer is unconfigured.")
    thermometer.configure()
    assert thermometer.idle(2.0) == Stale("This thermometer is inactive.", 2.0)
    thermometer.activate()
    assert thermometer.idle() is None
    thermometer.fail("Its wire is loose.")
    assert thermometer.idle(2.5) == Stale("This thermometer is error: Its wire is loose.", 2.5)
    thermometer.close()
    with pytest.raises(SensorLostError, match="This thermometer was closed") as e:
        thermometer.idle()
    assert e.value.fix == "open another."
