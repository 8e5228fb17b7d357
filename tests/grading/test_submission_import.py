"""Submissions: accepted whole or refused with a reason for the student; nothing outside is ever read or written."""

import os
import random
import re
import shutil
import stat
import struct
import subprocess
import sys
import tracemalloc
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from hypothesis import strategies as st

from snr_sim.grading.batch import submission_import
from snr_sim.grading.batch.member_names import SubmissionRejectedError
from snr_sim.grading.batch.submission_import import ImportedSubmission, import_submission, remove

REQUIRED_FILES = ["depth_hold.py"]
CODE = b"def factories(robot):\n    return []\n"


def folder(tmp_path: Path, **files: bytes) -> Path:
    """A submission; in names __ stands for a dot, ___ for a slash."""
    given = tmp_path / "ada"
    for name, text in files.items():
        path = given / name.replace("___", "/").replace("__", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text)
    given.mkdir(exist_ok=True)
    return given


def zipped(tmp_path: Path, *entries: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    path = tmp_path / "ada.zip"
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, text in entries:
            archive.writestr(name, text)
    return path


def taken(tmp_path: Path, given: Path) -> ImportedSubmission:
    return import_submission(given, REQUIRED_FILES, tmp_path / "private")


def files_in(place: ImportedSubmission) -> dict[str, bytes]:
    return {
        str(path.relative_to(place.folder)): path.read_bytes() for path in place.folder.rglob("*") if path.is_file()
    }


def test_folder_is_copied_read_only(tmp_path: Path) -> None:
    place = taken(tmp_path, folder(tmp_path, depth_hold__py=CODE, parts___mixer__py=b"x = 1"))
    assert files_in(place) == {"depth_hold.py": CODE, "parts/mixer.py": b"x = 1"}
    assert place.notes == ()
    modes = [stat.S_IMODE(path.stat().st_mode) for path in [place.folder, *place.folder.rglob("*")]]
    assert all(mode & 0o222 == 0 for mode in modes)
    remove(place.folder)
    assert not place.folder.exists()


def test_archive_import_equals_folder_import(tmp_path: Path) -> None:
    one = taken(tmp_path, folder(tmp_path, depth_hold__py=CODE))
    other = import_submission(zipped(tmp_path, ("depth_hold.py", CODE)), REQUIRED_FILES, tmp_path / "other")
    assert files_in(one) == files_in(other)
    assert one.digest == other.digest


def test_digest_depends_on_names_and_contents(tmp_path: Path) -> None:
    digests = set()
    for i, (name, text) in enumerate([("a.py", b"1"), ("a.py", b"2"), ("b.py", b"1")]):
        given = zipped(tmp_path, ("depth_hold.py", CODE), (name, text))
        digests.add(import_submission(given, REQUIRED_FILES, tmp_path / str(i)).digest)
    assert len(digests) == 3


def test_single_enclosing_folder_is_removed(tmp_path: Path) -> None:
    given = zipped(
        tmp_path, ("lab2/my work/", b""), ("lab2/my work/depth_hold.py", CODE), ("lab2/my work/notes/a.txt", b"a"),
        ("__MACOSX/lab2/._depth_hold.py", b"litter"), ("lab2/.DS_Store", b"litter"),
    )  # fmt: skip
    assert sorted(files_in(taken(tmp_path, given))) == ["depth_hold.py", "notes/a.txt"]


def test_archive_alone_in_a_folder_is_unpacked(tmp_path: Path) -> None:
    given = folder(tmp_path)
    zipped(given, ("depth_hold.py", CODE))
    assert files_in(taken(tmp_path, given)) == {"depth_hold.py": CODE}


def test_pipe_named_as_an_archive_does_not_block(tmp_path: Path) -> None:
    given = folder(tmp_path)
    os.mkfifo(given / "hw.zip")
    with pytest.raises(SubmissionRejectedError, match="empty"):
        taken(tmp_path, given)


def test_archive_next_to_a_folder_is_not_unpacked(tmp_path: Path) -> None:
    given = folder(tmp_path, ada__zip=b"", depth_hold___notes__txt=b"x")
    with pytest.raises(SubmissionRejectedError, match=r"The lab wants depth_hold\.py"):
        taken(tmp_path, given)


def test_moved_up_files_do_not_collide_with_other_submissions(tmp_path: Path) -> None:
    archive = zipped(tmp_path, ("lab/depth_hold.py", CODE))
    (tmp_path / "private.top" / "inside").mkdir(parents=True)  # a submission may have this name
    assert files_in(taken(tmp_path, archive)) == {"depth_hold.py": CODE}


def test_backslashes_separate_path_parts(tmp_path: Path) -> None:
    given = zipped(tmp_path, ("lab2\\depth_hold.py", CODE), ("lab2\\more\\a.py", b"a"))
    assert sorted(files_in(taken(tmp_path, given))) == ["depth_hold.py", "more/a.py"]


def test_archive_with_dot_slash_names_equals_folder_import(tmp_path: Path) -> None:
    given = zipped(tmp_path, ("./", b""), ("./depth_hold.py", CODE), ("./parts/", b""), ("./parts//./mixer.py", b"x"))
    place = taken(tmp_path, given)
    assert files_in(place) == {"depth_hold.py": CODE, "parts/mixer.py": b"x"}
    assert place.notes == ()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bsdtar") is None, reason="bsdtar, the tar of Windows and macOS, is not installed")
def test_bsdtar_archive_equals_folder_import(tmp_path: Path) -> None:
    given = folder(tmp_path, depth_hold__py=CODE, parts___mixer__py=b"x = 1")
    subprocess.run(["bsdtar", "-a", "-cf", tmp_path / "hw.zip", "."], cwd=given, check=True)
    place = import_submission(tmp_path / "hw.zip", REQUIRED_FILES, tmp_path / "other")
    assert place.digest == taken(tmp_path, given).digest


def test_ignored_files_are_left_out(tmp_path: Path) -> None:
    given = folder(
        tmp_path, depth_hold__py=CODE, __git___config=b"x", depth_hold__pyc=b"x", __venv___a__py=b"x", a__py=b"a"
    )
    (given / "__pycache__").mkdir(parents=True)
    (given / "__pycache__" / "a.cpython-311.pyc").write_bytes(b"x")
    assert sorted(files_in(taken(tmp_path, given))) == ["a.py", "depth_hold.py"]


def test_recorded_runs_of_any_size_are_left_out(tmp_path: Path) -> None:
    given = folder(tmp_path, depth_hold__py=CODE)
    run = given / "first" / "lander_noisy-0-20261122-003519"
    run.mkdir(parents=True)
    for name in ("trace.jsonl", "view.rrd", "replayed.rrd"):
        with (run / name).open("wb") as file:
            file.truncate(submission_import.MAX_BYTES)
    (run / "result.json").write_bytes(b"{}")
    assert files_in(taken(tmp_path, given)) == {"depth_hold.py": CODE}


@pytest.mark.parametrize(
    ("given_name", "message"),
    [
        (
            "depth_hold.ipynb",
            "You gave depth_hold.ipynb; the lab wants depth_hold.py, a plain Python file: copy its cells into one.",
        ),
        ("depthhold.py", "You gave depthhold.py; the lab wants depth_hold.py. Rename it."),
        ("Depth_Hold.py", "You gave Depth_Hold.py; the lab wants depth_hold.py"),
        ("depth_hold (1).py", "You gave depth_hold (1).py; the lab wants"),
        ("src/depth_hold.py", "yours is in a folder: src/depth_hold.py. Put it at the top"),
        ("essay.txt", "which is not there. You gave: essay.txt, other.py."),
    ],
)
def test_missing_file_is_reported_with_the_closest_match(tmp_path: Path, given_name: str, message: str) -> None:
    given = zipped(tmp_path, (given_name, CODE), ("other.py", b""))
    with pytest.raises(SubmissionRejectedError) as refused:
        taken(tmp_path, given)
    assert message in refused.value.message
    assert refused.value.fix == "hand in depth_hold.py."
    assert not (tmp_path / "private").exists()


def test_nested_archive_is_rejected_with_its_name(tmp_path: Path) -> None:
    with pytest.raises(
        SubmissionRejectedError, match=r"You gave mine\.zip, an archive in an archive; the lab wants depth_hold\.py"
    ):
        taken(tmp_path, zipped(tmp_path, ("mine.zip", zipped(tmp_path, ("depth_hold.py", CODE)).read_bytes())))


def test_one_missing_file_of_two_is_a_note(tmp_path: Path) -> None:
    given = folder(tmp_path, depth_hold__py=CODE, test_dept_hold__py=b"")
    place = import_submission(given, ["depth_hold.py", "test_depth_hold.py"], tmp_path / "private")
    assert place.notes == ("You gave test_dept_hold.py; the lab wants test_depth_hold.py. Rename it.",)


def test_empty_submission_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(SubmissionRejectedError, match="empty"):
        taken(tmp_path, folder(tmp_path))
    with pytest.raises(SubmissionRejectedError, match="empty"):
        taken(tmp_path, zipped(tmp_path, ("a/", b"")))


# What points elsewhere


def test_links_are_left_out_with_a_note(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("s3cret")
    given = folder(tmp_path, depth_hold__py=CODE)
    (given / "data.txt").symlink_to(tmp_path / "secret")
    (given / "around").symlink_to("/")
    place = taken(tmp_path, given)
    assert files_in(place) == {"depth_hold.py": CODE}
    assert [note for note in place.notes if "symbolic link" in note] == list(place.notes)
    assert len(place.notes) == 2


def test_link_as_a_required_file_is_rejected(tmp_path: Path) -> None:
    given = folder(tmp_path, a__py=b"")
    (given / "depth_hold.py").symlink_to("/etc/passwd")
    with pytest.raises(SubmissionRejectedError, match="is a symbolic link"):
        taken(tmp_path, given)


def link(name: str, kind: int = stat.S_IFLNK) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.create_system = 3
    info.external_attr = (kind | 0o777) << 16
    return info


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFCHR, stat.S_IFIFO])
def test_links_and_devices_in_an_archive_are_left_out(tmp_path: Path, kind: int) -> None:
    place = taken(tmp_path, zipped(tmp_path, ("depth_hold.py", CODE), (link("evil", kind), b"/etc/passwd")))
    assert files_in(place) == {"depth_hold.py": CODE}
    assert "'evil' is" in place.notes[0]


def test_pipe_in_a_folder_does_not_block(tmp_path: Path) -> None:
    given = folder(tmp_path, depth_hold__py=CODE)
    os.mkfifo(given / "pipe")
    assert taken(tmp_path, given).notes == ("'pipe' is not a plain file and was left out.",)


@pytest.mark.parametrize(
    "name",
    [
        *("../../evil.py", "/tmp/evil.py", "a/../../evil.py", "..\\evil.py", "C:\\evil.py", "c:evil.py", "\\evil.py"),
        *("//evil.py", "\\\\server\\evil.py", "./../evil.py", "a/./../b.py", "z:/evil.py", "__pycache__/../../evil.py"),
    ],
)
def test_archive_with_outside_paths_is_rejected_as_a_whole(tmp_path: Path, name: str) -> None:
    with pytest.raises(SubmissionRejectedError, match="outside itself"):
        taken(tmp_path, zipped(tmp_path, ("depth_hold.py", CODE), (name, b"evil")))
    assert [path.name for path in tmp_path.rglob("*")] == ["ada.zip"]


def test_link_in_an_archive_is_noted_without_its_control_characters(tmp_path: Path) -> None:
    place = taken(tmp_path, zipped(tmp_path, ("depth_hold.py", CODE), (link("evil\x1b[2J"), b"/etc/passwd")))
    assert place.notes[0].isprintable()


@pytest.mark.parametrize("other", ["Parts/Mixer.py", "parts/mixer.py/more.py", "PARTS"])
def test_names_equal_up_to_case_are_rejected(tmp_path: Path, other: str) -> None:
    given = zipped(tmp_path, ("depth_hold.py", CODE), ("parts/mixer.py", b"1"), (other, b"2"))
    with pytest.raises(SubmissionRejectedError, match=r"the same name on many computers|twice"):
        taken(tmp_path, given)


def test_names_equal_up_to_unicode_normalisation_are_rejected(tmp_path: Path) -> None:
    given = folder(tmp_path, depth_hold__py=CODE)
    for name in ("caf\u00e9.py", "cafe\u0301.py"):
        (given / name).write_bytes(b"")
    with pytest.raises(SubmissionRejectedError, match="the same name on many computers"):
        taken(tmp_path, given)


NAME_PARTS = [
    *("", ".", "..", "...", "zz", "ZZ", "zz.py", "depth_hold.py", "tmp", " ", "C:", "c:x", "~", "é", "e\u0301"),
    *("\x1b[2J", "\n", "\u202e", "\ud800", "x" * 201, "*", "$(x)", "%2e%2e", "\uff0e\uff0e", "..\u200b", "%s", "\x00x"),
]
SEPARATORS = ["/", "\\", "//", "/./"]


any_part = st.sampled_from(NAME_PARTS) | st.text(st.characters(), max_size=12)


@hypothesis.given(st.builds(str.join, st.sampled_from(SEPARATORS), st.lists(any_part, max_size=9)))
def test_hostile_name_stays_inside_or_is_rejected(tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    try_name(tmp_path_factory.mktemp("name"), name)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(10))
def test_hostile_names_stay_inside_or_are_rejected(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    for number in range(10_000):
        parts = [rng.choice(NAME_PARTS) if rng.random() < 0.5 else random_part(rng) for _ in range(rng.randrange(10))]
        name = rng.choice(SEPARATORS).join(parts)
        box = tmp_path / str(number)
        box.mkdir()
        try_name(box, name)
        shutil.rmtree(box)


def random_part(rng: random.Random) -> str:
    """Return up to 12 characters: control characters, ASCII, Latin, or any that there are, halves too."""
    end = rng.choice([0x20, 0x80, 0x100, 0x3000, 0x110000])
    return "".join(chr(rng.randrange(end)) for _ in range(rng.randrange(13)))


def try_name(box: Path, name: str) -> None:
    """Import an honest file and one of this name, from a zip and from a folder; nothing may appear outside."""
    archive = box / "ada.zip"
    with zipfile.ZipFile(archive, "w") as packed:
        packed.writestr("depth_hold.py", CODE)
        with suppress(UnicodeEncodeError, IndexError), warnings.catch_warnings():  # half a character; no name at all
            warnings.simplefilter("ignore", UserWarning)  # the same name twice
            packed.writestr(name, b"hostile")
    parts = [part for part in name.replace("\0", "").split("/") if part not in ("", ".", "..")]
    folder(box, depth_hold__py=CODE)
    with suppress(UnicodeEncodeError, OSError):  # names that the file system does not permit
        file = Path(box, "ada", *parts)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.open("xb").close()
    before = everything_around(box, name)
    for submission in (archive, box / "ada"):
        (box / "place").mkdir()
        try:
            place = import_submission(submission, REQUIRED_FILES, box / "place" / "private")
        except SubmissionRejectedError as refused:
            assert refused.message.isprintable()
            assert refused.message.endswith(".")
            assert len(refused.message) < 1000
        else:
            assert files_in(place)["depth_hold.py"] == CODE
            assert all(note.isprintable() for note in place.notes)
            assert [one.name for one in (box / "place").iterdir()] == ["private"]
            remove(place.folder)
        (box / "place").rmdir()
        assert everything_around(box, name) == before


def everything_around(box: Path, name: str) -> list[tuple[Path, str]]:
    """Return where the files that hostile names could make are: in a folder, in all above it, in the current one."""
    parts = {*NAME_PARTS, *os.listdir(box), *re.split(r"[/\\]", name)}
    return [(one, name) for one in (box, *box.parents, Path.cwd()) for name in sorted(parts & set(os.listdir(one)))]


# A folder that changes while it is read


class Listed:
    """What `os.scandir` returns, read to its end beforehand."""

    def __init__(self, found: Iterator[os.DirEntry[str]]) -> None:
        self._entries = iter(list(found))

    def __enter__(self) -> "Listed":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def __iter__(self) -> "Listed":
        return self

    def __next__(self) -> os.DirEntry[str]:
        return next(self._entries)


@pytest.mark.parametrize("listing", [1, 2])
def test_folder_replaced_by_a_link_after_listing_is_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, listing: int
) -> None:
    given = folder(tmp_path, depth_hold__py=CODE, sub___a__py=b"a")
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "b.py").write_bytes(b"secret")
    scandir, listings = os.scandir, iter(range(1, 100))

    def scandir_then_swap(*place: Any) -> Listed:
        with scandir(*place) as found:
            listed = Listed(found)
        if next(listings) == listing:
            (given / "sub").rename(tmp_path / "away")
            (given / "sub").symlink_to(secret)
        return listed

    monkeypatch.setattr(os, "scandir", scandir_then_swap)
    place = taken(tmp_path, given)
    monkeypatch.undo()
    assert files_in(place) == {"depth_hold.py": CODE}
    assert "'sub'" in place.notes[0]


SWAP = """
import os, sys
while os.getppid() == int(sys.argv[1]):
    os.symlink("../secret", "link")
    os.rename("ada/sub", "away")
    os.rename("link", "ada/sub")
    os.unlink("ada/sub")
    os.rename("away", "ada/sub")
"""


@pytest.mark.slow
def test_folder_swapped_with_a_link_repeatedly_reads_no_secret(tmp_path: Path) -> None:
    given = folder(tmp_path, depth_hold__py=CODE, sub___deep___a__py=b"honest")
    (tmp_path / "secret" / "deep").mkdir(parents=True)
    (tmp_path / "secret" / "deep" / "a.py").write_bytes(b"secret")
    swapping = subprocess.Popen([sys.executable, "-c", SWAP, str(os.getpid())], cwd=tmp_path)
    try:
        for _ in range(1500):
            place = import_submission(given, REQUIRED_FILES, tmp_path / "private")
            assert b"secret" not in files_in(place).values()
            remove(place.folder)
        assert swapping.poll() is None
    finally:
        swapping.kill()
        swapping.wait()


# Too much


def test_archive_of_zeros_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(SubmissionRejectedError, match="hundreds of times"):
        taken(tmp_path, zipped(tmp_path, ("depth_hold.py", CODE), ("data", b"\0" * 20_000_000)))
    assert [path.name for path in tmp_path.rglob("*")] == ["ada.zip"]


def test_false_size_in_an_archive_is_rejected(tmp_path: Path) -> None:
    path = zipped(tmp_path, ("depth_hold.py", CODE), ("data", b"\0" * 20_000_000))
    data = path.read_bytes().replace(struct.pack("<I", 20_000_000), struct.pack("<I", 20))
    path.write_bytes(data)
    with pytest.raises(SubmissionRejectedError):
        taken(tmp_path, path)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_unusual_compression_method_is_rejected(tmp_path: Path, method: int) -> None:
    with pytest.raises(SubmissionRejectedError, match="unusual way"):
        taken(tmp_path, zipped(tmp_path, ("depth_hold.py", CODE), method=method))


def test_million_archive_entries_are_rejected_unread(tmp_path: Path) -> None:
    given = zipped(tmp_path, *((f"empty_file_number_{i}", b"") for i in range(8000)))
    with pytest.raises(SubmissionRejectedError, match="too many files"):
        taken(tmp_path, given)


def test_too_many_files_or_bytes_are_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SubmissionRejectedError, match="more than 500 files"):
        taken(tmp_path, zipped(tmp_path, ("depth_hold.py", CODE), *((f"{i}.py", b"") for i in range(500))))
    monkeypatch.setattr(submission_import, "MAX_BYTES", 2**20)
    with pytest.raises(SubmissionRejectedError, match="larger than 1 MB"):
        taken(tmp_path, folder(tmp_path, depth_hold__py=CODE, data__txt=os.urandom(2**20)))
    assert not (tmp_path / "private").exists()


def test_too_deeply_nested_file_is_left_out(tmp_path: Path) -> None:
    place = taken(tmp_path, folder(tmp_path, depth_hold__py=CODE, **{"___".join("abcdefghijkl"): b""}))
    assert files_in(place) == {"depth_hold.py": CODE}


# Files that are not archives, and names that are not text


@pytest.mark.parametrize(
    "data", [b"", b"PK\x03\x04", b"%PDF-1.7", random.Random(1).randbytes(3000)], ids=["empty", "zip", "pdf", "noise"]
)
def test_non_archive_is_rejected(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "ada.zip"
    path.write_bytes(data)
    with pytest.raises(SubmissionRejectedError, match="not a zip archive"):
        taken(tmp_path, path)


def test_damaged_archive_is_rejected_or_read_correctly(tmp_path: Path) -> None:
    whole = zipped(tmp_path, ("depth_hold.py", CODE * 20), ("a.py", b"a = 1")).read_bytes()
    path = tmp_path / "damaged.zip"
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        try:
            found = files_in(import_submission(path, REQUIRED_FILES, tmp_path / "private"))
        except SubmissionRejectedError:
            assert not (tmp_path / "private").exists()
            continue
        remove(tmp_path / "private")
        assert found["depth_hold.py"] == CODE * 20


@pytest.mark.parametrize("name", ["depth_hold.py", "a"])
def test_duplicate_name_is_rejected(name: str, tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate"):
        given = zipped(tmp_path, ("depth_hold.py", CODE), (name, CODE), (name, b"other"))
    with pytest.raises(SubmissionRejectedError, match="twice"):
        taken(tmp_path, given)


def test_encrypted_archive_is_rejected(tmp_path: Path) -> None:
    path = zipped(tmp_path, ("depth_hold.py", CODE))
    data = bytearray(path.read_bytes())
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    with pytest.raises(SubmissionRejectedError, match="password"):
        taken(tmp_path, path)


def test_non_text_names_are_left_out_and_escaped_in_notes(tmp_path: Path) -> None:
    given = folder(tmp_path, depth_hold__py=CODE)
    (given / os.fsdecode(b"\xff\xfe.py")).write_bytes(b"")
    (given / "clear\x1b[2J.py").write_bytes(b"")
    place = taken(tmp_path, given)
    assert files_in(place) == {"depth_hold.py": CODE}
    assert all(note.isprintable() for note in place.notes)
    assert len(place.notes) == 2


def test_archive_is_read_with_bounded_memory(tmp_path: Path) -> None:
    """Its largest read is bounded, so its unpacked content is never in memory as a whole."""
    given = zipped(tmp_path, ("depth_hold.py", CODE), ("data", os.urandom(8_000_000)))
    tracemalloc.start()
    taken(tmp_path, given)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < 2_000_000
