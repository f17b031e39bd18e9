"""pyrender's renderer, scene and lights, set right where they do not fit: draw order, pixel centres, ids, shadows.

Import it after `gl_context.choose_platform`: PyOpenGL settles on a platform when it is imported.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyrender
from OpenGL import GL
from pyrender import RenderFlags
from pyrender.shader_program import ShaderProgramCache

SHADERS = Path(__file__).parent / "shaders"
SHADOW_SIZE = 1024
SHADOW_NEAR_M, SHADOW_FAR_M = 0.05, 30.0
SHADOW_TANGENT = 2.75
"""A light's shadow map reaches this far sideways per metre below it; beyond, all is lit."""


class CeilingLight(pyrender.SpotLight):  # type: ignore[misc]  # pyrender has no annotations
    """A point light whose shadow map looks straight down. pyrender's own point lights cast no shadows."""

    def _get_shadow_camera(self, scene_scale: float) -> pyrender.PerspectiveCamera:
        return pyrender.PerspectiveCamera(
            yfov=2.0 * math.atan(SHADOW_TANGENT), aspectRatio=1.0, znear=SHADOW_NEAR_M, zfar=SHADOW_FAR_M
        )

    def _generate_shadow_texture(self, size: int | None = None) -> None:
        side = size or SHADOW_SIZE
        self.shadow_texture = pyrender.Texture(width=side, height=side, source_channels="D", data_format=GL.GL_FLOAT)


class OrderedScene(pyrender.Scene):  # type: ignore[misc]
    """A scene whose lights have an order. pyrender keeps them in sets and adds their light up in order of address."""

    @property
    def light_nodes(self) -> list[pyrender.Node]:
        """By name."""
        return sorted(self.spot_light_nodes, key=lambda node: str(node.name))

    @property
    def scale(self) -> float:
        """Of no use to a CeilingLight; pyrender's own asks numpy for `infty`, which numpy 2 lacks."""
        return 1.0


class TruthRenderer(pyrender.Renderer):  # type: ignore[misc]
    """Draws colour from textured nodes and the truth from solid ones, each in the order given.

    Two passes. Colour goes through pyrender's own framebuffer, four samples a pixel. The truth goes into a float
    framebuffer of one sample at the pixel's centre: with pyrender's own, depth is that of a sample off the centre.
    """

    def __init__(self, width: int, height: int) -> None:
        super().__init__(width, height)
        self._program_cache = ShaderProgramCache(str(SHADERS))
        self._order: list[pyrender.Node] = []
        self._casters: list[pyrender.Node] = []
        self._units_of_lights = 0
        self._truth_frame: int | None = None
        self._truth_buffers: list[int] = []

    def __del__(self) -> None:
        """Nothing: resources are freed by `delete`, with the context current."""

    def delete(self) -> None:
        """Free all OpenGL resources."""
        super().delete()
        if self._truth_frame is not None:
            GL.glDeleteFramebuffers(1, [self._truth_frame])
            GL.glDeleteRenderbuffers(3, self._truth_buffers)
            self._truth_frame = None

    def colour(
        self, scene: OrderedScene, textured: list[pyrender.Node], casters: list[pyrender.Node]
    ) -> npt.NDArray[np.uint8]:
        """(H, W, 3), edges anti-aliased; `casters` throw the shadows."""
        self._order, self._casters = textured, casters
        image: npt.NDArray[np.uint8] = self.render(scene, RenderFlags.OFFSCREEN | RenderFlags.SHADOWS_SPOT)
        return image

    def truth(
        self, scene: OrderedScene, solid: list[pyrender.Node], *, normals: bool
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32] | None]:
        """What lies at the centre of every pixel; 0 where nothing was hit.

        Returns:
            (H, W, 2) instance id and z in metres; (H, W, 3) unit normals in the camera frame, if asked for.
        """
        self._order = solid
        painted = {node: (0, 0, 0) for node in solid}  # the colour comes from the mesh, but pyrender wants one
        image = self.render(scene, RenderFlags.OFFSCREEN | RenderFlags.SEG, painted)
        return image[..., :2], self._read(GL.GL_COLOR_ATTACHMENT1)[..., :3] if normals else None

    def _sorted_mesh_nodes(self, scene: OrderedScene) -> list[pyrender.Node]:
        return self._order

    def _bind_lighting(self, scene: OrderedScene, program: Any, node: pyrender.Node, flags: int) -> None:
        """Once a pass: all textured nodes share one program."""
        if not self._units_of_lights:
            super()._bind_lighting(scene, program, node, flags)
            self._units_of_lights = self._texture_alloc_idx

    def _reset_active_textures(self) -> None:
        """The first units keep the shadow maps."""
        self._texture_alloc_idx = self._units_of_lights

    def _shadow_mapping_pass(self, scene: OrderedScene, light_node: pyrender.Node, flags: int) -> None:
        order, self._order = self._order, self._casters
        super()._shadow_mapping_pass(scene, light_node, flags)
        self._order = order

    def _configure_shadow_mapping_viewport(self, light: CeilingLight, flags: int) -> None:
        super()._configure_shadow_mapping_viewport(light, flags)
        GL.glViewport(0, 0, SHADOW_SIZE, SHADOW_SIZE)

    def _configure_forward_pass_viewport(self, flags: int) -> None:
        super()._configure_forward_pass_viewport(flags)
        self._units_of_lights = self._texture_alloc_idx = 0
        if flags & RenderFlags.SEG:
            if self._truth_frame is None:
                self._make_truth_frame()
            GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._truth_frame)

    def _make_truth_frame(self) -> None:
        self._truth_frame = GL.glGenFramebuffers(1)
        self._truth_buffers = list(GL.glGenRenderbuffers(3))
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._truth_frame)
        kinds = (
            (GL.GL_RGBA32F, GL.GL_COLOR_ATTACHMENT0),
            (GL.GL_RGBA32F, GL.GL_COLOR_ATTACHMENT1),
            (GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_ATTACHMENT),
        )
        for buffer, (kind, attachment) in zip(self._truth_buffers, kinds, strict=True):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, kind, self.viewport_width, self.viewport_height)
            GL.glFramebufferRenderbuffer(GL.GL_DRAW_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)
        GL.glDrawBuffers(2, [GL.GL_COLOR_ATTACHMENT0, GL.GL_COLOR_ATTACHMENT1])

    def _read_main_framebuffer(self, scene: OrderedScene, flags: int) -> npt.NDArray[Any]:
        """The image of the pass, (H, W, 4) float or (H, W, 3) bytes, top row first."""
        if flags & RenderFlags.SEG:
            return self._read(GL.GL_COLOR_ATTACHMENT0)
        width, height = self.viewport_width, self.viewport_height
        box = (0, 0, width, height)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb_ms)
        GL.glBindFramebuffer(GL.GL_DRAW_FRAMEBUFFER, self._main_fb)
        GL.glBlitFramebuffer(*box, *box, GL.GL_COLOR_BUFFER_BIT, GL.GL_NEAREST)
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        pixels = GL.glReadPixels(*box, GL.GL_RGB, GL.GL_UNSIGNED_BYTE)
        return np.frombuffer(pixels, np.uint8).reshape(height, width, 3)[::-1]

    def _read(self, attachment: int) -> npt.NDArray[np.float32]:
        """One buffer of the truth, (H, W, 4), top row first."""
        width, height = self.viewport_width, self.viewport_height
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._truth_frame)
        GL.glReadBuffer(attachment)
        pixels = GL.glReadPixels(0, 0, width, height, GL.GL_RGBA, GL.GL_FLOAT)
        return np.frombuffer(pixels, np.float32).reshape(height, width, 4)[::-1]
