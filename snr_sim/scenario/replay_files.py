"""Files that a replay executes, and their origin: snr_sim, this user, or another person.

The files of a recorded run are in its folder (`recording/sources.py`) and are executed from there. A path in a trace is
not opened unless the user agrees: the trace may be from another person, who chose the path.

An owner or a path would prove nothing: an unpacked archive belongs to the user who unpacked it, and a trace can name
any path. So a part of snr_sim is found by its name in snr_sim alone, and a copy by this user's mark.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from snr_sim.core.reload.sources import SourceFiles
from snr_sim.recording.reader import Trace
from snr_sim.recording.replay import reload_sources
from snr_sim.recording.sources import KeptFile, RecordedFiles, copy_of, read_kept_files
from snr_sim.scenario import library

# The parts of a run that `--with FILE` can replace.
_REPLACED = ("controller", "program")
_OPTION = library.OPTION_FILE.rstrip("/")


@dataclass(frozen=True)
class ReplayFiles:
    """Files that the replay of a run executes.

    Args:
        files: source of its files.
        is_recorded: whether they are the copies in the run folder, not the files on the disk.
        executed: descriptions of the files that are not part of snr_sim.
        unknown: those of them that are not known to be this user's own.
        changed: names in the header of own files whose content has changed since.
        options: the run's, with copies of the files that they name.
    """

    files: SourceFiles
    is_recorded: bool
    executed: list[str]
    unknown: list[str]
    changed: list[str] = field(default_factory=list)
    options: dict[str, str] = field(default_factory=dict)


def files_of_replay(trace: Trace, with_file: str = "") -> ReplayFiles:
    """Return the files that a replay of a run executes; nothing is executed yet.

    Args:
        trace: of the run.
        with_file: file that replaces its controller or program, if any.

    Raises:
        TraceError: the copies in the run folder are damaged.
    """
    run, header = trace.path.parent.resolve(), trace.header
    kept = read_kept_files(run)
    matched = _matched(header.sources, kept)
    without_copy = _parts_without_copy(trace, matched, with_file)
    options, data = _options(run, header.options, matched)
    reloads = reload_sources(trace)
    if with_file:
        kept = [one for name, one in matched.items() if _part(name) not in (*_REPLACED, _OPTION)]
        reloads = {}
    without_copy += _lost_reloads(reloads, kept)
    if without_copy:
        named = [*without_copy, *_option_paths(trace)]
        return ReplayFiles(SourceFiles(), False, named, named, options=dict(header.options))
    folders = [Path(with_file).resolve().parent] if os.path.isfile(with_file) else []
    used = list(dict.fromkeys([*kept, *data]))
    return ReplayFiles(
        RecordedFiles([one for one in kept if one not in data], reloads, library.is_of_kit, folders),
        True,
        _paths(used),
        _paths([one for one in used if not one.is_own]) + _option_paths(trace, matched),
        [name for name, one in matched.items() if one in kept and one not in data and one.is_own and _has_changed(one)],
        options,
    )


def files_of_resim(trace: Trace, with_file: str = "") -> list[str]:
    """Describe the files that a new simulation would execute from the disk and that may be from another person.

    Args:
        trace: of the run.
        with_file: file that replaces its controller, if any.

    Raises:
        TraceError: the copies in the run folder are damaged.
    """
    matched = _matched(trace.header.sources, read_kept_files(trace.path.parent))
    own = {name: one for name, one in matched.items() if one.is_own}
    return _parts_without_copy(trace, own, with_file) + _option_paths(trace, own)


def printable_path(path: Path | str) -> str:
    """Return a path for a terminal, without control characters."""
    return "".join(one if one.isprintable() else "?" for one in str(path))


def _paths(kept: list[KeptFile]) -> list[str]:
    return [printable_path(path) for path in dict.fromkeys(one.path for one in kept)]  # a reload may add a copy


def _part(name: str) -> str:
    return name.partition("/")[0]


def _matched(sources: Mapping[str, str], kept: list[KeptFile]) -> dict[str, KeptFile]:
    """Return the copy of each file that the header names, by that name, where there is one."""
    by_sha256 = defaultdict(list)
    for one in kept:
        by_sha256[one.sha256].append(one)
    matched = {}
    for name, sha256 in sources.items():
        below = PurePosixPath(name.partition("/")[2]).parts
        for one in by_sha256[sha256]:
            if _part(name) == _OPTION or one.path.parts[-len(below) :] == below:
                matched[name] = one
                break
    return matched


def _parts_without_copy(trace: Trace, matched: Mapping[str, KeptFile], with_file: str) -> list[str]:
    """Describe the parts of a run that are neither part of snr_sim nor fully copied."""
    trace_info, robot = trace.trace_info, f"the robot '{trace.header.robot}'"
    parts = {_part(name) for name in trace.header.sources} - {_OPTION}
    parts |= {"scenario", "robot", "controller"} if trace.header.scenario else {"program"}
    parts -= set(_REPLACED) if with_file else set()
    asked = {"scenario": trace_info.scenario, "controller": trace_info.controller, "program": trace_info.controller}
    without_copy = [
        part for part in parts if not (_has_copy(trace, part, matched, asked) or _is_of_kit(trace, part, asked))
    ]
    return [printable_path(asked.get(part, robot)) for part in sorted(without_copy)]


def _has_copy(trace: Trace, part: str, matched: Mapping[str, KeptFile], asked: Mapping[str, str]) -> bool:
    """Return whether there is a copy of every file of a part, also of the one that was requested by its path."""
    names = [name for name in trace.header.sources if _part(name) == part]
    paths = {str(matched[name].path) for name in names if name in matched}
    is_named = Path(asked.get(part, "")).is_absolute()
    return bool(names) and all(name in matched for name in names) and (not is_named or asked[part] in paths)


def _is_of_kit(trace: Trace, part: str, asked: Mapping[str, str]) -> bool:
    if _is_path_in_kit(asked.get(part, "")):
        return True
    robot = library.find_in_kit("robots", trace.header.robot)
    if part == "scenario":
        return library.find_in_kit("scenarios", trace.trace_info.scenario) is not None
    if part == "controller":
        return robot is not None and trace.trace_info.controller in library.controllers(robot)
    return part != "program" and robot is not None


def _lost_reloads(reloads: Mapping[int, Mapping[str, str]], kept: list[KeptFile]) -> list[str]:
    """Return the files of which a reload read a version that was not copied."""
    known = {one.sha256 for one in kept}
    names = {"/".join(one.path.parts[-2:]) for one in kept}
    read = {name for then in reloads.values() for name, sha256 in then.items() if sha256 not in known}
    return [printable_path(name) for name in sorted(read & names)]


def _is_path_in_kit(text: str) -> bool:
    return Path(text).is_absolute() and library.is_of_kit(Path(text))


def _option_paths(trace: Trace, matched: Mapping[str, KeptFile] | None = None) -> list[str]:
    """Return the files that options name and that have no copy."""
    names = [name for name in trace.header.sources if _part(name) == _OPTION and name not in (matched or {})]
    paths = [trace.header.options.get(name.removeprefix(library.OPTION_FILE), "") for name in names]
    return [printable_path(path) for path in paths if not _is_path_in_kit(path)]


def _options(
    run: Path, options: Mapping[str, str], matched: Mapping[str, KeptFile]
) -> tuple[dict[str, str], list[KeptFile]]:
    """Return a run's options with copies of the files that they name, and these copies."""
    copies = {name.removeprefix(library.OPTION_FILE): one for name, one in matched.items() if _part(name) == _OPTION}
    changed = {key: str(copy_of(run, one)) for key, one in copies.items() if key in options}
    return {**options, **changed}, list(copies.values())


def _has_changed(kept: KeptFile) -> bool:
    try:
        return kept.path.read_bytes() != kept.data
    except OSError:
        return True
