"""TSDF integration and the label vote: known surfaces, a second implementation, growth, threads."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.fuse.integration import integrate
from scenewright.stages.fuse.surface import extract_surface
from scenewright.stages.fuse.voxel_blocks import SIDE, VoxelBlocks
from scenewright.stages.kit.geometry.transforms import look_at

from tests.unit.fuse.scenes import CAMERA, SCENE, color_of, orbit, render, sphere_depth

VOXEL = 0.02
TRUNCATION = 4 * VOXEL
LIMITS = {"truncation": TRUNCATION, "near": 0.1, "far": 4.0}


def box_distance(points: np.ndarray, minimum: np.ndarray, maximum: np.ndarray) -> np.ndarray:
    """Distance (N,) of points to the surface of a box."""
    outside = np.maximum(np.maximum(minimum - points, points - maximum), 0)
    inside = np.minimum(points - minimum, maximum - points).min(axis=1)
    return np.where((outside > 0).any(axis=1), np.linalg.norm(outside, axis=1), np.maximum(inside, 0))


def fused(frames: list[tuple[np.ndarray, np.ndarray]], capacity: int = 4096, **options: object) -> VoxelBlocks:
    blocks = VoxelBlocks(VOXEL, capacity)
    for depth, pose in frames:
        integrate(blocks, depth, CAMERA, pose, **LIMITS, **options)
    return blocks


def test_plane_seen_obliquely() -> None:
    pose = look_at(np.array([0.3, -1.2, 0.9]), np.array([0.1, 0.0, 0.0]))
    depth, _ = render(SCENE[:1], pose)
    surface = extract_surface(fused([(depth, pose)]), minimum_weight=0.01)
    assert len(surface.faces) > 500
    near = np.linalg.norm(surface.vertices - pose[:3, 3], axis=1) < 2.0  # farther off, a pixel is wider than a voxel
    height = np.abs(surface.vertices[near, 2])
    assert height.mean() < 0.002
    corners = surface.vertices[surface.faces].astype(float)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert -normals[:, 2].clip(max=0).sum() < 1e-3 * normals[:, 2].sum(), "faces look towards free space"


def test_sphere_from_all_sides() -> None:
    center, radius = np.array([0.05, -0.03, 0.4]), 0.3
    poses = [*orbit(8, height=0.4, target=tuple(center)), *orbit(4, radius=0.6, height=1.8, target=tuple(center))]
    frames = [(sphere_depth(center, radius, pose, CAMERA), pose) for pose in poses]
    surface = extract_surface(fused(frames), minimum_weight=0.1)
    distance = np.linalg.norm(surface.vertices - center, axis=1) - radius
    assert np.abs(distance).mean() < 0.002
    assert np.percentile(np.abs(distance), 95) < 0.005


def test_noise_averages_out() -> None:
    random = np.random.default_rng(0)
    frames = []
    for pose in orbit(24):
        depth, _ = render(SCENE, pose)
        sigma = 0.0012 + 0.0019 * (depth - 0.4) ** 2
        frames.append(((depth + sigma * random.standard_normal(depth.shape)).astype(np.float32), pose))
    surface = extract_surface(fused(frames), minimum_weight=0.5)
    boxes = [box_distance(surface.vertices, np.array(b.minimum), np.array(b.maximum)) for b in SCENE]
    error = np.min(boxes, axis=0)
    assert len(surface.vertices) > 5000
    assert error.mean() < 0.002, "mean surface error at 2 cm voxels"


def test_depth_weighs_by_the_inverse_of_its_variance() -> None:
    depth = np.full((CAMERA.height, CAMERA.width), 1.5, np.float32)
    blocks = VoxelBlocks(VOXEL)
    for nearer, deviation in ((0.0, 0.01), (0.02, 0.04)):
        integrate(
            blocks, depth + np.float32(nearer), CAMERA, np.eye(4), **LIMITS, deviation=np.full_like(depth, deviation)
        )
    surface = extract_surface(blocks, minimum_weight=0.1)
    assert blocks.weight.max() == pytest.approx(1.25), "0.02 m or less weighs 1, 0.04 m a quarter"
    assert np.median(surface.vertices[:, 2]) == pytest.approx(1.5 + 0.02 * 0.25 / 1.25, abs=2e-4)


def test_unknown_deviations_change_nothing_and_large_ones_are_no_hits() -> None:
    frames = [(render(SCENE, pose)[0], pose) for pose in orbit(2)]
    unknown = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    plain, same, unsure = fused(frames), fused(frames, deviation=unknown), fused(frames, deviation=unknown + 0.1)
    for name in ("tsdf", "weight", "hits"):
        assert getattr(plain, name).tobytes() == getattr(same, name).tobytes()
    assert plain.hits.max() > 0 and unsure.hits.max() == 0
    assert 0 < unsure.weight.max() < 0.1


def plain_integrate(
    state: dict[tuple[int, int, int], dict[str, float]],
    voxels: np.ndarray,
    depth: np.ndarray,
    color: np.ndarray,
    index_image: np.ndarray,
    labels: np.ndarray,
    camera: Camera,
    world_from_camera: np.ndarray,
    band: float,
) -> None:
    """The same arithmetic, one voxel at a time, in float64."""
    camera_from_world = np.linalg.inv(world_from_camera)
    for voxel in map(tuple, voxels.tolist()):
        x, y, z = camera_from_world[:3, :3] @ ((np.array(voxel) + 0.5) * VOXEL) + camera_from_world[:3, 3]
        if z < 0.1:
            continue
        u, v = camera.fx * x / z + camera.cx + 0.5, camera.fy * y / z + camera.cy + 0.5
        cell = state.setdefault(
            voxel, {"tsdf": 0.0, "weight": 0.0, "red": 0.0, "segment": 0, "votes": 0, "doubtful": False}
        )
        if abs(u - round(u)) < 1e-3 or abs(v - round(v)) < 1e-3:
            cell["doubtful"] = True  # the pixel depends on rounding
        if not (0 <= u < camera.width and 0 <= v < camera.height):
            continue
        measured = float(depth[int(v), int(u)])
        distance = measured - z
        if not 0.1 <= measured <= 4.0 or distance <= -TRUNCATION:
            continue
        if min(abs(abs(distance) - band), abs(abs(distance) - TRUNCATION)) < 1e-6:
            cell["doubtful"] = True
        gain = min(1.0, 1 / measured**2)
        if distance < -VOXEL:
            gain *= (TRUNCATION + distance) / (TRUNCATION - VOXEL)
        total = cell["weight"] + gain
        cell["tsdf"] = (cell["tsdf"] * cell["weight"] + min(1.0, distance / TRUNCATION) * gain) / total
        cell["weight"] = total
        if distance > TRUNCATION:
            continue
        share = 1.0 if cell["red"] == 0 else gain / total
        cell["red"] += share * (color[int(v), int(u), 0] - cell["red"])
        label = int(labels[index_image[int(v), int(u)]])
        if abs(distance) <= band and label > 0:
            if cell["segment"] == label:
                cell["votes"] += 1
            else:
                cell["votes"] -= 1
                if cell["votes"] < 0:
                    cell["segment"], cell["votes"] = label, 1


@pytest.mark.slow
def test_plain_numpy_gives_the_same_numbers() -> None:
    camera = Camera(width=40, height=30, fx=60.0, fy=60.0, cx=19.5, cy=14.5)
    target = np.array([0.0, 0.0, 0.5])
    poses = [look_at(np.array(eye), target) for eye in ([0.9, 0.1, 1.0], [0.2, -0.9, 1.1], [-0.8, -0.5, 0.9])]
    labels = np.array([0, 1, 2, 3, 4], dtype=np.int32)
    band = 0.5 * TRUNCATION
    blocks = VoxelBlocks(VOXEL, 64)
    history = []
    for number, pose in enumerate(poses):
        depth, image = render(SCENE, pose, camera)
        color = np.maximum(color_of(image), 20)
        turned = np.roll(labels, 0) if number < 2 else np.array([0, 2, 1, 3, 4], dtype=np.int32)
        count = integrate(
            blocks,
            depth,
            camera,
            pose,
            **LIMITS,
            color=color,
            index_image=image.astype(np.uint16),
            label_of_index=turned,
            canonical=labels,
            label_band=band,
            stride=2,
        )
        touched = blocks.coordinates[: blocks.count][blocks.last_touched[: blocks.count] == blocks._stamp]
        assert len(touched) == count
        history.append((touched, depth, color, image, turned, pose))
    inside = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    state: dict[tuple[int, int, int], dict[str, float]] = {}
    for touched, depth, color, image, turned, pose in history:
        voxels = (touched[:, None, :] * SIDE + inside[None]).reshape(-1, 3)
        plain_integrate(state, voxels, depth, color, image, turned, camera, pose, band)
    slot_of = {tuple(c): slot for slot, c in enumerate(blocks.coordinates[: blocks.count].tolist())}
    compared = labelled = doubtful = 0
    for voxel, cell in state.items():
        if cell["doubtful"]:
            doubtful += 1
            continue
        slot = slot_of[tuple(c // SIDE for c in voxel)]
        place = (voxel[0] % SIDE) + SIDE * (voxel[1] % SIDE) + SIDE * SIDE * (voxel[2] % SIDE)
        assert blocks.weight[slot, place] == pytest.approx(cell["weight"], rel=2e-4, abs=1e-5)
        assert blocks.tsdf[slot, place] == pytest.approx(cell["tsdf"], abs=1e-4)
        assert blocks.color[slot, place, 0] / 256 == pytest.approx(cell["red"], abs=0.1)
        assert (blocks.segment[slot, place], blocks.votes[slot, place]) == (cell["segment"], cell["votes"])
        compared += 1
        labelled += cell["segment"] > 0
    assert labelled > 1000
    assert doubtful < 0.05 * compared


def test_vote_is_taken_over_after_a_majority() -> None:
    pose = look_at(np.array([0.0, -1.0, 1.0]), np.array([0.0, 0.0, 0.0]))
    depth, image = render(SCENE[:1], pose)
    canonical = np.arange(6, dtype=np.int32)
    blocks = VoxelBlocks(VOXEL)

    def vote(label: int) -> tuple[int, int]:
        integrate(
            blocks,
            depth,
            CAMERA,
            pose,
            **LIMITS,
            index_image=image.astype(np.uint16),
            label_of_index=np.array([0, label], dtype=np.int32),
            canonical=canonical,
        )
        near = (blocks.segment > 0) & (np.abs(blocks.tsdf) < 0.2)
        (label,), (votes,) = np.unique(blocks.segment[near]), np.unique(blocks.votes[near])
        return int(label), int(votes)

    assert [vote(1), vote(1), vote(2), vote(2), vote(2), vote(0)] == [(1, 1), (1, 2), (1, 1), (1, 0), (2, 1), (2, 1)]
    canonical[2] = 1
    assert vote(1) == (2, 2), "a label that was merged into another votes with it"


def test_growth_changes_nothing() -> None:
    frames = [(render(SCENE, pose)[0], pose) for pose in orbit(4)]
    small, large = fused(frames, capacity=16), fused(frames, capacity=8192)
    assert small.capacity > 16 and small.count == large.count
    first, second = small.canonical_order(), large.canonical_order()
    assert np.array_equal(small.coordinates[first], large.coordinates[second])
    for name in ("tsdf", "weight"):
        assert np.array_equal(getattr(small, name)[first], getattr(large, name)[second])


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
def test_threads_change_nothing() -> None:
    frames = [(render(SCENE, pose)[0], pose) for pose in orbit(3)]
    before = numba.get_num_threads()
    try:
        results = []
        for threads in (1, numba.config.NUMBA_NUM_THREADS):
            numba.set_num_threads(threads)
            blocks = fused(frames)
            results.append((blocks, extract_surface(blocks, minimum_weight=0.1)))
    finally:
        numba.set_num_threads(before)
    (one, first), (many, second) = results
    assert one.tsdf.tobytes() == many.tsdf.tobytes()
    assert first.vertices.tobytes() == second.vertices.tobytes() and first.faces.tobytes() == second.faces.tobytes()


def test_depth_outside_of_the_range_is_not_used() -> None:
    pose = look_at(np.array([0.0, -1.0, 1.0]), np.zeros(3))
    blocks = VoxelBlocks(VOXEL)
    for value in (0.0, 0.05, 4.5, np.nan, np.inf):
        depth = np.full((CAMERA.height, CAMERA.width), value, dtype=np.float32)
        assert integrate(blocks, depth, CAMERA, pose, **LIMITS) == 0
    assert blocks.count == 0
