"""The default renderer: a software rasteriser with a visibility buffer, on the CPU.

Pass 1 finds the nearest triangle of every pixel (Burns and Hunt, "The visibility buffer: a cache-friendly approach to
deferred shading", JCGT 2013). Pass 2 visits each pixel once and writes colour, depth and instance id together, so the
images cannot disagree; normals and flow come from the same buffer. Shadow maps are pass 1 with a light as the camera;
their static part is drawn once.

The bytes depend on the scene, the camera and the poses alone, not on the number of threads.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from sim.geometry import FloatArray
from sim.records import CameraModel, Flow, Moment, RenderedImages
from sim.renderers import channel_kernels, edge_kernels, kernels, shading_kernels
from sim.renderers.scene_arrays import Float32Array, SceneArrays
from sim.renderers.shadows import RIGID_CELL_M, SKINNED_CELL_M, ShadowMaps, project, screen_box, simplified
from sim.scene import Scene

NEAR_M = 0.05
"""What is closer to the camera (z, metres) is not drawn."""


class VisibilityBufferRenderer:
    """Draws one scene with one camera model.

    Front faces only (counter-clockwise seen from outside); a single-sided panel shows from its front. Textures repeat,
    with trilinear filtering. Diffuse point lights with soft shadows, and an ambient light that is stronger from above.
    Edges are anti-aliased in colour, never in depth or ids.

    Args:
        scene: objects that are no actors are posed once, at time 0.
        camera: intrinsics, exposure, and size of the images.
        threads: bands of rows that are drawn at the same time.
        shadow_size: side of each light's shadow map in pixels, 0 = no shadows.

    Raises:
        ValueError: an argument is out of its range, or an object does not fit its own palette.
    """

    def __init__(
        self,
        scene: Scene,
        camera: CameraModel,
        threads: int = 1,
        *,
        shadow_size: int = 1024,
    ) -> None:
        if threads < 1 or shadow_size < 0:
            raise ValueError(f"threads must be at least 1 and shadow_size at least 0, got {threads} and {shadow_size}")
        if camera.width < 1 or camera.height < 1 or not (camera.fx > 0 and camera.fy > 0):
            raise ValueError(f"camera: needs a positive size and positive focal lengths, got {camera}")
        self._camera_model = camera
        self._lens = float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy)
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._arrays = SceneArrays.of(scene)
        vertices = len(self._arrays.rest)
        self._attributes = np.zeros((vertices, 8), np.float32)  # position, normal, uv
        self._attributes[:, 6:] = self._arrays.uv
        self._camera = np.zeros((vertices, 6), np.float32)  # x, y, z, u, v, 1/z
        self._pose(0, vertices, self._attributes)
        shape = (camera.height, camera.width)
        self._inverse_depth = np.zeros(shape, np.float32)
        self._triangles = np.full(shape, -1, np.int32)
        self._coverage = np.zeros(shape, np.uint32)
        self._colour = np.zeros(shape, np.uint32)  # 0x00bbggrr, before edges are blended
        self._rendered = False
        gain = 2.0**camera.exposure_ev
        self._ambient = np.float32(gain * scene.ambient)
        self._lights = np.array([(*light.position_world, gain * light.power) for light in scene.lights], np.float32)
        self._lights = self._lights.reshape(-1, 4)
        self._shadows = ShadowMaps(self._lights, shadow_size, self._in_bands)
        self._build_shadow_casters()

    def render(self, moment: Moment, *, normals: bool = False, flow_to: Moment | None = None) -> RenderedImages:
        """Images of one moment. The arrays belong to the caller.

        Args:
            moment: where the camera and every actor are.
            normals: whether to give the surface normals as well: of the flat triangles, as the depth has them.
            flow_to: the moment to which the flow is asked for.

        Raises:
            ValueError: an actor has no palette, a name is no actor's, or a shape is not as expected.
        """
        height, width = self._triangles.shape
        depth_m, ids = np.empty((height, width), np.float32), np.empty((height, width), np.uint16)
        rgb = self._draw(moment, (0, height), depth_m, ids, counts=True)
        self._rendered = True
        return RenderedImages(
            rgb=rgb,
            depth_m=depth_m,
            instance_ids=ids,
            normals_camera=self._normals() if normals else None,
            flow=None if flow_to is None else self._flow(moment, flow_to, depth_m),
        )

    def render_colour(self, moment: Moment, rows: tuple[int, int]) -> npt.NDArray[np.uint8]:
        """The rows first..last-1 of `render(moment).rgb` alone, (last - first, W, 3): for exposures in parts.

        Raises:
            ValueError: as `render`, or the image has no such rows.
        """
        height, width = self._triangles.shape
        if not 0 <= rows[0] < rows[1] <= height:
            raise ValueError(f"rows: expected 0 <= first < last <= {height}, got {rows}")
        depth_m, ids = np.empty((height, width), np.float32), np.empty((height, width), np.uint16)
        return self._draw(moment, rows, depth_m, ids, counts=False)[rows[0] : rows[1]].copy()

    def unoccluded_pixels(self, name: str) -> int:
        """Pixels inside the image that an actor of the last `render` would cover if it were alone.

        Raises:
            ValueError: no actor has this name, or nothing was rendered yet.
        """
        actors = self._arrays.actors
        if name not in actors:
            raise ValueError(f"{name!r} is no actor of the scene; the actors are {sorted(actors)}")
        if not self._rendered:
            raise ValueError("unoccluded_pixels: render a frame first")
        return int(np.count_nonzero(self._coverage & actors[name].bit))

    def _draw(
        self,
        moment: Moment,
        rows: tuple[int, int],
        depth_m: Float32Array,
        ids: npt.NDArray[np.uint16],
        *,
        counts: bool,
    ) -> npt.NDArray[np.uint8]:
        """Fill these rows of the images, and of the coverage image if `counts`. Returns an image with their colour."""
        arrays = self._arrays
        self._pose_actors(moment.palettes, self._attributes)
        project(self._attributes, np.asarray(moment.T_world_camera, np.float64), self._lens, NEAR_M, self._camera)
        T32 = np.ascontiguousarray(moment.T_world_camera[:3], np.float32)
        self._shadows.draw(self._attributes[self._caster_vertices], self._caster_faces)
        height, width = self._triangles.shape
        parts = [((0, arrays.static_faces), (0, height), np.uint32(0))]
        for actor in arrays.actors.values():
            box = screen_box(self._camera[slice(*actor.vertices)], NEAR_M, width, height)
            if any(box):
                parts.append((actor.faces, box[:2], actor.bit if counts else np.uint32(0)))

        rgb = np.empty((height, width, 3), np.uint8)

        def draw(first: int, last: int) -> None:
            self._inverse_depth[first:last] = 0
            self._triangles[first:last] = -1
            if counts:
                self._coverage[first:last] = 0
            for (face_first, face_last), (top, bottom), bit in parts:
                kernels.rasterise(
                    self._camera,
                    arrays.faces,
                    face_first,
                    face_last,
                    *self._lens,
                    max(first, top),
                    min(last, bottom),
                    NEAR_M,
                    self._inverse_depth,
                    self._triangles,
                    self._coverage,
                    bit,
                )
            shading_kernels.shade(
                self._camera,
                self._attributes,
                arrays.faces,
                arrays.face_texture,
                arrays.face_id,
                arrays.atlas.texels,
                arrays.atlas.offsets,
                arrays.atlas.sizes,
                *self._lens,
                T32,
                first,
                last,
                self._inverse_depth,
                self._triangles,
                self._lights,
                self._ambient,
                self._shadows.maps,
                self._colour,
                depth_m,
                ids,
            )

        def blend(first: int, last: int) -> None:
            edge_kernels.blend_edges(
                self._camera,
                arrays.faces,
                arrays.neighbours,
                *self._lens,
                self._triangles,
                self._inverse_depth,
                self._colour,
                first,
                last,
                rgb,
            )

        self._in_bands(draw, max(rows[0] - 1, 0), min(rows[1] + 1, height))
        self._in_bands(blend, *rows)
        return rgb

    def _normals(self) -> Float32Array:
        target = np.empty((*self._triangles.shape, 3), np.float32)

        def draw(first: int, last: int) -> None:
            channel_kernels.normals(self._camera, self._arrays.faces, self._triangles, first, last, target)

        self._in_bands(draw, 0, len(target))
        return target

    def _flow(self, moment: Moment, other: Moment, depth_m: Float32Array) -> Flow:
        arrays, shape = self._arrays, self._triangles.shape
        then = np.empty_like(self._attributes)  # filled for the actors alone
        self._pose_actors(other.palettes, then)
        here, there = (np.asarray(m.T_world_camera, np.float64) for m in (moment, other))
        R_there_world = there[:3, :3].T
        # Sums written out, and not left to BLAS, which differs between processors.
        T_there_here = (R_there_world[:, :, None] * (here[:3] - np.eye(4)[3] * there[:3, 3:])[None]).sum(axis=1)
        optical_px, scene_m = np.empty((*shape, 2), np.float32), np.empty((*shape, 3), np.float32)

        def draw(first: int, last: int) -> None:
            channel_kernels.flow(
                self._camera,
                self._attributes,
                then,
                arrays.faces,
                arrays.static_faces,
                *self._lens,
                np.ascontiguousarray(here[:3, :3]),
                T_there_here,
                self._triangles,
                depth_m,
                first,
                last,
                optical_px,
                scene_m,
            )

        self._in_bands(draw, 0, shape[0])
        return Flow(optical_px=optical_px, scene_m=scene_m)

    def _build_shadow_casters(self) -> None:
        """Draw the static shadows, and simplify the actors for theirs."""
        arrays, first = self._arrays, self._arrays.static_vertices
        self._shadows.draw_static(self._attributes[:first], arrays.faces[: arrays.static_faces])
        groups = np.zeros(len(arrays.rest) - first, np.int32)
        cells_m = np.zeros(len(groups), np.float32)
        for number, actor in enumerate(arrays.actors.values()):
            span = slice(actor.vertices[0] - first, actor.vertices[1] - first)
            groups[span] = number
            cells_m[span] = RIGID_CELL_M if actor.bones[1] - actor.bones[0] == 1 else SKINNED_CELL_M
        faces = arrays.faces[arrays.static_faces :] - np.uint32(first)
        kept, self._caster_faces = simplified(arrays.rest[first:], faces, groups, cells_m)
        self._caster_vertices = kept + first

    def _pose(self, first: int, last: int, attributes: Float32Array) -> None:
        arrays = self._arrays
        kernels.pose_vertices(
            arrays.rest, arrays.rest_normals, arrays.bones, arrays.weights, arrays.palette, first, last, attributes
        )

    def _pose_actors(self, palettes: Mapping[str, FloatArray], attributes: Float32Array) -> None:
        arrays = self._arrays
        if palettes.keys() != arrays.actors.keys():
            missing = sorted(arrays.actors.keys() - palettes.keys())
            unknown = sorted(palettes.keys() - arrays.actors.keys())
            raise ValueError(f"palettes: every actor needs one and nothing else; missing {missing}, unknown {unknown}")
        for name, actor in arrays.actors.items():
            first, last = actor.bones
            if palettes[name].shape != (last - first, 4, 4):
                raise ValueError(f"{name}: expected a palette ({last - first}, 4, 4), got {palettes[name].shape}")
            arrays.palette[first:last] = palettes[name]
        self._pose(arrays.static_vertices, len(arrays.rest), attributes)

    def _in_bands(self, draw: Callable[[int, int], None], first: int, last: int) -> None:
        """Call `draw(first_row, last_row)` on bands of these rows. The kernels release the GIL."""
        if self._pool is None:
            draw(first, last)
            return
        edges = [first + (last - first) * n // self._threads for n in range(self._threads + 1)]
        list(self._pool.map(draw, edges[:-1], edges[1:]))
