"""Doors of the physics world: what they are, what is believed of them, opened and shut by the arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.schemas.apartment import Apartment, Furniture, Thing
from scenewright.schemas.apartment import Room as Walls
from scenewright.stages.agent.arms.stations import around
from scenewright.stages.agent.obstacle_map import ObstacleMap
from scenewright.stages.agent.scene_map import Region
from scenewright.stages.agent.senses import Base, Position, SeenFurniture, Sweep
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.physics.apartment_room import ApartmentRoom
from scenewright.stages.agent.world.physics.before_fronts import bases_outside
from scenewright.stages.agent.world.physics.body import PhysicsBody
from scenewright.stages.agent.world.physics.doors import doored
from scenewright.stages.agent.world.physics.eyes import HEAD, Mask, Surface
from scenewright.stages.agent.world.physics.front_seeing import front_seen
from scenewright.stages.agent.world.physics.fronts import Front, edges
from scenewright.stages.agent.world.physics.seen import too_wide
from scenewright.stages.kit.geometry.transforms import apply, look_at
from scenewright.stages.kit.motion.doors import body_from_moved
from scenewright.stages.kit.rendering.object_views import Picture

NO_ERRORS = Rates().with_true_eyes()
FRIDGE = Furniture(name="fridge_0", label="fridge", centre=(2.0, 4.575), size=(0.65, 0.65), height=0.9, door=True)
DRESSER = Furniture(name="dresser_0", label="dresser", centre=(2.0, 4.65), size=(1.0, 0.5), height=0.65, door=True)


def apartment(piece: Furniture, label: str, at: tuple[float, float]) -> Apartment:
    return Apartment(
        rooms=(Walls(name="room_0", low=(-0.6, 0), high=(4.6, 5)),),
        furniture=(piece,),
        things=(Thing(name=f"{label}_0", label=label, on=piece.name, at=at),),
        start=(2.0, 2.6, np.pi / 2),
    )


def at_front(piece: Furniture) -> Position:
    return (*piece.centre, piece.height)


@pytest.mark.parametrize("piece", [FRIDGE, DRESSER])
def test_a_front_looks_into_the_room_and_hides_what_is_inside(piece: Furniture) -> None:
    room = ApartmentRoom(apartment(piece, "spoon", piece.centre))
    made = room.doored[piece.name]
    assert np.allclose(made.pose[:2, 0], (0, -1), atol=1e-9) and room.opened() == set()
    assert room.body("spoon_0", None).on == piece.name

    def seen() -> set[str]:
        eye = np.array([1.7, 3.2, 1.3])
        picture = room.renderer(eye).render(HEAD, look_at(eye, np.array([*piece.centre, 0.55]) - (0, 0.3, 0)))
        return {room.named.get(int(number), "") for number in np.unique(picture.instance)}

    assert "spoon_0" not in seen() and f"{piece.name}__handle" in seen()
    room.world.set_joint(piece.name, made.joint.name, made.joint.upper)
    if piece is DRESSER:  # it goes with the drawer, which the hand of this test does not
        room.world.set_pose("spoon_0", room._displacement(piece.name) @ room.world.pose("spoon_0"))
    assert "spoon_0" in seen() and room.opened() == {piece.name}
    assert room.body("spoon_0", None).on == piece.name
    room.close()


def test_a_leaf_hangs_beside_the_nearer_wall() -> None:
    for x, hinge in ((0.3, -1.0), (3.7, 1.0)):
        piece = FRIDGE.model_copy(update={"centre": (x, 4.575)})
        assert doored(apartment(piece, "bottle", piece.centre), piece).joint.axis[2] == hinge


def surface(label: str, low: Position, high: Position) -> Surface:
    points = np.random.default_rng(1).uniform(low, high, (6000, 3))
    return Surface(label, points, np.zeros_like(points), "", 0.0, 1)


def handle_seen() -> Surface:
    return surface("handle", (1.73, 4.19, 0.5), (1.75, 4.205, 0.7))


def fridge_front() -> Front:
    box = (np.array([1.7, 4.3, 0.0]), np.array([2.2, 4.8, 0.9]))
    door = surface("door", (1.675, 4.249, 0.03), (2.325, 4.251, 0.9))
    front = front_seen("furniture_0", "fridge", box, [door, handle_seen()], np.array([2.0, 3.4, np.pi / 2]))
    assert front is not None
    return front


def test_a_front_is_made_of_what_was_seen() -> None:
    front = fridge_front()
    assert not front.slides and abs(front.size[1] - 0.65) < 0.025
    origin = apply(front.map_from_front, np.array([front.joint.origin]))[0]
    assert np.allclose(origin[:2], (2.325, 4.27), atol=0.02), "its hinge is at the edge far from the handle"
    open_wide = apply(front.map_from_front @ body_from_moved(front.joint, 1.5), np.array([front.joint.handle]))[0]
    assert open_wide[1] < 3.75, "it opens into the room"
    edge = surface("door", (1.674, 4.25, 0.03), (1.676, 4.27, 0.9))
    box = (np.array([1.675, 4.3, 0.0]), np.array([2.325, 4.9, 0.9]))
    assert front_seen("furniture_0", "fridge", box, [edge, handle_seen()], np.array([0.9, 4.5, 0.0])) is None
    beyond = surface("handle", (1.63, 4.19, 0.5), (1.65, 4.205, 0.7))
    sides = (np.array([1.675, 4.25, 0.0]), np.array([2.325, 4.9, 0.9]))
    assert front_seen("furniture_0", "fridge", sides, [beyond], np.array([0.9, 4.5, 0.0])) is None, "past the edge"


def test_how_far_it_is_open_is_felt_and_seen() -> None:
    front = fridge_front()
    shut = np.array(front.joint.handle)
    for value in (0.3, 1.2):
        moved = front.map_from_front @ body_from_moved(front.joint, value)
        assert front.felt(apply(moved, shut[None])[0], shut) == pytest.approx(value, abs=1e-9)
        leaf = np.random.default_rng(0).uniform(
            (front.size[0] / 2, -0.32, 0.1), (front.size[0] / 2, 0.32, 0.8), (900, 3)
        )
        assert front.value_seen(apply(moved, leaf)) == pytest.approx(value, abs=0.06)


def test_a_drawer_that_is_taken_for_a_plate_is_no_thing() -> None:
    assert too_wide(surface("plate", (1.5, 4.0, 0.4), (2.5, 4.4, 0.6)))
    assert not too_wide(surface("plate", (1.9, 4.0, 0.6), (2.12, 4.22, 0.62)))


def test_a_leaf_that_swung_wide_is_pushed_from_its_outer_side() -> None:
    front = replace(fridge_front(), value=1.9)
    hinge = apply(front.map_from_front, np.array([front.joint.origin]))[0]
    moved = front.map_from_front @ body_from_moved(front.joint, front.value)
    bases = bases_outside(front)
    assert bases and all(base[0] > hinge[0] for base in bases), "the hinge is at large x, the leaf beyond a right angle"
    for base in bases:
        own = apply(np.linalg.inv(moved), np.array([[*base[:2], 0.0]]))[0]
        assert own[0] > front.size[0] / 2, "before the leaf's outer face as it stands"
    assert bases_outside(replace(front, value=0.0)) == []


def test_edges_leave_strays_out() -> None:
    random = np.random.default_rng(2)
    points = np.concatenate(
        [random.uniform((-0.3, 0), (0.3, 0.8), (20000, 2)), random.uniform((0.3, 0), (0.4, 0.8), (60, 2))]
    )
    assert np.allclose(edges(points), (-0.3, 0.3), atol=0.011)


def test_a_base_goes_around_what_is_put_aside_and_back_over_it() -> None:
    room = ObstacleMap(Base(0.0, 0.0, 0.0), 2.7)
    room.add(Sweep(np.argwhere(np.ones((41, 41), bool)), np.zeros((0, 2), int), ()))
    room.put_aside(np.array([(2.0, 1.0), (2.0, 1.1)]))
    assert not room.fits(2.2, 1.0) and room.fits(2.5, 1.0)
    way = room.path(Base(1.8, 1.0, 0.0), (2.5, 1.0))
    assert way is not None and all(np.hypot(x - 2.0, y - 1.05) > 0.1 for x, y in way), "not through it from near by"
    room.put_aside(np.zeros((0, 2)))
    assert room.fits(2.2, 1.0)


def test_a_base_gets_back_the_way_it_came() -> None:
    room = ObstacleMap(Base(1.0, 1.0, 0.0), 2.7)
    room.add(Sweep(np.argwhere(np.ones((31, 31), bool)), np.zeros((0, 2), int), ()))
    for x in np.arange(1.0, 2.21, 0.05):
        room.driven(x, 1.0 + 0.4 * (x - 1.0))
    felt = np.array([(17, row) for row in range(31) if row not in (12, 13)])  # a gap narrower than the map takes it for
    room.add(Sweep(np.zeros((0, 2), int), felt, ()))
    way = room.path(Base(2.2, 1.48, 0.0), (1.0, 1.0))
    assert way is not None and way[-1] == (1.0, 1.0)


def test_an_open_shelf_is_stood_before_on_its_front_alone() -> None:
    shelf = SeenFurniture("fridge", (2.0, 4.0), (0.6, 0.7), 0.9, True, True, open_to=-np.pi / 2)
    poses = around(shelf, 0.38)
    assert poses and all(pose.y < 3.65 for pose in poses)
    assert len(around(replace(shelf, open_to=None), 0.38)) > len(poses)


def test_a_drawer_is_opened_by_its_handle_and_shut() -> None:
    body = PhysicsBody(ApartmentRoom(apartment(DRESSER, "spoon", (2.1, 4.6))), ("spoon",), NO_ERRORS, 2)
    body.sweep()
    felt = body.pull(at_front(DRESSER), opening=True)
    assert felt.ok and felt.furniture is not None and felt.furniture.size[1] > 0.65
    assert body.opened == {"dresser_0"} and body._room.joint_value("dresser_0") > 0.3
    front = body._pulling._seen.fronts["furniture_0"]
    assert front.value == pytest.approx(body._room.joint_value("dresser_0"), abs=0.02)
    (spoon,) = body.look((2.0, 4.3, 0.65), close=False).detections
    assert spoon.label == "spoon" and np.hypot(*np.subtract(spoon.position[:2], body.bodies["spoon_0"].at)) < 0.03
    assert body.pull(at_front(DRESSER), opening=False).ok and body.opened == set()
    assert [event.ok for event in body.events if event.verb == "pull"] == [True, True]
    body.close()


def test_a_fridge_is_opened_looked_into_and_shut() -> None:
    body = PhysicsBody(ApartmentRoom(apartment(FRIDGE, "bottle", (1.95, 4.5))), ("bottle",), NO_ERRORS, 2)
    body.sweep()
    assert body.pull(at_front(FRIDGE), opening=True).ok and body._room.joint_value("fridge_0") > 0.9
    look = body.look(at_front(FRIDGE), close=False)
    assert look.in_view and [d.label for d in look.detections] == ["bottle"]
    bottle = look.detections[0]
    assert body.reaches(body.base, bottle.position) and body.grasp(bottle.position, "bottle", 0).ok
    assert body.bodies["bottle_0"].on == ""
    hindered = body.pull(at_front(FRIDGE), opening=False)
    assert not hindered.ok and hindered.kind == "out_of_reach", "with something in the hand"
    body.close()


def test_a_leaf_that_came_half_way_is_pushed_on_and_can_be_shut() -> None:
    body = PhysicsBody(ApartmentRoom(apartment(FRIDGE, "bottle", (1.95, 4.5))), ("bottle",), NO_ERRORS, 2)
    body.sweep()
    assert body.pull(at_front(FRIDGE), opening=True).ok
    room = body._room
    room.world.set_joint("fridge_0", room.doored["fridge_0"].joint.name, 0.9)
    assert body._pulling._push_on("furniture_0", 0.9) > 1.2 and room.joint_value("fridge_0") > 1.2
    room.world.set_joint("fridge_0", room.doored["fridge_0"].joint.name, 1.0)  # the elbow came against it, unfelt
    assert body.pull(at_front(FRIDGE), opening=False).ok and body.opened == set()
    body.close()


def test_a_handle_that_a_far_look_misses_is_found_from_near_by(monkeypatch: pytest.MonkeyPatch) -> None:
    body = PhysicsBody(ApartmentRoom(apartment(FRIDGE, "bottle", (1.95, 4.5))), ("bottle",), NO_ERRORS, 2)
    body.sweep()
    masks = body._looking._segmenter.masks

    def without_far_handles(picture: Picture, camera: np.ndarray, region: Region) -> list[Mask]:
        return [m for m in masks(picture, camera, region) if m.label != "handle" or region[1]]

    monkeypatch.setattr(body._looking._segmenter, "masks", without_far_handles)
    assert body.pull(at_front(FRIDGE), opening=True).ok
    body.close()


def test_without_a_handle_nothing_is_pulled(monkeypatch: pytest.MonkeyPatch) -> None:
    body = PhysicsBody(ApartmentRoom(apartment(FRIDGE, "bottle", (1.95, 4.5))), ("bottle",), NO_ERRORS, 2)
    body.sweep()
    monkeypatch.setattr(body._looking, "look_at_front", lambda at, *, close=False: [])
    felt = body.pull(at_front(FRIDGE), opening=True)
    assert not felt.ok and felt.failure is not None and felt.failure.kind == "no_grasp"
    assert felt.failure.numbers["sides"] >= 1 and body.opened == set()
    body.close()
