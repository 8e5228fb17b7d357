"""Code that a replay executes: copies in the run folder, never paths from a trace, other users' only when confirmed."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from snr_sim.cli import trust
from snr_sim.prelude.errors import ParameterError
from snr_sim.recording import sources
from snr_sim.recording.trace import FILE_NAME

Snr = Callable[..., Any]
Mine = Callable[..., Path]
WIRED = '        return self.store_data_task("engine", {"throttle": 0.2})'
EVIL = "from pathlib import Path\nPath(__file__)\nopen({marker!r}, 'w').close()\ndef factories(robot): return []\n"


@pytest.fixture(scope="session")
def one_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of all tests here, for a run keeps the paths of its files: what is in it, and the kept run."""
    return tmp_path_factory.mktemp("trust")


@pytest.fixture
def here(here: Path, one_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same empty folder for each test, which is the current one, and the same user."""
    shutil.rmtree(one_folder / "here", ignore_errors=True)
    (one_folder / "here").mkdir()
    monkeypatch.chdir(one_folder / "here")
    return one_folder / "here"


@pytest.fixture
def run(snr: Snr, here: Path, one_folder: Path, mine: Mine) -> Path:
    """A run of mine.py, which imports one module at the top and another in a handler; run once, then copied."""
    (here / "gains.py").write_text("THROTTLE = 0.2\n")
    (here / "late.py").write_text("OFFSET = 0.0\n")
    path = mine(
        ("from snr_sim import", "import json\nimport gains\nfrom snr_sim import"),
        (
            WIRED,
            "        import late\n" + WIRED.replace("0.2", "gains.THROTTLE + late.OFFSET + len(json.dumps('')) - 2"),
        ),
    )
    kept = one_folder / "kept"
    if not kept.exists():
        fields = snr("run", "lander_low_gate", "--no-rrd", "--json", "--controller", path).json
        shutil.move(here / str(fields["run_dir"]), kept)
    return Path(shutil.copytree(kept, here / "runs" / "kept"))


@pytest.fixture
def marker(tmp_path: Path) -> Path:
    """A file that an evil file makes when it is executed."""
    return tmp_path / "executed"


@pytest.fixture
def evil(tmp_path: Path, marker: Path) -> Path:
    """A Python file of this computer that must not be executed."""
    path = tmp_path / "elsewhere" / "evil.py"
    path.parent.mkdir()
    path.write_text(EVIL.format(marker=str(marker)))
    return path


def table(run: Path) -> list[dict[str, str]]:
    return [json.loads(line) for line in (run / "sources" / "files.jsonl").read_text().splitlines()]


def write_table(run: Path, lines: list[dict[str, str]]) -> None:
    (run / "sources" / "files.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


def add_file(run: Path, path: str, text: str) -> None:
    """Add a further file to the run folder, as in a folder that was made by hand."""
    import hashlib

    sha256 = hashlib.sha256(text.encode()).hexdigest()
    (run / "sources" / f"{sha256}.py").write_text(text)
    write_table(run, [{"path": path, "sha256": sha256, "mark": ""}, *table(run)])


def edit(run: Path, trace_info: dict[str, Any] | None = None, **header: Any) -> None:
    """Change the first lines of a trace."""
    lines = (run / FILE_NAME).read_text().split("\n", 2)
    lines[0] = json.dumps({**json.loads(lines[0]), **(trace_info or {})})
    lines[1] = json.dumps({**json.loads(lines[1]), **header})
    (run / FILE_NAME).write_text("\n".join(lines))


# One's own runs


def test_own_run_replays_from_copies_after_files_were_deleted(snr: Snr, run: Path, here: Path, tmp_path: Path) -> None:
    names = [Path(line["path"]).name for line in table(run)]
    assert sorted(names) == ["gains.py", "late.py", "mine.py"]
    for name in names:
        (here / name).unlink()
    moved = shutil.move(run, tmp_path / "moved")
    answer = snr("replay", moved)
    assert answer.status == 0, answer.err
    listed = ", ".join(line["path"] for line in table(Path(moved)))
    assert answer.err.startswith(f"executes, as recorded: {listed}\n")
    assert snr("replay", moved, "--json").json["executed"] == listed.split(", ")


def test_own_run_replays_recorded_files_unless_with_is_given(snr: Snr, run: Path, here: Path) -> None:
    (here / "late.py").write_text("OFFSET = 0.1\n")
    assert snr("replay", run).status == 0
    answer = snr("replay", run, "--with", here / "mine.py", "--json")
    assert answer.json["first_divergence"]["replayed"] == pytest.approx(0.3)


def test_replay_failure_shows_recorded_line_under_original_name(snr: Snr, here: Path, mine: Mine) -> None:
    path = mine((WIRED, "        return 1 / (now_s < 1.0)  # as it was"))
    run = snr("run", "lander_low_gate", "--no-rrd", "--json", "--controller", path).json["run_dir"]
    path.write_text("\n" * 40)
    answer = snr("replay", run)
    assert answer.status == 0, answer.out + answer.err  # the message of the failure is compared, too


def test_users_robot_and_scenario_replay_from_run_folder(snr: Snr, here: Path) -> None:
    assert snr("new", "robot", "moth", "--from", "lander").status == 0
    assert snr("new", "scenario", "fall", "--from", "lander_low_gate", "--robot", "moth").status == 0
    run = snr("run", "fall", "--no-rrd", "--json").json["run_dir"]
    shutil.rmtree(here / "robots")
    shutil.rmtree(here / "scenarios")
    answer = snr("replay", run)
    assert answer.status == 0, answer.err
    assert "robots/moth/robot.py" in answer.err


def test_signing_key_is_readable_by_its_user_only(run: Path) -> None:
    key = Path(os.environ["XDG_STATE_HOME"]) / "snr_sim" / "key"
    assert (key.stat().st_mode & 0o777, key.stat().st_size) == (0o600, 32)
    assert key.read_bytes().hex() not in (run / "sources" / "files.jsonl").read_text()


def test_file_too_large_to_copy_is_noted_and_confirmed(
    snr: Snr, here: Path, mine: Mine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sources, "MAX_FILE_BYTES", 100)
    fields = snr("run", "lander_low_gate", "--no-rrd", "--json", "--controller", mine()).json
    assert "mine.py was not kept for a replay: it is too large, or there are too many." in fields["notes"]
    answer = snr("replay", fields["run_dir"])
    assert answer.status == 2
    assert f"It would execute:\n  {here / 'mine.py'}\n" in answer.err
    assert snr("replay", fields["run_dir"], "--trust").status == 0


# Runs of others


@pytest.fixture
def strange(run: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The same run for another user, or on another computer."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "other"))
    return run


@pytest.mark.parametrize("verb", ["replay", "resim"])
def test_run_of_other_user_names_files_and_executes_nothing(
    snr: Snr, strange: Path, verb: str, mine: Mine, marker: Path, here: Path
) -> None:
    mine(text=EVIL.format(marker=str(marker)))
    answer = snr(verb, strange)
    assert answer.status == 2
    assert "was not recorded by you on this computer, as far as is known. It would execute:" in answer.err
    assert f"  {here / 'mine.py'}\n" in answer.err
    assert "Nothing was executed." in answer.err
    assert "--trust" in answer.err
    assert not marker.exists()
    assert snr(verb, strange, "--with", "optimal").status == (0 if verb == "resim" else 1)


def test_trusted_run_of_other_user_replays_from_its_folder(snr: Snr, strange: Path, mine: Mine, marker: Path) -> None:
    mine(text=EVIL.format(marker=str(marker)))
    assert snr("replay", strange, "--trust").status == 0
    assert not marker.exists()


@pytest.mark.parametrize("answer", [True, False])
def test_answer_no_executes_nothing(monkeypatch: pytest.MonkeyPatch, answer: bool) -> None:
    asked = []
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(trust.typer, "confirm", lambda text, err: asked.append(text) or answer)
    if answer:
        trust.ask("runs/x", ["/a/b.py"], is_trusted=False)
    else:
        with pytest.raises(ParameterError, match="Nothing was executed"):
            trust.ask("runs/x", ["/a/b.py"], is_trusted=False)
    assert "/a/b.py" in asked[0]


def test_empty_answer_means_no() -> None:
    import inspect

    assert inspect.signature(trust.typer.confirm).parameters["default"].default is False


def without_copies(run: Path, path: str, **more: Any) -> None:
    shutil.rmtree(run / "sources")
    edit(run, {"controller": path, **more})


def no_files_in_the_header(run: Path, evil: Path) -> None:
    without_copies(run, str(evil), scenario=str(evil))
    edit(run, sources={})


def robot_by_path(run: Path, evil: Path) -> None:
    shutil.copy(evil, evil.with_name("robot.py"))
    edit(run, robot=str(evil.parent))
    shutil.rmtree(run / "sources")


ROBOTS = Path(__file__).parents[2] / "robots"
PATHS: dict[str, Callable[[Path, Path], None]] = {
    "without copies": lambda run, evil: without_copies(run, str(evil)),
    "relative path": lambda run, evil: without_copies(run, os.path.relpath(evil)),
    "scenario by path": lambda run, evil: edit(run, {"scenario": str(evil)}),
    "no files in the header": no_files_in_the_header,
    "a path out of the kit": lambda run, evil: without_copies(run, f"{ROBOTS}/{os.path.relpath(evil, ROBOTS)}"),
    "robot by path": robot_by_path,
}


@pytest.mark.parametrize("how", PATHS)
@pytest.mark.parametrize("verb", ["replay", "resim"])
def test_path_in_trace_is_not_executed_without_confirmation(
    snr: Snr, run: Path, evil: Path, marker: Path, how: str, verb: str
) -> None:
    PATHS[how](run, evil)
    answer = snr(verb, run)
    assert answer.status == 2, answer.out
    assert "Nothing was executed" in answer.err
    assert not marker.exists()


def test_with_option_rejects_other_files_named_in_trace(
    snr: Snr, run: Path, evil: Path, marker: Path, mine: Mine
) -> None:
    edit(run, {"scenario": str(evil)}, sources={})
    beside = shutil.copy(mine(), evil.parent)
    assert snr("replay", run, "--with", beside).status == 2
    assert not marker.exists()


def first_copy(run: Path) -> Path:
    return run / "sources" / f"{table(run)[0]['sha256']}.py"


def put_link(path: Path, real: Path) -> None:
    path.rename(real)
    path.symlink_to(real)


def pipe_as_a_copy(run: Path) -> None:
    first_copy(run).unlink()
    os.mkfifo(first_copy(run))


def swapped_copies(run: Path) -> None:
    one, other = (run / "sources" / f"{line['sha256']}.py" for line in table(run)[:2])
    text = one.read_text()
    one.write_text(other.read_text())
    other.write_text(text)


def changed_line(**fields: str) -> Callable[[Path], None]:
    def change(run: Path) -> None:
        first, *rest = table(run)
        write_table(run, [{**first, **fields}, *rest])

    return change


DAMAGED: dict[str, Callable[[Path], object]] = {
    "link as a copy": lambda run: put_link(first_copy(run), run / "real.py"),
    "link as the folder": lambda run: put_link(run / "sources", run / "real"),
    "link as the table": lambda run: put_link(run / "sources" / "files.jsonl", run / "real"),
    "pipe as a copy": pipe_as_a_copy,
    "changed copy": lambda run: first_copy(run).write_text(first_copy(run).read_text() + "import os\n"),
    "swapped copies": swapped_copies,
    "missing copy": lambda run: first_copy(run).unlink(),
    "huge copy": lambda run: os.truncate(first_copy(run), 1 << 40),
    "huge table": lambda run: os.truncate(run / "sources" / "files.jsonl", 1 << 40),
    "many files": lambda run: write_table(run, table(run)[:1] * 201),
    "path with ..": changed_line(path="/tmp/../etc/evil.py"),
    "relative path": changed_line(path="mine.py"),
    "path that moves the cursor": changed_line(path="/tmp/\x1b[2Jmine.py"),
    "hash that is a path": changed_line(sha256="../../../etc/passwd"),
    "unknown field": changed_line(more="1"),
}


@pytest.mark.parametrize("how", DAMAGED)
def test_damaged_copies_make_a_run_unusable(snr: Snr, run: Path, how: str) -> None:
    DAMAGED[how](run)
    answer = snr("replay", run, "--trust")
    assert answer.status == 2
    assert f"The sources in {run} cannot be used: " in answer.err
    assert "\x1b" not in answer.err


@pytest.mark.parametrize("name", ["json.py", "snr_sim/__init__.py", "snr_sim.py"])
def test_file_named_like_pythons_or_the_kits_does_not_take_its_place(
    snr: Snr, run: Path, here: Path, marker: Path, name: str
) -> None:
    add_file(run, str(here / name), EVIL.format(marker=str(marker)))
    assert snr("replay", run).status == 2  # it is not this user's
    assert snr("replay", run, "--trust").status == 0
    assert not marker.exists()


def test_file_at_a_path_of_the_kit_does_not_take_its_place(snr: Snr, run: Path, marker: Path) -> None:
    robot = Path(__file__).parents[2] / "robots" / "lander" / "robot.py"
    add_file(run, str(robot), EVIL.format(marker=str(marker)))
    assert snr("replay", run, "--trust").status == 0
    assert not marker.exists()


def test_other_text_for_ones_own_path_is_not_ones_own(snr: Snr, run: Path, here: Path, marker: Path) -> None:
    add_file(run, str(here / "mine.py"), EVIL.format(marker=str(marker)))
    answer = snr("replay", run)
    assert answer.status == 2
    assert str(here / "mine.py") in answer.err
    assert not marker.exists()
