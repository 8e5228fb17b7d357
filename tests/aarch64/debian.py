"""Debian packages of another architecture or release, unpacked into a folder: nothing is installed, no root needed.

apt gets a state of its own (lists, cache, an empty list of installed packages) in a work folder, and takes packages
from the mirror that this machine's apt uses.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

KEYRING = Path("/usr/share/keyrings/debian-archive-keyring.gpg")
MIRROR = "SNR_DEBIAN_MIRROR"  # where packages come from, if this machine's apt is not to be asked

_SETTINGS = """\
APT::Architecture "{architecture}";
APT::Architectures {{ "{architecture}"; }};
APT::Install-Recommends "false";
APT::Sandbox::User "";
Acquire::Languages "none";
Dir::State "{state}";
Dir::State::lists "lists";
Dir::State::status "{state}/status";
Dir::Cache "{state}/cache";
Dir::Cache::archives "{state}/debs";
Dir::Etc::sourcelist "{state}/sources.list";
Dir::Etc::sourceparts "-";
Dir::Log "{state}";
"""


class Debian:
    """A release of Debian for one architecture.

    Args:
        work: a folder for apt's state.
        architecture: such as 'arm64'.
        release: such as 'bookworm'.
    """

    def __init__(self, work: Path, architecture: str, release: str) -> None:
        self._state = work.resolve() / f"apt-{release}-{architecture}"
        self._settings, self._debs = self._state / "apt.conf", self._state / "debs"
        self._is_updated = False
        for folder in ("lists/partial", "cache", "debs/partial"):
            (self._state / folder).mkdir(parents=True, exist_ok=True)
        (self._state / "status").touch()
        self._settings.write_text(_SETTINGS.format(architecture=architecture, state=self._state))
        (self._state / "sources.list").write_text(f"deb [signed-by={KEYRING}] {mirror()} {release} main\n")

    def unpack(self, packages: list[str], folder: Path, *, with_dependencies: bool = True) -> None:
        """Downloads packages and all they depend on, or just themselves, and unpacks them; once for each folder."""
        whole = folder / ".unpacked"
        if whole.exists() and whole.read_text().split() == packages:
            return
        shutil.rmtree(folder, ignore_errors=True)
        self.update()
        for old in self._debs.glob("*.deb"):
            old.unlink()
        if with_dependencies:
            self._apt("apt-get", "install", "-y", "--download-only", *packages)
        else:
            self._apt("apt-get", "download", *packages)
        folder.mkdir(parents=True)
        for deb in sorted(self._debs.glob("*.deb")):
            subprocess.run(["dpkg-deb", "-x", deb, folder], check=True)
        if not (folder / "lib").exists() and (folder / "usr/lib").exists():
            (folder / "lib").symlink_to("usr/lib")  # from trixie on; programs ask for their loader there
        whole.write_text(" ".join(packages))

    def update(self) -> None:
        """Asks the mirror what there is, once in the life of this object."""
        if not self._is_updated:
            self._apt("apt-get", "update")
            self._is_updated = True

    def depends(self, package: str) -> list[str]:
        """Returns what a package depends on itself, such as the kernel of today that 'linux-image-arm64' stands for."""
        self.update()
        lines = self._apt("apt-cache", "depends", package).splitlines()
        return [line.split()[1] for line in lines if line.strip().startswith("Depends:")]

    def _apt(self, *command: str) -> str:
        environment = {**os.environ, "APT_CONFIG": str(self._settings), "LC_ALL": "C"}
        done = subprocess.run(
            command, env=environment, cwd=self._debs, text=True, stdin=subprocess.DEVNULL, capture_output=True
        )
        if done.returncode:
            raise SystemExit(f"{' '.join(command[:2])} failed:\n{done.stdout}{done.stderr}")
        return done.stdout


def mirror() -> str:
    """Returns the address of the mirror that this machine's apt takes packages from; empty if it knows none."""
    if MIRROR in os.environ:
        return os.environ[MIRROR]
    listing = ["apt-get", "indextargets", "--format", "$(REPO_URI) $(ORIGIN) $(COMPONENT)", "Created-By: Packages"]
    for line in subprocess.run(listing, text=True, capture_output=True, check=True).stdout.splitlines():
        uri, _, rest = line.partition(" ")
        if rest == "Debian main" and "security" not in uri:
            return uri
    return ""


def what_to_do_first(packages: Iterable[str]) -> str:
    """Returns the command that installs what is missing here, or finds a mirror; empty if nothing is missing.

    Args:
        packages: that are missing for other reasons than this module's.
    """
    needs = {"apt": shutil.which("apt-get"), "dpkg": shutil.which("dpkg-deb"), KEYRING.stem: KEYRING.exists()}
    missing = [package for package, found in needs.items() if not found] + list(packages)
    if missing:
        return f"apt-get install --no-install-recommends {' '.join(missing)}"
    return "" if mirror() else f"apt-get update, or set {MIRROR}: apt here knows no mirror of Debian"
