"""Runs `snr` and sends itself a signal when a function is entered: `python phased.py SIGNAL FILE:FUNCTION WORD...`.

A program of its own, as a signal in this process would stop the tests.
"""

import os
import runpy
import signal
import sys
from types import FrameType
from typing import Any


def main(number: int, file: str, function: str, words: list[str]) -> None:
    def watch(frame: FrameType, event: str, argument: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_name == function and code.co_filename.endswith(file):
            sys.setprofile(None)
            os.kill(os.getpid(), number)

    sys.argv = ["snr", *words]
    sys.setprofile(watch)
    runpy.run_module("snr_sim", run_name="__main__")


if __name__ == "__main__":
    main(getattr(signal, sys.argv[1]), *sys.argv[2].split(":"), sys.argv[3:])  # type: ignore[call-arg, arg-type]
