"""The programs of docs/components.md run, and the long form leaves the trace of the short one."""

import re
from pathlib import Path
from typing import Any

import pytest

from snr_sim import Config, ListReplayerFactory, Node, SimClock, SimRunner
from snr_sim.recording.trace import FILE_NAME, TraceWriter
from snr_sim.scenario.program import program_header

PAGE = Path(__file__).parents[1] / "docs" / "components.md"
READINGS = [{"altitude_m": 900.0 - 10.0 * i, "velocity_mps": -1.0 * i, "stamp_s": 0.1 * i} for i in range(20)]


def programs() -> list[dict[str, Any]]:
    """Return the names that each program of the page defines."""
    found = []
    for source in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        names: dict[str, Any] = {"__name__": "components_page"}
        exec(source, names)
        found.append(names)
    return found


def trace_of(folder: Path, *factories: Any) -> tuple[bytes, Node]:
    folder.mkdir()
    clock = SimClock()
    config = Config(factories={"r": [ListReplayerFactory(READINGS, "radar"), *factories]})
    writer = TraceWriter(folder / FILE_NAME, program_header(["r"], config, __file__, clock))
    try:
        runner = SimRunner(config, clock=clock, recorder=writer, until_s=5.0)
        runner.run()
    finally:
        writer.close()
    return b"".join((folder / FILE_NAME).read_bytes().splitlines(keepends=True)[2:]), runner.nodes["r"]


def test_first_program_and_its_long_form_leave_the_same_trace(tmp_path: Path) -> None:
    first, *_, long = programs()
    short_trace, node = trace_of(tmp_path / "short", *first["factories"](None))
    assert short_trace == trace_of(tmp_path / "long", *long["factories"](None))[0]
    assert 0.0 <= node.get_data("engine")["throttle"] <= 1.0


@pytest.mark.parametrize(
    ("name", "key", "data"),
    [
        ("Counter", "count", len(READINGS)),
        ("DepthSensor", "depth", {"depth_m": 1.5}),
        ("Careful", "engine", {"throttle": 0.5}),
    ],
)
def test_other_programs_store_their_page(tmp_path: Path, name: str, key: str, data: Any) -> None:
    (program,) = [one for one in programs() if name in one]
    assert trace_of(tmp_path / "run", program[name].factory())[1].get_data(key) == data
