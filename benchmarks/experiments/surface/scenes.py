"""What the camera sees in the experiment `surface`: a board at an angle, and generated rooms at eye heights.

Every scene is a triangle mesh that is the truth, and frames of it: exact depth, or with the noise of a
structured-light camera. A room is walked along the path of `synthesize`, its eye height replaced: the camera stands
where it stood, at the height of the case, and looks at what was in the middle of its picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.trajectories import read_tum
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply, look_at
from scenewright.stages.kit.rendering.depth_noise import disturb_depth

from benchmarks.generated_rooms import make_library
from benchmarks.steps import made

FARTHEST = 4.0
"""Depth is used up to here [m]."""
LEVEL = 0.95
"""A face whose normal's z is at least this is level."""
CLEAR = 0.3
"""Frames with something nearer to the camera than this are left out [m]."""
REFLECTANCE = 0.5


@dataclass(frozen=True)
class Frame:
    """depth (H, W) float32 [m], 0 invalid; points (H, W, 3): where the rays truly hit [m]; level (H, W) bool: valid
    depth of a level surface."""

    depth: np.ndarray
    points: np.ndarray
    level: np.ndarray
    world_from_camera: np.ndarray


@dataclass(frozen=True)
class Scene:
    """The true surface, and what was recorded of it."""

    vertices: np.ndarray
    faces: np.ndarray
    camera: Camera
    frames: tuple[Frame, ...]


def camera_of(width: int) -> Camera:
    """Return a 4:3 camera with the field of view of a PrimeSense sensor."""
    height = width * 3 // 4
    return Camera(
        width=width, height=height, fx=525 / 640 * width, fy=525 / 640 * width, cx=(width - 1) / 2, cy=(height - 1) / 2
    )


def raycasting(vertices: np.ndarray, faces: np.ndarray) -> o3d.t.geometry.RaycastingScene:
    """Return a mesh ready for rays."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(vertices, dtype=np.float32)),
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(faces, dtype=np.uint32)),
    )
    return scene


def record(
    vertices: np.ndarray,
    faces: np.ndarray,
    camera: Camera,
    poses: list[np.ndarray],
    noise: np.random.Generator | None,
    counted: int | None = None,
) -> Scene:
    """Record a mesh from poses world_from_camera (4, 4); without `noise` depth is exact. Of the level faces the first
    `counted` count, or all."""
    scene, frames = raycasting(vertices, faces), []
    rays_in_camera = back_project(np.ones((camera.height, camera.width), dtype=np.float32), camera)
    dark = np.full((camera.height, camera.width), REFLECTANCE, dtype=np.float32)
    for pose in poses:
        directions = rays_in_camera @ pose[:3, :3].T
        rays = np.concatenate([np.broadcast_to(pose[:3, 3], directions.shape), directions], axis=-1)
        hit = scene.cast_rays(o3d.core.Tensor.from_numpy(np.ascontiguousarray(rays, dtype=np.float32)))
        exact = hit["t_hit"].numpy()
        exact = np.where(np.isfinite(exact), exact, 0).astype(np.float32)
        normals = hit["primitive_normals"].numpy()
        facing = -np.einsum("ijk,ijk->ij", normals, directions)
        depth = exact
        if noise is not None:
            cosine = np.abs(facing) / np.linalg.norm(directions, axis=-1)
            depth = disturb_depth(exact, cosine.astype(np.float32), dark, np.zeros_like(dark), camera, noise)
        depth = np.where(depth <= FARTHEST, depth, 0).astype(np.float32)
        # Depth that the noise moved to another surface was not measured on this one.
        its_own = np.abs(depth - exact) <= 0.05 + 0.02 * exact**2
        level = (depth > 0) & its_own & (normals[..., 2] >= LEVEL) & (facing > 0)
        if counted is not None:
            level &= hit["primitive_ids"].numpy() < counted
        frames.append(Frame(depth, pose[:3, 3] + exact[..., None] * directions, level, pose))
    return Scene(vertices, faces, camera, tuple(frames))


def board_at(angle: float, camera: Camera, random: np.random.Generator, noisy: bool, frames: int = 20) -> Scene:
    """Return a board of 1.2 x 1.2 m over a floor and before a wall, seen at `angle` [deg] from 1.6 m.

    `random` draws how the board stands to the voxel grid, and the small steps of the camera.
    """
    height, heading = random.uniform(0.7, 0.8), random.uniform(0, 2 * np.pi)
    board = trimesh.creation.box((1.2, 1.2, 0.04), trimesh.transformations.translation_matrix((0, 0, -0.02)))
    wall = trimesh.creation.box((4.0, 0.1, 3.0), trimesh.transformations.translation_matrix((0, 1.5, 0.6)))
    floor = trimesh.creation.box((4.0, 4.0, 0.1), trimesh.transformations.translation_matrix((0, 0, -height - 0.05)))
    whole = trimesh.util.concatenate([board, wall, floor])
    assert isinstance(whole, trimesh.Trimesh)
    world_from_board = trimesh.transformations.rotation_matrix(heading, (0, 0, 1))
    world_from_board[:3, 3] = [*random.uniform(-0.5, 0.5, 2), height]
    poses = []
    for k in range(frames):
        turn = np.radians(8 * np.sin(2 * np.pi * k / frames)) - np.pi / 2
        rise = np.radians(angle)
        eye = 1.6 * np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
        eye += random.normal(0, 0.004, 3)
        up = (0, 0, 1) if angle < 80 else (0, 1, 0)
        poses.append(world_from_board @ look_at(eye, random.normal(0, 0.01, 3), up))
    return record(apply(world_from_board, whole.vertices), whole.faces, camera, poses, random if noisy else None, 12)


def room_at(
    root: Path, name: str, eye_height: float, camera: Camera, random: np.random.Generator, noisy: bool, frames: int
) -> Scene:
    """Return a generated room (`<recipe>-<seed>`), walked through at an eye height [m]. Raises StepFailed."""
    library = make_library(root)
    recipe, seed = name.rsplit("-", 1)
    truth = made(
        "synthesize",
        root / f"{name}-{frames}",
        *("--library", library, "--recipe", recipe, "--seed", seed, "--clutter", "high"),
        *("--frames", frames, "--width", 64, "--height", 48),
    )
    mesh = read_mesh(truth / "mesh.ply")
    scene = raycasting(mesh.vertices, mesh.faces)
    _, walk = read_tum(truth / "trajectory.tum")
    rays = np.concatenate([walk[:, :3, 3], walk[:, :3, 2]], axis=1).astype(np.float32)
    reach = np.clip(scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy(), 0.5, 3.0)
    targets = walk[:, :3, 3] + reach[:, None] * walk[:, :3, 2]
    eyes = walk[:, :3, 3].copy()
    eyes[:, 2] += eye_height - np.median(eyes[:, 2])
    clear = scene.compute_distance(o3d.core.Tensor.from_numpy(eyes.astype(np.float32))).numpy() >= CLEAR
    poses = [look_at(eye, target) for eye, target in zip(eyes[clear], targets[clear], strict=True)]
    return record(np.asarray(mesh.vertices), np.asarray(mesh.faces), camera, poses, random if noisy else None)
