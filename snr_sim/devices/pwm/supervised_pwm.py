"""Outputs behind the supervisor, as the robot's program sees them: a PwmOut that fails safe when this program dies."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from snr_sim.devices.pwm.plain_pwm import PlainPwm
from snr_sim.devices.pwm.pwm_backend import PwmBackend
from snr_sim.devices.wire.child_port import ChildPort
from snr_sim.devices.wire.lease_messages import Answer, Arm, Close, Disarm, Lease, Message, Open, encode, receive
from snr_sim.prelude.device import LEASE_S
from snr_sim.prelude.errors import DeviceError
from snr_sim.prelude.signals import NOT_ACTIVE, SLEWING

OPEN_S = 20.0  # until a new Python on a small computer has opened them
ANSWER_S = 1.0

open_supervisor = partial(ChildPort, "snr_sim.devices.pwm.pwm_supervisor:run", receive)


class SupervisedPwm(PwmBackend):
    """Outputs that a separate process owns. Implements `PwmOut`.

    Args:
        like: the same outputs, not opened: source of their channels, limits and steps.
        now_s: the clock of command stamps.
        opener: "module:function", called in the supervisor; returns the outputs.
        args: its arguments, JSON. One more follows: whether a supervisor of this program held the outputs before.
        open_line: starts a supervisor.
        monotonic_s: the clock that all processes of this computer share.
    """

    fails_safe_alone = True

    def __init__(
        self,
        like: PlainPwm,
        now_s: Callable[[], float],
        opener: str,
        args: Sequence[Any],
        open_line: Callable[[], ChildPort[Message]] = open_supervisor,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(now_s, like.channels, like.limits_us, like.resolution_us)
        self.still_us = like.still_us
        self.title = f"{like.title}, behind its supervisor,"
        self._opener, self._args = opener, list(args)
        self._open_line, self._monotonic_s = open_line, monotonic_s
        self._line: ChildPort[Message] | None = None
        self._has_held = False
        self._seq = 0
        self._asked: list[float] = []
        self._asked_of: dict[int, list[float]] = {}
        self._answer = Answer(0, "unconfigured", "", [], [], {})
        self._heard_s = 0.0

    def counts(self) -> dict[str, int]:
        """Return the counters of the outputs."""
        return self._answer.counts

    def on_configure(self) -> None:
        """Start a supervisor, which opens the outputs.

        Raises:
            DeviceError: the supervisor's error, or that it died.
        """
        self._let_go()
        self._line = self._open_line()
        self._asked_of.clear()
        try:
            self._order(Open(self._opener, [*self._args, self._has_held]), OPEN_S)
        except BaseException:
            self._let_go()
            raise
        self._has_held = True

    def on_activate(self) -> None:
        """Order the supervisor to arm."""
        self._order(Arm(), ANSWER_S)
        self.state, self.why = self._answer.state, self._answer.why
        self._heard_s = self._monotonic_s()

    def on_deactivate(self, reason: str) -> None:
        """Order the supervisor to go to neutral."""
        if self._line is not None:
            self._order(Disarm(reason), ANSWER_S)

    def on_close(self) -> None:
        """Order the supervisor to release the outputs and end."""
        self._let_go()

    def put(self, pulses_us: list[float], stamp_s: float, lease_s: float, why: list[str]) -> list[float]:
        """Send a lease; return the pulses of the newest answer, which may belong to the lease before."""
        self._hear()
        now_s = self._monotonic_s()
        if self._asked_of and now_s > self._heard_s + ANSWER_S:
            raise DeviceError(
                f"{self.title} has not answered for {ANSWER_S:g} s.", fix="is the computer overloaded? `top`."
            )
        self._seq += 1
        # An old command has expired to neutral, and no newer state is possible.
        age_s = self.now_s() - stamp_s if lease_s > 0.0 else 0.0
        self._send(Lease(self._seq, pulses_us, now_s - age_s, age_s + lease_s if lease_s > 0.0 else LEASE_S))
        self._asked_of[self._seq] = pulses_us
        self._hear()
        answer = self._answer
        if answer.state == "error":
            raise DeviceError(answer.why, fix=answer.fix)
        if answer.state == "inactive":
            self.state, self.why = answer.state, answer.why
            why.append(NOT_ACTIVE)
            return self.still_us
        if self.state == "activating" and answer.state == "active" and self.asks_neutral:
            self.state, self.why = "active", ""
        if self._asked != pulses_us:
            why.append(SLEWING)
        why += [reason for reason in answer.reasons if reason not in why and reason != NOT_ACTIVE]
        return answer.pulses_us or self.still_us

    def _order(self, order: Message, timeout_s: float) -> None:
        """Send an order and wait for its result."""
        line = self._opened()
        self._hear()
        before = len(self._asked_of)
        self._send(order)
        until_s = time.monotonic() + timeout_s
        answers = before + 1
        while answers and line.wait(max(0.0, until_s - time.monotonic())):
            answers -= self._hear()
        if answers > 0:
            raise DeviceError(
                f"{self.title} has not answered for {timeout_s:g} s.", fix="is the computer overloaded? `top`."
            )
        if self._answer.state == "error":
            raise DeviceError(self._answer.why, fix=self._answer.fix)

    def _send(self, message: Message) -> None:
        self._opened().write(encode(message))

    def _hear(self) -> int:
        """Read the answers that have arrived; return their number."""
        heard = 0
        for message in self._opened().read():
            if isinstance(message, Answer):
                heard += 1
                self._answer = message
                self._heard_s = self._monotonic_s()
                self._asked = self._asked_of.get(message.seq, self._asked)
                for seq in [seq for seq in self._asked_of if seq <= message.seq]:
                    del self._asked_of[seq]
        return heard

    def _let_go(self) -> None:
        line, self._line = self._line, None
        if line is None:
            return
        with suppress(DeviceError):  # a supervisor that has died
            line.write(encode(Close()))
        line.close()

    def _opened(self) -> ChildPort[Message]:
        if self._line is None:
            raise DeviceError(f"{self.title} is not open.", fix="configure() it first.")
        return self._line
