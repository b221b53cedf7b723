"""Colour, z-depth, instance and normal images of triangle meshes by ray casting (Embree through Open3D), no display.

    renderer = SceneRenderer([(1, floor), (2, table)])
    picture = renderer.render(camera, look_at(eye, target))

By default the scene is lit by two lamps with hard shadows and an even ambient term, which needs no preparation: right
for single pictures of scenes that move. `soft_light=SoftLight()` computes soft light with one bounce once (seconds) and
then renders faster: right for many pictures of a scene that stands still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import open3d as o3d
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.rendering import shading
from scenewright.stages.kit.rendering.light_map import AreaLight, LightMap, SoftLight, bake
from scenewright.stages.kit.rendering.patterns import GLOSS, Material
from scenewright.stages.kit.rendering.shading import Hits, Surfaces
from scenewright.stages.kit.rendering.surfaces import TriangleSoup, build_soup, linear_to_srgb

BACKGROUND = (0.86, 0.89, 0.92)
"""Colour where no ray hits (sRGB, 0 to 1)."""
_SRGB_TABLE = np.round(linear_to_srgb(np.arange(4096) / 4095.0) * 255.0).astype(np.uint8)
"""8-bit sRGB of 4096 steps of linear light."""


@dataclass(frozen=True)
class Rendering:
    """The images of one view."""

    color: np.ndarray
    """(H, W, 3) uint8 sRGB."""
    depth: np.ndarray
    """(H, W) float32, exact z-depth [m], 0 where nothing is hit."""
    instance: np.ndarray
    """(H, W) int32, 0 where nothing is hit."""
    normals: np.ndarray
    """(H, W, 3) float32, world frame, unit, towards the camera; 0 where nothing is hit."""
    incidence: np.ndarray
    """(H, W) float32, cosine between the viewing ray and the true face."""
    albedo: np.ndarray
    """(H, W, 3) float32, linear diffuse reflectance."""


def default_lights(minimum: np.ndarray, maximum: np.ndarray) -> tuple[AreaLight, ...]:
    """Return a key and a fill lamp above a scene with these bounds (3,) [m]."""
    center = 0.5 * (minimum + maximum)
    reach = float(np.linalg.norm(maximum - minimum))
    key = center + reach * np.array([-0.5, -0.8, 1.2])
    fill = center + reach * np.array([0.9, 0.3, 0.9])
    lamp = 0.2 * reach
    return (
        AreaLight(tuple(key), (lamp, 0.0, 0.0), (0.0, -lamp, 0.0), (0.75, 0.73, 0.70)),
        AreaLight(tuple(fill), (lamp, 0.0, 0.0), (0.0, -lamp, 0.0), (0.22, 0.23, 0.25)),
    )


class SceneRenderer:
    """Holds meshes in the world frame as one Embree scene.

    `meshes` are `(instance id, mesh)` pairs with face, vertex or texture colours, or a soup made of such (which has its
    materials); `materials` add patterns and gloss by instance id. Without a light map the colour of a light is what a
    matt white surface that faces it returns, at any distance; with one it is the lamp's radiance. Raises BadInput for
    an empty scene.
    """

    def __init__(
        self,
        meshes: Sequence[tuple[int, trimesh.Trimesh]] | TriangleSoup,
        *,
        lights: Sequence[AreaLight] | None = None,
        ambient: tuple[float, float, float] = (0.34, 0.35, 0.37),
        shadows: bool = True,
        materials: dict[int, Material] | None = None,
        background: tuple[float, float, float] = BACKGROUND,
        soft_light: SoftLight | None = None,
        antialias: bool = True,
    ) -> None:
        self.soup = meshes if isinstance(meshes, TriangleSoup) else build_soup(meshes, materials)
        self.scene = o3d.t.geometry.RaycastingScene()
        triangles = self.soup.triangles
        self.scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(self.soup.corners.reshape(-1, 3))),
            o3d.core.Tensor.from_numpy(np.arange(3 * triangles, dtype=np.uint32).reshape(-1, 3)),
        )
        points = self.soup.corners.reshape(-1, 3)
        self.lights = tuple(lights) if lights is not None else default_lights(points.min(axis=0), points.max(axis=0))
        self.ambient = np.asarray(ambient, dtype=np.float32)
        self.shadows = shadows
        self.background = np.asarray(background, dtype=np.float32)
        self.antialias = antialias
        self.exposure = 1.0
        self.light_map: LightMap | None = None
        if soft_light is not None:
            self.light_map = bake(self.scene, self.soup, self.lights, self.ambient, soft_light)
            self.exposure = self._exposure()
            self.usual_light = np.maximum(np.median(self.light_map.light, axis=0), 1e-6)

    def render(self, camera: Camera, world_from_camera: np.ndarray) -> Rendering:
        """Render one view. `world_from_camera` (4, 4), OpenCV camera frame."""
        height, width = camera.height, camera.width
        v, u = np.divmod(np.arange(height * width), width)
        hits = self._cast(camera, world_from_camera, np.stack([u, v], axis=1).astype(np.float32))
        hit = hits.primitive != shading.MISS
        depth = np.where(hit, hits.t, 0.0).astype(np.float32).reshape(height, width)
        instance = np.where(hit, self.soup.instance[np.where(hit, hits.primitive, 0).astype(np.int64)], 0)
        instance = instance.astype(np.int32).reshape(height, width)
        albedo, light = self._shade(hits, camera)
        if self.antialias:
            edges = np.flatnonzero(_edge_pixels(instance, hits.normals.reshape(height, width, 3), depth))
            self._refine(light, edges, camera, world_from_camera)
        color = shading.tone_map(light, self.exposure, _SRGB_TABLE)
        if not self.antialias:
            color[~hit] = np.round(self.background * 255.0).astype(np.uint8)
        return Rendering(
            color=color.reshape(height, width, 3),
            depth=depth,
            instance=instance,
            normals=hits.normals.reshape(height, width, 3),
            incidence=hits.cosine.reshape(height, width),
            albedo=albedo.reshape(height, width, 3),
        )

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Return the distance (N,) [m] from points (N, 3) to the nearest surface."""
        return self.scene.compute_distance(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(points, dtype=np.float32))
        ).numpy()

    def occluded(self, origins: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Return whether something stands between origins (N, 3) and targets (N, 3) [m], as (N,) bool."""
        rays = np.concatenate([origins, targets - origins], axis=1).astype(np.float32)
        return self.scene.test_occlusions(o3d.core.Tensor.from_numpy(rays), 1e-4, 0.995).numpy() != 0

    def _cast(self, camera: Camera, world_from_camera: np.ndarray, pixels: np.ndarray) -> Hits:
        pose = np.ascontiguousarray(world_from_camera, dtype=np.float64)
        rays = shading.camera_rays(pixels, camera.fx, camera.fy, camera.cx, camera.cy, pose)
        answer = self.scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
        primitive = answer["primitive_ids"].numpy()
        uvs = answer["primitive_uvs"].numpy()
        normals, cosine = shading.surface_at(rays, primitive, uvs, self.soup.corner_normals, self.soup.face_normals)
        return Hits(rays, primitive, uvs, answer["t_hit"].numpy(), normals, cosine)

    def _surfaces(self) -> Surfaces:
        return Surfaces(self.soup.corner_colors, self.soup.material, self.soup.material_table)

    def _shade(self, hits: Hits, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Return (albedo (N, 3), outgoing linear light (N, 3), background included)."""
        albedo = shading.surface_color(hits, self._surfaces(), 1.0 / camera.fx)
        highlight = np.zeros_like(albedo)
        if self.light_map is not None:
            light = shading.light_from_map(hits, self.light_map)
        else:
            light = np.broadcast_to(self.ambient, albedo.shape).copy()
        for lamp in self.lights:
            self._add_lamp(light, highlight, hits, lamp)
        if self.light_map is not None:
            # The map already knows what lies in shadow: dark places get no highlight.
            highlight *= np.minimum(1.0, light / self.usual_light)
        result = albedo * light + highlight
        missed = hits.primitive == shading.MISS
        if missed.any():
            # The background passes through the tone curve: give what comes out as the wanted colour.
            exposed = np.where(
                self.background <= 0.04045, self.background / 12.92, ((self.background + 0.055) / 1.055) ** 2.4
            )
            over = np.maximum(exposed - 0.6, 0.0) / 0.4
            result[missed] = (
                np.where(exposed > 0.6, 0.6 - 0.4 * np.log(np.maximum(1.0 - over, 1e-3)), exposed) / self.exposure
            )
        return albedo, result

    def _add_lamp(self, light: np.ndarray, highlight: np.ndarray, hits: Hits, lamp: AreaLight) -> None:
        """Add one lamp in place; with a light map its highlight alone."""
        color = np.asarray(lamp.color, dtype=np.float32)
        point = np.asarray(lamp.center, dtype=np.float32)
        if self.light_map is not None:
            if self.soup.material_table[:, GLOSS].max() <= 0.0:
                return
            # A highlight mirrors the lamp; its solid angle from mid-room stands in for the exact reflection.
            color = color * np.float32(lamp.area / 6.0)
            blocked = np.zeros(len(light), dtype=np.bool_)
        else:
            blocked = self._shadow_mask(hits, point)
        shading.add_light(light, highlight, hits, self._surfaces(), blocked, point, color, self.light_map is None)

    def _shadow_mask(self, hits: Hits, point: np.ndarray) -> np.ndarray:
        blocked = np.zeros(len(hits.t), dtype=np.bool_)
        if not self.shadows:
            return blocked
        rays, asked = shading.shadow_rays(hits, point)
        blocked[asked] = self.scene.test_occlusions(o3d.core.Tensor.from_numpy(rays), 1e-4, 1.0).numpy() != 0
        return blocked

    def _refine(self, light: np.ndarray, edges: np.ndarray, camera: Camera, world_from_camera: np.ndarray) -> None:
        """Average four rays in the pixels on edges (rotated grid), after the tone curve's knee is applied."""
        if len(edges) == 0:
            return
        v, u = np.divmod(edges, camera.width)
        centers = np.stack([u, v], axis=1).astype(np.float32)
        offsets = np.array([[-0.125, -0.375], [0.375, -0.125], [0.125, 0.375], [-0.375, 0.125]], dtype=np.float32)
        pixels = (centers[None] + offsets[:, None]).reshape(-1, 2)
        _, samples = self._shade(self._cast(camera, world_from_camera, pixels), camera)
        ceiling = np.float32(1.2 / self.exposure)
        light[edges] = np.minimum(samples, ceiling).reshape(4, -1, 3).mean(axis=0)

    def _exposure(self) -> float:
        """Return the factor that brings the light leaving the surfaces, by area, to a mid tone at its median."""
        soup, m = self.soup, self.light_map
        assert m is not None
        edges = np.cross(soup.corners[:, 1] - soup.corners[:, 0], soup.corners[:, 2] - soup.corners[:, 0])
        area = 0.5 * np.linalg.norm(edges, axis=1)
        sums = np.add.reduceat(m.light, m.offset, axis=0)
        counts = np.diff(np.append(m.offset, len(m.light)))[:, None]
        radiance = (sums / counts * soup.corner_colors.mean(axis=1)).mean(axis=1)
        order = np.argsort(radiance, kind="stable")
        cumulated = np.cumsum(area[order])
        median = radiance[order][np.searchsorted(cumulated, 0.5 * cumulated[-1])]
        return float(0.38 / max(float(median), 1e-6))


def _edge_pixels(instance: np.ndarray, normals: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return (H*W,) bool: pixels whose right or lower neighbour is another object, or bent or stepped away."""
    edge = np.zeros(instance.shape, dtype=bool)
    for axis in (0, 1):
        head = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        tail = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        changed = instance[head] != instance[tail]
        changed |= np.einsum("ijk,ijk->ij", normals[head], normals[tail]) < 0.9
        changed |= np.abs(depth[head] - depth[tail]) > 0.05 * np.minimum(depth[head], depth[tail])
        edge[head] |= changed
        edge[tail] |= changed
    return edge.reshape(-1)
