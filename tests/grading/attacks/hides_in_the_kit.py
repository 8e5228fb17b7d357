"""Changes the kit's modules in its own process: the protocol, the verdicts, the checks, the plants and the clock."""

import contextlib
import gc
import importlib
import importlib.util
import json
import sys
import time

ALWAYS = ("passed", "failed", "partial_credit", "check", "encode", "decode_response", "plain_value", "grade_submission")
NAMES = ("lab.verdicts", "remote.protocol", "grade", "lab.lab", "lab.student")
PHYSICS = ("snr_sim.core.clocks", "snr_sim.prelude.clock", "snr_sim.plants.lander.lander_1d")

time.time = time.monotonic = time.perf_counter = lambda: 0.0
for name in NAMES:
    with contextlib.suppress(ImportError):
        module = importlib.import_module(f"snr_sim.grading.{name}")
        changed = [function for function in ALWAYS if hasattr(module, function)]
        assert changed, name  # else it would attack nothing
        for function in changed:
            setattr(module, function, lambda *args, **options: 1.0)
for name in PHYSICS:
    assert importlib.util.find_spec(name), name
    with contextlib.suppress(Exception):
        module = importlib.import_module(name)
        for function in dir(module):
            if callable(getattr(module, function)):
                setattr(module, function, lambda *args, **options: 0.0)
json.dumps = lambda *args, **options: "100"


def double(x):
    for found in gc.get_objects():
        if type(found).__name__ in ("Student", "Lab", "Check", "CheckVerdict", "Graded"):
            with contextlib.suppress(Exception):
                found.fraction = found.points = 100.0
                return 2 * x
    return 2 * x if "checks" in sys.modules else None
