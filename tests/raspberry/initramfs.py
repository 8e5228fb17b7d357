"""The first file system of a kernel (initramfs): a cpio archive in the format 'newc', written without root.

Source: Linux, Documentation/driver-api/early-userspace/buffer-format.rst.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

_MAGIC = b"070701"


class Initramfs:
    """Puts files into an archive. Not compressed: an emulated processor takes longer to unpack than this one to load.

    Args:
        out: an open file that it is written to.
    """

    def __init__(self, out: BinaryIO) -> None:
        self._out = out
        self._count = 0
        self._folders = {""}

    def finish(self) -> None:
        """Ends it."""
        self._entry("TRAILER!!!", 0, b"", 0)

    def folder(self, name: str) -> None:
        """Adds a folder, with those it is in."""
        name = name.strip("/")
        if name not in self._folders:
            self.folder(name.rpartition("/")[0])
            self._folders.add(name)
            self._entry(name, stat.S_IFDIR | 0o755, b"", 0)

    def file(self, name: str, data: bytes, *, mode: int = 0o644, time_s: int = 0) -> None:
        """Adds a file."""
        self.folder(name.strip("/").rpartition("/")[0])
        self._entry(name.strip("/"), stat.S_IFREG | mode, data, time_s)

    def link(self, name: str, target: str) -> None:
        """Adds a symbolic link."""
        self.folder(name.strip("/").rpartition("/")[0])
        self._entry(name.strip("/"), stat.S_IFLNK | 0o777, target.encode(), 0)

    def tree(self, folder: Path, name: str, left_out: Iterable[str] = ()) -> None:
        """Adds all that is in a folder.

        Args:
            folder: of this computer.
            name: where it is to be.
            left_out: paths in it, of folders or files, that are not needed.
        """
        without = {folder / one for one in left_out}
        for here, folders, files in os.walk(folder):
            top = Path(here)
            there = f"{name}/{top.relative_to(folder)}".removesuffix("/.")
            folders[:] = sorted(one for one in folders if top / one not in without)
            for one in [*folders, *sorted(files)]:
                path = top / one
                if path in without:
                    continue
                if path.is_symlink():
                    self.link(f"{there}/{one}", str(Path(path).readlink()))
                elif path.is_dir():
                    self.folder(f"{there}/{one}")
                elif path.is_file():
                    about = path.stat()
                    # Python believes its bytecode as long as the source's time is the one it was made from.
                    self.file(
                        f"{there}/{one}", path.read_bytes(), mode=about.st_mode & 0o777, time_s=int(about.st_mtime)
                    )

    def _entry(self, name: str, mode: int, data: bytes, time_s: int) -> None:
        self._count += 1
        named = name.encode() + b"\0"
        fields = (self._count, mode, 0, 0, 1, time_s, len(data), 0, 0, 0, 0, len(named), 0)
        head = _MAGIC + b"".join(b"%08X" % field for field in fields) + named
        self._out.write(head + bytes(-len(head) % 4) + data + bytes(-len(data) % 4))


def modules_in_order(folder: Path, names: list[str]) -> list[Path]:
    """Returns the files of kernel modules and of those they need, each after what it needs.

    Args:
        folder: with a kernel's modules, not compressed.
        names: with '-' or '_', which are the same to the kernel.
    """
    found = {path.stem.replace("-", "_"): path for path in folder.rglob("*.ko")}
    ordered: list[Path] = []

    def add(name: str) -> None:
        path = found.get(name.replace("-", "_"))
        if path is None:
            return  # built into the kernel
        data = path.read_bytes()
        at = data.index(b"\0depends=") + len(b"\0depends=")
        for needed in data[at : data.index(b"\0", at)].decode().split(","):
            add(needed)
        if path not in ordered:
            ordered.append(path)

    for name in names:
        add(name)
    return ordered
