"""Build tools of the emulator, and messages for missing ones."""

import shutil
from pathlib import Path

import pytest

from snr_sim.devices.emulated import toolchain
from snr_sim.devices.emulated.toolchain import ToolsMissingError, firmware_elf, require_tools, runner_library
from snr_sim.prelude.errors import DeviceError

FIRMWARE = Path(__file__).parents[3] / "robots" / "urov" / "firmware"
MCU = "atmega328p"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "snr_sim" / "emulated"


@pytest.mark.usefixtures("cache")
def test_toolchain_missing_compiler_names_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    for ask in (require_tools, runner_library, lambda: firmware_elf(FIRMWARE, MCU)):
        with pytest.raises(ToolsMissingError, match=r"avr-gcc") as caught:
            ask()
        assert "sudo apt install" in str(caught.value)
        assert "gcc-avr" in str(caught.value)


@pytest.mark.usefixtures("cache")
def test_toolchain_missing_simavr_raises_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(toolchain, "_INCLUDE", (tmp_path,))
    with pytest.raises(ToolsMissingError, match="simavr's headers"):
        runner_library()


@pytest.mark.slow
@pytest.mark.usefixtures("emulators")
def test_toolchain_reuses_cached_files(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = runner_library(), firmware_elf(FIRMWARE, MCU)
    assert all(path.parent == cache for path in made)
    monkeypatch.setenv("PATH", "")
    assert (runner_library(), firmware_elf(FIRMWARE, MCU)) == made
    assert sorted(path.name for path in cache.iterdir()) == sorted(path.name for path in made)


@pytest.mark.usefixtures("emulators")
def test_toolchain_unwritable_cache_suggests_xdg_cache_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(DeviceError, match=r"cannot be compiled into .*/file/snr_sim/emulated: Not a directory") as e:
        firmware_elf(FIRMWARE, MCU)
    assert "XDG_CACHE_HOME=FOLDER" in e.value.fix


@pytest.mark.slow
@pytest.mark.usefixtures("emulators", "cache")
def test_toolchain_full_disk_suggests_freeing_space(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    for tool in ("gcc", "make", "avr-gcc", "avr-objcopy"):
        (folder / tool).write_text("#!/bin/sh\necho 'ld: final close failed: No space left on device' >&2\nexit 1\n")
        (folder / tool).chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    with pytest.raises(DeviceError, match="No space left on device") as e:
        firmware_elf(FIRMWARE, MCU)
    assert e.value.fix.startswith("make room in ")


@pytest.mark.slow
@pytest.mark.usefixtures("emulators", "cache")
def test_toolchain_changed_source_or_settings_recompiles(tmp_path: Path) -> None:
    folder = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, folder)
    first = firmware_elf(folder, MCU)
    source = folder / "esc.c"
    source.write_text(source.read_text() + "/* changed */\n")
    assert len({first, firmware_elf(folder, MCU), firmware_elf(folder, MCU, {"PERIOD_MS": 20})}) == 3


@pytest.mark.slow
@pytest.mark.usefixtures("emulators")
def test_toolchain_compile_error_names_line_and_caches_nothing(tmp_path: Path, cache: Path) -> None:
    folder = tmp_path / "firmware"
    shutil.copytree(FIRMWARE, folder)
    (folder / "esc.c").write_text("int main(void) { return nonsense; }\n")
    with pytest.raises(DeviceError, match=r"esc\.c:1:.*nonsense"):
        firmware_elf(folder, MCU)
    assert list(cache.iterdir()) == []


def test_firmware_elf_empty_folder_raises_device_error(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="no firmware"):
        firmware_elf(tmp_path, MCU)
