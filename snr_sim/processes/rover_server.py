"""RoverServer: a process with devices at serial ports, which are asked for the keys that they take.

The devices speak the seed's dialect of VESC frames (`devices/wire/vesc_messages.py`). Another kind of device needs
`get_device`, and `read_cmd` and `send_cmd`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

from snr_sim.devices.wire.serial_port import BytePort, SerialPort
from snr_sim.devices.wire.vesc_frames import VescFrames, encode
from snr_sim.devices.wire.vesc_messages import Subscription, VescCodec, VescMessage
from snr_sim.processes.rover_process import RoverProcess

REQUESTS = 4  # to a device, for its name; each waits `ANSWER_S` for the answer
ANSWER_S = 0.25
READ_PERIOD_S = 0.02


class RoverServer(RoverProcess):
    """A process with devices, each of which takes the messages of a key.

    Attributes:
        erpm_per_rpm: electrical revolutions of a device's motor for one of its wheel; 228 for the seed's rover.
    """

    erpm_per_rpm: float = 228.0

    @cached_property
    def devices(self) -> dict[str, BytePort]:
        """The devices that have answered, by the keys that they take."""
        return {}

    @cached_property
    def _readers(self) -> dict[BytePort, tuple[VescFrames, deque[VescMessage]]]:
        return {}

    @cached_property
    def _codec(self) -> VescCodec:
        return VescCodec("seed", self.erpm_per_rpm)

    def spawn_thread(self, function: Callable[..., Any], **kwargs: Any) -> None:
        """Call a function on a thread of its own, which is joined at the end.

        Args:
            function: in lock step a generator function, which is called as `loop` is: there are no threads.
            kwargs: its arguments.

        Raises:
            ConfigError: in lock step the function is not a generator function.
        """
        self._uplink.spawn(function, kwargs)

    def get_device(self, port: str) -> BytePort:
        """Return the device at a port, opened; raise a DeviceError if it cannot be."""
        return SerialPort(port)

    def get_subscription(self, device: BytePort) -> str | None:
        """Ask a device for the key that it takes; return None if it does not answer within a second."""
        for _ in range(REQUESTS):
            device.read()  # what it has sent before
            self.send_cmd(Subscription("t"), device)
            device.wait(ANSWER_S)
            while (message := self.read_cmd(device)) is not None:
                if isinstance(message, Subscription):
                    return message.name
        return None

    def req_subscription(self, port: str) -> str | None:
        """Open the device at a port, subscribe to the key that it takes, and listen to it.

        Returns:
            its key; None if it does not answer, and then it is closed.
        """
        device = self.get_device(port)
        key = self.get_subscription(device)
        if key is None:
            device.close()
            return None
        self.devices[key] = device
        self.subscribe(key)
        self.spawn_thread(self.listen_to_device, device=device)
        return key

    def listen_to_device(self, device: BytePort) -> Iterator[float]:
        """Publish what a device sends, each message by the name of its class, until the end."""
        while True:
            while (message := self.read_cmd(device)) is not None:
                self.publish(type(message).__name__, message)
            yield READ_PERIOD_S

    def read_cmd(self, device: BytePort) -> VescMessage | None:
        """Return the next message of a device; None if there is none. Raise a DeviceError if it is gone."""
        frames, waiting = self._readers.setdefault(device, (VescFrames(), deque()))
        for payload in frames.feed(device.read(), self.get_time_s()):
            message = self._codec.decode(payload)
            if message is not None:
                waiting.append(message)
        return waiting.popleft() if waiting else None

    def send_cmd(self, message: VescMessage, device: BytePort) -> None:
        """Send a message to a device; raise a DeviceError if it is gone."""
        device.write(encode(self._codec.encode(message)))

    def cleanup(self) -> None:
        """Close the devices."""
        for device in self.devices.values():
            device.close()
