"""The folder of a class: the job, the submissions completed so far, and nothing half done.

    class.json                 the lab, its digest, version, secret's digest; the submissions and their names
    secret                     from which hidden cases are drawn, if none was given (mode 0600)
    results/<name>.json        the record of a submission; it is there exactly if the submission is done
    students/<name>/           its reports, and the recorded runs of visible cases
    class.csv ...              made at the end

A submission's reports are written first and its record last, so after an interruption at any point a submission is
either done or not begun. One process at a time works in the folder; a lock that ends with the process ensures it.

A different lab, version, secret or isolation is refused by `--resume`. A submission that has changed, or that ended as
`grader_error`, is graded again.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import msgspec

from snr_sim.grading.batch.submission_import import remove
from snr_sim.grading.batch.submissions import Submission
from snr_sim.grading.reports.results import Graded
from snr_sim.prelude.errors import SnrError
from snr_sim.prelude.values import JSON_ERRORS
from snr_sim.recording.atomic_files import sync_folder, write_atomic

MIN_SECRET_BYTES = 16
_PRIVATE_PREFIX = "snr_grade_"
_REMOVE_TIMEOUT_S = 2.0
_FIRST_FILES = {".lock", "secret", ".secret.part", ".class.json.part"}  # all of a run that was killed before it began
_FINAL_FILES = ("class.csv", "cases.csv", "leaderboard.csv", "distribution.png")


class ClassSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What must be the same for marks to be of one class."""

    lab: str
    lab_digest: str  # over all its files
    version: str  # of snr_sim
    secret_digest: str  # which does not reveal the secret
    isolation: str  # "required" or "none"


class _Manifest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    settings: ClassSettings
    submissions: list[tuple[str, str]]


class _SavedResult(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    digest: str
    graded: Graded


_decode_manifest = msgspec.json.Decoder(_Manifest).decode
_decode_saved = msgspec.json.Decoder(_SavedResult).decode


class ClassFolder:
    """A class's folder, made if it is not there, and opened to work in.

    Raises:
        SnrError: it holds results and is not resumed, another process works in it, or it cannot be written.
    """

    def __init__(self, path: Path, is_resumed: bool) -> None:
        self.path: Path = path
        self._manifest: _Manifest | None = None
        try:
            path.mkdir(mode=0o700, parents=True, exist_ok=True)  # its tables contain hidden cases
            if not (path / "class.json").is_file() and {entry.name for entry in path.iterdir()} - _FIRST_FILES:
                raise SnrError(f"{path} contains files that are not results.", fix="name a new folder with --out.")
            if (path / "class.json").exists() and not is_resumed:
                raise SnrError(
                    f"{path} already contains the results of a class.",
                    fix="continue with --resume, or name a new folder with --out.",
                )
            self._lock = os.open(path / ".lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            raise SnrError(f"{path} cannot be written: {error.strerror}.", fix="name another folder.") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._lock)
            raise SnrError(f"Another snr grade uses {path}.", fix="wait for it, or name another folder.") from error
        try:
            self._tidy_up()
            self._manifest = self._read_manifest()
            self.private_folder: Path = self._make_private_folder()
        except BaseException:
            os.close(self._lock)
            raise

    def _tidy_up(self) -> None:
        """Remove the files that a killed process has left."""
        left = Path(os.pread(self._lock, 4096, 0).decode(errors="replace"))
        is_private = left.name.startswith(_PRIVATE_PREFIX) and left.is_absolute() and left.is_dir()
        if is_private and left.stat().st_uid == os.getuid():
            remove(left)
        shutil.rmtree(self.path / ".staged", ignore_errors=True)
        for folder in (self.path, self.path / "results"):
            for part in folder.glob(".*.part"):
                part.unlink(missing_ok=True)

    def _make_private_folder(self) -> Path:
        """Return a private folder for submissions: no other user can list it, but a sandbox's user can enter it."""
        private_folder = Path(tempfile.mkdtemp(prefix=_PRIVATE_PREFIX))
        try:
            private_folder.chmod(stat.S_IRWXU | stat.S_IXGRP | stat.S_IXOTH)
            os.ftruncate(self._lock, 0)
            os.pwrite(self._lock, os.fsencode(private_folder), 0)
        except OSError:  # the disk of the class's folder is full
            remove(private_folder)
            raise
        return private_folder

    def _read_manifest(self) -> _Manifest | None:
        try:
            return _decode_manifest((self.path / "class.json").read_bytes())
        except FileNotFoundError:
            return None
        except (OSError, *JSON_ERRORS) as error:
            raise SnrError(f"{self.path / 'class.json'} cannot be read: {error}.", fix="name a new folder.") from error

    def close(self) -> None:
        """Leave it, and remove the private folder. Safe to call twice.

        Whatever writes into the private place has ended: all threads, and all workers.
        """
        if self._lock < 0:
            return
        _remove_wholly(self.private_folder)
        if not self.private_folder.exists():  # else the next run in this folder removes it
            os.ftruncate(self._lock, 0)
        os.close(self._lock)
        self._lock = -1

    @property
    def known(self) -> list[Submission]:
        """The submissions that it was asked for before, by name."""
        return [Submission(name, Path(given)) for name, given in self._manifest.submissions] if self._manifest else []

    def secret(self, given: Path | None) -> tuple[bytes, bool]:
        """Return the secret, and whether it was made just now; errors as of `read_secret`."""
        path = given or self.path / "secret"
        is_made = given is None and not path.exists()
        if is_made:
            write_atomic(path, new_secret() + b"\n", mode=0o600)
        return read_secret(path), is_made

    def begin(self, settings: ClassSettings, submissions: Sequence[Submission]) -> None:
        """Store the job, and remove the files of an earlier end; raise SnrError if it was begun with other terms."""
        if self._manifest is not None and self._manifest.settings != settings:
            before = msgspec.structs.asdict(self._manifest.settings)
            now = msgspec.structs.asdict(settings)
            raise SnrError(
                f"{self.path} was started with another {_changed(before, now)}: the marks would not be comparable.",
                fix="grade into a new folder with --out, or restore what has changed.",
            )
        for name in _FINAL_FILES:
            (self.path / name).unlink(missing_ok=True)
        every = {one.id: (one.id, str(one.given)) for one in [*self.known, *submissions]}
        self._manifest = _Manifest(settings, list(every.values()))
        # Before the folders: it identifies the folder as a class's if the process is killed here.
        write_atomic(self.path / "class.json", msgspec.json.format(msgspec.json.encode(self._manifest), indent=1))
        for folder in ("results", "students", ".staged"):
            (self.path / folder).mkdir(exist_ok=True)

    def done(self, name: str, digest: str) -> Graded | None:
        """Return the result of a submission, if it is done and still the same."""
        kept = self._kept(name)
        return kept.graded if kept is not None and kept.digest == digest else None

    def every_result(self) -> Iterator[Graded]:
        """Yield the results, one by one, in the order of the submissions."""
        for name, _ in self._manifest.submissions if self._manifest else []:
            kept = self._kept(name)
            if kept is not None:
                yield kept.graded

    def _kept(self, name: str) -> _SavedResult | None:
        try:
            return _decode_saved((self.path / "results" / f"{name}.json").read_bytes())
        except (OSError, *JSON_ERRORS):
            return None

    def stage(self, name: str) -> Path:
        """Return an empty folder in which a submission's reports can be made."""
        folder = self.path / ".staged" / name
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return folder

    def keep(self, graded: Graded, digest: str, reports: Mapping[str, str]) -> None:
        """Write a result: the reports and other staged files, then the record that marks it as done."""
        staged = self.path / ".staged" / graded.submission
        staged.mkdir(exist_ok=True)
        for name, text in reports.items():
            write_atomic(staged / name, text.encode())
        final = self.path / "students" / graded.submission
        (self.path / "results" / f"{graded.submission}.json").unlink(missing_ok=True)
        shutil.rmtree(final, ignore_errors=True)
        staged.rename(final)
        sync_folder(final.parent)
        record = msgspec.json.encode(_SavedResult(digest, graded), order="deterministic")
        write_atomic(self.path / "results" / f"{graded.submission}.json", record + b"\n", mode=0o600)


def _remove_wholly(private_folder: Path) -> None:
    """Remove a folder, and files that a dying program adds meanwhile."""
    # The kernel kills a student's process with the worker that started it, but the grader cannot wait for a process
    # that is not its child. Such a process may finish one system call, and a folder with a new file is not removed.
    give_up_s = time.monotonic() + _REMOVE_TIMEOUT_S
    remove(private_folder)
    while private_folder.exists() and time.monotonic() < give_up_s:
        time.sleep(0.01)
        remove(private_folder)


def new_secret() -> bytes:
    """Return a new secret."""
    return secrets.token_hex(32).encode()


def read_secret(path: Path) -> bytes:
    """Return the secret in a file; raise SnrError if it cannot be read, or is so short that it could be guessed."""
    try:
        secret = path.read_bytes().strip()
    except OSError as error:
        raise SnrError(f"The secret {path} cannot be read: {error.strerror}.", fix="--secret FILE.") from error
    if len(secret) < MIN_SECRET_BYTES:
        raise SnrError(
            f"The secret in {path} has {len(secret)} bytes: it could be guessed, and with it the hidden cases.",
            fix="leave --secret out, and one is made; keep it for next time.",
        )
    return secret


def _changed(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    words = {"lab_digest": "version of the lab", "version": "version of snr_sim", "secret_digest": "secret"}
    name = next(name for name in now if before[name] != now[name])
    shown = f" ({before[name]}, now {now[name]})" if name in ("lab", "version", "isolation") else ""
    return words.get(name, name) + shown


def digest_of_secret(secret: bytes) -> str:
    """Return a digest of a secret, which shows only whether two secrets are the same."""
    return hashlib.sha256(b"snr_sim grading\0" + secret).hexdigest()[:32]
