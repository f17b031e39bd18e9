"""Where OpenGL comes from: EGL or OSMesa, found at run time, and the one context of this process.

pyrender's own contexts do not serve here. Deleting one ends the EGL display of all others, and a context stays current
in the thread that made it, so that no other thread can draw with it.
"""

import ctypes
import ctypes.util
import functools
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any, Protocol

from sim.errors import SimError

LIBRARIES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"egl": ("EGL", "GL", "X11", "Xrender"), "osmesa": ("OSMesa", "GL", "X11", "Xrender")}
)
"""Shared libraries per value of PYOPENGL_PLATFORM, in the order in which they are tried. The last three are what
pyglet loads, which pyrender imports."""

PACKAGES: Mapping[str, str] = MappingProxyType(
    {"egl": "libegl1 libgl1 libxrender1", "osmesa": "libosmesa6 libgl1 libxrender1"}
)
"""Debian and Ubuntu packages that bring them."""

GL_VERSION = (4, 1)


class RendererMissingError(SimError):
    """No OpenGL library that can draw without a window; the message says what to install."""


class Discardable(Protocol):
    """Something that holds OpenGL resources."""

    def delete(self) -> None:
        """Free them; called with the context current."""
        ...


def choose_platform() -> str:
    """The OpenGL platform, "egl" or "osmesa". Leaves it in PYOPENGL_PLATFORM, which PyOpenGL reads when it is imported.

    Raises:
        RendererMissingError: the platform that PYOPENGL_PLATFORM names, or every platform, lacks a library.
    """
    asked = os.environ.get("PYOPENGL_PLATFORM")
    if asked and asked not in LIBRARIES:
        raise RendererMissingError(
            f"PYOPENGL_PLATFORM={asked}: pyrender draws without a window on {' or '.join(LIBRARIES)} only; "
            "unset the variable or name one of them"
        )
    complaints = []
    for platform in (asked,) if asked else LIBRARIES:
        lacking = _what_lacks(platform)
        if not lacking:
            os.environ["PYOPENGL_PLATFORM"] = platform
            return platform
        complaints.append(f"{platform} lacks {lacking}")
    raise RendererMissingError(
        f"pyrender needs an OpenGL library ({'; '.join(complaints)}). On Debian or Ubuntu: "
        f"apt-get install {PACKAGES[asked or 'egl']}. The renderer numba needs none"
    )


def _what_lacks(platform: str) -> str:
    """What is not here of what a platform needs; empty when all is."""
    lacking = [name for name in LIBRARIES[platform] if ctypes.util.find_library(name) is None]
    if lacking:
        return ", ".join(f"lib{name}" for name in lacking)
    return "a device" if platform == "egl" and not _count_egl_devices() else ""


def _count_egl_devices() -> int:
    """Devices that EGL can draw on, asked without PyOpenGL: its platform cannot be changed once it is imported."""
    egl = ctypes.CDLL(ctypes.util.find_library("EGL"))
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    if not address:
        return 0
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int))(address)
    count = ctypes.c_int(0)
    return count.value if query(0, None, ctypes.byref(count)) else 0


class GlContext:
    """The context. One thread draws at a time; between two drawings no thread holds it.

    Args:
        acquire: makes the context current in the calling thread.
        release: leaves the calling thread without a context.
    """

    def __init__(self, acquire: Callable[[], None], release: Callable[[], None]) -> None:
        self._acquire, self._release = acquire, release
        self._lock = threading.Lock()
        self._discarded: list[Discardable] = []

    @contextmanager
    def current(self) -> Iterator[None]:
        """Hold the context. Frees first what was discarded."""
        with self._lock:
            self._acquire()
            try:
                while self._discarded:
                    self._discarded.pop().delete()
                yield
            finally:
                self._release()

    def discard(self, resources: Discardable) -> None:
        """Free `resources` when the context is held next. May be called at any time, by the garbage collector too."""
        self._discarded.append(resources)


@functools.cache
def gl_context() -> GlContext:
    """The context of this process, made on the first call.

    Raises:
        RendererMissingError: no library, or none that can draw.
    """
    return _egl_context() if choose_platform() == "egl" else _osmesa_context()


def _egl_context() -> GlContext:
    from OpenGL import EGL
    from OpenGL.error import GLError
    from pyrender.platforms import egl

    chosen = os.environ.get("EGL_DEVICE_ID")
    for device in egl.query_devices() if chosen is None else [egl.get_device_by_index(int(chosen))]:
        platform = egl.EGLPlatform(1, 1, device)
        try:
            platform.init_context()
        except (AssertionError, GLError):  # a device without a driver; the next may be the CPU's
            continue

        def acquire(platform: Any = platform) -> None:
            EGL.eglBindAPI(EGL.EGL_OPENGL_API)  # a setting of each thread
            platform.make_current()

        def release(platform: Any = platform) -> None:
            display = platform._egl_display
            EGL.eglMakeCurrent(display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT)

        release()
        return GlContext(acquire, release)
    raise RendererMissingError(
        f"EGL offers no device that draws OpenGL {GL_VERSION[0]}.{GL_VERSION[1]}. On Debian or Ubuntu: apt-get install "
        f"libgl1-mesa-dri, which draws on the CPU, or {PACKAGES['osmesa']} and set PYOPENGL_PLATFORM=osmesa"
    )


def _osmesa_context() -> GlContext:
    """By OSMesa's own functions: pyrender's way needs a newer PyOpenGL than the one that it asks for."""
    from OpenGL import osmesa
    from OpenGL.platform import PLATFORM

    library = PLATFORM.OSMesa
    # PyOpenGL keeps things by context, and its own type for one cannot be a key.
    PLATFORM.GetCurrentContext.restype = ctypes.c_void_p
    create = library.OSMesaCreateContextAttribs
    create.restype, create.argtypes = ctypes.c_void_p, [ctypes.POINTER(ctypes.c_int), ctypes.c_void_p]
    make = library.OSMesaMakeCurrent
    make.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_int]
    make.restype = ctypes.c_ubyte
    # OSMESA_PROFILE, OSMESA_CORE_PROFILE, OSMESA_CONTEXT_MAJOR_VERSION, OSMESA_CONTEXT_MINOR_VERSION of osmesa.h
    profile, core, major, minor = 0x33, 0x34, 0x36, 0x37
    wanted = (osmesa.OSMESA_FORMAT, osmesa.OSMESA_RGBA, profile, core, major, GL_VERSION[0], minor, GL_VERSION[1], 0)
    context = create((ctypes.c_int * len(wanted))(*(int(value) for value in wanted)), None)
    if not context:
        raise RendererMissingError(
            f"the OSMesa library here gives no OpenGL {GL_VERSION[0]}.{GL_VERSION[1]}: install EGL instead. "
            f"On Debian or Ubuntu: apt-get install {PACKAGES['egl']}"
        )
    canvas = (ctypes.c_ubyte * 4)()  # one pixel, never drawn to: all goes into framebuffer objects
    unsigned_byte = 0x1401  # GL_UNSIGNED_BYTE

    def acquire() -> None:
        if not make(context, canvas, unsigned_byte, 1, 1):
            raise RendererMissingError("OSMesa cannot make its context current")

    def release() -> None:
        make(None, None, 0, 0, 0)

    return GlContext(acquire, release)
