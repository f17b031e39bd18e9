"""Where OpenGL comes from, with and without libraries; needs none."""

import ctypes.util
import subprocess
import sys
from collections.abc import Iterable

import pytest

from sim.errors import SimError
from sim.renderers.pyrender_renderer import gl_context
from sim.renderers.pyrender_renderer.gl_context import GlContext, choose_platform

ALL = {"EGL", "GL", "X11", "Xrender", "OSMesa"}


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Iterable[object]:
    """Sets up a machine with these libraries and EGL devices."""

    def with_libraries(libraries: set[str], devices: int = 1, asked: str | None = None) -> None:
        monkeypatch.setattr(ctypes.util, "find_library", lambda name: name if name in libraries else None)
        monkeypatch.setattr(gl_context, "_count_egl_devices", lambda: devices)
        monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
        if asked is not None:
            monkeypatch.setenv("PYOPENGL_PLATFORM", asked)

    return with_libraries


def test_egl_goes_before_osmesa_and_the_user_before_both(machine, monkeypatch) -> None:
    machine(ALL)
    assert choose_platform() == "egl"
    assert gl_context.os.environ["PYOPENGL_PLATFORM"] == "egl"
    machine(ALL - {"EGL"})
    assert choose_platform() == "osmesa"
    machine(ALL, devices=0)
    assert choose_platform() == "osmesa"
    machine(ALL, asked="osmesa")
    assert choose_platform() == "osmesa"


@pytest.mark.parametrize(
    ("libraries", "devices", "asked", "said"),
    [
        (
            set(),
            0,
            None,
            r"egl lacks libEGL, libGL, .*osmesa lacks libOSMesa.*apt-get install libegl1 libgl1 libxrender1",
        ),
        ({"EGL", "GL", "X11", "Xrender"}, 0, None, r"egl lacks a device.*osmesa lacks libOSMesa"),
        (ALL - {"Xrender"}, 1, "egl", r"egl lacks libXrender\).*apt-get install libegl1"),
        (ALL - {"OSMesa"}, 1, "osmesa", r"osmesa lacks libOSMesa\).*apt-get install libosmesa6"),
        (ALL, 1, "glx", r"PYOPENGL_PLATFORM=glx: .*egl or osmesa"),
    ],
)
def test_a_machine_without_is_told_what_to_install(machine, libraries, devices, asked, said) -> None:
    machine(libraries, devices, asked)
    with pytest.raises(SimError, match=said) as caught:
        choose_platform()
    assert "\n" not in str(caught.value)


def test_the_context_is_let_go_whatever_happens_and_frees_what_was_discarded() -> None:
    events: list[str] = []

    class Resources:
        def delete(self) -> None:
            events.append("freed")

    context = GlContext(lambda: events.append("acquired"), lambda: events.append("released"))
    context.discard(Resources())
    with pytest.raises(RuntimeError, match="boom"), context.current():
        raise RuntimeError("boom")
    with context.current():
        pass
    assert events == ["acquired", "freed", "released", "acquired", "released"]


def test_nothing_imports_pyrender_unless_it_is_asked_for() -> None:
    code = "import sys, scenarios.cli, scenarios.world; sys.exit(any(m in sys.modules for m in ('pyrender', 'OpenGL')))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_the_command_line_says_it_in_one_line(tmp_path) -> None:
    command = [sys.executable, "-m", "scenarios.cli", "render", "smoke", "--renderer", "pyrender", "--out"]
    environment = {**gl_context.os.environ, "PYOPENGL_PLATFORM": "glx"}
    done = subprocess.run([*command, tmp_path / "out"], env=environment, capture_output=True, text=True)
    assert done.returncode == 2, done.stderr
    assert "\ndotmask: PYOPENGL_PLATFORM=glx: " in "\n" + done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()
