"""Finds the wheel that holds RTAB-Map and compiles the bridge to it, once per version of either.

The bridge needs a C++ compiler and no header of RTAB-Map; it is kept in the user's cache folder.
"""

import functools
import hashlib
import importlib.metadata
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path

import dotmask
from dotmask.errors import SlamError
from dotmask.slam.rtabmap.worker import Libraries

DEPTHAI_VERSION = "3.12.0"
"""The version whose binary interface the bridge was checked against."""

COMPILERS = ("c++", "g++", "clang++")
FLAGS = (
    "-std=c++17", "-O2", "-fPIC", "-shared", "-D_GLIBCXX_USE_CXX11_ABI=1",
    # The types of ours that are called like RTAB-Map's must not be mixed with those when the libraries are loaded.
    "-fvisibility-inlines-hidden", "-Wl,-Bsymbolic",
)  # fmt: skip
_INSTALL = f"pip install 'dotmask[rtabmap]' (depthai {DEPTHAI_VERSION})"
_LIST_TIMEOUT_S = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter that RTAB-Map knows.

    Attributes:
        type: as RTAB-Map calls it: bool, int, unsigned int, float, double, string.
        default: its value where none is given.
    """

    type: str
    default: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Core:
    """What RTAB-Map says of itself.

    Attributes:
        version: of RTAB-Map.
        parameters: by name.
    """

    version: str
    parameters: Mapping[str, Parameter]


def find_libraries() -> Libraries:
    """The wheel's library and the bridge, which is compiled when the cache holds none that fits.

    Raises:
        SlamError: this is no x86-64 Linux, the wheel is missing or has another version, there is no C++ compiler, or
            the cache cannot be written.
    """
    machine = f"{platform.system()} {platform.machine()}"
    if machine != "Linux x86_64":
        raise SlamError(f"RTAB-Map runs on x86-64 Linux only, this is {machine}: use --slam embedded")
    return Libraries(core=str(_find_core()), bridge=str(_compiled_bridge()))


def _find_core() -> Path:
    try:
        wheel = importlib.metadata.distribution("depthai")
    except importlib.metadata.PackageNotFoundError:
        raise SlamError(f"RTAB-Map is not installed: {_INSTALL}") from None
    if wheel.version != DEPTHAI_VERSION:
        raise SlamError(f"RTAB-Map is not usable in depthai {wheel.version}: {_INSTALL}")
    cores = [f for f in wheel.files or () if f.match("depthai.libs/libdepthaicore*.so")]
    if len(cores) != 1 or not (core := Path(str(wheel.locate_file(cores[0])))).is_file():
        raise SlamError(f"depthai {wheel.version} lacks its core library: pip install --force-reinstall depthai")
    return core


def _compiled_bridge() -> Path:
    source = files("dotmask.slam.rtabmap").joinpath("bridge.cpp").read_bytes()
    key = hashlib.sha256(b"\0".join([source, DEPTHAI_VERSION.encode(), *(f.encode() for f in FLAGS)])).hexdigest()
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    path = cache / "dotmask" / f"rtabmap-bridge-{key[:32]}.so"
    if not path.is_file():
        _compile(source, path)
    return path


def _compile(source: bytes, path: Path) -> None:
    """Compile into a folder of our own and rename: who looks finds all or nothing, and two at once do no harm."""
    compiler = _find_compiler()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".rtabmap-", dir=path.parent) as folder:
            text, made = Path(folder, "bridge.cpp"), Path(folder, "bridge.so")
            text.write_bytes(source)
            done = subprocess.run(
                [compiler, *FLAGS, str(text), "-o", str(made)], capture_output=True, text=True, check=False
            )
            if done.returncode != 0:
                said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
                raise SlamError(f"{compiler} cannot compile the bridge to RTAB-Map ({said}): set CXX to another one")
            os.replace(made, path)
    except OSError as error:
        raise SlamError(
            f"cannot write the bridge to RTAB-Map to {path.parent} ({error.strerror}): set XDG_CACHE_HOME"
        ) from error


def _find_compiler() -> str:
    wanted = os.environ.get("CXX")
    for name in (wanted,) if wanted else COMPILERS:
        if found := shutil.which(name):
            return found
    looked = f"CXX={wanted}" if wanted else ", ".join(COMPILERS)
    raise SlamError(f"RTAB-Map needs a C++ compiler once, there is none ({looked}): apt-get install g++, or set CXX")


def worker_command(argument: str) -> list[str]:
    """The command that starts the worker."""
    return [sys.executable, "-P", "-m", "dotmask.slam.rtabmap.worker", argument]


def worker_environment() -> dict[str, str]:
    """The environment in which the worker finds this very package."""
    root = str(Path(dotmask.__file__).parents[1])
    path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path}


@functools.cache
def core() -> Core:
    """RTAB-Map's version and parameters, asked in a process of its own.

    Raises:
        SlamError: see `find_libraries`; or the library cannot be loaded.
    """
    libraries = find_libraries()
    try:
        done = subprocess.run(
            worker_command(json.dumps(asdict(libraries))),
            env=worker_environment(),
            capture_output=True,
            text=True,
            check=True,
            timeout=_LIST_TIMEOUT_S,
        )
        version, *lines = done.stdout.splitlines()
    except (subprocess.SubprocessError, ValueError) as error:
        said = (getattr(error, "stderr", None) or str(error)).strip().splitlines()[-1:]
        raise SlamError(f"RTAB-Map cannot be loaded: {''.join(said)}; reinstall: {_INSTALL}") from error
    known = {}
    for line in lines:
        name, type_, default = line.split("\t")
        known[name] = Parameter(type=type_, default=default)
    return Core(version=version, parameters=known)
