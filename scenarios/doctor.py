"""What `dotmask doctor` looks at: is everything here that a run needs, and is it unharmed?"""

import ctypes.util
import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import sim
from scenarios.run_folder import versions
from sim.assets import AssetState, verify_assets
from sim.errors import AssetError


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing looked at.

    Attributes:
        what: its name.
        said: what was found, and what to do where it is not well.
        is_well: whether it is as it should be.
        is_needed: whether a run fails without it.
    """

    what: str
    said: str
    is_well: bool
    is_needed: bool = True


def _python() -> Finding:
    well = (3, 11) <= sys.version_info < (3, 14)
    return Finding(
        what="python", said=platform.python_version() + ("" if well else ": use Python 3.11 to 3.13"), is_well=well
    )


def _packages() -> Finding:
    return Finding(what="packages", said=", ".join(f"{k} {v}" for k, v in versions().items()), is_well=True)


def _owner_of_sim() -> Finding:
    return Finding(what="package sim", said=str(Path(sim.__file__ or "").parent), is_well=True)


def _assets() -> Finding:
    try:
        states = verify_assets()
    except AssetError as error:
        return Finding(what="assets", said=str(error), is_well=False)
    harmed = [f"{name} is {state.value}" for name, state in states.items() if state is not AssetState.OK]
    if harmed:
        return Finding(what="assets", said=", ".join(harmed) + ": restore the checkout or reinstall", is_well=False)
    return Finding(what="assets", said=f"{len(states)} files agree with the manifest", is_well=True)


def _threads() -> Finding:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Finding(what="cores", said=str(cores), is_well=True)


def _opengl() -> Finding:
    found = ctypes.util.find_library("EGL") or ctypes.util.find_library("OSMesa")
    said = f"{found}" if found else "no EGL or OSMesa library: not needed by the numba renderer"
    return Finding(what="OpenGL", said=said, is_well=found is not None, is_needed=False)


EXAMINATIONS: tuple[Callable[[], Finding], ...] = (_python, _packages, _owner_of_sim, _assets, _threads, _opengl)


def examine() -> list[Finding]:
    """All findings."""
    return [look() for look in EXAMINATIONS]
