"""RoverServer: devices are asked for their keys, listened to and commanded; functions run next to the loop."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from snr_sim.devices.wire.vesc_frames import VescFrames, encode
from snr_sim.devices.wire.vesc_messages import SetDuty, SetRotorPositionMode, Subscription, VescCodec
from snr_sim.prelude.errors import ComponentFailedError
from snr_sim.processes.process_components import ProcessEndpoint
from snr_sim.processes.rover_server import REQUESTS, RoverServer
from snr_sim.processes.runner import ProcessRunner

CODEC = VescCodec("seed", erpm_per_rpm=228.0)


class Device:
    """A device at a port that answers with its name, once it was asked often enough."""

    def __init__(self, name: str, mute_requests: int = 0) -> None:
        self.name = name
        self.taken: list[Any] = []
        self.out = b""
        self.is_closed = False
        self._mute = mute_requests
        self._frames = VescFrames()

    def write(self, data: bytes) -> None:
        for payload in self._frames.feed(data, 0.0):
            message = CODEC.decode(payload)
            self.taken.append(message)
            if isinstance(message, Subscription) and len(self.taken) > self._mute:
                self.out += encode(CODEC.encode(Subscription(self.name)))

    def read(self) -> bytes:
        data, self.out = self.out, b""
        return data

    def wait(self, seconds: float) -> bool:
        return bool(self.out)

    def close(self) -> None:
        self.is_closed = True


DEVICES: dict[str, Device] = {}


class Usb(RoverServer):
    """Passes duties on to wheels, and keeps what devices say."""

    def setup(self, args: Any) -> None:
        self.got: list[Any] = []
        self.keys = [self.req_subscription(port) for port in DEVICES]
        self.subscribe("SetRotorPositionMode")

    def get_device(self, port: str) -> Any:
        return DEVICES[port]

    def message_trigger(self, message: Any) -> None:
        if message.key in self.devices:
            self.send_cmd(SetDuty(message.data), self.devices[message.key])
        else:
            self.got.append(message.data)

    def loop(self) -> Iterator[float]:
        yield 1.0
        self.publish("wheelLF", 0.5)
        DEVICES["a"].out = encode(CODEC.encode(SetRotorPositionMode(2)))
        yield 1e6


def test_devices_are_asked_for_their_key_and_served() -> None:
    DEVICES.clear()
    DEVICES.update(a=Device("wheelLF", mute_requests=2), b=Device("mute", mute_requests=99))
    runner = ProcessRunner([Usb])
    runner.simulate(2.0)
    endpoint = runner.nodes["Usb"].components["Usb"]
    assert isinstance(endpoint, ProcessEndpoint)
    usb: Any = endpoint.process
    assert usb.keys == ["wheelLF", None]
    assert DEVICES["a"].taken[3:] == [SetDuty(0.5)]
    assert (len(DEVICES["b"].taken), DEVICES["b"].is_closed) == (REQUESTS, True)
    assert usb.got == [{"mode": 2}]
    assert DEVICES["a"].is_closed


class Spawns(RoverServer):
    """Spawns a generator, which ends, and a function if its arguments request it."""

    def setup(self, args: Any) -> None:
        self.steps: list[float] = []
        self.spawn_thread(self.count, until=3)
        if args:
            self.spawn_thread(self.block)

    def count(self, until: int) -> Iterator[float]:
        for _ in range(until):
            self.steps.append(self.get_time_s())
            yield 0.5

    def block(self) -> None: ...


def test_spawned_generator_is_stepped_in_lock_step_until_its_end() -> None:
    runner = ProcessRunner([Spawns])
    runner.simulate(5.0)
    endpoint = runner.nodes["Spawns"].components["Spawns"]
    assert isinstance(endpoint, ProcessEndpoint)
    assert vars(endpoint.process)["steps"] == [0.0, 0.5, 1.0]


def test_spawned_function_is_rejected_in_lock_step() -> None:
    with pytest.raises(ComponentFailedError, match=r"(?s)Spawns spawns block, which would block.*generator function"):
        ProcessRunner([Spawns.with_args(blocks=True)]).simulate(1.0)
