"""The wheel is found, the bridge compiled once, and what is missing is said in one line with what to do."""

import importlib.metadata
import os
import platform
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from dotmask.errors import SlamError
from dotmask.slam.rtabmap import library


class Wheel:
    """An installed `depthai` as far as the library looks at it."""

    def __init__(self, root: Path, version: str = library.DEPTHAI_VERSION) -> None:
        self.version, self._root = version, root
        self.files = [importlib.metadata.PackagePath("depthai.libs/libdepthaicore-1234.so")]

    def locate_file(self, file: importlib.metadata.PackagePath) -> Path:
        return self._root / file


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An x86-64 Linux with a wheel, an empty cache, and a compiler that notes that it was called."""
    monkeypatch.setattr(platform, "system", lambda: "Linux")
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    core = tmp_path / "site/depthai.libs/libdepthaicore-1234.so"
    core.parent.mkdir(parents=True)
    core.touch()
    monkeypatch.setattr(importlib.metadata, "distribution", lambda name: Wheel(tmp_path / "site"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_compiler(tmp_path, 'echo called >> "$CALLS"; while [ "$1" != -o ]; do shift; done; echo compiled > "$2"')
    monkeypatch.setenv("CXX", str(tmp_path / "compiler"))
    monkeypatch.setenv("CALLS", str(tmp_path / "calls"))
    return tmp_path


def write_compiler(folder: Path, script: str) -> None:
    path = folder / "compiler"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def test_the_bridge_is_compiled_once(machine: Path) -> None:
    first, second = library.find_libraries(), library.find_libraries()
    assert first == second
    assert Path(first.core).name == "libdepthaicore-1234.so"
    assert Path(first.bridge).read_text() == "compiled\n"
    assert Path(first.bridge).parent == machine / "cache/dotmask"
    assert (machine / "calls").read_text() == "called\n"
    assert [p.name for p in (machine / "cache/dotmask").iterdir()] == [Path(first.bridge).name], "nothing is left over"


def test_another_version_or_other_flags_are_another_bridge(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bridges = {library.find_libraries().bridge}
    monkeypatch.setattr(library, "FLAGS", (*library.FLAGS, "-g"))
    bridges.add(library.find_libraries().bridge)
    monkeypatch.setattr(library, "DEPTHAI_VERSION", "9.9.9")
    monkeypatch.setattr(importlib.metadata, "distribution", lambda name: Wheel(machine / "site", "9.9.9"))
    bridges.add(library.find_libraries().bridge)
    assert len(bridges) == 3


def test_the_home_folder_has_the_cache_where_nothing_else_is_said(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(machine / "home"))
    assert Path(library.find_libraries().bridge).parent == machine / "home/.cache/dotmask"


def test_a_bridge_that_another_process_has_loaded_is_not_written_into(machine: Path) -> None:
    """Who was second renames its own file; the pages of the first stay as they are."""
    path = machine / "cache/dotmask/bridge.so"
    library._compile(b"", path)
    with path.open() as loaded:
        library._compile(b"", path)
        assert os.fstat(loaded.fileno()).st_ino != path.stat().st_ino


def test_two_processes_at_once_both_get_a_whole_bridge(machine: Path) -> None:
    """Each compiler writes a first half, waits until both are at it, and writes the second half."""
    write_compiler(
        machine,
        'while [ "$1" != -o ]; do shift; done; printf first- > "$2"; echo >> "$CALLS"; '
        'while [ $(wc -l < "$CALLS") -lt 2 ]; do sleep 0.01; done; printf second >> "$2"',
    )
    code = (
        "import importlib.metadata as m\n"
        "from types import SimpleNamespace as S\nfrom pathlib import Path\nfrom dotmask.slam.rtabmap import library\n"
        f"m.distribution = lambda name: S(version=library.DEPTHAI_VERSION, files=[m.PackagePath("
        f"'depthai.libs/libdepthaicore-1234.so')], locate_file=lambda f: Path({str(machine / 'site')!r}) / f)\n"
        "print(Path(library.find_libraries().bridge).read_text())\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    both = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert [process.communicate(timeout=60)[0] for process in both] == ["first-second\n"] * 2


def refused() -> str:
    with pytest.raises(SlamError) as caught:
        library.find_libraries()
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_another_machine(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")
    assert refused() == "RTAB-Map runs on x86-64 Linux only, this is Linux aarch64: use --slam embedded"


def test_no_wheel(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> Wheel:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", missing)
    assert refused() == "RTAB-Map is not installed: pip install 'dotmask[rtabmap]' (depthai 3.12.0)"


def test_another_version_of_the_wheel(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.metadata, "distribution", lambda name: Wheel(machine / "site", "3.13.1"))
    assert refused().startswith("RTAB-Map is not usable in depthai 3.13.1: pip install")


def test_a_wheel_without_its_library(machine: Path) -> None:
    (machine / "site/depthai.libs/libdepthaicore-1234.so").unlink()
    assert "lacks its core library: pip install --force-reinstall depthai" in refused()


def test_no_compiler(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CXX")
    monkeypatch.setenv("PATH", str(machine / "nothing"))
    assert "there is none (c++, g++, clang++): apt-get install g++" in refused()
    monkeypatch.setenv("CXX", "no-such-compiler")
    assert "(CXX=no-such-compiler)" in refused()


def test_a_bridge_in_the_cache_needs_no_compiler(machine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = library.find_libraries()
    monkeypatch.setenv("CXX", "no-such-compiler")
    assert library.find_libraries() == made


def test_a_compiler_that_fails_leaves_nothing(machine: Path) -> None:
    write_compiler(machine, "echo 'bridge.cpp:1: error: no <array> here' >&2; echo more >&2; exit 1")
    assert "(bridge.cpp:1: error: no <array> here): set CXX" in refused()
    assert not list((machine / "cache/dotmask").iterdir())


def test_a_cache_that_cannot_be_written(machine: Path) -> None:
    (machine / "cache").touch()
    assert refused().endswith("set XDG_CACHE_HOME")


def test_a_library_that_cannot_be_loaded(machine: Path) -> None:
    library.core.cache_clear()
    with pytest.raises(SlamError, match=r"RTAB-Map cannot be loaded: .*libdepthaicore-1234.so.*reinstall"):
        library.core()
    library.core.cache_clear()


def test_the_worker_imports_little() -> None:
    """Each method of a run starts one."""
    code = (
        "import sys, dotmask.slam.rtabmap.worker\n"
        "print([m for m in ('numpy', 'cv2', 'scipy', 'gtsam', 'numba') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=library.worker_environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "[]\n"
