"""Run folders: one folder per run, and access to the files in it for replays."""

from __future__ import annotations

import hashlib
import json
import math
import platform
import shutil
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from snr_sim import __version__
from snr_sim.prelude.errors import TraceError
from snr_sim.recording.atomic_files import write_atomic
from snr_sim.recording.reader import Trace
from snr_sim.recording.records import Header, digest_of, name_of
from snr_sim.recording.sources import FOLDER as SOURCES
from snr_sim.recording.sources import program_sources
from snr_sim.recording.trace import FILE_NAME

MIN_FREE_BYTES = 50_000_000  # for a run to begin: some minutes of a dive
RESULT_NAME = "result.json"
RESULT_SCHEMA = 1  # docs/formats.md, section 4: changes when a field is renamed or removed
VIEW_NAME = "view.rrd"
RUNS = Path("runs")  # in the current folder
_REPORTED_PACKAGES = ("numpy", "msgspec", "pymunk", "mujoco-core")
COMMON_FIELDS: tuple[str, ...] = (  # what every result.json has, or may have
    *("scenario", "seed", "engine", "controller", "success", "outcome", "sim_time_s", "wall_time_s"),
    *("tasks", "pages", "notes", "trace_digest", "run_dir", "error", "signal"),
)


def new_run_folder(out: Path, scenario: str, seed: int) -> Path:
    """Create `<out>/<scenario>-<seed>-<stamp>` and return it.

    Raises:
        TraceError: the folder cannot be created, or the disk has less space than `MIN_FREE_BYTES`.
    """
    stamp = time.strftime("%Y%m%d-%H%M%S")
    for attempt in range(1000):
        folder = out / (f"{scenario}-{seed}-{stamp}" + (f"-{attempt + 1}" if attempt else ""))
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            if out.exists() and not out.is_dir():
                raise TraceError(f"{out} is a file, not a folder.", fix="name a folder with --out.") from None
            continue
        except OSError as error:
            raise TraceError(
                f"The run folder {folder} cannot be made: {error.strerror}.", fix="name another folder with --out."
            ) from error
        _check_room(folder)
        return folder
    raise TraceError(f"{out} holds a thousand runs of this second.", fix="name another folder with --out.")


def _check_room(folder: Path) -> None:
    room = shutil.disk_usage(folder)
    if room.total and room.free < MIN_FREE_BYTES:  # some network disks report neither
        discard(folder)
        free = f"{room.free / 1e6:.0f} MB free, and a run begins with {MIN_FREE_BYTES / 1e6:.0f} MB"
        raise TraceError(
            f"The disk of {folder.parent} has {free}.",
            fix="make room on the disk, or record to another one with --out.",
        )


def discard(folder: Path) -> None:
    """Remove the folder of a run that never began."""
    (folder / FILE_NAME).unlink(missing_ok=True)
    shutil.rmtree(folder / SOURCES, ignore_errors=True)
    for empty in (folder, folder.parent):
        with suppress(OSError):  # other runs are in it
            empty.rmdir()


def write_result(folder: Path, fields: dict[str, Any]) -> None:
    """Write result.json atomically; its field `schema` is RESULT_SCHEMA.

    Raises:
        TraceError: it cannot be written, for example on a full disk.
    """
    try:
        write_atomic(folder / RESULT_NAME, (as_json(fields, indent=2) + "\n").encode())
    except OSError as error:
        raise TraceError(
            f"{folder / RESULT_NAME} could not be written: {error.strerror}. What it would say is printed here.",
            fix="make room on the disk, or name another folder with --out.",
        ) from error


def read_result(folder: Path) -> dict[str, Any]:
    """Return the content of result.json, or an empty dict if there is no valid one."""
    try:
        fields = json.loads((folder / RESULT_NAME).read_bytes())
    except (OSError, ValueError):
        return {}
    return fields if isinstance(fields, dict) else {}


def scenario_metrics(fields: dict[str, Any]) -> dict[str, float | str]:
    """Return the scenario's own numbers and texts from the content of result.json.

    >>> scenario_metrics({"seed": 3, "outcome": "held", "settling_s": 5.5, "fault": "off", "sim_time_s": 40.0})
    {'settling_s': 5.5, 'fault': 'off'}
    """
    found = {name: value for name, value in fields.items() if name not in COMMON_FIELDS}
    return {name: value for name, value in found.items() if isinstance(value, (int, float, str))}


def outcome_reason(fields: dict[str, Any]) -> str:
    """Return the scenario's comment on its outcome from the content of result.json; empty if there is none.

    >>> outcome_reason({"outcome": "failed", "notes": ["Something else.", "failed: ended 1 m off."]})
    'ended 1 m off.'
    """
    begins = f"{fields.get('outcome', '')}: "
    return next((note.removeprefix(begins) for note in fields.get("notes", []) if note.startswith(begins)), "")


def as_json(fields: dict[str, Any], indent: int | None = None) -> str:
    """Return strict JSON: NaN and infinities become null, numpy numbers plain ones."""
    return json.dumps(_plain(fields), indent=indent, allow_nan=False)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # a numpy array or number
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (str, int, bool)) or value is None else str(value)


def trace_path(run: Path) -> Path:
    """Return the trace of a run, given its folder or the trace itself.

    Raises:
        TraceError: there is none; the message lists runs nearby.
    """
    path = run / FILE_NAME if run.is_dir() else run
    if path.is_file():
        return path
    views = sorted(run.glob("*.rrd")) if run.is_dir() else []
    if views:
        raise TraceError(f"{run} holds {views[0].name}, but no {FILE_NAME}.", fix=f"snr view {views[0]} shows it.")
    near = runs_here(run if run.is_dir() else RUNS)
    fix = f"the newest run here is {near[-1]}." if near else "make one: snr run lander_vertical."
    raise TraceError(f"There is no run at {run}.", fix=fix)


def runs_here(folder: Path = RUNS) -> list[Path]:
    """Return the runs in a folder, the newest last: by when their traces were last written, then by their names."""
    traces = folder.glob(f"*/{FILE_NAME}")
    return [path.parent for path in sorted(traces, key=lambda path: (path.stat().st_mtime_ns, path))]


def records_digest(path: Path) -> str:
    """Return the digest of a trace's records: without opening and header, which name versions, sources and options."""
    with open(path, "rb") as file:
        file.readline()
        file.readline()
        return hashlib.file_digest(file, digest_of).hexdigest()


def check_unchanged(trace: Trace) -> None:
    """Check a trace against the digest in its folder's result.json, if there is one.

    Raises:
        TraceError: it was changed or truncated after its result.json was written.
    """
    if _digest_in_result(trace) not in (None, trace.digest):
        raise TraceError(
            f"The trace was changed after the run, so it proves nothing: result.json says its digest is "
            f"{_digest_in_result(trace)}, but it is {trace.digest}.",
            fix="replay it without --check to look at it, or run the scenario again: snr resim.",
        )


def _digest_in_result(trace: Trace) -> Any:
    return read_result(trace.path.parent).get("trace_digest")


def trace_warnings(trace: Trace) -> list[str]:
    """Return remarks about a trace: that it was changed, truncated, or did not end by itself."""
    if trace.is_truncated:
        return ["The trace was cut short; what follows stops at its last whole record."]
    if _digest_in_result(trace) not in (None, trace.digest):
        return ["The trace was changed after the run: its digest is not the one in result.json."]
    return [] if trace.is_ended else ["The run did not end by itself; its trace stops at its last record."]


def package_versions() -> dict[str, str]:
    """Return the versions of the installed packages that a run depends on."""
    from importlib import metadata  # its import takes as long as all others, and few runs need it

    versions = {}
    for package in _REPORTED_PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return versions


def new_header(roles: Sequence[str], commands: Mapping[str, list[str]], **fields: Any) -> Header:
    """Return the second line of a trace: versions, nodes, and the fields given.

    Args:
        roles: in the order in which they run.
        commands: keys of pages that drive actuators, by role.
        fields: the others.
    """
    return Header(
        version=__version__,
        python=platform.python_version(),
        platform=platform.platform(),
        packages=package_versions(),
        roles=list(roles),
        nodes=[f"{role}_node" for role in roles],
        commands={f"{role}_node": commands.get(role, []) for role in roles},
        **fields,
    )


def header_of_program(
    roles: Sequence[str], commands: Mapping[str, list[str]], program: Path, clock: str, seed: int
) -> Header:
    """Return the second line of the trace of a program without a scenario; arguments as above, and of the run."""
    return new_header(
        roles,
        commands,
        scenario="",
        robot="",
        controller=name_of(str(program)),
        engine="",
        io="",
        seed=seed,
        options={},
        clock=clock,
        sources=program_sources(program),
        scene={},
    )


def environment_changes(header: Header, packages: Mapping[str, str], version: str) -> list[str]:
    """Return each difference between what a run was recorded with and these packages and version, as text."""
    pairs = {
        "snr_sim": (header.version, version),
        "Python": (header.python, platform.python_version()),
        **{name: (header.packages.get(name), packages.get(name)) for name in sorted({*header.packages, *packages})},
        "platform": (header.platform, platform.platform()),
    }
    return [f"{name} {then or 'none'} then, {now or 'none'} now" for name, (then, now) in pairs.items() if then != now]
