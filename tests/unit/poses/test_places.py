"""Features, their matches, and recognising places."""

from __future__ import annotations

import numpy as np
from scenewright.stages.kit.geometry.transforms import apply, transform_from
from scenewright.stages.kit.registration.rigid_motion import between, distance_of
from scenewright.stages.poses.features import Features, find_features, match_features, ransac_motion, rigid_motions
from scenewright.stages.poses.loops import LEAST_WORDS
from scenewright.stages.poses.places import Ferns, PlaceIndex, fern_likeness
from scipy.spatial.transform import Rotation

from tests.unit.poses.textured_room import CAMERA, render, round_walk

WALK = round_walk(13)


def made_up(points: np.ndarray, descriptors: np.ndarray) -> Features:
    return Features(np.zeros((len(points), 2), np.float32), points.astype(np.float32), descriptors)


def test_a_motion_is_found_among_wrong_matches() -> None:
    random = np.random.default_rng(1)
    descriptors = random.integers(0, 256, (60, 32), dtype=np.uint8)
    points = random.uniform(-1, 1, (60, 3)) + [0, 0, 2.5]
    motion = transform_from(Rotation.from_rotvec([0.2, -0.4, 0.1]).as_matrix(), np.array([0.3, 0.1, -0.2]))
    moved = apply(motion, points)
    moved[:25] = random.uniform(-1, 1, (25, 3)) + [0, 0, 2.5]
    found = ransac_motion(made_up(moved, descriptors), made_up(points, descriptors), random)
    assert found is not None and found.inliers >= 35
    np.testing.assert_allclose(found.target_from_source, motion, atol=0.02)


def test_places_and_matches_of_descriptors_of_real_numbers() -> None:
    random = np.random.default_rng(1)
    descriptors = random.normal(size=(60, 64)).astype(np.float32)
    descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
    again = descriptors[::-1] + random.normal(0, 0.03, (60, 64)).astype(np.float32)
    again /= np.linalg.norm(again, axis=1, keepdims=True)
    again[:20] = -again[:20]
    points = np.zeros((60, 3))
    pairs = match_features(made_up(points, descriptors), made_up(points, again))
    assert pairs.tolist() == [[59 - k, k] for k in range(20, 60)]
    index = PlaceIndex(random)
    for seen in (descriptors, random.normal(size=(60, 64)), again):
        index.add(seen)
    likeness = index.scores(2)
    assert likeness[0] > LEAST_WORDS > 2 * likeness[1]


def test_points_on_a_line_fix_no_motion() -> None:
    random = np.random.default_rng(1)
    descriptors = random.integers(0, 256, (20, 32), dtype=np.uint8)
    line = np.column_stack([np.linspace(0, 1, 20), np.zeros(20), np.full(20, 2.0)])
    assert ransac_motion(made_up(line, descriptors), made_up(line, descriptors), random) is None


def test_rigid_motions_are_exact_and_never_mirror() -> None:
    random = np.random.default_rng(2)
    source = random.normal(size=(5, 3, 3))
    motions = np.array(
        [transform_from(Rotation.random(random_state=k).as_matrix(), random.normal(size=3)) for k in range(5)]
    )
    target = np.array([apply(motion, points) for motion, points in zip(motions, source, strict=True)])
    np.testing.assert_allclose(rigid_motions(target, source), motions, atol=1e-9)


def test_frames_of_one_place_are_alike() -> None:
    """The walk ends where it began: of all others, the last frame is most like the first."""
    index = PlaceIndex(np.random.default_rng(0))
    ferns = Ferns(np.random.default_rng(0))
    found, codes = [], []
    for pose in WALK:
        color, depth = render(pose)
        found.append(find_features(color, depth, CAMERA, 4.5))
        index.add(found[-1].descriptors)
        codes.append(ferns.code(depth))
    scores = index.scores(12)
    assert scores[12] == 1.0 and np.argmax(scores[:12]) == 0 and scores[0] > 3 * scores[1:11].max()
    likeness = fern_likeness(codes[12], np.array(codes))
    assert np.argmax(likeness[:12]) == 0 and likeness[0] > 0.9
    match = ransac_motion(found[0], found[12], np.random.default_rng(0))
    assert match is not None and distance_of(between(np.eye(4), match.target_from_source)) < 0.03


def test_no_colour_no_features() -> None:
    _, depth = render(WALK[0])
    features = find_features(None, depth, CAMERA, 4.5)
    assert len(features.points) == len(features.descriptors) == 0
    index = PlaceIndex(np.random.default_rng(0))
    index.add(features.descriptors)
    index.add(features.descriptors)
    assert index.scores(1).tolist() == [0.0, 0.0]
