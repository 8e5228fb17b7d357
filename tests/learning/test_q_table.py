"""A table and its file: the chosen action, saving and loading, and files that are rejected."""

import io
import json
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from snr_sim.learning.discretiser import Discretiser
from snr_sim.learning.q_table import QTable
from snr_sim.prelude.errors import ParameterError, RecordingError

GRID = Discretiser(("x",), ((0.0, 1.0),))


def table() -> QTable:
    made = QTable(GRID, ("left", "right"), "toy/Line-v0")
    made.values[:] = [[-1.0, -2.0], [0.5, 0.25], [3.0, 3.0]]
    made.visits[:] = [[4, 1], [1, 1], [1, 1]]
    return made


def test_best_returns_first_of_equal_actions() -> None:
    assert [table().act([x]) for x in (-5.0, 0.5, 5.0)] == [0, 0, 0]
    other = table()
    other.values[1] = 0.1, 0.2
    assert other.act([0.5]) == 1


def test_best_ignores_untried_actions() -> None:
    fresh = table()
    fresh.values[0], fresh.visits[0] = (-1.0, 0.0), (4, 0)
    assert fresh.act([-5.0]) == 0


def test_loaded_table_equals_saved_one_bitwise(tmp_path: Path) -> None:
    mine = table()
    mine.made_by = "by hand"
    mine.save(tmp_path / "policy.npz")
    back = QTable.load(tmp_path / "policy.npz", "toy/Line-v0")
    assert (back.values == mine.values).all()
    assert (back.visits == mine.visits).all()
    assert (back.discretiser, back.actions, back.environment, back.made_by) == (
        GRID,
        mine.actions,
        "toy/Line-v0",
        "by hand",
    )


def test_table_of_other_environment_raises(tmp_path: Path) -> None:
    table().save(tmp_path / "policy.npz")
    with pytest.raises(RecordingError, match="was learned in toy/Line-v0, not in snr_sim/LanderVertical-v0"):
        QTable.load(tmp_path / "policy.npz", "snr_sim/LanderVertical-v0")


class Bomb:
    """Unpickled, it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return (open, (str(self.path), "w"))


def test_pickle_raises_and_is_not_opened(tmp_path: Path) -> None:
    trace = tmp_path / "it_ran"
    (tmp_path / "plain.npz").write_bytes(pickle.dumps(Bomb(trace)))
    array = np.empty(1, object)
    array[0] = Bomb(trace)
    np.savez(tmp_path / "inside.npz", about=array, values=array, visits=array)
    for name in ("plain.npz", "inside.npz"):
        with pytest.raises(RecordingError, match="is not a table of action values"):
            QTable.load(tmp_path / name)
    assert not trace.exists()


@pytest.mark.parametrize("length", [0, 10, 100, -30])
def test_truncated_file_raises(length: int, tmp_path: Path) -> None:
    path = tmp_path / "policy.npz"
    table().save(path)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(RecordingError, match="is not a table of action values"):
        QTable.load(path)


def rewritten(path: Path, **arrays: Any) -> None:
    """Replaces arrays of a table's file."""
    table().save(path)
    with np.load(path) as whole:
        kept = {name: whole[name] for name in whole.files}
    np.savez(path, **{**kept, **arrays})


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        (
            {"values": np.zeros((2, 2))},
            r"'values' is float64 of shape \(2, 2\), its edges and actions make float64 of shape \(3, 2\)",
        ),
        ({"visits": np.zeros((3, 2))}, "'visits' is float64"),
        ({"values": np.full((3, 2), np.nan)}, "not finite"),
        ({"about": np.frombuffer(b'{"environment": "x"}', np.uint8)}, "is not a table"),
        ({"about": np.frombuffer(b"not json", np.uint8)}, "is not a table"),
    ],
)
def test_inconsistent_file_raises(arrays: dict[str, Any], message: str, tmp_path: Path) -> None:
    rewritten(tmp_path / "policy.npz", **arrays)
    with pytest.raises(RecordingError, match=message):
        QTable.load(tmp_path / "policy.npz")


def test_oversized_archive_raises_before_unpacking(tmp_path: Path) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("values.npy", bytes(300 * 2**20))
    (tmp_path / "bomb.npz").write_bytes(packed.getvalue())
    with pytest.raises(RecordingError, match="holds 314572800 bytes"):
        QTable.load(tmp_path / "bomb.npz")


def header(shape: str, descr: str = "<f8") -> bytes:
    """The beginning of an array's file."""
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def with_member(path: Path, name: str, data: bytes, packing: int = zipfile.ZIP_DEFLATED) -> None:
    """Writes a table's file with another member in place of one of its own."""
    table().save(path)
    with zipfile.ZipFile(path) as archive:
        kept = {info.filename: archive.read(info) for info in archive.infolist()}
    with zipfile.ZipFile(path, "w", packing) as archive:
        for member, content in {**kept, name: data}.items():
            archive.writestr(member, content)


@pytest.mark.parametrize(
    ("data", "packing"),
    [
        (header("(10000000000000,)"), zipfile.ZIP_DEFLATED),  # more memory than any computer has
        (header("(-3, 2)"), zipfile.ZIP_DEFLATED),
        (header("(3, 2)", "|O") + pickle.dumps([1]), zipfile.ZIP_DEFLATED),
        (header("(3, 2)", "<f16") + bytes(96), zipfile.ZIP_DEFLATED),
        (header("(3, 2)") + bytes(40), zipfile.ZIP_DEFLATED),  # a number too few
        (header("(3, 2)") + bytes(49), zipfile.ZIP_DEFLATED),  # a byte too many
        (header("((((("), zipfile.ZIP_DEFLATED),
        (b"", zipfile.ZIP_DEFLATED),
        (header("(3, 2)") + bytes(48), zipfile.ZIP_BZIP2),
    ],
)
def test_array_with_wrong_header_raises(data: bytes, packing: int, tmp_path: Path) -> None:
    with_member(tmp_path / "policy.npz", "values.npy", data, packing)
    with pytest.raises(RecordingError, match="is not a table of action values"):
        QTable.load(tmp_path / "policy.npz")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"edges": [list(range(30000)), list(range(30000))], "names": ["x", "y"]}, "numbers are more than"),
        ({"edges": [list(range(3000))] * 6, "names": list("abcdef")}, "numbers are more than"),
        ({"edges": [[1.0, 0.0]]}, "do not grow"),
        ({"edges": [[0.0, 1.0], [2.0]]}, "1 names for 2 lists"),
        ({"edges": [["a"]]}, "is not a table"),
        ({"actions": []}, "nothing to choose"),
        ({"environment": 3}, "is not a table"),
        ({"version": 2}, "has version 2; this kit reads 1"),
    ],
)
def test_requested_size_is_checked_before_allocation(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    about = {"environment": "toy", "names": ["x"], "edges": [[0.0, 1.0]], "actions": ["left", "right"], "version": 1}
    rewritten(tmp_path / "policy.npz", about=np.frombuffer(json.dumps({**about, **changes}).encode(), np.uint8))
    with pytest.raises(RecordingError, match=message):
        QTable.load(tmp_path / "policy.npz")


def test_negative_visits_raise(tmp_path: Path) -> None:
    rewritten(tmp_path / "policy.npz", visits=np.full((3, 2), -1))
    with pytest.raises(RecordingError, match="visits below 0"):
        QTable.load(tmp_path / "policy.npz")


def test_non_regular_file_raises_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.npz")
    (tmp_path / "folder.npz").mkdir()
    for path in (tmp_path / "fifo.npz", tmp_path / "folder.npz", Path("/dev/zero")):
        with pytest.raises(RecordingError, match="is not a regular file"):
            QTable.load(path)


@pytest.mark.slow
def test_any_changed_byte_gives_table_or_recording_error(tmp_path: Path) -> None:
    """Every byte, to one of 255 others: most are noticed by the check sums, the rest change nothing that matters."""
    path, whole = tmp_path / "policy.npz", table()
    whole.save(path)
    good, rng = path.read_bytes(), np.random.default_rng(0)
    refused = 0
    for place in [*range(len(good))] * 3:
        damaged = bytearray(good)
        damaged[place] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        try:
            back = QTable.load(path)
        except RecordingError as error:
            refused += 1
            assert error.fix
        else:
            assert (back.values == whole.values).all()
            assert (back.visits == whole.visits).all()
            assert back.discretiser == GRID
    assert len(good) > 600
    assert refused > len(good)


NAMES, ACTIONS = ("altitude_m", "velocity_mps"), ("off", "low", "half", "full")
EDGES = {"altitude_m": (10.0, 100.0), "velocity_mps": (-5.0, 0.0), "fuel_kg": (1.0,)}


@pytest.mark.parametrize(
    ("names", "actions", "message"),
    [
        (NAMES, "abcdefgh", r"is a table of 8 actions \(a, b, .*\); what flies has 4 \(off, low, half, full\)"),
        (NAMES, "ab", "is a table of 2 actions"),
        (NAMES[::-1], "abcd", "is a table over velocity_mps, altitude_m; what flies observes altitude_m, velocity_mps"),
        (NAMES[:1], "abcd", "is a table over altitude_m; what"),
        ((*NAMES, "fuel_kg"), "abcd", "is a table over altitude_m, velocity_mps, fuel_kg; what"),
    ],
)
def test_table_with_other_names_or_actions_raises_at_load(
    names: tuple[str, ...], actions: str, message: str, tmp_path: Path
) -> None:
    QTable(Discretiser(names, tuple(EDGES[name] for name in names)), actions, "toy").save(tmp_path / "policy.npz")
    QTable.load(tmp_path / "policy.npz", "toy")
    with pytest.raises(RecordingError, match=message):
        QTable.load(tmp_path / "policy.npz", "toy", NAMES, ACTIONS)


def test_missing_file_and_missing_folder_raise(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="There is no file"):
        QTable.load(tmp_path / "none.npz")
    with pytest.raises(RecordingError, match="cannot be written") as error:
        table().save(tmp_path / "no" / "folder.npz")
    assert error.value.fix == "name a file in a folder that is there."


def test_full_disk_keeps_previous_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    table().save(tmp_path / "q.npz")
    before = (tmp_path / "q.npz").read_bytes()
    monkeypatch.setattr("os.fsync", fails)
    with pytest.raises(RecordingError, match="No space left on device"):
        table().save(tmp_path / "q.npz")
    assert (tmp_path / "q.npz").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


def test_single_action_raises() -> None:
    with pytest.raises(ParameterError, match="nothing to choose"):
        QTable(GRID, ("only",), "toy/Line-v0")
