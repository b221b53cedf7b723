"""A cupboard in a corner with a door or a drawer, shut in the first half of a walk and open in the second."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d as o3d
import trimesh
from scenewright.schemas.base import as_transform
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Gravity, Sequence, SequenceCamera, SequenceFile
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import look_at

CAMERA = Camera(width=320, height=240, fx=262.0, fy=262.0, cx=159.5, cy=119.5)
WIDTH, DEEP, HIGH, THICK = 0.6, 0.5, 0.8, 0.02
FRONT = 1.5
"""y of the shut front [m]; the room is before it."""


def block(low, high):
    return trimesh.creation.box(bounds=np.array([low, high], dtype=float))


def carcass():
    """A box without a front, between x of 0 and WIDTH, a board inside, and floor and wall."""
    x, y, z = WIDTH, FRONT + DEEP, HIGH
    return [
        block((0, FRONT, 0), (THICK, y, z)),
        block((x - THICK, FRONT, 0), (x, y, z)),
        block((0, FRONT, z - THICK), (x, y, z)),
        block((0, FRONT, 0), (x, y, THICK)),
        block((0, y - THICK, 0), (x, y, z)),
        block((-2, -2, -0.1), (2.5, y + 0.1, 0)),
        block((-2, y, 0), (2.5, y + 0.1, 2.4)),
    ]


def with_door(angle):
    """A door over the whole front, hinged at x = 0, turned open by an angle [rad]."""
    leaf = block((0, FRONT - THICK, 0.02), (WIDTH, FRONT, HIGH - 0.02))
    turn = trimesh.transformations.rotation_matrix(-angle, (0, 0, 1), (0, FRONT, 0))
    return [*carcass(), leaf.apply_transform(turn)]


def with_drawer(out):
    """A drawer in the upper part, pulled out by so much [m], over a fixed lower front."""
    low, high, y = HIGH - 0.25, HIGH - 0.03, FRONT - out
    parts = [
        block((0.01, y - THICK, low), (WIDTH - 0.01, y, high)),
        block((0.03, y, low), (WIDTH - 0.03, y + 0.42, low + 0.012)),
        block((0.03, y, low), (0.042, y + 0.42, high - 0.06)),
        block((WIDTH - 0.042, y, low), (WIDTH - 0.03, y + 0.42, high - 0.06)),
        block((0, FRONT - THICK, 0), (WIDTH, FRONT, low - 0.02)),
    ]
    return [*carcass(), *parts]


def depth_of(meshes, pose, camera=CAMERA, random=None):
    """z-depth (H, W) [m], with the noise of a structured-light camera where `random` is given."""
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    whole = trimesh.util.concatenate(meshes)
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(np.asarray(whole.vertices, dtype=np.float32)),
        o3d.core.Tensor.from_numpy(np.asarray(whole.faces, dtype=np.uint32)),
    )
    directions = back_project(np.ones((camera.height, camera.width), np.float32), camera) @ pose[:3, :3].T
    rays = np.concatenate([np.broadcast_to(pose[:3, 3], directions.shape), directions], axis=-1).astype(np.float32)
    depth = scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy()
    depth = np.where(np.isfinite(depth), depth, 0).astype(np.float32)
    if random is not None:
        depth += (0.0015 * depth**2 * random.standard_normal(depth.shape)).astype(np.float32)
    return depth


def poses(count):
    """Looks at the cupboard from before it, from the left to the right, from two heights."""
    looks = []
    for k, side in enumerate(np.linspace(-0.7, 0.9, count)):
        eye = np.array([0.3 + side, FRONT - 1.5, 1.5 if k % 2 else 1.2])
        looks.append(look_at(eye, np.array([0.3, FRONT, 0.45])))
    return looks


def write_sequence(folder: Path, states, frames: int = 12, *, noise: bool = True, depth: bool = True) -> Sequence:
    """Write a sequence: so many frames of each of the states (lists of meshes), one after the other."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(5) if noise else None
    with FrameWriter(folder / "frames.mcap", CAMERA) as writer:
        time = 0.0
        for meshes in states:
            for pose in poses(frames):
                time += 0.1
                writer.write(time, None, depth_of(meshes, pose, random=random) if depth else None, pose)
    gravity = Gravity(method="given", world_from_log=as_transform(np.eye(4)))
    count = frames * len(states)
    SequenceFile(
        source_format="test",
        rule="test",
        camera=CAMERA,
        cameras=(SequenceCamera(name="camera", camera=CAMERA),),
        streams=("depth", "pose") if depth else ("pose",),
        frame_count=count,
        frames_in_log=count,
        gravity=gravity,
    ).write(folder / "sequence.json")
    return Sequence(folder)
