"""Who is at the other end of a serial port: asks for a name until one is answered. Owns no port and no clock.

Subscription, up to four times --> Subscription(name)         a controller with the dialect seed
                               --> {"name": "..."}            a small device, see json_frames.py
GetFirmware, to a silent port  --> Firmware(chip) --> table   a controller with the dialect stock
"""

from __future__ import annotations

from collections.abc import Mapping

from snr_sim.devices.wire import vesc_messages as vesc
from snr_sim.devices.wire.json_frames import JsonFrames
from snr_sim.devices.wire.vesc_frames import VescFrames, encode

TRY_S = 0.25  # until a name is asked for again
TRIES = 4
FIRMWARE_S = 0.1  # a controller answers within a millisecond
_MAX_NAME = 64
_SHOWN = 16  # bytes of a bad answer
SAME_S = 1e-9  # times closer than this are equal, to allow for rounding


class Handshake:
    """Asks one port. A port that is silent is done after 1.1 s, any number of them at the same time.

    Args:
        chips: names of controllers with the dialect stock, by their chip numbers as hexadecimal text.

    Attributes:
        name: of the device; empty as long as it is unknown.
        is_controller: whether that was a controller's answer, with a check sum: others drive no motor.
        failure: as text, why its name stays unknown; empty before.
        bad_answers: to each question that was answered, and not with a name: the first bytes, as hexadecimal text.
    """

    def __init__(self, chips: Mapping[str, str]) -> None:
        self.name: str = ""
        self.is_controller: bool = False
        self.failure: str = ""
        self.bad_answers: list[str] = []
        self._chips = chips
        self._codec = vesc.VescCodec("seed", 1.0)  # GetFirmware has the same bytes in both dialects
        self._frames, self._objects = VescFrames(), JsonFrames()
        self._asked = 0  # questions so far
        self._asked_s = 0.0
        self._received = b""  # since then
        self._chip = ""

    @property
    def is_done(self) -> bool:
        """Whether the name is known, or will not be."""
        return bool(self.name or self.failure)

    def step(self, data: bytes, now_s: float) -> bytes:
        """Take received bytes, which may be none; return the bytes to send.

        What the first call brings is dropped, as it answers no question. Call it every few hundredths of a second.
        """
        if self._asked and not self.is_done:
            self._received = (self._received + data)[:_SHOWN]
            self._listen(data, now_s)
        elapsed_s = now_s - self._asked_s + SAME_S
        is_waiting = self._asked and elapsed_s < (TRY_S if self._asked <= TRIES else FIRMWARE_S)
        return b"" if self.is_done or is_waiting else self._ask(now_s)

    def _listen(self, data: bytes, now_s: float) -> None:
        for payload in self._frames.feed(data, now_s):
            message = self._codec.decode(payload)
            if isinstance(message, vesc.Subscription):
                self._take(message.name, is_controller=True)
            elif isinstance(message, vesc.Firmware):
                self._chip = message.chip.hex()
                self._take(self._chips.get(self._chip), is_controller=True)
        for value in self._objects.feed(data, now_s):
            self._take(value.get("name"), is_controller=False)

    def _take(self, name: object, is_controller: bool) -> None:
        if not self.name and isinstance(name, str) and 1 <= len(name) <= _MAX_NAME and name.isprintable():
            self.name, self.is_controller = name, is_controller

    def _ask(self, now_s: float) -> bytes:
        """Return the next question; empty if there is none left, which is a failure."""
        if self._received:
            self.bad_answers.append(self._received.hex(" "))
        was_firmware_asked = self._asked > TRIES
        if was_firmware_asked or (self._asked == TRIES and self.bad_answers):
            self.failure = self._describe_failure()
            return b""
        self._asked, self._asked_s, self._received = self._asked + 1, now_s, b""
        question = vesc.GetFirmware() if self._asked > TRIES else vesc.Subscription("t")
        return encode(self._codec.encode(question))

    def _describe_failure(self) -> str:
        if self._chip:
            return f"is a VESC controller with the chip number {self._chip}, which the robot's table does not name"
        if self.bad_answers:
            return f"sends {self.bad_answers[-1]}, which is not a name"
        return "sends nothing"
