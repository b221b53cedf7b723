"""The physics world: what its cameras measure, grasps by contact, failures with numbers, the same bytes again."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from scenewright.cli.main import run as run_command
from scenewright.schemas.apartment import Apartment, Furniture, Room, Thing
from scenewright.stages.agent.body import Body
from scenewright.stages.agent.obstacle_map import ObstacleMap
from scenewright.stages.agent.scene_map import SceneMap, classes_not_of
from scenewright.stages.agent.senses import Base, Detection, SeenFurniture, Sweep
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.physics.apartment_room import ApartmentRoom
from scenewright.stages.agent.world.physics.beliefs import Beliefs
from scenewright.stages.agent.world.physics.body import PhysicsBody
from scenewright.stages.agent.world.physics.eyes import Surface, fuse
from scenewright.stages.agent.world.physics.grasps import FORWARD_PITCHES, LEVEL, antipodal_grasps, within_reach
from scenewright.stages.agent.world.physics.hands import Target, grasps_of, whole_box
from scenewright.stages.agent.world.physics.head import SeenPiece, enter, steady
from scenewright.stages.agent.world.physics.looking_arm import looking_arm, turned
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.kit.motion.kinematics import forward
from scenewright.stages.kit.simulation.robot import Configuration
from scenewright.stages.kit.simulation.robot_description import load_robot

PANDA = load_robot("panda")
NO_ERRORS = Rates().with_true_eyes()
TABLE = Furniture(name="table_0", label="table", centre=(2.0, 2.4), size=(1.4, 0.75), height=0.74)
THINGS = (
    Thing(name="apple_0", label="apple", on="table_0", at=(2.0, 2.3)),
    Thing(name="cup_0", label="cup", color="blue", on="table_0", at=(1.75, 2.25)),
    Thing(name="plate_0", label="plate", on="table_0", at=(2.3, 2.3), carries=True, radius=0.11),
)
APARTMENT = Apartment(
    rooms=(Room(name="room_0", low=(0, 0), high=(4, 4)),),
    furniture=(TABLE,),
    things=THINGS,
    start=(2.0, 1.575, np.pi / 2),
)
ABOVE = (2.0, 2.4, 0.74)


class PhysicsBodyStub:
    """As much of a body as a map asks for."""

    base, same_thing = Base(0.0, -1.0, 0.0), 0.07
    obstacles = ObstacleMap(base, 2.9)


def table(x: float, width: float) -> SeenFurniture:
    return SeenFurniture("table", (x, 0.4), (width, 0.75), 0.74, False, False)


@pytest.fixture
def body() -> Iterator[PhysicsBody]:
    made = PhysicsBody(ApartmentRoom(APARTMENT), ("apple", "plate"), NO_ERRORS, 3)
    yield made
    made.close()


def test_eyes_measure_and_the_hand_holds_by_contact(body: PhysicsBody) -> None:
    sweep = body.sweep()
    (table,) = sweep.furniture
    assert table.label == "table" and np.allclose(table.centre, TABLE.centre, atol=0.06)
    assert np.allclose(table.size, TABLE.size, atol=0.12) and len(sweep.free) > 300
    seen = {d.label: d for d in body.look(ABOVE, close=False).detections}
    assert set(seen) == {"apple", "cup", "plate"} and seen["cup"].color == "blue"
    for thing in THINGS:
        assert np.hypot(*np.subtract(seen[thing.label].position[:2], thing.at)) < 0.03
    assert body.look_at_hand(0) is None
    assert body.grasp(seen["apple"].position, "apple", 0).ok
    assert body.bodies["apple_0"].on == "" and body.events[-1].ok
    held = body.look_at_hand(0)
    assert held is not None and held.label == "apple"
    assert body.release(seen["plate"].position, "plate", gently=True).ok
    assert body.bodies["apple_0"].on == "plate_0" and body.root("apple_0") == "table_0" and body.events[-1].ok


@pytest.mark.parametrize("room_behind", [True, False])
def test_a_robot_whose_arm_is_in_the_way_turns_before_it_drives_off(body: PhysicsBody, room_behind: bool) -> None:
    """It stands before the table's edge with its folded arm over it, and drives along the edge: it turns away first,
    or, between the table and something felt behind it, as far as it goes."""
    edge = TABLE.centre[1] - TABLE.size[1] / 2
    start = np.array([TABLE.centre[0], edge - 0.45, np.pi / 2])
    driving, robot = body._driving, body._robot
    robot.driver.put(Configuration(start, robot.arm + robot.driver.encoders, robot.description.opening))
    if not room_behind:  # it may not turn far: half a metre of the way round is taken
        away = driving._room_to_turn
        driving._room_to_turn = lambda base, turn: float(np.clip(away(base, turn), -0.5, 0.5))  # type: ignore[method-assign]
    driving._turn_from(np.array([start[0], edge]))
    turned = abs((robot.true_base()[2] - start[2] + np.pi) % (2 * np.pi) - np.pi)
    assert turned == pytest.approx(np.pi if room_behind else 0.5, abs=0.01)
    assert np.allclose(robot.true_base()[:2], start[:2])


@pytest.mark.parametrize("robot", ["ur5e", "xarm7"])
def test_another_arm_looks_takes_and_puts_down(robot: str) -> None:
    other = PhysicsBody(ApartmentRoom(APARTMENT), ("apple", "plate"), NO_ERRORS, 3, robot=robot)
    try:
        other.sweep()
        seen = {d.label: d for d in other.look(ABOVE, close=False).detections}
        assert set(seen) == {"apple", "cup", "plate"}
        assert other.grasp(seen["apple"].position, "apple", 0).ok
        assert other.release(seen["plate"].position, "plate", gently=True).ok
        assert other.bodies["apple_0"].on == "plate_0"
    finally:
        other.close()


def test_a_view_is_turned_by_the_first_joint_and_stays_within_its_limits() -> None:
    for name in ("panda", "ur5e", "kinova_gen3"):
        beliefs = Beliefs(load_robot(name))
        try:
            look = looking_arm(beliefs)
            ahead = forward(beliefs.chain, look)
            for by in (0.5, -2.0):
                arm = turned(beliefs.chain, look, by)
                assert np.all(arm >= beliefs.chain.lower) and np.all(arm <= beliefs.chain.upper)
                expected = transform_from_yaw(by, np.zeros(3)) @ ahead
                np.testing.assert_allclose(forward(beliefs.chain, arm), expected, atol=1e-6)
        finally:
            beliefs.close()


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--robot", "r2d2", "--simulation", "physics"], "no robot is called 'r2d2'"),
        (["--robot", "ur5_bench", "--simulation", "physics"], "does not drive"),
        (["--robot", "ur5e"], "the fast world has no arm"),
    ],
)
def test_a_robot_that_cannot_do_it_is_refused(
    words: list[str], problem: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["agent", "run", *words, "--out", str(tmp_path / "episode"), "--quiet"]) == 2
    assert problem in capsys.readouterr().err and not (tmp_path / "episode").exists()


def test_what_cannot_be_done_says_why_with_numbers(body: PhysicsBody) -> None:
    body.sweep()
    body.look(ABOVE, close=False)
    nothing = body.grasp((2.6, 2.6, 0.76), "apple", 0)
    assert not nothing.ok and nothing.failure is not None and nothing.failure.kind == "no_grasp"
    assert not body.grasp((2.0, 2.3, 0.78), "apple", 0, most=0).ok, "no grasp of it may be tried"
    plate = body.grasp((2.3, 2.3, 0.75), "plate", 0)
    assert not plate.ok and plate.failure is not None
    assert plate.failure.numbers["width"] > plate.failure.numbers["opening"]
    assert body.bodies["plate_0"].on != "" and [e.ok for e in body.events] == [False, False, False]


def test_a_world_is_its_seed() -> None:
    looks = []
    for _ in range(2):
        made = PhysicsBody(ApartmentRoom(APARTMENT), ("apple",), Rates(), 5)
        made.sweep()
        looks.append((made.look(ABOVE, close=False), made.look((2.0, 2.3, 0.76), close=True)))
        made.close()
    assert looks[0] == looks[1]


def test_grasps_come_from_above_first_and_across_the_narrow_side() -> None:
    random = np.random.default_rng(0)
    points = random.uniform((-0.08, -0.02, 0), (0.08, 0.02, 0.03), (4000, 3))
    side = np.sign(points[:, 1])[:, None] * np.array([0.0, 1.0, 0.0])
    grasps = antipodal_grasps(points, side, PANDA, floor=0.0)
    assert np.allclose(grasps[0][:3, 2], (0, 0, -1), atol=1e-6) and abs(grasps[0][1, 1]) > 0.99
    assert all(pose[2, 3] > 0.004 for pose in grasps)
    wide = random.uniform(-0.08, 0.08, (4000, 3))
    assert antipodal_grasps(wide, np.tile([0.0, 1.0, 0.0], (4000, 1)), PANDA, floor=-0.08) == []


def test_what_is_too_wide_for_the_fingers_is_taken_by_its_rim() -> None:
    """A bowl of 18 cm, seen from above: the inside of its wall, the outside towards the robot, and its floor."""
    random = np.random.default_rng(2)
    angle = random.uniform(-np.pi, np.pi, 6000)
    wall = np.column_stack([0.09 * np.cos(angle), 0.09 * np.sin(angle), random.uniform(0.0, 0.07, 6000)])
    wall[:, :2] *= random.choice([0.96, 1.0], 6000)[:, None]
    low = random.uniform(-0.06, 0.06, (2000, 3)) * (1, 1, 0)
    points = np.concatenate([wall, low]) + random.normal(0, 0.001, (8000, 3)) + (1.0, 0.0, 0.75)
    bowl = Surface("bowl", points, np.tile([0.0, 0.0, 1.0], (8000, 1)), "white", 0.0, 1)
    grasps = grasps_of(Target(bowl, "bowl", 0, 0.75), np.array([0.4, 0.0, 0.0]), PANDA)
    assert len(grasps) > 8
    for pose in grasps:
        assert pose[2, 2] < -0.99, "from above"
        assert np.hypot(*(pose[:2, 3] - (1.0, 0.0))) == pytest.approx(0.088, abs=0.006), "over the wall"
    away = [np.hypot(*(pose[:2, 3] - (0.4, 0.0))) for pose in grasps]
    assert away == sorted(away) and away[0] < 0.52, "the wall near the robot first: it does not get to the far one"
    solid = Surface("book", random.uniform(-0.1, 0.1, (8000, 3)) * (1, 1, 0.1), bowl.normals, "white", 0.0, 1)
    assert not grasps_of(Target(solid, "book", 0, -0.01), np.array([-0.6, 0.0, 0.0]), PANDA), "it has no rim"


@pytest.mark.parametrize(("radius", "count"), [(0.0325, 1), (0.036, 1), (0.0395, 0)])
def test_what_nearly_fills_the_hand_is_taken_all_the_same_and_wider_things_are_not(radius: float, count: int) -> None:
    """Cans that a hand opens 15, 8 and 1 mm wider than, seen from one side and above with the noise of a near look."""
    random = np.random.default_rng(3)
    angle, height = random.uniform(np.pi / 2, 3 * np.pi / 2, 3000), random.uniform(0.0, 0.09, 3000)
    side = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    spread = radius * np.sqrt(random.uniform(0, 1, 2000))
    around = random.uniform(-np.pi, np.pi, 2000)
    top = np.column_stack([spread * np.cos(around), spread * np.sin(around), np.full(2000, 0.09)])
    points = np.concatenate([side, top]) + random.normal(0, 0.0005, (5000, 3)) + (1.0, 0.0, 0.73)
    outward = np.concatenate(
        [np.column_stack([np.cos(angle), np.sin(angle), np.zeros(3000)]), np.tile([0.0, 0.0, 1.0], (2000, 1))]
    )
    can = Surface("can", points, outward, "white", 0.0, 2)
    grasps = grasps_of(Target(can, "can", 0, 0.73), np.array([0.4, 0.0, 0.0]), PANDA)
    across = [abs(float((pose[:2, 3] - (1.0, 0.0)) @ pose[:2, 1])) for pose in grasps if pose[2, 2] > -0.999]
    assert len(grasps) >= count and (count or not across)
    assert all(off < PANDA.opening / 2 - radius for off in across), "the fingers pass it on both sides"


def test_a_level_hand_grips_what_it_saw_the_front_of_about_its_axis() -> None:
    angles = np.linspace(np.pi / 2, 3 * np.pi / 2, 60)  # the half that faces a hand that comes along x
    ring = 0.03 * np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.concatenate([np.column_stack([ring, np.full(60, z)]) for z in np.linspace(0.0, 0.2, 40)])
    normals = np.column_stack([np.tile(ring / 0.03, (40, 1)), np.zeros(2400)])
    grasps = within_reach(antipodal_grasps(points, normals, PANDA, -0.5, FORWARD_PITCHES), 0.0, 0.99)
    assert len(grasps) > 3 and all(abs(g[0, 3]) < 0.006 and abs(g[1, 3]) < 0.003 for g in grasps)


def test_furniture_is_as_large_as_it_is_and_its_top_as_high() -> None:
    random = np.random.default_rng(1)
    top = np.column_stack([random.uniform(0, 1.4, 4000), random.uniform(0, 0.75, 4000), np.full(4000, 0.74)])
    side = np.column_stack([random.uniform(0, 1.4, 2000), np.zeros(2000), random.uniform(0, 0.74, 2000)])
    behind = np.column_stack([random.uniform(0, 1.4, 60), random.uniform(0.8, 1.3, 60), random.uniform(0.2, 0.6, 60)])
    cup = np.column_stack([random.uniform(0.5, 0.6, 30), random.uniform(0.3, 0.4, 30), random.uniform(0.78, 0.85, 30)])
    piece = SeenPiece("table")
    piece.add(np.concatenate([top, side, behind, cup]))
    low, high = piece.box
    assert np.allclose([*low[:2], *high[:2]], [0, 0, 1.4, 0.75], atol=0.06) and abs(high[2] - 0.74) <= 0.03


def test_depth_beside_a_jump_is_nobodys() -> None:
    depth = np.full((20, 20), 2.0)
    depth[:, 10:] = 3.0
    depth[5, 5] = 0.0
    kept = steady(depth)
    assert kept[:, :9].sum() == 20 * 9 - 1 and not kept[:, 9:11].any() and kept[:, 11:].all()


def test_a_few_grasps_of_each_steepness_and_none_from_behind() -> None:
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = np.column_stack([0.03 * np.cos(angles), 0.03 * np.sin(angles)])
    points = np.concatenate([np.column_stack([ring, np.full(60, z)]) for z in np.linspace(0.02, 0.1, 12)])
    normals = np.column_stack([np.tile(ring / 0.03, (12, 1)), np.zeros(720)])
    grasps = within_reach(antipodal_grasps(points, normals, PANDA, 0.0), 0.0)
    steep = [round(float(g[2, 2]), 1) for g in grasps]
    assert steep == sorted(steep) and max(steep.count(p) for p in set(steep)) <= 8 and len(set(steep)) == 5
    assert all(g[0, 2] > 0 for g in grasps if g[2, 2] > -0.99)
    flat = [g for g in grasps if g[2, 2] > -np.sin(LEVEL)]
    assert flat and all(g[0, 2] >= 0.8 * np.hypot(g[0, 2], g[1, 2]) - 1e-9 for g in flat), (
        "it sees no middle from aside"
    )


def test_a_narrow_box_that_is_turned_is_taken_along_its_sides_and_noise_of_its_top_is_no_palm_in_the_way() -> None:
    """63 by 144 mm, 11 degrees off any of the headings all around: along those it is wider than the hand opens."""
    random, yaw = np.random.default_rng(4), np.pi / 16
    half = np.array([0.0315, 0.072])
    top = np.column_stack([random.uniform(-half, half, (3000, 2)), np.full(3000, 0.18)])
    face = np.column_stack(
        [random.uniform(-half[0], half[0], 1500), np.full(1500, -half[1]), random.uniform(0, 0.18, 1500)]
    )
    side = np.column_stack(
        [np.full(3000, -half[0]), random.uniform(-half[1], half[1], 3000), random.uniform(0, 0.18, 3000)]
    )
    normals = np.repeat(np.array([(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0)]), (3000, 1500, 3000), axis=0)
    turn = transform_from_yaw(yaw, np.zeros(3))
    points = apply(turn, np.concatenate([top, face, side])) + random.normal(0, 0.0005, (7500, 3))
    grasps = antipodal_grasps(points, normals @ turn[:3, :3].T, PANDA, floor=0.0)
    above = [pose for pose in grasps if np.allclose(pose[:3, 2], (0, 0, -1), atol=1e-6)]
    assert len(above) > 1 and all(abs(pose[:3, 1] @ turn[:3, 0]) > np.cos(0.03) for pose in above)


def test_a_way_goes_around_what_is_known() -> None:
    room = ObstacleMap(Base(0.0, 0.0, 0.0), 2.7)
    free = np.argwhere(np.ones((41, 41), bool))
    wall = np.array([(20, row) for row in range(28)])
    room.add(Sweep(free, wall, ()))
    way = room.path(Base(0.5, 1.0, 0.0), (3.5, 1.0))
    assert way is not None and way[0] == (0.5, 1.0) and way[-1] == (3.5, 1.0)
    assert max(y for _, y in way) > 2.9
    assert room.path(Base(0.5, 1.0, 0.0), (2.0, 1.0)) is None


def test_who_stands_too_near_first_goes_away() -> None:
    """Along a wall, not in its clearance all the way but out of it at once."""
    room = ObstacleMap(Base(1.0, 0.3, 0.0), 2.7, 4.5)
    room.add(Sweep(np.argwhere(np.ones((41, 41), bool)), np.array([(row, 0) for row in range(41)]), ()))
    way = room.path(Base(1.0, 0.2, 0.0), (3.0, 0.9))
    assert way is not None and all(y >= 0.29 for _, y in way[1:])
    assert way[1][1] > way[0][1] and max(x for x, y in way if y < 0.29) < 1.2


def test_what_is_put_into_a_box_does_not_drag_it_along() -> None:
    box = Thing(name="fruit-box_0", label="fruit box", on="table_0", at=(2.3, 2.35), carries=True, radius=0.13)
    apartment = APARTMENT.model_copy(update={"things": (THINGS[0], box)})
    body = PhysicsBody(ApartmentRoom(apartment), ("apple", "fruit box"), NO_ERRORS, 3)
    body.sweep()
    seen = {d.label: d for d in body.look(ABOVE, close=False).detections}
    x, y, z = seen["fruit box"].position
    assert body.grasp(seen["apple"].position, "apple", 0).ok
    assert body.release((x - 0.06, y, z), "fruit box", gently=True).ok
    assert body.bodies["apple_0"].on == "fruit-box_0"
    assert np.hypot(*np.subtract(body.bodies["fruit-box_0"].at, box.at)) < 0.02
    body.close()


def test_what_the_hand_holds_is_carried_upright_and_is_no_obstacle(body: PhysicsBody) -> None:
    body.sweep()
    cup = next(d for d in body.look(ABOVE, close=False).detections if d.label == "cup")
    assert body.grasp(cup.position, "cup", 0).ok
    assert body.drive(Base(2.0, 0.8, -np.pi / 2), "").ok
    assert body._room.world.pose("cup_0")[2, 2] > 0.97
    cells = 0.1 * body.sweep().occupied
    assert len(cells) and np.hypot(*(cells - (2.0, 0.8)).T).min() > 0.6


def test_a_cup_is_gripped_in_its_middle_though_its_back_was_not_seen(body: PhysicsBody) -> None:
    body.sweep()
    cup = next(d for d in body.look(ABOVE, close=False).detections if d.label == "cup")
    assert body.grasp(cup.position, "cup", 0).ok
    assert body._robot.driver.robot.configuration().opening > 0.064  # 68 mm across


def test_what_is_round_goes_down_to_its_foot() -> None:
    away = np.random.default_rng(4).normal(size=(3000, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    seen = np.array([0.0, 0.0, 0.78]) + 0.035 * away[away[:, 2] > 0]
    apple = Surface("apple", seen, away[away[:, 2] > 0], "red", 0.0, 2)
    assert apple.low[2] > 0.775 and abs(whole_box(Target(apple, "", 0, 0.74))[0][2] - 0.745) < 0.006
    assert whole_box(Target(apple, "", 0, 0.77))[0][2] == 0.77, "it stands on something"


def test_what_stands_in_a_shelf_is_as_deep_as_it_is_wide() -> None:
    y, z = (axis.ravel() for axis in np.meshgrid(np.linspace(-0.03, 0.03, 30), np.linspace(0.5, 0.68, 30)))
    seen = np.column_stack([np.zeros(y.shape), y, z])  # the front of a bottle, looked at along x
    bottle = Surface("bottle", seen, np.tile([-1.0, 0.0, 0.0], (len(y), 1)), "green", 0.0, 2)
    for inward, ends in ((0.1, (0.0, 0.06)), (np.pi, (-0.06, 0.0))):
        low, high = whole_box(Target(bottle, "", 0, 0.5, behind=0.2, inward=inward))
        assert np.allclose((low[0], high[0]), ends, atol=0.004)
    low, high = whole_box(Target(bottle, "", 0, 0.5))
    assert high[0] - low[0] < 0.004, "on a table it is seen from above, too"


def test_what_came_apart_is_one_piece_of_furniture() -> None:
    random = np.random.default_rng(2)
    top = np.column_stack([random.uniform(0, 1.4, 4000), random.uniform(0, 0.75, 4000), np.full(4000, 0.74)])
    pieces: list[SeenPiece] = []
    for part in (top[top[:, 0] < 0.4], top[top[:, 0] > 1.0]):
        enter(pieces, "table", part)
    assert len(pieces) == 2
    enter(pieces, "table", top)
    enter(pieces, "table", top + (3.0, 0.0, 0.0))
    assert len(pieces) == 2 and np.allclose(pieces[0].box[1][:2], (1.4, 0.75), atol=0.06)


def test_two_ends_of_furniture_become_one_with_the_things_on_it() -> None:
    scene = SceneMap(cast(Body, PhysicsBodyStub()))
    for x in (0.2, 1.2):
        scene.add(Detection("cup", (x, 0.4, 0.76), "blue", None, 0.04), scene._enter(table(x, 0.3)), (0, False))
    assert len(scene.furniture) == 2
    assert scene._enter(table(0.7, 1.4)) == "table_0" and list(scene.furniture) == ["table_0"]
    assert {item.place for item in scene.items.values()} == {"table_0"}


def test_what_the_picture_cuts_says_what_it_is_and_not_where() -> None:
    scene = SceneMap(cast(Body, PhysicsBodyStub()))
    place = scene._enter(table(0.7, 1.4))
    box = Detection("toy box", (0.7, 0.4, 0.76), "", None, 0.13)
    item = scene.add(box, place, (0, False))
    scene.enter((Detection("toy box", (0.74, 0.42, 0.76), "", None, 0.1, whole=False),), place, lambda _: (1, True))
    assert item.position == box.position and item.votes[1, True] == "toy box"
    cut, whole = (
        Surface("cup", np.random.default_rng(0).uniform(0, 0.05, (50, 3)), np.zeros((50, 3)), "", 0.0, 1, c)
        for c in (True, False)
    )
    assert fuse([cut])[0].cut and not fuse([cut, whole])[0].cut


def test_a_thing_with_a_head_is_held_where_it_is() -> None:
    """A body of which no back was seen, with a smaller ball on one end: over the ball the hand closes on the ball."""
    random = np.random.default_rng(3)
    top = np.column_stack([random.uniform((-0.04, -0.025), (0.04, 0.025), (3000, 2)), np.full(3000, 0.045)])
    away = random.normal(size=(3000, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    ball = np.array([0.02, 0.0, 0.06]) + 0.022 * away
    points, normals = np.concatenate([top, ball]), np.concatenate([np.tile([0.0, 0.0, 1.0], (3000, 1)), away])
    first = antipodal_grasps(points, normals, PANDA, floor=0.0)[0]
    assert first[2, 2] < -0.99 and np.hypot(*(first[:2, 3] - (0.02, 0.0))) < 0.01 and first[2, 3] > 0.045


def test_what_fell_is_seen_on_the_floor_and_taken_from_there(body: PhysicsBody) -> None:
    body.sweep()
    fallen = np.eye(4)
    fallen[:3, 3] = (2.0, 0.4, 0.001)
    body._room.world.set_pose("cup_0", fallen)
    (cup,) = body.look((2.0, 0.4, 0.0), close=False).detections
    assert cup.label == "cup" and np.allclose(cup.position, (2.0, 0.4, 0.02), atol=0.03)
    far, near = Base(2.0, 1.5, -np.pi / 2), Base(2.0, 0.85, -np.pi / 2)
    assert body.reaches(near, cup.position, take=True) and not body.reaches(far, cup.position, take=True)
    assert body.drive(near, "floor_0").ok
    assert body.grasp(cup.position, "cup", 7).ok, "where few grasps are possible the first have their turn again"
    assert body.bodies["cup_0"].on == ""


def test_a_base_pose_is_for_the_grasps_that_are_possible(body: PhysicsBody) -> None:
    body.sweep()
    seen = {d.label: d for d in body.look(ABOVE, close=False).detections}
    before = Base(2.1, 1.65, np.pi / 2)
    for label, possible in (("apple", True), ("plate", False)):
        assert body.reaches(before, seen[label].position)
        assert body.reaches(before, seen[label].position, take=True) == possible


def test_a_box_has_corners_and_a_plate_has_none() -> None:
    scene = SceneMap(cast(Body, PhysicsBodyStub()))
    place = scene._enter(table(0.7, 1.4))
    for label, x in (("toy box", 0.3), ("plate", 1.1)):
        scene.add(Detection(label, (x, 0.4, 0.76), "", None, 0.13), place, (0, False))
    assert scene.at_carrier((0.3 + 0.083, 0.4 + 0.083, 0.8), place) == "toy_box_0"
    assert scene.at_carrier((0.3 + 0.1, 0.4 + 0.1, 0.8), place) == ""
    assert scene.at_carrier((0.3 + 0.11, 0.4, 0.8), place) == ""
    assert scene.at_carrier((1.1 + 0.083, 0.4 + 0.083, 0.8), place) == ""
    assert "plate" in classes_not_of(0.04) and "doll" not in classes_not_of(0.04) and "doll" in classes_not_of(0.13)
    assert not {"plate", "apple"} & set(classes_not_of(0.08)), (
        "a small plate is one, and what is as wide may lie on one"
    )


def test_floor_under_what_fell_is_no_furniture_to_go_to() -> None:
    scene = SceneMap(cast(Body, PhysicsBodyStub()))
    scene._enter(table(0.7, 1.4))
    key = scene.patch((0.0, -0.9, 0.0))
    assert key in scene.furniture and scene.in_front(Base(0.0, -0.4, -np.pi / 2)) != key
    assert [piece.key for piece in scene.global_map()] == ["table_0"]
