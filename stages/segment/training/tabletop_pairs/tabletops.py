"""Generated tabletops as a structured-light camera sees them: colour, depth and the object of every pixel.

Boxes with printed faces, cans, mugs, bowls and pots are dropped on a table (rigid-body simulation), beside, against and
on one another, also flush boxes and coaxial cans, whose borders only the print shows. Prints are strongly randomised,
so that a learned grouping leans on what holds for every print. Depth has the sensor's noise: constant in inverse
depth, quantised, smeared at edges, and missing where the projector does not reach.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import open3d as o3d
import pybullet
import trimesh
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import look_at

CAMERA = Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
TEXTURE = 96
"""Pixels along a side of a print."""
PROJECTOR = 0.075
"""The projector stands so far beside the camera [m]."""
DISPARITY_STEP = 0.125 / (525.0 * PROJECTOR)
"""An eighth of a pixel of disparity, as inverse depth [1/m]."""
SETTLING_STEPS = 160
"""Steps that a thing is given to settle before the next one is put down. By eye."""


@dataclass
class Thing:
    """One object: its mesh about the middle of its bounds, how it collides, and its prints."""

    mesh: trimesh.Trimesh
    size: np.ndarray
    """(3,) edge lengths of its bounds [m]."""
    round: bool
    prints: list[np.ndarray] = field(default_factory=list)
    """Six (TEXTURE, TEXTURE, 3) float32 RGB 0..1: faces -x +x -y +y -z +z; a round thing uses jacket, inside, lid."""
    world_from_thing: np.ndarray = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True)
class Tabletop:
    """One generated frame."""

    color: np.ndarray
    """(H, W, 3) uint8 RGB."""
    depth: np.ndarray
    """(H, W) float32 [m], 0 missing."""
    labels: np.ndarray
    """(H, W) int32: 0 table or nothing, else the object."""


def _print(random: np.random.Generator, palette: np.ndarray, busy: float) -> np.ndarray:
    """A face with figures, bands and lines in the colours of a palette (K, 3)."""
    image = np.empty((TEXTURE, TEXTURE, 3), np.float32)
    image[:] = palette[0]

    def shade() -> tuple[float, ...]:
        return tuple(float(c) for c in palette[random.integers(len(palette))])

    if random.random() < 0.5 * busy:
        for _ in range(random.integers(1, 3)):
            low = int(random.integers(0, TEXTURE - 8))
            image[low : low + int(random.integers(4, TEXTURE // 2))] = shade()
    for _ in range(random.poisson(5 * busy)):
        x, y = (int(k) for k in random.integers(0, TEXTURE, 2))
        w, h = (int(k) for k in random.integers(5, TEXTURE // 2, 2))
        kind = random.random()
        if kind < 0.4:
            cv2.rectangle(image, (x, y), (x + w, y + h), shade(), -1)
        elif kind < 0.7:
            cv2.ellipse(image, (x, y), (w // 2, h // 2), float(random.uniform(0, 180)), 0, 360, shade(), -1)
        else:
            for line in range(random.integers(2, 7)):
                cv2.line(image, (x, y + 4 * line), (x + w, y + 4 * line), shade(), 1)
    image += random.normal(0, 0.05) * np.linspace(-1, 1, TEXTURE, dtype=np.float32)[:, None, None]
    if busy > 0.5:
        image += cv2.resize(random.normal(0, 0.05, (12, 12, 3)).astype(np.float32), (TEXTURE, TEXTURE))
    return np.clip(image, 0, 1).astype(np.float32)


def _palette(random: np.random.Generator) -> np.ndarray:
    base = random.uniform(0.05, 0.95, 3) if random.random() < 0.7 else np.full(3, random.uniform(0.3, 0.97))
    others = random.uniform(0, 1, (random.integers(1, 5), 3))
    # Most real surfaces are paler than evenly drawn colours.
    base = base + (base.mean() - base) * random.uniform(0, 0.9)
    others = others + (others.mean(axis=1, keepdims=True) - others) * random.uniform(0, 0.7)
    if random.random() < 0.4:
        others = np.clip(base + random.normal(0, 0.15, others.shape), 0, 1)
    return np.vstack([base, others])


def _with_prints(thing: Thing, random: np.random.Generator) -> Thing:
    palette = _palette(random)
    busy = float(random.choice([0.0, 0.4, 1.0, 1.6], p=[0.25, 0.25, 0.3, 0.2]))
    sides = _palette(random) if random.random() < 0.15 else palette
    thing.prints = [_print(random, palette if k in (1, 3, 5) else sides, busy) for k in range(6)]
    if thing.round:
        plain = random.random() < 0.5
        thing.prints[4] = _print(random, palette[:1] if plain else _palette(random), busy if not plain else 0.0)
    return thing


def make_box(random: np.random.Generator) -> Thing:
    """A carton, a book or a block."""
    kind = random.random()
    if kind < 0.55:
        size = [random.uniform(0.10, 0.24), random.uniform(0.04, 0.09), random.uniform(0.14, 0.30)]
    elif kind < 0.75:
        size = [random.uniform(0.12, 0.24), random.uniform(0.10, 0.20), random.uniform(0.015, 0.05)]
    else:
        size = random.uniform(0.04, 0.12, 3).tolist()
    size = [size[k] for k in random.permutation(3)]
    mesh = trimesh.creation.box(extents=size)
    return _with_prints(Thing(mesh, np.array(size), round=False), random)


def _revolved(profile: list[tuple[float, float]]) -> trimesh.Trimesh:
    mesh = trimesh.creation.revolve(np.array(profile), sections=40)
    mesh.apply_translation([0, 0, -0.5 * (mesh.bounds[0, 2] + mesh.bounds[1, 2])])
    return mesh


def make_round(random: np.random.Generator) -> Thing:
    """A can, a mug, a bowl or a pot, some with a handle, some upside down."""
    kind = random.random()
    if kind < 0.4:
        radius, height = random.uniform(0.025, 0.055), random.uniform(0.06, 0.24)
        rim = random.uniform(0, 0.002)
        profile = [(0, 0), (radius, 0), (radius, height), (radius - 0.003, height), (radius - 0.004, height - rim)]
        mesh = _revolved([*profile, (0, height - rim)])
    elif kind < 0.5:
        radius, height = random.uniform(0.07, 0.12), random.uniform(0.04, 0.09)
        mesh = _revolved([(0, 0), (radius, 0), (radius, height - 0.006), (radius - 0.006, height), (0, height)])
    elif kind < 0.75:
        radius, height, wall = random.uniform(0.03, 0.05), random.uniform(0.07, 0.12), 0.004
        bottom = random.uniform(0.75, 1.0) * radius
        inside = [(radius - wall, height), (bottom - wall, wall + 0.002), (0, wall + 0.002)]
        mesh = _revolved([(0, 0), (bottom, 0), (radius, height), *inside])
        if random.random() < 0.8:
            handle = trimesh.creation.torus(0.3 * height, 0.006, major_sections=20, minor_sections=8)
            handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
            handle.apply_translation([0.5 * (radius + bottom) + 0.2 * height, 0, 0])
            mesh = trimesh.util.concatenate([mesh, handle])  # type: ignore[assignment]
    else:
        radius, height, wall = random.uniform(0.06, 0.11), random.uniform(0.05, 0.11), 0.004
        foot = random.uniform(0.35, 1.0) * radius
        steps = np.linspace(0, 1, 8)
        # From a cone to a quarter circle between the foot and the rim.
        bend = random.uniform(0.4, 1.0)
        outer = [(foot + (radius - foot) * s**bend, height * s ** (2 - bend)) for s in steps]
        inner = [(max(0.0, r - wall), h + wall * 0.5) for r, h in reversed(outer)]
        mesh = _revolved([(0, 0), *outer, *inner, (0, wall)])
        if random.random() < 0.35:
            for sign in (-1, 1):
                grip = trimesh.creation.box(extents=[0.03, 0.05, 0.012])
                grip.apply_translation([sign * (radius + 0.01), 0, 0.3 * height])
                mesh = trimesh.util.concatenate([mesh, grip])  # type: ignore[assignment]
    if random.random() < 0.2:
        mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))
    return _with_prints(Thing(mesh, np.ptp(mesh.bounds, axis=0), round=True), random)


def _arrange(random: np.random.Generator, count: int) -> list[Thing]:
    """Drop things one after another; the pose of each is that in which all come to rest."""
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    ground = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[2, 2, 0.05], physicsClientId=client)
    pybullet.createMultiBody(0, ground, basePosition=[0, 0, -0.05], physicsClientId=client)
    things: list[Thing] = []
    bodies: list[int] = []
    try:
        while len(things) < count:
            twin = None
            place, yaw, lay = random.normal(0, 0.16, 2), random.uniform(0, 2 * np.pi), random.random() < 0.15
            low = 0.0
            choice = random.random()
            if things and choice < 0.16:
                twin = int(random.integers(len(things)))
            thing = make_box(random) if random.random() < 0.58 else make_round(random)
            if twin is not None:
                # The same thing again, flush on or beside the first, with prints of its own.
                first = things[twin]
                thing = _with_prints(Thing(first.mesh.copy(), first.size.copy(), first.round), random)
                position, orientation = pybullet.getBasePositionAndOrientation(bodies[twin], physicsClientId=client)
                turn = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)
                axis = 2 if first.round else int(random.integers(3))
                offset = turn[:, axis] * (first.size[axis] + 0.0005)
                offset = offset if offset[2] >= -0.01 else -offset
                target = np.array(position) + offset + turn @ random.normal(0, 0.0012, 3)
                quaternion = orientation
            else:
                if things and choice < 0.42:
                    other = int(random.integers(len(things)))
                    seen = pybullet.getAABB(bodies[other], physicsClientId=client)
                    place = np.array(seen[0][:2]) + random.uniform(0.2, 0.8, 2) * (
                        np.array(seen[1][:2]) - np.array(seen[0][:2])
                    )
                    low = seen[1][2]
                elif things and choice < 0.7:
                    other = int(random.integers(len(things)))
                    position, _ = pybullet.getBasePositionAndOrientation(bodies[other], physicsClientId=client)
                    angle = random.uniform(0, 2 * np.pi)
                    reach = (
                        0.5 * (np.hypot(*thing.size[:2]) + np.hypot(*things[other].size[:2])) * random.uniform(0.7, 1)
                    )
                    place = np.array(position[:2]) + reach * np.array([np.cos(angle), np.sin(angle)])
                tilt = np.pi / 2 if lay else random.normal(0, 0.02)
                quaternion = pybullet.getQuaternionFromEuler([tilt, 0, yaw])
                half = 0.5 * (thing.size[1] if lay else thing.size[2])
                target = np.array([*place, low + half + 0.004])
            if thing.round:
                shape = pybullet.createCollisionShape(
                    pybullet.GEOM_CYLINDER,
                    radius=0.5 * float(thing.size[1]),
                    height=float(thing.size[2]),
                    physicsClientId=client,
                )
            else:
                shape = pybullet.createCollisionShape(
                    pybullet.GEOM_BOX, halfExtents=(0.5 * thing.size).tolist(), physicsClientId=client
                )
            body = pybullet.createMultiBody(
                0.3, shape, basePosition=target.tolist(), baseOrientation=quaternion, physicsClientId=client
            )
            pybullet.changeDynamics(
                body,
                -1,
                lateralFriction=1.0,
                rollingFriction=0.01,
                spinningFriction=0.01,
                restitution=0.0,
                physicsClientId=client,
            )
            pybullet.performCollisionDetection(physicsClientId=client)
            deep = [
                c
                for other_body in bodies
                for c in pybullet.getClosestPoints(body, other_body, 0.0, physicsClientId=client)
                if c[8] < -0.004
            ]
            if deep:
                pybullet.removeBody(body, physicsClientId=client)
                if random.random() < 0.05:
                    count -= 1
                continue
            things.append(thing)
            bodies.append(body)
            for _ in range(SETTLING_STEPS):
                pybullet.stepSimulation(physicsClientId=client)
        kept = []
        for thing, body in zip(things, bodies, strict=True):
            position, orientation = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
            thing.world_from_thing[:3, :3] = np.array(pybullet.getMatrixFromQuaternion(orientation)).reshape(3, 3)
            thing.world_from_thing[:3, 3] = position
            if np.hypot(*position[:2]) < 0.6:
                kept.append(thing)
        return kept
    finally:
        pybullet.disconnect(client)


def _surface_colors(thing: Thing, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Colours (N, 3) of points (N, 3) and normals (N, 3) in the thing's own frame."""
    half = 0.5 * thing.size
    if thing.round:
        radial = np.hypot(points[:, 0], points[:, 1])
        inward = (normals[:, :2] * points[:, :2]).sum(axis=1) < -0.2 * radial
        lid = np.abs(normals[:, 2]) > 0.8
        face = np.where(lid, 5, np.where(inward, 4, 1))
        u = np.where(lid, points[:, 0] / (2 * half[0]) + 0.5, (np.arctan2(points[:, 1], points[:, 0]) / np.pi) % 1)
        v = np.where(lid, points[:, 1] / (2 * half[1]) + 0.5, points[:, 2] / (2 * half[2]) + 0.5)
    else:
        scaled = points / half
        axis = np.argmax(np.abs(scaled), axis=1)
        rows = np.arange(len(points))
        face = 2 * axis + (scaled[rows, axis] > 0)
        u, v = scaled[rows, (axis + 1) % 3] * 0.5 + 0.5, scaled[rows, (axis + 2) % 3] * 0.5 + 0.5
    colors = np.empty((len(points), 3), np.float32)
    column = np.clip((u * TEXTURE).astype(int), 0, TEXTURE - 1)
    row = np.clip((v * TEXTURE).astype(int), 0, TEXTURE - 1)
    for k in range(6):
        here = face == k
        colors[here] = thing.prints[k][row[here], column[here]]
    return colors


def _sensed(
    depth: np.ndarray, slant: np.ndarray, lit: np.ndarray, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth (H, W) as the sensor gives it, and the (row, column) in the exact image that every pixel comes from."""
    height, width = depth.shape
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32)
    wander = [cv2.GaussianBlur(random.normal(0, 1, depth.shape).astype(np.float32), (0, 0), 1.5) * 3 for _ in range(2)]
    rows = np.clip(np.round(rows + wander[0]), 0, height - 1).astype(int)
    columns = np.clip(np.round(columns + wander[1]), 0, width - 1).astype(int)
    moved, moved_slant, moved_lit = depth[rows, columns], slant[rows, columns], lit[rows, columns]
    fine = cv2.GaussianBlur(random.normal(0, 1, depth.shape).astype(np.float32), (0, 0), 1.2) * 4.0
    inverse = 1 / np.maximum(moved, 1e-3) + 0.0012 * fine
    # The eighth of a pixel is a step of the matcher; the device interpolates a little.
    inverse = np.round(inverse / DISPARITY_STEP + random.uniform(-0.2, 0.2, depth.shape)) * DISPARITY_STEP
    keep = (moved > 0) & moved_lit & (moved_slant > random.uniform(0.05, 0.2))
    speckle = cv2.GaussianBlur(random.normal(0, 1, depth.shape).astype(np.float32), (0, 0), 2.0)
    keep &= speckle < 0.62
    return np.where(keep, 1 / np.maximum(inverse, 1e-3), 0).astype(np.float32), rows, columns


def make_tabletop(seed: int) -> Tabletop:
    """Return the generated tabletop of a seed; the same seed gives the same frame."""
    random = np.random.default_rng([seed, 4711])
    count = int(random.choice([2, 3, 4, 6, 9, 13], p=[0.15, 0.15, 0.2, 0.2, 0.2, 0.1]))
    things = _arrange(random, count)
    bend = random.uniform(0.3, 1.1)
    distance = random.uniform(0.75, 1.25)
    eye = distance * np.array([0.1 * random.normal(), -np.cos(bend), np.sin(bend)])
    world_from_camera = look_at(eye, np.array([*random.normal(0, 0.04, 2), 0.05]))

    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    table = trimesh.creation.box(extents=[1.8, 1.8, 0.02])
    table.apply_translation([0, 0, -0.01])
    for mesh, pose in [(table, np.eye(4)), *((thing.mesh, thing.world_from_thing) for thing in things)]:
        vertices = mesh.vertices @ pose[:3, :3].T + pose[:3, 3]
        scene.add_triangles(
            o3d.core.Tensor(vertices.astype(np.float32)),  # type: ignore[call-overload]
            o3d.core.Tensor(mesh.faces.astype(np.uint32)),  # type: ignore[call-overload]
        )
    rays_in_camera = back_project(np.ones((CAMERA.height, CAMERA.width), np.float32), CAMERA).reshape(-1, 3)
    directions = rays_in_camera @ world_from_camera[:3, :3].T
    origins = np.broadcast_to(world_from_camera[:3, 3], directions.shape)
    rays = np.concatenate([origins, directions], axis=1).astype(np.float32)
    hits = scene.cast_rays(o3d.core.Tensor(rays), nthreads=1)  # type: ignore[call-overload]
    depth = hits["t_hit"].numpy()
    hit = np.isfinite(depth)
    depth = np.where(hit, depth, 0).astype(np.float32)
    owner = np.where(hit, hits["geometry_ids"].numpy().astype(np.int64), 0).astype(np.int32)
    normals = hits["primitive_normals"].numpy()
    points = origins + directions * depth[:, None]
    normals = normals * np.where((normals * directions).sum(axis=1, keepdims=True) > 0, -1, 1)
    slant = -(normals * directions).sum(axis=1) / np.linalg.norm(directions, axis=1)

    projector = world_from_camera[:3, 3] + world_from_camera[:3, 0] * PROJECTOR
    reach = projector - points
    length = np.linalg.norm(reach, axis=1, keepdims=True)
    shadow_rays = np.concatenate([points + normals * 0.002, reach / length], axis=1).astype(np.float32)
    tensor = o3d.core.Tensor(shadow_rays)  # type: ignore[call-overload]
    lit = ~scene.test_occlusions(tensor, 0.0, 10.0, nthreads=1).numpy()

    lamp = random.normal(0, 1, 3) * [1, 1, 0] + [0, 0, random.uniform(0.8, 3)]
    lamp /= np.linalg.norm(lamp)
    light = random.uniform(0.35, 0.65) + random.uniform(0.3, 0.6) * np.maximum(normals @ lamp, 0)
    albedo = np.empty((len(depth), 3), np.float32)
    # The table.
    albedo[:] = _palette(random)[0]
    for k, thing in enumerate(things, start=1):
        own = owner == k
        if own.any():
            turn, shift = thing.world_from_thing[:3, :3], thing.world_from_thing[:3, 3]
            albedo[own] = _surface_colors(thing, (points[own] - shift) @ turn, normals[own] @ turn)
    shape = (CAMERA.height, CAMERA.width)
    color = (albedo * light[:, None] * random.uniform(0.75, 1.1) * random.uniform(0.92, 1.08, 3)).reshape(*shape, 3)
    color = cv2.GaussianBlur(color.astype(np.float32), (0, 0), random.uniform(0.5, 1.1))
    color += random.normal(0, 0.012, color.shape).astype(np.float32)
    # The two cameras of such a device agree within a pixel or two.
    shift = np.array([[1, 0, random.normal(0, 1.2)], [0, 1, random.normal(0, 0.8)]], np.float32)
    color = cv2.warpAffine(color, shift, (shape[1], shape[0]), borderMode=cv2.BORDER_REPLICATE)
    sensed, rows, columns = _sensed(depth.reshape(shape), slant.reshape(shape), lit.reshape(shape), random)
    labels = np.where(sensed > 0, owner.reshape(shape)[rows, columns], 0).astype(np.int32)
    return Tabletop(np.round(np.clip(color, 0, 1) * 255).astype(np.uint8), sensed, labels)
