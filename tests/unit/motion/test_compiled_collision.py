"""The compiled collision model: covers cover, distances agree with a second implementation, free means free."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Box
from scenewright.stages.kit.acting.query import carrying, touching
from scenewright.stages.kit.motion.collision import CollisionChecker
from scenewright.stages.kit.motion.compiled_check import FREE, HIT, find_collision
from scenewright.stages.kit.motion.convex_distance import Hull, convex_distance
from scenewright.stages.kit.motion.convex_pieces import link_pieces
from scenewright.stages.kit.motion.sphere_cover import enclosing_ball, hull_vertices, sphere_cover
from scenewright.stages.kit.simulation.robot import Configuration, Robot
from scenewright.stages.kit.simulation.robot_description import load_robot, mobile_robot_urdf
from scenewright.stages.kit.simulation.world import PhysicsWorld
from scipy.optimize import minimize

PANDA = load_robot("panda")
UNIT = np.eye(4)[:3]
BOX = SceneBody(
    name="box",
    class_name="box",
    movable=False,
    world_from_body=as_transform(np.eye(4)),
    box=Box(center=(0, 0, 0), size=(0.4, 0.4, 0.4)),
    mass=0.0,
    world_from_reconstructed=None,
)


def box_text(at: tuple[float, ...]) -> str:
    place = " ".join(map(str, at))
    return (
        f'<robot name="box"><link name="box"><collision><origin xyz="{place}"/><geometry><box size="0.4 0.4 0.4"/>'
        "</geometry></collision></link></robot>"
    )


def test_balls_cover_the_hull_of_every_link() -> None:
    random = np.random.default_rng(0)
    for pieces in link_pieces(mobile_robot_urdf(PANDA)).values():
        for piece in pieces:
            weights = random.dirichlet(np.full(len(piece.vertices), 0.1), 400)
            points = np.concatenate([weights @ piece.vertices, piece.vertices])
            outside = np.linalg.norm(points[:, None] - piece.spheres[None, :, :3], axis=2) - piece.spheres[:, 3]
            assert outside.min(axis=1).max() < 1e-9
            assert piece.spheres[:, 3].max() <= piece.bound[3] + 1e-9


def test_a_cover_with_more_balls_is_tighter_and_the_same_each_time() -> None:
    box = np.array([[x, y, z] for x in (0, 1) for y in (0, 0.2) for z in (0, 0.1)], dtype=float)
    covers = [sphere_cover(box, most, 0.01) for most in (1, 4, 12)]
    radii = [cover[:, 3].max() for cover in covers]
    assert radii[0] > radii[1] > radii[2]
    np.testing.assert_array_equal(covers[2], sphere_cover(box, 12, 0.01))
    assert enclosing_ball(box)[3] >= np.linalg.norm([0.5, 0.1, 0.05]) - 1e-12


def _distance_by_optimiser(first: np.ndarray, second: np.ndarray) -> float:
    """Distance of two hulls as a quadratic program over convex weights."""

    def square(weights: np.ndarray) -> float:
        gap = weights[: len(first)] @ first - weights[len(first) :] @ second
        return float(gap @ gap)

    count = len(first) + len(second)
    start = np.concatenate([np.full(len(first), 1 / len(first)), np.full(len(second), 1 / len(second))])
    sums = [
        {"type": "eq", "fun": lambda w: w[: len(first)].sum() - 1},
        {"type": "eq", "fun": lambda w: w[len(first) :].sum() - 1},
    ]
    found = minimize(square, start, bounds=[(0, 1)] * count, constraints=sums, method="SLSQP", options={"ftol": 1e-12})
    return float(np.sqrt(found.fun))


def hull(vertices: np.ndarray, pose: np.ndarray = UNIT) -> Hull:
    return Hull(vertices, 0, len(vertices), pose)


def test_distance_of_hulls_agrees_with_an_optimiser() -> None:
    random = np.random.default_rng(3)
    for _ in range(6):
        first = hull_vertices(random.normal(size=(9, 3)) * 0.2)
        second = hull_vertices(random.normal(size=(8, 3)) * 0.2 + random.uniform(-0.7, 0.7, 3))
        lower, upper = convex_distance(hull(first), hull(second), np.inf, 0.0)
        assert lower <= upper + 1e-12
        assert abs(upper - _distance_by_optimiser(first, second)) < 1e-3


def test_distance_of_boxes_in_closed_form_and_early_ends() -> None:
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    away = UNIT.copy()
    away[:, 3] = [5.0, 6.0, 0.3]
    lower, upper = convex_distance(hull(box), hull(box, away), np.inf, 0.0)
    assert abs(lower - 5.0) < 1e-4
    assert abs(upper - 5.0) < 1e-4
    assert 1.0 < convex_distance(hull(box), hull(box, away), 1.0, 0.0)[0] <= 5.0
    away[:, 3] = [1.5, 0.2, 0.1]
    assert convex_distance(hull(box), hull(box, away), np.inf, 0.0) == (0.0, 0.0)


def _walk(count: int, seed: int) -> np.ndarray:
    """Random configurations (count, 10) in the kitchen, half of them near one place."""
    random = np.random.default_rng(seed)
    base = random.uniform([-2.2, -2.2, -3.1], [2.2, 2.2, 3.1], (count, 3))
    base[::2] = [0.75, 0.3, 0.4]
    return np.column_stack([base, random.uniform(PANDA.lower, PANDA.upper, (count, 7))])


def _compare(checker: CollisionChecker, count: int, seed: int) -> tuple[int, int, int]:
    """Return how often compiled says free where the meshes do not, how often it refuses surely what they free, both."""
    robot, scene = checker.arrays()
    wrong, strict, free = 0, 0, 0
    for body in _walk(count, seed):
        state = find_collision(robot, scene, body, 0)[0]
        mesh_free = checker.check_meshes(body) is None
        wrong += state == FREE and not mesh_free
        strict += state == HIT and mesh_free
        free += mesh_free and state == FREE
    return wrong, strict, free


def test_free_means_free_for_the_meshes(checker: CollisionChecker) -> None:
    wrong, strict, free = _compare(checker, 600, 0)
    assert wrong == 0
    assert strict <= 3  # nearly exact, not only on the safe side
    assert free > 150


def test_free_means_free_while_carrying_and_with_a_door_elsewhere(checker: CollisionChecker) -> None:
    joint = next(iter(checker.world.bodies["fridge_2"].joints))
    value = checker.world.joint_value("fridge_2", joint)
    before, _ = checker.arrays()
    held = np.eye(4)
    held[:3, 3] = [0.0, 0.0, 0.05]
    checker.world.set_joint("fridge_2", joint, 1.2)
    in_hand = checker.under(carrying("bottle_7", held))
    try:
        after, _ = in_hand.arrays()
        assert len(after.frame) > len(before.frame)
        wrong, strict, free = _compare(in_hand, 300, 1)
    finally:
        checker.world.set_joint("fridge_2", joint, value)
    assert (wrong, strict <= 2, free > 50) == (0, True, True)
    assert len(checker.arrays()[0].frame) == len(before.frame)


def test_what_may_be_touched_is_not_in_the_way(checker: CollisionChecker) -> None:
    _, scene = checker.under(touching(("bottle_7",))).arrays()  # compiles anew what was put down or opened since
    names = checker.compiled.groups
    hand = checker.compiled.parts.index(PANDA.hand_link)
    arm = checker.compiled.parts.index("panda_link4")
    bottle = names.index("bottle_7")
    assert scene.allowed[hand, bottle] != scene.allowed[arm, bottle]
    _, scene = checker.arrays()
    assert scene.allowed[hand, bottle] == scene.allowed[arm, bottle]


def test_in_an_empty_world_all_is_free() -> None:
    with PhysicsWorld() as world:
        checker = CollisionChecker(world, Robot(world, PANDA))
        assert checker.check(np.concatenate([np.zeros(3), PANDA.carry])) is None


def test_a_body_in_the_place_of_another_of_its_name_is_seen() -> None:
    """pybullet gives the id of a body that was taken out to the next one."""
    with PhysicsWorld() as world:
        robot = Robot(world, PANDA)
        robot.set(Configuration(np.zeros(3), PANDA.carry, PANDA.opening))
        far, here = (box_text((x, 0.0, 0.7)) for x in (3.0, 0.0))
        world.add_body(BOX, far)
        checker = CollisionChecker(world, robot)
        body = np.concatenate([np.zeros(3), PANDA.carry])
        assert checker.check(body) is None
        world.remove_body("box")
        world.add_body(BOX, here)
        checker.add_body("box")
        assert checker.check(body) is not None
