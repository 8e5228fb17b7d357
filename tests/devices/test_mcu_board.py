"""The microcontroller's board at a port: its owner, and a plug that is pulled in the middle of a run."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("serial", reason="the extra 'hardware' is not installed")

from snr_sim import Config, Node, SimClock, TimeoutLoopFactory, WallClock, tasks
from snr_sim.devices.mcu.mcu import McuPower, McuPwm
from snr_sim.devices.mcu.mcu_board import McuBoard
from snr_sim.devices.pwm.pwm_loop import PwmLoopFactory
from snr_sim.devices.readings import SensorLoopFactory
from snr_sim.devices.wire.mcu_messages import BAUD
from snr_sim.devices.wire.serial_port import SerialPort
from snr_sim.prelude.errors import DeviceError
from snr_sim.testing.function_components import FunctionLoopFactory
from snr_sim.testing.pwm_contract import check_pwm_out

FIRMWARE = Path(__file__).parents[2] / "robots" / "urov" / "firmware"
STILL, AHEAD = [1500.0] * 8, [1700.0] * 8


@pytest.mark.slow
def test_mcu_pwm_on_serial_port_passes_pwm_contract(pty_bench: Any) -> None:
    """Through the system's terminal and pyserial, with the plug pulled and put back."""
    check_pwm_out(pty_bench)


def test_mcu_board_busy_port_raises_device_error(pty_bench: Any) -> None:
    first, second = pty_bench.open(), pty_bench.open()
    first.configure()
    with pytest.raises(DeviceError, match=rf"{pty_bench.link} is busy"):
        second.configure()
    assert second.health().state == "error"
    first.close()
    second.configure()
    second.close()


def test_mcu_board_missing_port_raises_until_it_appears(pty_bench: Any) -> None:
    out = pty_bench.open()
    pty_bench.unplug()
    with pytest.raises(DeviceError, match=rf"no serial port {pty_bench.link}"):
        out.configure()
    pty_bench.plug_in()
    out.configure()
    assert out.health().state == "inactive"
    out.close()


def test_mcu_board_replugged_during_run_recovers(pty_bench: Any) -> None:
    """The node continues; it logs this once, and the outputs turn again only after half a second of neutral."""
    pulled_s, back_s, rests_s, end_s = 4.0, 5.0, 7.0, 11.0
    board_s: list[float] = []
    pins: list[tuple[float, float]] = []

    def store_command(loop: Any) -> None:
        t = loop.get_time_s()
        neutral = t < 2.0 or rests_s <= t < rests_s + 2.0
        loop.store_data("pwm", {"pulses_us": STILL if neutral else AHEAD})
        if pulled_s <= t < pulled_s + 0.01:
            pty_bench.unplug()
        if back_s <= t < back_s + 0.01:
            pty_bench.plug_in()

    def follow(time_s: float) -> None:
        """Keep the board's time up with the node's clock."""
        if not board_s:
            board_s.append(pty_bench.now_s() - time_s)
        behind_s = time_s + board_s[0] - pty_bench.now_s()
        if behind_s > 0.0:
            pty_bench.advance(behind_s)
        pins.append((time_s, max(pty_bench.pins_us())))

    clock = SimClock()
    out = McuPwm(McuBoard(pty_bench.open_port, clock.now_s, pty_bench.now_s), clock.now_s, 8)
    parts = [FunctionLoopFactory(store_command, "pilot", 50.0), PwmLoopFactory("pwm", lambda: out, 50.0)]
    config = Config(factories={"r": [*parts, TimeoutLoopFactory(seconds=end_s)]})
    node = Node("r", config, clock=clock)
    clock.follow(follow)
    node.loop()
    assert max(width for t, width in pins if 3.0 < t < pulled_s) == pytest.approx(1700.0, abs=0.5)
    unpowered = [width for t, width in pins if pulled_s + 0.25 < t < rests_s + 0.5]
    assert max(unpowered) == pytest.approx(1500.0, abs=0.5), "neutral by itself, and it stays so"
    assert pins[-1][1] == pytest.approx(1700.0, abs=0.5), "after neutral it turns again"
    states = [note.split(" s: ")[1].split(".")[0].split(";")[0] for note in node.notes if "Outputs" in note]
    assert states == ["error", "found again, and inactive", "active"], node.notes
    assert f"{pty_bench.link} is gone" in next(note for note in node.notes if "error" in note)
    assert out.health().counts["reopened"] >= 1


@pytest.mark.slow
def test_mcu_board_is_shared_by_two_threads_in_real_time(emulators: None, tmp_path: Path) -> None:
    """As on the vehicle: the wall clock, a thread for each device, and a board in a separate process."""
    link = tmp_path / "ttyUSB0"
    words = [str(Path(__file__).with_name("emulated") / "pty_board.py"), str(FIRMWARE), "--link", str(link)]
    with subprocess.Popen([sys.executable, *words], stdout=subprocess.PIPE, text=True) as far:
        assert far.stdout is not None
        assert far.stdout.readline() == f"atmega328p at {link}\n"
        clock = WallClock()
        board = McuBoard(lambda: SerialPort(str(link), BAUD), clock.now_s, timeout_s=60.0)
        state: dict[str, str] = {}

        def store_command(loop: Any) -> None:
            applied, power = loop.parent.get_page("pwm_applied"), loop.parent.get_page("power")
            state["pwm"] = "" if applied is None else applied.data["state"]
            is_ahead = state["pwm"] == "active"
            loop.store_data("pwm", {"pulses_us": AHEAD if is_ahead else STILL})
            if is_ahead and applied.data["pulses_us"] == AHEAD and power is not None:
                state["power"] = power.data["voltage_v"]
                loop.stop()
                loop.parent.enqueue_input(tasks.terminate("done"), "test")

        parts = [
            SensorLoopFactory("power", lambda: McuPower(board), 5.0),
            FunctionLoopFactory(store_command, "pilot", 50.0),
            PwmLoopFactory("pwm", lambda: McuPwm(board, clock.now_s, 8), 50.0),
        ]
        config = Config(factories={"r": [*parts, TimeoutLoopFactory(seconds=60.0)]})
        node = Node("r", config, clock=clock)
        node.loop()
        far.terminate()
    assert node.exit_reason == "done", (state, node.notes)
    assert state == {"pwm": "active", "power": 0.0}, "nothing is at its ADC"
    assert not board.is_open


def test_mcu_board_uses_new_session_each_time() -> None:
    boards = [McuBoard(lambda: SerialPort("/dev/null", BAUD), lambda: 0.0) for _ in range(20)]
    assert len({board.session for board in boards}) > 1
    assert all(0 <= board.session < 0xFFFF for board in boards)


def test_mcu_board_opens_port_only_on_demand(tmp_path: Path) -> None:
    board = McuBoard(lambda: SerialPort(str(tmp_path / "none"), BAUD), lambda: 0.0)
    assert not board.is_open
    with pytest.raises(DeviceError, match="port has not been opened"):
        board.poll()
    board.release(object())
    board.mark_lost("again")
