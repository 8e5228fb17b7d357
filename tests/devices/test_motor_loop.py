"""The loop between pages and motors: leases, what arms motors that were lost, and what is reported."""

from collections.abc import Callable
from typing import Any

from snr_sim import Config, Node, SimClock, TimeoutLoopFactory
from snr_sim.devices.motors.motor_loop import MAX_NOTES, MotorLoopFactory
from snr_sim.prelude.device import LEASE_S
from snr_sim.testing.function_components import FunctionLoopFactory
from tests.testing.test_motor_contract import Bench, Good

AHEAD = {"mode": "speed", "values": [2.0, 2.0, 2.0]}
NEUTRAL = {"mode": "brake", "values": []}
BRAKE = {"mode": "brake", "values": [4.0, 4.0, 4.0]}
RATE_HZ = 50.0


class Drive:
    """A robot that commands, and what its first motor does by time.

    Args:
        page_at: page "drive" of a time; None: none is stored.
        unplugged: when a wire is out.
    """

    def __init__(
        self,
        page_at: Callable[[float], dict[str, Any] | None],
        until_s: float = 4.0,
        unplugged: Callable[[float], bool] = lambda now_s: False,
    ) -> None:
        self.does: dict[float, str] = {}
        bench = Bench(Good)

        def command(loop: Any) -> None:
            bench.time_s = loop.get_time_s()
            (bench.unplug if unplugged(bench.time_s) else bench.plug_in)(1)
            page = page_at(bench.time_s)
            if page is not None:
                loop.store_data("drive", page, process=False)

        def look(loop: Any) -> None:
            self.does[round(loop.get_time_s(), 2)] = bench.does()[0][0]

        self.node = Node(
            "r",
            Config(
                factories={
                    "r": [
                        FunctionLoopFactory(command, "commander", RATE_HZ),
                        MotorLoopFactory("drive", bench.open, RATE_HZ),
                        FunctionLoopFactory(look, "watcher", RATE_HZ),
                        TimeoutLoopFactory(seconds=until_s),
                    ]
                }
            ),
            clock=SimClock(),
        )
        self.node.loop()

    def driven_s(self) -> list[float]:
        """Return when the motor was driven."""
        return [time_s for time_s, mode in self.does.items() if mode == "speed"]

    def notes(self) -> list[str]:
        return [str(note) for note in self.node.notes if "Motors of 'drive'" in str(note)]


def test_command_is_followed_for_a_lease_from_the_time_of_its_page() -> None:
    driven_s = Drive(lambda now_s: AHEAD if now_s < 1.0 else None, until_s=2.0).driven_s()
    assert (min(driven_s), max(driven_s)) == (0.0, 0.98 + LEASE_S - 1.0 / RATE_HZ)


def test_command_may_end_before_its_lease() -> None:
    driven_s = Drive(lambda now_s: {**AHEAD, "until_s": 0.1}, until_s=0.5).driven_s()
    assert max(driven_s) == 0.08


def test_motors_that_were_lost_are_driven_only_after_a_command_for_neutral() -> None:
    def page_at(now_s: float) -> dict[str, Any]:
        return BRAKE if 3.0 <= now_s < 3.5 else NEUTRAL if 4.0 <= now_s < 4.2 else AHEAD

    drive = Drive(page_at, 5.0, lambda now_s: 1.0 <= now_s < 1.5)
    driven_s = drive.driven_s()
    assert [time_s for time_s in driven_s if 1.0 <= time_s < 4.2] == []
    assert {0.98, 4.2} <= set(driven_s)
    lost, found, armed = drive.notes()
    assert "t = 1.00 s: error. A wire is out." in lost
    assert "t = 2.00 s: found again. They are neutral until the robot commands neutral" in found
    assert "t = 4.00 s: armed again." in armed


def test_neutral_for_want_of_a_fresh_command_does_not_arm() -> None:
    drive = Drive(lambda now_s: AHEAD if now_s < 1.2 or now_s > 3.0 else None, 4.0, lambda now_s: 1.0 <= now_s < 1.5)
    assert max(drive.driven_s()) == 0.98
    assert len(drive.notes()) == 2


def test_neutral_from_before_they_were_found_does_not_arm() -> None:
    drive = Drive(lambda now_s: NEUTRAL if 1.4 <= now_s < 1.8 else AHEAD, 4.0, lambda now_s: 1.0 <= now_s < 1.5)
    assert max(drive.driven_s()) == 0.98


def test_loose_plug_is_reported_a_limited_number_of_times() -> None:
    drive = Drive(lambda now_s: NEUTRAL if now_s % 1.0 > 0.8 else AHEAD, 20.0, lambda now_s: now_s % 2.0 < 0.1)
    notes = drive.notes()
    assert len(notes) == MAX_NOTES
    assert notes[-1].endswith("(not reported again)")
