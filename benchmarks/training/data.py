"""Training frames: views of generated rooms and tabletops with strongly varied colours, lights, lenses and sensors.

    python -m benchmarks.training.data --out FOLDER [--rooms N] [--tables N] [--varied N] [--workers N] [--quick]

Rooms are those of RECIPES with seeds of their tuning range, furnished from a library built with a seed of its own, and
rooms that follow no recipe (`varied_rooms`); the reporting seeds, and the library that other experiments use (seed 0),
are never touched. Written as shards (stages/segment/training/network/shards.py), which `scenewright train network`
reads.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
import trimesh
from pydantic import Field
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.kit.geometry.transforms import look_at, transform_from_yaw
from scenewright.stages.kit.rendering.depth_noise import DepthCamera, disturb_depth
from scenewright.stages.kit.rendering.light_map import AreaLight
from scenewright.stages.kit.rendering.patterns import PATTERNS, Material
from scenewright.stages.kit.rendering.ray_casting import Rendering, SceneRenderer
from scenewright.stages.kit.rendering.surfaces import TriangleSoup
from scenewright.stages.segment import Sample, write_shard
from scenewright.stages.segment.training.network.shards import DEPTH_UNIT, HEIGHT, WIDTH
from scenewright.stages.synthesize import (
    Arrangement,
    Catalogue,
    arrange,
    build_room,
    load_recipe,
    recipe_names,
    world_meshes,
)

from benchmarks.options import Recipe, asked
from benchmarks.training.clutter import Thing, height_map, primitives, put_down
from benchmarks.training.sensors import coarse_depth, lose_things
from benchmarks.training.varied_rooms import varied_room

TRAINING_SEEDS, VALIDATION_SEEDS = range(0, 85), range(85, 100)
"""Both of the recipes' tuning range."""
RECIPES = ("bedroom", "kitchen", "office", "room")
"""Those whose rooms are found at the first start, mostly: the others take longer than all their pictures."""
VIEWS_PER_ROOM, VIEWS_PER_TABLE, VIEWS_PER_VARIED = 12, 8, 10
SHARD = 240
LEAST_CLEARANCE = 0.25
"""The camera keeps this far from everything [m]."""
ROOM_STREAM, TABLE_STREAM, VARIED_STREAM = 31, 32, 33


@dataclass(frozen=True)
class Scene:
    """Meshes of the world with the class of every instance; what a camera may look at."""

    meshes: list[tuple[int, trimesh.Trimesh]]
    classes: dict[int, str]
    targets: list[tuple[np.ndarray, float, float]]
    """(point (3,) [m], least and largest distance of the camera [m])."""
    bounds: np.ndarray
    """(2, 3): where the camera may be [m]."""


def room_scene(recipe_name: str, seed: int, catalogue: Catalogue, random: np.random.Generator) -> Scene:
    """Return a furnished room with things thrown about. Raises BadInput when the recipe finds no room."""
    clutter = ("low", "medium", "high")[int(random.integers(3))]
    arrangement: Arrangement = arrange(load_recipe(recipe_name), catalogue, clutter, seed)
    meshes = world_meshes(arrangement)
    classes = {k: layout.class_name for k, layout in enumerate(arrangement.room.layouts, start=1)}
    classes |= {thing.instance: thing.class_name for thing in arrangement.objects}
    half = arrangement.room.size / 2
    number = int(random.integers(0, 14))
    if number:
        heights = height_map(
            SceneRenderer(meshes), -half[:2] + 0.05, half[:2] - 0.05, arrangement.room.size[2] - 0.1, 0.02
        )
        raised = np.argwhere((heights.height > 0.2) & (heights.height < 1.6))
        for thing in islice(primitives(random), number):
            low, high = -half[:2], half[:2]
            if len(raised) and random.random() < 0.75:
                place = heights.origin + heights.cell * raised[int(random.integers(len(raised)))]
                low, high = place - 0.05, place + 0.05
            mesh = put_down(thing, heights, low, high, random)
            if mesh is not None:
                instance = max(classes) + 1
                meshes.append((instance, mesh))
                classes[instance] = thing.class_name
    targets = [
        (mesh.bounds.mean(axis=0), *((0.5, 2.2) if np.ptp(mesh.bounds, axis=0).max() < 0.5 else (0.9, 4.5)))
        for instance, mesh in meshes
        if classes[instance] not in ("floor", "wall", "ceiling")
    ]
    low = np.array([-half[0] + 0.2, -half[1] + 0.2, 0.35])
    high = np.array([half[0] - 0.2, half[1] - 0.2, min(1.95, arrangement.room.size[2] - 0.3)])
    return Scene(meshes, classes, targets, np.stack([low, high]))


def table_scene(catalogue: Catalogue, random: np.random.Generator) -> Scene:
    """Return an empty room with one table on which many small things stand, some on others, seen from close by."""
    recipe = load_recipe(recipe_names()[int(random.integers(len(recipe_names())))])
    room = build_room(recipe.shell, random)
    meshes = [(k, layout.mesh) for k, layout in enumerate(room.layouts, start=1)]
    classes = {k: layout.class_name for k, layout in enumerate(room.layouts, start=1)}
    half = room.size[:2] / 2
    size = random.uniform([0.7, 0.6], [2.0, 1.1])
    top, middle = float(random.uniform(0.4, 1.1)), random.uniform(-half + 1.2, half - 1.2)
    table = _slab_table(size, top, random)
    table.apply_transform(transform_from_yaw(float(random.uniform(-np.pi, np.pi)), np.array([*middle, 0.0])))
    meshes.append((len(meshes) + 1, table))
    classes[len(meshes)] = "table"
    reach = float(random.uniform(0.18, 0.45))
    heights = height_map(SceneRenderer(meshes), middle - 1.3, middle + 1.3, top + 0.5, 0.005)
    heights.height[heights.height < top - 0.01] = -1.0
    small = [model for name in ("bottle", "bowl", "cup", "book", "box") for model in catalogue.by_class.get(name, [])]
    shapes = primitives(random, scale=float(random.uniform(0.8, 1.3)))
    for _ in range(int(random.integers(2, 16))):
        if random.random() < 0.4 and small:
            furnishing = catalogue.furnishing(small[int(random.integers(len(small)))], {})
            mesh = furnishing.mesh.copy()
            mesh.apply_scale(float(random.uniform(0.85, 1.2)))
            mesh.apply_translation([0, 0, -mesh.bounds[0, 2]])
            thing = Thing(furnishing.model.class_name, mesh, furnishing.model.class_name in ("box", "book"))
        else:
            thing = next(shapes)
        low, high = middle - reach, middle + reach
        put = put_down(thing, heights, low, high, random)
        if put is not None:
            meshes.append((len(meshes) + 1, put))
            classes[len(meshes)] = thing.class_name
    target = np.array([*middle, top + 0.05])
    targets = [(target + np.array([*random.uniform(-0.2, 0.2, 2), 0.0]), 0.5, 1.5) for _ in range(6)]
    low, high = np.array([*(-half + 0.2), top + 0.12]), np.array([*(half - 0.2), min(top + 1.1, room.size[2] - 0.2)])
    return Scene(meshes, classes, targets, np.stack([low, high]))


def varied_scene(catalogue: Catalogue, random: np.random.Generator) -> Scene:
    """Return a room that follows no recipe; now and then the camera looks at a wall for its own sake."""
    room = varied_room(catalogue, random)
    targets = []
    for instance, mesh in room.meshes:
        extent = float(np.ptp(mesh.bounds, axis=0).max())
        middle = mesh.bounds.mean(axis=0)
        if room.classes[instance] == "wall" and random.random() < 0.5:
            targets.append((middle * [0.9, 0.9, random.uniform(0.5, 1.2)], 0.8, 4.5))
        elif room.classes[instance] not in ("floor", "wall", "ceiling"):
            targets.append((middle, *((0.4, 2.2) if extent < 0.5 else (0.8, 5.5))))
    half = room.size / 2
    # From further off too, at nothing in particular.
    targets += [
        (random.uniform([-1, -1, 0.2], [1, 1, 1.6]) * [half[0], half[1], 1], 1.2, 7.0) for _ in range(len(targets))
    ]
    low = np.array([-half[0] + 0.15, -half[1] + 0.15, 0.3])
    high = np.array([half[0] - 0.15, half[1] - 0.15, min(2.0, room.size[2] - 0.2)])
    return Scene(room.meshes, room.classes, targets, np.stack([low, high]))


def _slab_table(size: np.ndarray, top: float, random: np.random.Generator) -> trimesh.Trimesh:
    thickness = float(random.uniform(0.015, 0.05))
    parts = [trimesh.creation.box(extents=(*size, thickness))]
    parts[0].apply_translation([0, 0, top - thickness / 2])
    for x in (-0.45, 0.45):
        for y in (-0.45, 0.45):
            leg = trimesh.creation.box(extents=(0.05, 0.05, top - thickness))
            leg.apply_translation([x * size[0], y * size[1], (top - thickness) / 2])
            parts.append(leg)
    table: trimesh.Trimesh = trimesh.util.concatenate(parts)  # type: ignore[assignment]
    color = np.array([*random.integers(30, 240, 3), 255], dtype=np.uint8)
    table.visual.face_colors = color  # type: ignore[union-attr]
    return table


def random_camera(random: np.random.Generator) -> Camera:
    """Return a camera of 320x240 with a horizontal field of view of 44 to 86 degrees and a slightly moved centre."""
    focal = 0.5 * WIDTH / float(np.tan(np.deg2rad(random.uniform(44.0, 86.0)) / 2))
    cx, cy = (WIDTH - 1) / 2 + random.uniform(-10, 10), (HEIGHT - 1) / 2 + random.uniform(-10, 10)
    return Camera(width=WIDTH, height=HEIGHT, fx=focal, fy=focal, cx=float(cx), cy=float(cy))


def random_pose(scene: Scene, renderer: SceneRenderer, random: np.random.Generator) -> np.ndarray | None:
    """Return world_from_camera (4, 4) near one of the scene's targets, looking about at it; None when none was free."""
    for _ in range(30):
        target, near, far = scene.targets[int(random.integers(len(scene.targets)))]
        direction = random.standard_normal(3) * np.array([1.0, 1.0, 0.6])
        eye = target + float(random.uniform(near, far)) * direction / np.linalg.norm(direction)
        if np.any(eye < scene.bounds[0]) or np.any(eye > scene.bounds[1]):
            continue
        if renderer.distance(eye[None])[0] < LEAST_CLEARANCE:
            continue
        # Mostly the target is to be seen.
        if renderer.occluded(eye[None], target[None] + 1e-3)[0] and random.random() < 0.8:
            continue
        aim = target + 0.12 * np.linalg.norm(target - eye) * random.standard_normal(3)
        pose = look_at(eye, aim)
        roll = np.eye(4)
        angle = float(np.deg2rad(random.normal(0.0, 5.0)))
        roll[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        return pose @ roll
    return None


def vary_look(
    renderer: SceneRenderer, soup: TriangleSoup, scene: Scene, size: np.ndarray, random: np.random.Generator
) -> np.ndarray:
    """Give the renderer other colours, patterns and lights than those of `soup`; returns the gloss (0..1) by instance.

    A quarter of the views keeps the colours as designed; in the others every instance gets its own, and with them a
    random pattern. One to three lamps, hard shadows in half of the views.
    """
    instances = max(scene.classes) + 1
    colors = soup.corner_colors
    table, rows = [Material().row()], np.zeros(soup.triangles, dtype=np.int32)
    gloss = np.where(random.random(instances) < 0.3, random.uniform(0.0, 0.8, instances), 0.0).astype(np.float32)
    if random.random() < 0.75:
        tint = np.exp(random.normal(0.0, 0.35, (instances, 3))).astype(np.float32)
        paint = random.random((instances, 3), dtype=np.float32) ** 2
        repainted = (random.random(instances) < 0.6)[soup.instance][:, None, None]
        # A quarter of the parts' own contrast stays in the new colour.
        contrast = colors / np.maximum(colors.mean(axis=(1, 2), keepdims=True), 0.05)
        painted = paint[soup.instance][:, None] * (0.75 + 0.25 * contrast)
        colors = np.clip(np.where(repainted, painted, colors * tint[soup.instance][:, None]), 0.01, 1.0)
    for instance in range(1, instances):
        name = PATTERNS[int(random.integers(len(PATTERNS)))]
        frame = np.eye(4)
        frame[:3, :3] = np.linalg.qr(random.standard_normal((3, 3)))[0]
        period = float(np.exp(random.uniform(np.log(0.01), np.log(0.4))))
        strength, shine = float(random.uniform(0.0, 3.0)), float(gloss[instance])
        seed = int(random.integers(4096))
        rows[soup.instance == instance] = len(table)
        table.append(Material(name, strength, period, shine, float(random.uniform(10, 80)), seed, frame).row())
    renderer.soup = replace(
        soup, corner_colors=colors.astype(np.float32), material=rows, material_table=np.stack(table)
    )
    lamps = []
    for _ in range(int(random.integers(1, 4))):
        place = random.uniform([-size[0] / 2, -size[1] / 2, 0.6 * size[2]], [size[0] / 2, size[1] / 2, size[2] - 0.05])
        color = random.uniform(0.2, 0.9) * random.uniform(0.75, 1.0, 3)
        (x, y, z), (red, green, blue) = map(float, place), map(float, color)
        lamps.append(AreaLight((x, y, z), (0.1, 0, 0), (0, -0.1, 0), (red, green, blue)))
    renderer.lights = tuple(lamps)
    renderer.ambient = (random.uniform(0.15, 0.6) * random.uniform(0.85, 1.0, 3)).astype(np.float32)
    renderer.shadows = bool(random.random() < 0.5)
    renderer.exposure = float(np.exp(random.normal(0.0, 0.35)))
    return gloss


def random_sensor(random: np.random.Generator) -> DepthCamera:
    """Return a depth sensor between a coarse and a fine one; ranges and losses vary."""
    return DepthCamera(
        minimum_range=float(random.uniform(0.2, 0.5)),
        maximum_range=float(random.uniform(3.5, 9.0)),
        baseline=float(random.uniform(0.04, 0.09)),
        disparity_levels=float(np.exp(random.uniform(np.log(16), np.log(80)))),
        jump_share=float(random.uniform(0.4, 0.8)),
        dark_signal=float(np.exp(random.uniform(np.log(0.0003), np.log(0.003)))),
        shine_loss=float(random.uniform(0.0, 0.8)),
        block=int(random.integers(1, 5)),
    )


def sensed_depth(
    true: np.ndarray, view: Rendering, gloss: np.ndarray, camera: Camera, random: np.random.Generator
) -> np.ndarray:
    """Return the depth (H, W) [m] that a random sensor makes of the true one: structured light in two of three views,
    its errors shrunk by a random share, as images of 640 pixels that are brought to 320 have finer noise; else time of
    flight at a low resolution; one view in twelve is exact. In a third of the views some things give no depth."""
    if random.random() < 1 / 12:
        return true
    if random.random() < 1 / 3:
        true = lose_things(true, view.instance, random)
    if random.random() < 1 / 3:
        return coarse_depth(true, random)
    noisy = disturb_depth(
        true, view.incidence, view.albedo.mean(axis=2), gloss[view.instance], camera, random, random_sensor(random)
    )
    share = np.float32(random.uniform(0.15, 1.0))
    step = np.abs(noisy - true) > 0.03 * true
    return np.where((noisy > 0) & ~step, true + share * (noisy - true), noisy)


def samples_of(
    scene: Scene, number: int, size: np.ndarray, random: np.random.Generator, origin: str
) -> Iterator[Sample]:
    """Yield up to `number` views of a scene in which at least three instances can be seen."""
    renderer = SceneRenderer(scene.meshes)
    soup = renderer.soup
    for _ in range(number):
        camera = random_camera(random)
        pose = random_pose(scene, renderer, random)
        if pose is None:
            continue
        gloss = vary_look(renderer, soup, scene, size, random)
        view = renderer.render(camera, pose)
        color = papered(view.color, view.instance, random) if random.random() < 0.6 else view.color
        present, counts = np.unique(view.instance, return_counts=True)
        kept = present[(counts >= 12) & (present > 0)]
        if len(kept) < 3 or counts[present > 0].max() > 0.9 * WIDTH * HEIGHT:
            continue
        # The same picture shows a larger world from further away.
        scale = float(random.uniform(0.85, 1.15))
        depth = sensed_depth(view.depth * np.float32(scale), view, gloss, camera, random)
        lookup = np.zeros(max(scene.classes) + 1, dtype=np.uint8)
        lookup[kept[:255]] = np.arange(1, len(kept[:255]) + 1)
        yield Sample(
            color=color,
            depth=np.round(np.minimum(depth / DEPTH_UNIT, 65535)).astype(np.uint16),
            label=lookup[view.instance],
            camera=camera,
            up=pose[2, :3],
            height=float(pose[2, 3]) * scale,
            classes=tuple(scene.classes[int(instance)] for instance in kept[:255]),
            origin=origin,
        )


def papered(color: np.ndarray, instance: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the picture (H, W, 3) with prints over some instances: collages of patches, lines and smooth blots, drawn
    on the screen, so that colour edges within a thing say nothing of where it ends."""
    present = np.unique(instance[instance > 0])
    if not len(present):
        return color
    result = color.astype(np.float32)
    for chosen in random.choice(present, min(len(present), int(random.integers(1, 6))), replace=False):
        size = int(np.exp(random.uniform(np.log(6), np.log(120))))
        coarse = random.integers(0, 256, (max(2, HEIGHT // size), max(2, WIDTH // size), 3)).astype(np.uint8)
        smooth = cv2.INTER_CUBIC if random.random() < 0.5 else cv2.INTER_NEAREST
        print_ = cv2.resize(coarse, (WIDTH, HEIGHT), interpolation=smooth)
        for _ in range(int(random.integers(0, 12))):
            x, y, w, h = random.integers(0, WIDTH, 4)
            paint = tuple(map(int, random.integers(0, 256, 3)))
            if random.random() < 0.5:
                cv2.rectangle(print_, (int(x), int(y)), (int(x + w // 4), int(y + h // 4)), paint, -1)
            else:
                cv2.line(print_, (int(x), int(y)), (int(w), int(h)), paint, int(random.integers(1, 4)))
        where, strength = instance == chosen, float(random.uniform(0.15, 0.9))
        result[where] *= 1 - strength + strength * print_[where].astype(np.float32) / 160
    return np.clip(np.round(result), 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Job:
    """One scene to be made and looked at."""

    kind: str
    """Name of a recipe, `table` or `varied`."""
    seed: int
    views: int


def views_of(job: Job, catalogue: Catalogue) -> Iterator[Sample]:
    """Yield the samples of a scene; a recipe that finds no room is named and yields none."""
    origin = f"{job.kind}/{job.seed}"
    size = np.array([4.0, 4.0, 2.5])
    if job.kind == "table":
        random = np.random.default_rng([job.seed, TABLE_STREAM])
        scene = table_scene(catalogue, random)
    elif job.kind == "varied":
        random = np.random.default_rng([job.seed, VARIED_STREAM])
        scene = varied_scene(catalogue, random)
        size = np.array([*(2 * scene.bounds[1, :2]), scene.bounds[1, 2] + 0.2])
    else:
        random = np.random.default_rng([job.seed, ROOM_STREAM, recipe_names().index(job.kind)])
        try:
            scene = room_scene(job.kind, job.seed, catalogue, random)
        except BadInput as error:
            print(f"{origin}: {error}", flush=True)
            return
        size = np.array([*(2 * scene.bounds[1, :2]), 2.5])
    yield from samples_of(scene, job.views, size, random, origin)


def interleaved(*kinds: list[Job]) -> list[Job]:
    """Return all jobs, each kind spread evenly over the whole."""
    places = [((k + 0.5) / len(kind), number, job) for number, kind in enumerate(kinds) for k, job in enumerate(kind)]
    return [job for _, _, job in sorted(places, key=lambda entry: entry[:2])]


def write_set(library: Path, jobs: list[Job], folder: Path, worker: int, workers: int, until: float) -> int:
    """Write the samples of every `workers`-th job as shards; returns how many frames there are.

    No scene is begun after `until` (`time.time()`), and what there is then is written.
    """
    catalogue = Catalogue(open_artifact(library, CadLibrary))  # type: ignore[arg-type]
    mine = (job for job in jobs[worker::workers] if time.time() < until)
    samples = (sample for job in mine for sample in views_of(job, catalogue))
    number = 0
    while shard := list(islice(samples, SHARD)):
        write_shard(shard, folder / f"shard_{worker:02d}_{number // SHARD:03d}")
        number += len(shard)
        print(f"{folder.name}, {worker}: {number} frames", flush=True)
    return number


def write_sets(library: Path, jobs: list[Job], folder: Path, workers: int, until: float) -> int:
    """Write the samples of all jobs with so many processes; returns how many frames there are."""
    shares = [(library, jobs, folder, worker, workers, until) for worker in range(workers)]
    if workers == 1:
        return write_set(*shares[0])
    with get_context("spawn").Pool(workers) as pool:
        return sum(pool.starmap(write_set, shares))


class Options(Recipe):
    """Options."""

    library: Path = Field(description="CAD library (library build --seed 41)")
    rooms: int = Field(4 * len(TRAINING_SEEDS), description="Training rooms of the recipes")
    tables: int = Field(260, description="Training tabletops")
    varied: int = Field(1400, description="Training rooms that follow no recipe")
    workers: int = Field(1, description="Processes")
    seconds: float = Field(float("inf"), description="No scene is begun after so many; fewer frames then")


def main() -> None:
    """Make the training and the validation set."""
    arguments = asked(Options)
    started = time.time()
    rooms = [Job(name, seed, VIEWS_PER_ROOM) for seed in TRAINING_SEEDS for name in RECIPES]
    tables = [Job("table", seed, VIEWS_PER_TABLE) for seed in range(arguments.tables)]
    varied = [Job("varied", seed, VIEWS_PER_VARIED) for seed in range(arguments.varied)]
    held_back = [Job(name, seed, 8) for seed in VALIDATION_SEEDS for name in RECIPES][:16]
    held_back_tables = [Job("table", 100_000 + k, 6) for k in range(8)]
    held_back_varied = [Job("varied", 100_000 + k, 6) for k in range(16)]
    rooms = rooms[: arguments.rooms]
    if arguments.quick:
        rooms, tables, varied = rooms[:8], tables[:4], varied[:6]
        held_back, held_back_tables, held_back_varied = held_back[:2], held_back_tables[:1], held_back_varied[:2]
    validation = interleaved(held_back, held_back_tables, held_back_varied)
    training = interleaved(rooms, tables, varied)
    library, out, workers, until = arguments.library, arguments.out, arguments.workers, started + arguments.seconds
    counts = {"training": write_sets(library, training, out / "training", workers, until)}
    counts["validation"] = write_sets(library, validation, out / "validation", workers, float("inf"))
    (arguments.out / "done.json").write_text(json.dumps(counts) + "\n")
    print(f"{counts} in {time.time() - started:.0f} s")


if __name__ == "__main__":
    main()
