"""Sends signals to its parent, to its group, to the first process and to everybody."""

import contextlib
import os
import signal

# Outside a sandbox this would harm the machine: it acts only as a user who owns nothing.
assert os.getuid() >= 61184


def double(x):
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    for target in (os.getppid(), 1, 0, -1, -os.getpgid(0), *range(2, 400)):
        for number in (signal.SIGTERM, signal.SIGSTOP if target > 1 else 0, signal.SIGKILL):
            if target not in (os.getpid(), 0, -os.getpgid(0), -1) or number == signal.SIGTERM:
                with contextlib.suppress(OSError):
                    os.kill(target, number)
