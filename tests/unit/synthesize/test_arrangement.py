"""Rooms keep their promises: nothing overlaps, everything rests on its parent, doors swing, people can walk."""

from __future__ import annotations

import itertools

import fcl
import numpy as np
import open3d as o3d
import pytest
from scenewright.schemas.cad_library import CadLibrary, LibraryFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.kit.formats.cad_models import load_collision_parts, part_transforms
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.synthesize.arrangement import Arrangement, arrange
from scenewright.stages.synthesize.collision import CollisionWorld, box_shape, convex_shape
from scenewright.stages.synthesize.furniture import Catalogue, main_joint
from scenewright.stages.synthesize.placement import PlacedObject
from scenewright.stages.synthesize.recipes import Recipe, load_recipe, recipe_names, rescaled

SEEDS = (0, 1, 2, 3)


def recipe_for_few_shapes(name: str) -> Recipe:
    """The recipe; none of the few shelves in the library of these tests is as low as those on the walls of a studio."""
    recipe = load_recipe(name)
    hung = [(place.class_name, place.where) == ("shelf", "mounted") for place in recipe.place]
    places = [
        p.model_copy(update={"largest_height": 1.3}) if is_hung else p
        for p, is_hung in zip(recipe.place, hung, strict=True)
    ]
    return recipe.model_copy(update={"place": tuple(places)})


@pytest.fixture(
    scope="module",
    params=[("room", 0), ("office", 0)]
    + [pytest.param(("room", seed), marks=pytest.mark.slow) for seed in SEEDS[1:]]
    + [pytest.param((name, 0), marks=pytest.mark.slow) for name in recipe_names() if name not in ("room", "office")],
)
def arrangement(request: pytest.FixtureRequest, catalogue: Catalogue) -> Arrangement:
    name, seed = request.param
    return arrange(recipe_for_few_shapes(name), catalogue, "medium", seed)


def penetration(a: PlacedObject, b: PlacedObject) -> float:
    """Deepest overlap of the convex pieces of two objects [m]."""
    first, second = (thing.furnishing.shape.placed(thing.world_from_model) for thing in (a, b))
    deepest = 0.0
    for i, j in itertools.product(range(len(first.objects)), range(len(second.objects))):
        if np.any(first.minimum[i] > second.maximum[j]) or np.any(second.minimum[j] > first.maximum[i]):
            continue
        result = fcl.CollisionResult()
        request = fcl.CollisionRequest(num_max_contacts=10, enable_contact=True)
        if fcl.collide(first.objects[i], second.objects[j], request, result):
            deepest = max(deepest, max(contact.penetration_depth for contact in result.contacts))
    return deepest


def ray_scene(thing: PlacedObject) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene()
    mesh = thing.world_mesh()
    scene.add_triangles(np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32))
    return scene


def test_nothing_interpenetrates(arrangement: Arrangement) -> None:
    for a, b in itertools.combinations(arrangement.objects, 2):
        assert penetration(a, b) <= 1e-3, f"{a.name} and {b.name}"


def test_everything_rests_on_its_parent(arrangement: Arrangement) -> None:
    by_name = {thing.name: thing for thing in arrangement.objects}
    for thing in arrangement.objects:
        bottom = float(np.asarray(thing.world_mesh().vertices)[:, 2].min())
        if thing.parent == "floor_1":
            assert abs(bottom) < 1e-6
        elif thing.parent in by_name:
            contacts = apply(thing.world_from_model, thing.furnishing.contacts)
            up = np.tile([0.0, 0.0, -1.0], (len(contacts), 1))
            rays = np.concatenate([contacts + [0, 0, 0.005], up], axis=1).astype(np.float32)
            gap = ray_scene(by_name[thing.parent]).cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy() - 0.005
            if any(entry.relation == "also_supports" for entry in thing.further):
                over = np.isfinite(gap) & (gap < 0.1)  # the ends of a board lie on one carrier each, its middle on none
                assert over.any() and not over.all()
                gap = gap[over]
            assert np.abs(gap).max() <= 1e-3 + 1e-5, thing.name
            assert thing.plane is not None
            plane = by_name[thing.parent].furnishing.surfaces[thing.plane]
            level = by_name[thing.parent].world_from_model[2, 3] - plane.offset / plane.normal[2]
            assert abs(bottom - level) < 2e-3, f"{thing.name} is not on the plane that its link names"
        elif thing.relation == "hangs_from":
            highest = float(np.asarray(thing.world_mesh().vertices)[:, 2].max())
            assert 0.0 <= arrangement.room.size[2] - highest < 2e-3
        else:
            wall = arrangement.room.layouts[int(thing.parent.split("_")[1]) - 1]
            back = (np.asarray(thing.world_mesh().vertices) - wall.maximum) @ wall.inward
            face = (np.asarray(wall.plane.center) - wall.maximum) @ wall.inward
            assert abs(back.min() - face) < 1e-3, f"{thing.name} does not hang on {thing.parent}"


def test_what_holds_a_thing_beside_its_parent_touches_it(arrangement: Arrangement) -> None:
    by_name = {thing.name: thing for thing in arrangement.objects}
    walls = {f"wall_{k}": k for k in range(2, 6)}
    for thing in arrangement.objects:
        vertices = np.asarray(thing.world_mesh().vertices)
        for entry in thing.further:
            if entry.source in walls:
                wall = arrangement.room.layouts[walls[entry.source] - 1]
                distance = (vertices - np.asarray(wall.plane.center)) @ wall.inward
                upper = vertices[:, 2] > 0.5 * vertices[:, 2].max()
                assert 0.0 <= distance[upper].min() < 2e-3 and distance[~upper].min() > 0.02
                continue
            scene = ray_scene(by_name[entry.source])
            near = scene.compute_distance(o3d.core.Tensor(vertices.astype(np.float32))).numpy()
            if entry.relation == "leans_on":
                upper = vertices[:, 2] > 0.5 * vertices[:, 2].max()
                assert near[upper].min() < 2e-3 < near[~upper].min()
            else:
                assert near.min() < 1e-3 and entry.plane is not None
                plane = by_name[entry.source].furnishing.surfaces[entry.plane]
                level = by_name[entry.source].world_from_model[2, 3] - plane.offset / plane.normal[2]
                assert abs(vertices[:, 2].min() - level) < 2e-3


def test_a_studio_has_all_the_less_common_supports(catalogue: Catalogue) -> None:
    objects = arrange(recipe_for_few_shapes("studio"), catalogue, "medium", 0).objects
    held = {thing.relation for thing in objects} | {entry.relation for t in objects for entry in t.further}
    assert held == {"supports", "contains", "carries_on_wall", "hangs_from", "also_supports", "leans_on"}
    in_drawers = [t for t in objects if t.parent.startswith("drawer_unit") and t.relation == "contains"]
    assert in_drawers and any(t.parent.startswith("tray") for t in objects)


def test_all_inside_the_room(arrangement: Arrangement) -> None:
    for thing in arrangement.objects:
        points = np.asarray(thing.world_mesh().vertices)
        assert arrangement.room.holds(points.min(axis=0), points.max(axis=0), tolerance=1e-3), thing.name


def test_doors_and_drawers_swing_freely(arrangement: Arrangement) -> None:
    """The moving parts, over their whole range, touch nothing: not even what stands inside."""
    swinging = 0
    for thing in arrangement.objects:
        others = CollisionWorld()
        for other in arrangement.objects:
            in_drawer = thing.furnishing.drawer_floors and other.parent == thing.name and other.relation == "contains"
            if other is not thing and not in_drawer:
                others.add(other.name, other.furnishing.shape.placed(other.world_from_model))
        parts = load_collision_parts(thing.furnishing.folder)
        for joint in thing.furnishing.model.joints:
            for value in np.linspace(joint.lower, joint.upper, 7):
                pose = part_transforms(thing.furnishing.model, {joint.name: float(value)})[joint.part]
                moving = convex_shape(parts[joint.part]).placed(thing.world_from_model @ pose)
                hit = others.conflict(moving)
                assert hit is None, f"{thing.name}.{joint.name} at {value:.2f} hits {hit}"
                swinging += 1
    assert swinging > 0


def test_fridge_stands_open_with_an_item_that_a_robot_can_take(catalogue: Catalogue) -> None:
    for seed in SEEDS:
        arrangement = arrange(load_recipe("room"), catalogue, "medium", seed)
        (fridge,) = (thing for thing in arrangement.objects if thing.class_name == "fridge")
        joint = main_joint(fridge.furnishing.model)
        assert fridge.furnishing.joints[joint.name] > 0.8 * joint.upper
        items = [t for t in arrangement.objects if t.parent == fridge.name and t.furnishing.model.grasp_width]
        items = [t for t in items if 0.5 <= t.world_from_model[2, 3] <= 1.1]
        assert items and all(item.relation == "contains" for item in items)
        # Seen from 1 m before the fridge, at its own height, the item is not hidden by the fridge (open door included).
        seen = False
        for item in items:
            local = apply(np.linalg.inv(fridge.world_from_model), item.world_from_model[:3, 3]) + [0, 0, 0.08]
            eye = np.array([0.0, -1.3, local[2]])
            ray = np.concatenate([eye, local - eye])[None].astype(np.float32)
            scene = o3d.t.geometry.RaycastingScene()
            mesh = fridge.furnishing.mesh
            scene.add_triangles(np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32))
            seen |= not scene.test_occlusions(o3d.core.Tensor(ray), 0.0, 0.95).numpy().any()
        assert seen
        # Free floor in front of it, but for the fridge itself.
        world = CollisionWorld()
        for thing in arrangement.objects:
            if thing is not fridge:
                world.add(thing.name, thing.furnishing.shape.placed(thing.world_from_model))
        size = fridge.furnishing.closed_size
        strip = box_shape(
            np.array([-size[0] / 2, -size[1] / 2 - 1.0, 0.05]), np.array([size[0] / 2, -size[1] / 2, 1.8])
        )
        assert world.conflict(strip.placed(fridge.world_from_model)) is None


def test_support_tree_holds_things_on_things(catalogue: Catalogue) -> None:
    """Cups on tables and desks, something in the fridge, and over a few rooms something on something movable."""
    deep = False
    for seed in range(8):
        objects = {t.name: t for t in arrange(load_recipe("room"), catalogue, "high", seed).objects}
        parents = {t.class_name: t.parent.split("_")[0] for t in objects.values()}
        assert parents["monitor"] == "desk" and parents["keyboard"] == "desk" and parents["wall_cabinet"] == "wall"
        deep |= any(t.parent in objects and objects[t.parent].furnishing.model.movable for t in objects.values())
        for thing in objects.values():
            chain, name = 0, thing.name
            while name in objects:
                name, chain = objects[name].parent, chain + 1
                assert chain < 10
            assert name == "floor_1" or name.startswith("wall_")
    assert deep


def test_same_seed_same_room(library: CadLibrary) -> None:
    rooms = [arrange(load_recipe("room"), Catalogue(library), "medium", seed) for seed in (4, 4, 5)]
    described = [
        [(t.name, t.furnishing.model.id, t.world_from_model.tobytes()) for t in room.objects] for room in rooms
    ]
    assert described[0] == described[1] != described[2]


def test_clutter_levels_grow(catalogue: Catalogue) -> None:
    counts = {}
    for level in ("none", "low", "medium", "high"):
        counts[level] = np.mean([len(arrange(load_recipe("room"), catalogue, level, s).objects) for s in range(4)])
    assert counts["none"] < counts["low"] < counts["high"] and counts["none"] < counts["medium"] < counts["high"]


def test_recipes_split_their_seeds() -> None:
    assert {"room", "kitchen", "office", "bedroom", "studio"} <= set(recipe_names())
    for name in recipe_names():
        split = load_recipe(name).seeds
        assert split.tuning[0] <= split.tuning[1] < split.reporting[0] <= split.reporting[1]


def test_unknown_recipe_and_missing_class(library: CadLibrary, tmp_path) -> None:
    with pytest.raises(UsageError, match="no room recipe"):
        load_recipe("castle")
    kept = tuple(model for model in library.info.models if model.class_name != "fridge")
    LibraryFile(seed=0, models=kept).write(tmp_path / "library.json")
    with pytest.raises(BadInput, match="fridge"):
        arrange(load_recipe("room"), Catalogue(CadLibrary(tmp_path)), "medium", 0)


def test_rearranged_room_keeps_its_furniture_and_moves_what_lies_on_it(catalogue: Catalogue) -> None:
    recipe = recipe_for_few_shapes("office")
    first, again, other = (arrange(recipe, catalogue, "medium", 1, rearranged=draw) for draw in (0, 1, 2))

    def poses(room: Arrangement) -> dict[int, tuple[str, bytes]]:
        return {o.instance: (o.furnishing.model.id, o.world_from_model.tobytes()) for o in room.objects}

    before, after = poses(first), poses(again)
    assert after == poses(arrange(recipe, catalogue, "medium", 1, rearranged=1))
    carried = {o.instance for o in first.objects if o.relation in ("supports", "contains") and o.parent != "floor_1"}
    assert all(after[k] == before[k] for k in before.keys() - carried)
    changed = {k for k in after if after[k] != before[k]}
    assert changed and changed <= carried
    assert poses(other) != after
    assert all(penetration(a, b) < 1e-3 for a, b in itertools.combinations(again.objects, 2))


def test_things_of_a_rescaled_room_are_larger_and_smaller_than_their_models(catalogue: Catalogue) -> None:
    recipe = rescaled(load_recipe("room"), 0.2)
    scales = [thing.furnishing.scale for thing in arrange(recipe, catalogue, "medium", 0).objects]
    assert all(0.8 <= scale <= 1.2 for scale in scales) and min(scales) < 0.95 < 1.05 < max(scales)
    assert rescaled(recipe, 0.0) is recipe
