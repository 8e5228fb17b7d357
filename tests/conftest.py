"""Shared by the folders below: recorded runs to read, each simulated once, the schemas, a log left as it was."""

import logging
import os
import signal
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from jsonschema import Draft202012Validator, validators
from referencing import Registry, Resource

from snr_sim.devices.emulated.toolchain import ToolsMissingError, require_tools
from snr_sim.grading.remote.isolation import try_sandbox
from snr_sim.grading.sandbox.sandbox import IsolationMissingError
from snr_sim.recording.reader import Trace, read_trace
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.simulation import Request, prepare
from snr_sim.scenario.simulation_run import SimulationRun
from snr_sim.schemas import NAMES, SUFFIX, read_schema

RecordScenario = Callable[..., Trace]
IsValid = Callable[[Any], bool]

# How many examples a property is tried with: `--hypothesis-profile ci` in .ci/run, `nightly` in .ci/nightly. The first
# two are the same examples in every run. No deadline: no test depends on the speed of the computer.
for name, count in (("fast", 10), ("ci", 25), ("nightly", 500)):
    settings.register_profile(
        name,
        max_examples=count,
        derandomize=name != "nightly",
        deadline=None,
        suppress_health_check=[HealthCheck.too_slow],
        print_blob=True,
    )
settings.load_profile("fast")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # As in the background of a shell's script: whatever the tests start would ignore Ctrl-C, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def user_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What programs remember of their user stays in a folder of the tests', also in processes that they start."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(autouse=True)
def log_as_before() -> Iterator[None]:
    """Restore the log after a test that runs a program as the command line does, which redirects it."""
    logger = logging.getLogger("snr")
    handlers, level, propagate = logger.handlers[:], logger.level, logger.propagate
    yield
    logger.handlers[:], logger.propagate = handlers, propagate
    logger.setLevel(level)
    for name, one in list(logger.manager.loggerDict.items()):  # of nodes and components, which share names in tests
        if name.startswith("snr.") and isinstance(one, logging.Logger) and one.level != logging.NOTSET:
            one.setLevel(logging.NOTSET)


@pytest.fixture(scope="session")
def record_scenario(tmp_path_factory: pytest.TempPathFactory) -> RecordScenario:
    """Returns a function that flies (scenario, controller, seed) and returns the trace."""

    @cache
    def record_scenario(scenario: str = "lander_vertical", controller: str | None = None, seed: int = 0) -> Trace:
        folder: Path = tmp_path_factory.mktemp("run")
        simulation = prepare(Request(scenario, seed, controller=controller))
        plant = simulation.plant()
        config = simulation.config(plant)
        recorder = TraceWriter(folder / FILE_NAME, simulation.header(plant, config), simulation.trace_info())
        result = SimulationRun(simulation, plant, config, recorder).run()
        recorder.close()
        trace = read_trace(folder / FILE_NAME)
        assert trace.digest == recorder.digest
        assert sum(record.__struct_config__.tag in ("task", "page") for record in trace.records) == result.tasks
        return trace

    return record_scenario


@pytest.fixture(scope="session")
def validator() -> Callable[[str], IsValid]:
    """Returns a function that makes, from a schema's name and perhaps a part of it, a check of decoded JSON."""
    registry: Any = Registry().with_resources(
        [(f"{name}{SUFFIX}", Resource.from_contents(read_schema(name))) for name in NAMES]
    )
    # JSON Schema takes 1.0 for an integer; docs/formats.md does not, and here it is known how a number was written.
    checker = Draft202012Validator.TYPE_CHECKER.redefine("integer", lambda _, value: type(value) is int)
    strict = validators.extend(Draft202012Validator, type_checker=checker)

    @cache
    def validator(name: str, part: str = "") -> IsValid:
        is_valid: IsValid = strict({"$ref": f"{name}{SUFFIX}#{part}"}, registry=registry).is_valid
        return is_valid

    return validator


@pytest.fixture(scope="session")
def emulators() -> None:
    """Skip tests of the emulated microcontroller where its packages are absent, but not in CI."""
    try:
        require_tools()
    except ToolsMissingError as error:
        if os.environ.get("SNR_REQUIRE_EMULATORS"):
            raise
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def sandbox() -> None:
    """Skip tests of the sandbox where it cannot be set up, but not in CI."""
    try:
        try_sandbox()
    except IsolationMissingError as error:
        if os.environ.get("SNR_REQUIRE_SANDBOX"):
            raise
        pytest.skip(str(error))
