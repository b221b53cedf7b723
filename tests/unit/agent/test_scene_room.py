"""Rooms of library models that the robot lives in: what lies in a drawer, what the eyes see of fronts, opening them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.agent_episode import AgentEpisode
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile
from scenewright.schemas.interactive_scene import InteractiveSceneFile
from scenewright.schemas.scene_parts import Camera, Joint
from scenewright.stages.agent.brains.words import understood
from scenewright.stages.agent.goals import kind
from scenewright.stages.agent.parameters import ReplayParameters, RunParameters
from scenewright.stages.agent.replay_stage import run as replay
from scenewright.stages.agent.run_stage import run as run_step
from scenewright.stages.agent.world.physics.body import PhysicsBody
from scenewright.stages.agent.world.physics.eyes import HEAD, Surface
from scenewright.stages.agent.world.physics.front_seeing import fronts_seen, open_shelf
from scenewright.stages.agent.world.physics.scene_room import SceneRoom, is_front, split_handle
from scenewright.stages.agent.world.reconstructed import apartment_of, lived_in
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.kit.geometry.transforms import apply, look_at
from scenewright.stages.kit.motion.doors import body_from_moved
from scenewright.stages.kit.simulation.engine import engine

from tests.unit.agent.made_scene import CABINET_AT, DRAWER_LOW, write_room
from tests.unit.agent.test_doors import NO_ERRORS, surface
from tests.unit.agent.test_sessions import context

UPPER = "cabinet_3__drawer_2"


def scene_room(folder: Path) -> SceneRoom:
    apartment = apartment_of(InteractiveSceneFile.read(folder / "scene.json").bodies, "a room")
    return SceneRoom(folder, apartment)


@pytest.fixture
def room(tmp_path: Path) -> Iterator[SceneRoom]:
    made = scene_room(write_room(tmp_path / "room"))
    yield made
    made.close()


def pull_out(room: SceneRoom, to: float) -> None:
    """Let a motor move the upper drawer."""
    body = room.world.bodies["cabinet_3"]
    index, client = body.joints[f"{UPPER}_slide"], room.world.client
    for value in np.linspace(room.world.joint_value("cabinet_3", f"{UPPER}_slide"), to, 240):
        engine.setJointMotorControl2(
            body.body_id, index, engine.POSITION_CONTROL, targetPosition=value, force=200, physicsClientId=client
        )
        room.world.wake()
        room.world.step()


def seen(room: SceneRoom) -> set[str]:
    """Return the names of what is seen of the cabinet from before it and above."""
    eye = np.array([CABINET_AT[0] + 0.2, 0.7, 1.8])
    picture = room.renderer(eye).render(HEAD, look_at(eye, np.array([CABINET_AT[0], CABINET_AT[1] - 0.25, 0.55])))
    return {room.named.get(int(number), "") for number in np.unique(picture.instance)}


def test_a_thing_in_a_drawer_moves_with_it_and_stays_in_its_furniture(room: SceneRoom) -> None:
    assert room.body("can_4", None).on == "table_2" and room.body("can_4", "can_4").on == ""
    assert room.body("cup_5", None).on == "cabinet_3" and room.opened() == set()
    before = room.lies("cup_5")
    pull_out(room, 0.3)
    after = room.lies("cup_5")
    assert after[1] == pytest.approx(before[1] - 0.3, abs=0.03) and after[0] == pytest.approx(before[0], abs=0.01)
    assert room.body("cup_5", None).on == "cabinet_3" and room.opened() == {"cabinet_3"}
    room.world.set_pose("cup_5", np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.002], [0, 0, 0, 1.0]]))
    room.world.settle(0.3)
    assert room.body("cup_5", None).on == "floor"


def test_front_and_handle_are_seen_and_a_shut_drawer_hides_what_is_in_it(room: SceneRoom) -> None:
    assert {UPPER, f"{UPPER}__handle"} <= seen(room) and "cup_5" not in seen(room)
    assert room.label(UPPER) == "drawer" and room.label(f"{UPPER}__handle") == "handle"
    assert room.owner(UPPER) == "cabinet_3"
    pull_out(room, 0.3)
    assert "cup_5" in seen(room)
    assert room.owner(UPPER) == "" == room.owner(f"{UPPER}__handle"), "what stands open is not of the furniture's mask"


def test_its_own_colours_are_what_the_judge_knows(room: SceneRoom) -> None:
    assert room.things["can_4"].color == "white"


@pytest.mark.parametrize(
    ("type_", "axis", "front"),
    [
        ("revolute", (0, 0, 1), True),
        ("revolute", (1, 0, 0), False),
        ("prismatic", (0, -1, 0), True),
        ("prismatic", (0, 0, 1), False),
    ],
)
def test_lids_and_flaps_are_no_fronts(
    room: SceneRoom, type_: str, axis: tuple[float, float, float], front: bool
) -> None:
    record = room.world.bodies["cabinet_3"].record
    joint = Joint(name="j", type=type_, part="p", origin=(0, 0, 0), axis=axis, lower=0, upper=1)  # type: ignore[arg-type]
    assert is_front(record, joint) is front


def test_the_handle_is_the_piece_that_is_gripped_and_never_the_whole_front() -> None:
    panel = trimesh.creation.box((0.6, 0.02, 0.3))
    bar = trimesh.creation.box((0.2, 0.02, 0.02), trimesh.transformations.translation_matrix((0, -0.06, 0)))
    joined = trimesh.util.concatenate([panel, bar])
    front, handle = split_handle([joined], np.array([0.0, -0.06, 0.0]))
    assert [len(mesh.faces) for mesh in (*front, *handle)] == [12, 12]
    assert handle[0].extents == pytest.approx([0.2, 0.02, 0.02])
    assert split_handle([panel], np.zeros(3))[1] == []


BOX = (np.array([-1.3, 1.375, 0.0]), np.array([-0.7, 1.825, 0.8]))
BEFORE = np.array([-1.0, 0.5, np.pi / 2])


def drawers() -> list[Surface]:
    made = []
    for low in DRAWER_LOW:
        made.append(surface("drawer", (-1.28, 1.374, low), (-0.72, 1.376, low + 0.33)))
        made.append(surface("handle", (-1.1, 1.32, low + 0.155), (-0.9, 1.34, low + 0.175)))
    return made


def test_each_handle_has_its_own_front_the_topmost_first() -> None:
    fronts = fronts_seen("furniture_0", "cabinet", BOX, drawers(), BEFORE)
    assert [round(front.panel[2], 1) for front in fronts] == [0.4, 0.1] and all(front.slides for front in fronts)
    assert all(not front.alone and front.value == 0 for front in fronts)
    assert fronts[0].solid(), "what is below the upper one is no hollow"
    inside = np.array([[-1.0, 1.6, 0.5], [-1.0, 1.6, 0.2]])
    assert fronts[0].inside(inside).tolist() == [True, False] and fronts[1].inside(inside).tolist() == [False, True]


def test_a_neighbours_handle_is_none_of_the_furniture() -> None:
    neighbour = [
        surface("door", (-0.5, 1.374, 0.0), (0.1, 1.376, 0.9)),
        surface("handle", (0.0, 1.32, 0.5), (0.02, 1.34, 0.7)),
    ]
    own = [
        surface("door", (-1.29, 1.374, 0.02), (-0.71, 1.376, 0.8)),
        surface("handle", (-1.25, 1.32, 0.4), (-1.23, 1.34, 0.6)),
    ]
    (front,) = fronts_seen("furniture_0", "fridge", BOX, [*own, *own[1:], neighbour[0]], BEFORE)
    assert front.alone and front.size[1] == pytest.approx(0.6, abs=0.03)


def test_a_door_that_stands_open_is_known_by_where_it_is() -> None:
    angle = 1.8
    hinge, leaf = np.array([-0.7, 1.375]), 0.6 * np.array([-np.cos(angle), -np.sin(angle)])
    along = np.random.default_rng(0).uniform(0, 1, (4000, 1))
    heights = np.random.default_rng(1).uniform(0.05, 0.78, (4000, 1))
    points = np.concatenate([hinge + along * leaf, heights], axis=1)
    panel = Surface("door", points, np.zeros_like(points), "", 0.0, 1)
    (front,) = fronts_seen("furniture_0", "cabinet", BOX, [panel], BEFORE)
    assert front.value == pytest.approx(angle, abs=0.05) and front.before(BEFORE)
    assert front.inside(np.array([[-1.0, 1.6, 0.4]]))[0]
    free_end = apply(front.map_from_front @ body_from_moved(front.joint, front.value), np.array([front.joint.handle]))[
        0
    ]
    assert np.linalg.norm(free_end[:2] - (hinge + leaf)) < 0.15
    assert fronts_seen("furniture_0", "cabinet", BOX, [panel], BEFORE)[0].joint.type == "revolute"


def test_a_shelf_is_open_where_its_inside_was_seen() -> None:
    low, high = np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.4, 1.2])
    random = np.random.default_rng(0)
    before = random.uniform((0, 0, 0), (1, 0.01, 1.2), (900, 3))
    boards = random.uniform((0.1, 0.1, 0.6), (0.9, 0.3, 0.62), (300, 3))
    base = np.array([0.5, -0.8, np.pi / 2])
    shelf = open_shelf("furniture_0", "shelf", (low, high), np.concatenate([before, boards]), base)
    assert shelf is not None and shelf.before(base) and shelf.inside(np.array([[0.5, 0.2, 0.7]]))[0]
    assert shelf.behind(np.array([0.5, 0.2, 0.7])) == pytest.approx(0.2)
    assert len(shelf.outline()) == 0 and not shelf.of_part(boards, 0.05).any()
    assert open_shelf("furniture_0", "shelf", (low, high), before, base) is None, "a plain block"
    assert open_shelf("furniture_0", "table", (low, high), boards, base) is None


@pytest.mark.slow
def test_drawers_are_opened_one_after_the_other(tmp_path: Path) -> None:
    room = scene_room(write_room(tmp_path / "room"))
    body = PhysicsBody(room, ("cup",), NO_ERRORS, 2)
    body.sweep()
    at = (*CABINET_AT[:2], 0.8)
    first = body.pull(at, opening=True)
    assert first.ok and first.furniture is not None and first.furniture.more and first.furniture.top
    assert room.world.joint_value("cabinet_3", f"{UPPER}_slide") > 0.2
    assert [d.label for d in body.look(at, close=False).detections] == ["cup"]
    second = body.pull(at, opening=True)
    assert second.ok and second.furniture is not None and not second.furniture.more
    assert room.world.joint_value("cabinet_3", f"{UPPER}_slide") < 0.02
    assert room.world.joint_value("cabinet_3", "cabinet_3__drawer_1_slide") > 0.2
    body.close()


def truth_of_room(folder: Path, digest: str) -> GroundTruth:
    """Return the handle of a generated truth whose room is the one made by hand."""
    camera = Camera(width=4, height=3, fx=4, fy=4, cx=1.5, cy=1)
    about = {
        "seed": 0,
        "recipe": "hand",
        "room_size": (5, 5, 2.5),
        "frame_count": 0,
        "depth_noise": False,
        "objects": (),
    }
    GroundTruthFile(camera=camera, **about).write(folder / "ground_truth.json")  # type: ignore[arg-type]
    return GroundTruth(folder, manifest=SimpleNamespace(content_digest=digest))  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_task_in_words_is_done_among_library_furniture_and_again_from_its_episode(tmp_path: Path) -> None:
    write_room(tmp_path / "truth" / "room")
    truth, other = (truth_of_room(tmp_path / "truth", digest) for digest in ("1" * 64, "2" * 64))
    parameters = RunParameters(
        task="put the cup on the table", simulation="physics", image_width=300, failures=0.0, perception=0.0
    )
    made = run_step(None, None, truth, None, parameters=parameters, context=context(tmp_path / "made", 4))
    assert made.outcome == "ok" and made.info.score.success and made.info.room == "1" * 64
    assert "open(rooms['cabinet_0'])" in "\n".join(turn.code for turn in made.info.turns), "the cup was in a drawer"
    small = ReplayParameters(image_width=300)
    replay(AgentEpisode(tmp_path / "made"), truth, parameters=small, context=context(tmp_path / "again"))
    digests = {content_digest(record_files(tmp_path / name, ())) for name in ("made", "again")}
    assert len(digests) == 1
    for number, wrong in enumerate((None, other)):
        with pytest.raises(BadInput, match="the room of the truth 111111111111"):
            replay(AgentEpisode(tmp_path / "made"), wrong, parameters=small, context=context(tmp_path / str(number)))


def test_a_room_is_lived_in_by_its_truth_alone_in_the_fast_world_and_a_scan_has_none(tmp_path: Path) -> None:
    write_room(tmp_path / "truth" / "room")
    truth = truth_of_room(tmp_path / "truth", "1" * 64)
    parameters = RunParameters(task="put the can on the cabinet", arm="oracle", failures=0, image_width=300)
    made = run_step(None, None, truth, None, parameters=parameters, context=context(tmp_path / "made"))
    assert (
        made.outcome == "ok"
        and made.info.room == ""
        and {f.label for f in made.apartment.furniture} == {"table", "cabinet"}
    )
    scan = truth.info.model_copy(update={"source": "scan"})
    scan.write(tmp_path / "truth" / "ground_truth.json")
    with pytest.raises(BadInput, match="no room to live in"):
        lived_in(GroundTruth(tmp_path / "truth"))


def test_words_name_furniture_of_two_words_and_say_on_or_in() -> None:
    (onto,) = understood("put the cup on the drawer unit")
    assert onto.onto == kind("drawer unit") and not onto.inside  # type: ignore[union-attr]
    (into,) = understood("put the cup into the drawer unit")
    assert into.inside  # type: ignore[union-attr]
    (out,) = understood("take the book out of the drawer unit and put it on the desk")
    assert (out.start, out.onto) == ("drawer unit", kind("desk"))  # type: ignore[union-attr]
