"""How things stand, where they are put down first, and which hands come last."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.kit.motion.kinematics import forward
from scenewright.stages.kit.simulation.robot import base_pose
from scenewright.stages.kit.simulation.robot_description import load_robot
from scenewright.stages.plan import pick_place
from scenewright.stages.plan.pick_place import HAND_END, PALM_BEHIND, Budgets, palm_bottom, plan_pick
from scenewright.stages.plan.placements import PUT_DOWN_HEIGHT, Placement, sample_placements, untaken
from scenewright.stages.plan.regions import CELL
from scenewright.stages.plan.world_model import RobotState, WorldModel
from scipy.spatial.transform import Rotation

from tests.unit.simulation.handmade_scene import HandmadeBody, bottle, kitchen, write_scene

PANDA = load_robot("panda")
FAR, BAR = np.array([1.0, 1.0, 0.0]), [((0.0, 0.0, 0.05), (0.16, 0.04, 0.1))]
"""Where a bar stands at first; its box."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("kitchen")
    bodies = kitchen()
    next(body for body in bodies if body.name == "cup_5").boxes = [((0, 0, 0.04), (0.07, 0.07, 0.08))]
    write_scene(root, bodies)
    return root


def turned(axis: str, degrees: float, yaw: float = 0.0) -> np.ndarray:
    pose = np.eye(4)
    turn = Rotation.from_euler(axis, degrees, degrees=True)
    pose[:3, :3] = (Rotation.from_euler("z", yaw, degrees=True) * turn).as_matrix()
    pose[:3, 3] = [-1.3, -1.0, 0.8]
    return pose


def see(model: WorldModel, name: str, pose: np.ndarray) -> None:
    model.records[name] = model.records[name].model_copy(update={"world_from_body": as_transform(pose)})


# The bottle is 6 cm x 6 cm x 20 cm, its origin in the middle of its bottom.


@pytest.mark.parametrize("yaw", [0.0, 40.0, -170.0])
@pytest.mark.parametrize("tilt", [0.0, 10.0, 25.0])
def test_what_stands_nearly_upright_is_put_down_upright(model: WorldModel, yaw: float, tilt: float) -> None:
    see(model, "bottle_7", turned("x", tilt, yaw))
    np.testing.assert_array_equal(model.standing("bottle_7"), np.eye(4))
    assert model.foot("bottle_7") == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("tilt", [155.0, 180.0, 200.0])
def test_what_stands_on_its_head_is_put_down_so(model: WorldModel, tilt: float) -> None:
    see(model, "bottle_7", turned("y", tilt, 70.0))
    standing = model.standing("bottle_7")
    np.testing.assert_allclose(standing[:3, 2], [0.0, 0.0, -1.0])
    np.testing.assert_allclose(standing[:3, :3] @ standing[:3, :3].T, np.eye(3))
    assert np.linalg.det(standing) == pytest.approx(1.0) and np.all(standing[:3, 3] == 0)
    assert model.foot("bottle_7") == pytest.approx(-0.2, abs=1e-3)  # the bottom is up, the origin with it


@pytest.mark.parametrize(("tilt", "foot"), [(90.0, 0.03), (-90.0, 0.03), (45.0, 0.03 * np.sin(np.pi / 4))])
def test_what_lies_is_put_down_lying(model: WorldModel, tilt: float, foot: float) -> None:
    pose = turned("x", tilt, 20.0)
    see(model, "bottle_7", pose)
    standing = model.standing("bottle_7")
    np.testing.assert_allclose(standing[:3, :3], pose[:3, :3])
    assert np.all(standing[:3, 3] == 0)
    assert model.foot("bottle_7") == pytest.approx(-foot, abs=2e-3)


@pytest.mark.parametrize("tilt", [0.0, 180.0, 90.0])
def test_places_are_a_hair_over_the_surface_however_it_stands(model: WorldModel, tilt: float) -> None:
    see(model, "cup_5", turned("x", tilt))
    places = sample_placements(model, "cup_5", "table_3", None, np.random.default_rng(0), 12)
    assert places
    for place in places:
        upright = place.world_from_item @ model.standing("cup_5")
        assert apply(upright, model.points("cup_5"))[:, 2].min() == pytest.approx(0.75 + PUT_DOWN_HEIGHT, abs=1e-6)


# --- order of places ------------------------------------------------------------------------------------------


def test_roomy_places_come_first(model: WorldModel) -> None:
    """A place is roomy when the whole foot and a cell more are on the table top of 1.2 m x 0.7 m."""
    places = sample_placements(model, "cup_5", "table_3", None, np.random.default_rng(0), 400)
    radius, _ = model.footprint("cup_5")
    middle, half = np.array([-1.3, -1.0]), np.array([0.6, 0.35])
    to_edge = np.array([(half - np.abs(place.world_from_item[:2, 3] - middle)).min() for place in places])
    roomy = np.array([place.roomy for place in places])
    assert 0 < roomy.sum() < len(roomy)
    assert np.all(np.diff(roomy.astype(int)) <= 0), "the tight ones come last"
    assert np.all(roomy[to_edge > radius + CELL / 2 + CELL])
    assert not np.any(roomy[to_edge < radius])
    assert to_edge.min() > 0.8 * radius - 1e-3  # tight ones have surface under most of the foot too


def test_turns_of_regions_go_on_among_the_roomy_ones(model: WorldModel) -> None:
    """The fridge's shelves behind its open door: none waits until another has run out of roomy places."""
    places = sample_placements(model, "cup_5", "fridge_2", "fridge_2__hinge", np.random.default_rng(0), 20)
    levels = [round(float(place.world_from_item[2, 3]), 2) for place in places if place.roomy]
    assert len(set(levels)) >= 2 and len(set(levels[: len(set(levels))])) == len(set(levels))


def test_a_place_that_is_taken_is_none(model: WorldModel) -> None:
    """The cup stands in the middle of the table; the bottle, 6 cm square, goes anywhere but there."""
    model.world.set_pose("cup_5", transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.75])))
    drawn = sample_placements(model, "bottle_7", "table_3", None, np.random.default_rng(0), 400)
    free = untaken(model, "bottle_7", "table_3", drawn)
    from_cup = [np.abs(place.world_from_item[:2, 3] - [-1.3, -1.0]).max() for place in free]
    beside = [place for place in drawn if np.linalg.norm(place.world_from_item[:2, 3] - [-1.3, -1.0]) > 0.15]
    assert min(from_cup) > 0.035 + 0.03 and len(beside) <= len(free) < len(drawn)


def test_a_long_thing_is_turned_to_where_it_has_room(tmp_path: Path) -> None:
    """Between two walls 10 cm apart a bar 16 cm long stands along them."""
    wall = [((side * 0.055, 0.0, 0.1), (0.01, 0.4, 0.2)) for side in (-1, 1)]
    bodies = [
        *kitchen()[:3],
        HandmadeBody("box_8", "box", transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.75])), wall, "table_3"),
        HandmadeBody("book_9", "book", transform_from_yaw(0.0, FAR), BAR, "floor_1", movable=True, mass=0.2),
    ]
    write_scene(tmp_path, bodies)
    model = WorldModel(tmp_path, ContactGraphFile.read(tmp_path / "graph.json"), PANDA, 0.004)
    across = Placement(transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.756])), False, False)
    (turned_place,) = untaken(model, "book_9", "table_3", [across])
    assert abs(turned_place.world_from_item[1, 0]) == pytest.approx(1.0)
    model.close()


# --- hands ----------------------------------------------------------------------------------------------------


def tool(pitch: float, heading: float, roll: bool = False) -> np.ndarray:
    """A tool pose 1 m up, its approach tilted down by `pitch`, its fingers closing horizontally."""
    approach = np.array([np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), -np.sin(pitch)])
    closing = np.array([-np.sin(heading), np.cos(heading), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(closing, approach), closing, approach])
    pose[:3, 3] = [0.3, -0.4, 1.0]
    return pose @ np.diag([-1.0, -1.0, 1.0, 1.0]) if roll else pose


@pytest.mark.parametrize("roll", [False, True])
@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("pitch", [0.0, 0.35, 0.7, 1.1, np.pi / 2])
def test_the_lowest_point_of_the_hand(pitch: float, heading: float, roll: bool) -> None:
    """From the side half the palm's breadth below the tool point, from above the palm's distance over it; its length
    lies level."""
    expected = 1.0 + PALM_BEHIND * np.sin(pitch) - 0.033 * np.cos(pitch)
    assert palm_bottom(tool(pitch, heading, roll), (0.21, 0.066)) == pytest.approx(expected)


def test_a_hand_from_below_has_its_end_lowest() -> None:
    assert palm_bottom(tool(-np.pi / 2, 0.0), (0.21, 0.066)) == pytest.approx(1.0 - HAND_END)


def test_a_hand_on_edge_has_its_length_upright() -> None:
    pose = tool(0.0, 0.0)
    pose[:3, :2] = np.column_stack([pose[:3, 1], -pose[:3, 0]])
    assert palm_bottom(pose, (0.21, 0.066)) == pytest.approx(1.0 - 0.105)


@pytest.mark.parametrize("style", ["any", "rather_level"])
def test_a_hand_that_would_reach_below_the_foot_comes_last(
    model: WorldModel, monkeypatch: pytest.MonkeyPatch, style: pick_place.GraspStyle
) -> None:
    """The cup is 8 cm high: taken level at a third of that, the hand would reach below it, over the table's edge."""
    tried: list[tuple[bool, bool]] = []

    def note(model, state, item, source, base, grasp, arm_planner, tally):  # type: ignore[no-untyped-def]
        bottom = palm_bottom(model.pose(item) @ grasp.body_from_tool, model.description.palm)
        tried.append((bool(bottom <= 0.75 + 1e-3), bool(grasp.pitch > 0.7)))

    monkeypatch.setattr(pick_place, "_try_pick", note)
    monkeypatch.setattr(pick_place, "_bases_around", lambda *_: np.zeros((3, 3)))
    model.world.set_pose("cup_5", transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.75])))
    with pytest.raises(MotionFailed):
        plan_pick(
            model,
            RobotState(np.zeros(3), PANDA.carry),
            "cup_5",
            "table_3",
            Budgets(4, 4000, 10, 1),
            np.random.default_rng(0),
            style=style,
        )
    below = [entry[0] for entry in tried]
    assert 0 < sum(below) < len(below)
    assert below == sorted(below), "no hand over the edge is tried before one that is not"
    if style == "rather_level":  # among either, those from the side come first
        assert tried == sorted(tried)


def test_what_turns_a_heavy_thing_least_in_the_fingers_is_tried_first(
    model: WorldModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bottle of a kilogram, its middle 10 cm up: taken there it does not turn, 6 cm beside with 0.6 N m."""
    levers: list[float] = []

    def note(model, state, item, source, base, grasp, arm_planner, tally):  # type: ignore[no-untyped-def]
        levers.append(abs(float((model.pose(item) @ grasp.body_from_tool)[2, 3]) - 0.85))

    monkeypatch.setattr(pick_place, "_try_pick", note)
    monkeypatch.setattr(pick_place, "_bases_around", lambda *_: np.zeros((3, 3)))
    record = model.records["bottle_7"]
    monkeypatch.setitem(model.records, "bottle_7", record.model_copy(update={"mass": 1.0}))
    model.world.set_pose("bottle_7", transform_from_yaw(0.0, np.array([-1.3, -1.0, 0.75])))
    with pytest.raises(MotionFailed):
        plan_pick(
            model,
            RobotState(np.zeros(3), PANDA.carry),
            "bottle_7",
            "table_3",
            Budgets(4, 4000, 10, 1),
            np.random.default_rng(0),
            style="level",
        )
    assert max(levers) > 0.05 and max(levers[: len(levers) // 8]) < 0.01


# --- ways out -------------------------------------------------------------------------------------------------


def under_a_cover(root: Path, headroom: float) -> WorldModel:
    """A bottle 20 cm high on a table, in a case that is open all around."""
    top, inside = 0.02 + 0.2 + headroom, 0.75
    case = [((0.0, 0.0, 0.01), (0.5, 0.3, 0.02)), ((0.0, 0.0, top + 0.01), (0.5, 0.3, 0.02))]
    bodies = [
        *kitchen()[:3],
        HandmadeBody("shelf_8", "shelf", transform_from_yaw(0.0, np.array([-1.3, -1.15, inside])), case, "table_3"),
        bottle(-1.3, -1.2, inside + 0.02, "shelf_8", "supports", "bottle_9"),
    ]
    write_scene(root, bodies)
    return WorldModel(root, ContactGraphFile.read(root / "graph.json"), PANDA, 0.004)


@pytest.mark.parametrize(
    ("headroom", "lifts"), [(0.002, (0.0,)), (0.014, (0.0,)), (0.02, (0.012, 0.0)), (0.2, (0.03, 0.012, 0.0))]
)
def test_a_thing_is_lifted_no_farther_than_there_is_room_under_its_cover(
    tmp_path: Path, headroom: float, lifts: tuple[float, ...]
) -> None:
    """With the clearance of 4 mm kept; cover and floor of the case are one link."""
    model = under_a_cover(tmp_path, headroom)
    assert pick_place._lifts(model, "bottle_9", "shelf_8") == lifts
    model.close()


@pytest.mark.parametrize(("headroom", "lifted"), [(0.002, 0.0), (0.2, 0.03)])
def test_a_thing_that_cannot_be_lifted_under_its_cover_slides_out(
    tmp_path: Path, headroom: float, lifted: float
) -> None:
    model = under_a_cover(tmp_path, headroom)
    state = RobotState(np.zeros(3), PANDA.carry)
    base = np.array([-1.3, -1.75, np.pi / 2])
    budgets = Budgets(4, 4000, 800, 8)
    motion = plan_pick(model, state, "bottle_9", "shelf_8", budgets, np.random.default_rng(0), style="level", base=base)
    tools = [base_pose(base, PANDA) @ forward(model.chain, row[3:]) for row in motion.segments[2].path]
    assert max(tool[2, 3] for tool in tools[:3]) - tools[0][2, 3] == pytest.approx(lifted, abs=5e-3)
    model.close()
