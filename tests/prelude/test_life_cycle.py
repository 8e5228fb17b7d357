"""The life cycle of a device: its transitions, rejected steps, and an end that never raises."""

import pytest

from snr_sim.prelude.device import Device, Health, Stale
from snr_sim.prelude.errors import DeviceError, SensorLost
from snr_sim.prelude.life_cycle import LifeCycle, SensorLife


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


def test_each_step_is_made_once_however_often_it_is_asked_for() -> None:
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


def test_what_is_not_configured_is_not_activated() -> None:
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
def test_a_step_that_fails_says_why_and_configure_begins_anew(step: str) -> None:
    winch = Winch(step)
    if step == "activate":
        winch.configure()
    with pytest.raises(DeviceError, match=f"stuck at {step}"):
        getattr(winch, step)()
    assert winch.state == "error"
    assert "stuck" in winch.why
    with pytest.raises(DeviceError, match="cannot be activated: it is error"):
        winch.activate()
    winch.fails.clear()
    winch.configure()
    assert (winch.state, winch.why) == ("inactive", "")
    winch.activate()
    assert winch.state == "active"


def test_one_that_takes_its_time_is_activating_and_may_be_asked_again() -> None:
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


def test_ending_never_raises_whatever_fails() -> None:
    winch = Winch("deactivate", "close")
    winch.deactivate("before anything")
    assert winch.steps == []
    winch.configure()
    winch.activate()
    winch.deactivate("now")
    assert winch.state == "error"
    assert "stuck at deactivate" in winch.why
    winch.close()
    assert winch.state == "closed"
    assert "stuck at close" in winch.why
    winch.deactivate("after the end")
    winch.close()


def test_one_whose_wire_failed_is_still_put_to_neutral_but_stays_in_error() -> None:
    winch = Winch()
    winch.configure()
    winch.activate()
    winch.fail("the wire is cut")
    winch.deactivate("now")
    assert winch.steps[-1] == "deactivate: now"
    assert winch.health() == Health("error", "the wire is cut", {"turns": 3})


def test_what_keeps_no_steps_of_its_own_goes_through_all() -> None:
    plain = LifeCycle()
    plain.configure()
    plain.activate()
    plain.deactivate("done")
    plain.close()
    assert plain.health() == Health("closed", "closed")


class Thermometer(SensorLife):
    title = "This thermometer"


def test_a_sensor_that_is_not_active_says_so_and_one_that_is_closed_is_lost() -> None:
    thermometer = Thermometer()
    assert thermometer.idle() == Stale("This thermometer is unconfigured.")
    thermometer.configure()
    assert thermometer.idle(2.0) == Stale("This thermometer is inactive.", 2.0)
    thermometer.activate()
    assert thermometer.idle() is None
    thermometer.fail("Its wire is loose.")
    assert thermometer.idle(2.5) == Stale("This thermometer is error: Its wire is loose.", 2.5)
    thermometer.close()
    with pytest.raises(SensorLost, match="This thermometer was closed") as e:
        thermometer.idle()
    assert e.value.fix == "open another."
