"""A lost pad is at rest within a tick, and recovers automatically."""

from typing import Any

from snr_sim import FakeSensor, SNRTestCase, TaskType
from snr_sim.devices.gamepad import GamepadLoopFactory
from snr_sim.prelude.device import Stale
from snr_sim.prelude.signals import GamepadReading
from snr_sim.testing.function_components import FunctionEndpointFactory

HELD = GamepadReading([0.5, -1.0], [True, False], [[1, 0]], stamp_s=7.5)


def pages_of(*readings: GamepadReading | Exception) -> list[dict[str, Any]]:
    came: list[dict[str, Any]] = []
    listener = FunctionEndpointFactory(
        {(TaskType.store_page, "pad"): lambda task, task_id: came.append(task.val_list[0].data)}
    )
    pad = FakeSensor(readings)
    factories = [GamepadLoopFactory("pad", lambda: pad, rate_hz=10), listener]
    SNRTestCase().run_test_node(factories, until_s=(len(readings) - 1) / 10)
    assert pad.is_closed
    return came


def test_gamepad_loop_stores_reading_as_page() -> None:
    assert pages_of(HELD) == [
        {"axes": [0.5, -1.0], "buttons": [True, False], "hats": [[1, 0]], "is_connected": True, "stamp_s": 7.5},
    ]


def test_gamepad_loop_unplugged_releases_all_in_same_tick_and_recovers() -> None:
    rest = {"axes": [0.0, 0.0], "buttons": [False, False], "hats": [[0, 0]], "is_connected": False, "stamp_s": 7.5}
    came = pages_of(HELD, Stale("gone"), Stale("gone"), HELD)
    assert came[1:3] == [rest, rest]
    assert came[3] == came[0]


def test_gamepad_loop_never_plugged_in_stores_empty_reading() -> None:
    assert pages_of(Stale("none")) == [{"axes": [], "buttons": [], "hats": [], "is_connected": False, "stamp_s": 0.0}]
