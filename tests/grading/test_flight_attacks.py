"""Controllers that attack while the grader simulates a plant: they get no points, and the run does not change.

The programs are attacks/in_flight/*.py, submitted as pilot.py together with `falling.py`.
"""

import csv
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.grading.grade import grade_submission
from snr_sim.grading.lab.lab import load_lab
from snr_sim.grading.lab.student import Student
from snr_sim.grading.remote.fork_server import ForkServer

IN_FLIGHT = Path(__file__).parent / "attacks" / "in_flight"
ATTACKS = sorted(path.stem for path in IN_FLIGHT.glob("*.py") if path.stem != "falling")
# One takes half a minute, and where programs are confined the run is the same: the nightly job runs all.
LONG = {"floods_steadily"}
AGAINST_CONFINEMENT = {
    "never_answers",
    "starts_others",
    "writes_records",
    "leaves_in_flight",
    "answers_for_itself_in_flight",
}
HONEST = Path(__file__).parents[2] / "robots" / "lander" / "controllers" / "optimal.py"
WITHOUT_EFFECT = ("patches_the_kit", "writes_records", "forges_verdicts", "starts_others")


def hand_in(folder: Path, name: str) -> Path:
    folder = folder / name
    folder.mkdir(parents=True)
    shutil.copy(IN_FLIGHT / "falling.py", folder)
    shutil.copy(HONEST if name == "honest" else IN_FLIGHT / f"{name}.py", folder / "pilot.py")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("isolation", "attacks"),
    [
        pytest.param("sandbox", sorted(set(ATTACKS) - LONG), id="sandbox"),
        pytest.param("confined", sorted(AGAINST_CONFINEMENT), id="confined"),
        pytest.param("sandbox", ATTACKS, id="sandbox-all", marks=pytest.mark.nightly),
        pytest.param("confined", ATTACKS, id="confined-all", marks=pytest.mark.nightly),
    ],
)
def test_attacks_in_a_run_get_no_points_and_honest_neighbour_gets_all(
    isolation: str,
    attacks: list[str],
    request: pytest.FixtureRequest,
    landing_lab: Path,
    open_folder: Path,
    tmp_path: Path,
) -> None:
    prefix = request.getfixturevalue("docker") if isolation == "confined" else request.getfixturevalue("sandbox") or []
    given = [str(hand_in(tmp_path / "submissions", name)) for name in [*attacks, "honest"]]
    words = ["grade", str(landing_lab), *given, "--out", str(tmp_path / "out"), "--jobs", "2"]
    done = subprocess.run(
        [*prefix, sys.executable, "-m", "snr_sim", *words],
        capture_output=True,
        text=True,
        env={**os.environ, "TMPDIR": str(open_folder)},
    )
    assert done.returncode == 0, done.stderr + done.stdout
    with (tmp_path / "out" / "class.csv").open(newline="") as file:
        table = {
            row["submission"]: (float(row["points"]), row["status"], row["isolation"]) for row in csv.DictReader(file)
        }
    due = dict.fromkeys(attacks, (0.0, "graded", isolation))
    assert table == {**due, "honest": (100.0, "graded", isolation)}
    for path in (tmp_path / "out" / "results").iterdir():
        assert "AssertionError" not in path.read_text(), f"{path.stem} has not acted at all"
        assert len(path.read_bytes()) < 100_000
    assert list(open_folder.iterdir()) == []


@pytest.mark.slow
def test_attacks_without_effect_keep_the_run_identical(sandbox: None, tmp_path: Path) -> None:
    """The plant's trajectory and the sensors' readings are equal, to the last bit."""

    def run_outcome(name: str) -> tuple[Any, ...]:
        with Student(hand_in(tmp_path, name), "sandbox") as student:
            flight = student.run_scenario("lander_vertical", 4, "pilot.py")
        return flight.outcome, flight.success, flight.metrics, flight.truth(), flight.pages("radar")

    honest = run_outcome("only_falls")
    assert honest[:2] == ("crashed", False)
    for name in WITHOUT_EFFECT:
        assert run_outcome(name) == honest, name


FORGER = """
import sys

frame = sys._getframe()
while "asked" not in frame.f_locals or "child" not in frame.f_locals:
    frame = frame.f_back
child = frame.f_locals["child"]
if {verb!r} not in child.verbs:
    sys.modules["snr_sim.grading.remote.child"].node_verbs(child)
honest = child.verbs[{verb!r}]


def forged(raw):
    real = honest(raw)
    import json
    return json.dumps({{**json.loads(real), **{changes}}}).encode()


child.verbs[{verb!r}] = {raw!r} and (lambda raw: {raw!r}) or forged
from falling import falling


def factories(robot):
    return falling(lambda pilot: None)
"""


def page(
    data: str, key: str = "engine", origin: str = '"lander_node"', created: str = "0.0", process: str = "true"
) -> bytes:
    """What a student's process would send in answer to a reading: this page."""
    fields = f'"key":"{key}","data":{data},"origin":{origin},"created_at_s":{created},"process":{process}'
    return f'{{"returned":{{"falling":[["store_page","{key}",[{{"$":"page",{fields}}}]]]}}}}'.encode()


STRANGE_DATA = (
    '{"throttle":{"$":"float","v":"nan"}}',
    '{"throttle":{"$":"int","v":"0x' + "f" * 9000 + '"}}',
    '{"throttle":{"$":"array","dtype":"float64","shape":[2],"data":[1,1]}}',
    '{"throttle":{"$":"array","dtype":"<U999999999","shape":[1],"b64":""}}',
    '{"throttle":{"$":"array","dtype":"<U999999999","shape":[0],"b64":""}}',
    '{"throttle":{"$":"array","dtype":"float64","shape":[1000000000000],"b64":""}}',
    '{"throttle":{"$":"array","dtype":"float64","shape":[0,1000000000000],"data":[]}}',
    '{"throttle":{"$":"set","v":[[1]]}}',
    '{"throttle":{"$":"object","type":"os.system","fields":{}}}',
    '{"throttle":{"$":"page","key":"x","data":1,"origin":"y","created_at_s":0}}',
    '{"throttle":{"$":"shared","name":"x"}}',
    '{"$":"dict","v":[[1,2]]}',
    "[" * 30 + "]" * 30,
    '"\\ud800"',
)
FORGED: list[tuple[str, dict[str, Any] | bytes]] = [
    ("load", b'{"options":[1,2],"roles":[[1],{"a":2}]}'),
    ("load", b'{"options":{"a":{"b":1}},"roles":5}'),
    ("open", b'{"are_loops":[' + b"true," * 9999 + b'true],"files":[]}'),
    ("open", {"files": [[".", "\0"], [".", "../../../etc/passwd"], ["x", "y"], [".", "pilot.py/" * 3000]]}),
    ("make", {"handlers": [["bogus", None, "f"]]}),
    ("make", {"name": "radar_sensor"}),
    ("make", {"name": "node_core"}),
    ("make", {"name": ""}),
    ("make", {"name": "x" * 900_000}),
    ("make", {"handlers": [["event", f"e{i}", "f"] for i in range(1_001)]}),
    ("make", {"steps": ["begin", "schedule", "__class__"]}),
    ("make", {"is_loop": True, "rate_hz": -1.0, "next_s": -1e300}),
    ("handle", b"[]"),
    ("handle", {"returned": {"falling": [5, "x", None]}}),
    ("handle", {"returned": {"falling": [["bogus", "x", []]], "engine_actuator": [["event", "x", []]]}}),
    ("handle", {"entered": [[["terminate", "landed", []], "referee"]]}),
    (
        "handle",
        {"handlers": {"radar_sensor": [["process_data", None, "f"]], "engine_actuator": [["event", None, "f"]]}},
    ),
    ("handle", {"handlers": {"falling": [["bogus", None, "f"]]}}),
    ("handle", {"failed": "engine_actuator", "failure": {"step": "handle", "text": "x" * 10_000}}),
    ("handle", {"failed": "falling", "failure": {"step": "", "text": "\x1b[2J\0 all points", "fix": "\u202e"}}),
    ("handle", {"notes": [f"{i} {'n' * 9_000}" for i in range(100)], "missed": [str(i) for i in range(20_000)]}),
    ("handle", b'{"returned":{}}}\n{"n":99,"value":{"returned":{}}'),
    ("handle", b"[" * 100_000 + b"]" * 100_000),
    ("handle", b'{"returned":{},"notes":["' + b"x" * 2_000_000 + b'"]}'),
    ("handle", b'{"returned":{},"notes":["\xff\xfe"]}'),
    ("handle", page('{"throttle":1}', created="true")),
    ("handle", page('{"throttle":1}', created='{"$":"float","v":"-inf"}')),
    ("handle", page('{"throttle":1}', created="-1e308")),
    ("handle", page('{"throttle":1}', origin='"' + "x" * 100_000 + '"')),
    ("handle", page('{"throttle":1}', origin='"referee"', process="1")),
    *[("handle", page(data)) for data in STRANGE_DATA],
]


@pytest.mark.slow
@pytest.mark.parametrize(("verb", "answer"), FORGED, ids=[f"{verb}-{i}" for i, (verb, _) in enumerate(FORGED)])
def test_forged_response_is_a_failed_case_and_not_a_grader_error(
    landing_lab: Path,
    copying: Callable[..., ForkServer],
    tmp_path: Path,
    verb: str,
    answer: dict[str, Any] | bytes,
) -> None:
    """A fault of the grader's would be no mark, which is better than none of the points."""
    folder = hand_in(tmp_path, "only_falls")
    is_raw = isinstance(answer, bytes)
    program = FORGER.format(verb=verb, changes={} if is_raw else answer, raw=answer if is_raw else b"")
    (folder / "pilot.py").write_text(program)
    graded = grade_submission(load_lab(landing_lab / "checks.py"), folder, None, "none", fork_server=copying())
    assert (graded.status, graded.points) == ("graded", 0.0), graded.error
    assert len(json.dumps(graded.checks[0].cases[0].error)) < 50_000
