"""A lost pad is at rest within a tick, and recovers automatically."""

from typing import Any

from snr_sim import FakeSensor, SNRTestCase, TaskType
from snr_sim.devices.pad import PadLoopFactory
from snr_sim.prelude.device import Stale
from snr_sim.prelude.signals import PadReading
from snr_sim.testing.parts import PartFactory

HELD = PadReading([0.5, -1.0], [True, False], [[1, 0]], stamp_s=7.5)


def pages_of(*readings: PadReading | Exception) -> list[dict[str, Any]]:
    came: list[dict[str, Any]] = []
    ear = PartFactory({(TaskType.store_page, "pad"): lambda task, task_id: came.append(task.val_list[0].data)})
    pad = FakeSensor(readings)
    factories = [PadLoopFactory("pad", lambda: pad, rate_hz=10), ear]
    SNRTestCase().run_test_node(factories, until_s=(len(readings) - 1) / 10)
    assert pad.is_closed
    return came


def test_a_reading_becomes_a_page() -> None:
    assert pages_of(HELD) == [
        {"axes": [0.5, -1.0], "buttons": [True, False], "hats": [[1, 0]], "is_connected": True, "stamp_s": 7.5},
    ]


def test_a_pad_that_is_unplugged_lets_go_of_everything_in_the_same_tick_and_may_come_back() -> None:
    rest = {"axes": [0.0, 0.0], "buttons": [False, False], "hats": [[0, 0]], "is_connected": False, "stamp_s": 7.5}
    came = pages_of(HELD, Stale("gone"), Stale("gone"), HELD)
    assert came[1:3] == [rest, rest]
    assert came[3] == came[0]


def test_a_pad_that_was_never_there_has_nothing_to_press() -> None:
    assert pages_of(Stale("none")) == [{"axes": [], "buttons": [], "hats": [], "is_connected": False, "stamp_s": 0.0}]
