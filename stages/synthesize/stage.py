"""Make a room, walk a camera through it, and write the log with everything that is true of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.ground_truth import GroundTruth, GroundTruthFile
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import LabelEntry
from scenewright.stages.kit.formats.frame_streams import CAMERA_FRAME
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.scene_bundle import write_scene_bundle
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.rendering.depth_noise import DepthCamera, disturb_depth
from scenewright.stages.kit.rendering.light_map import SoftLight
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.stage import Context
from scenewright.stages.synthesize.appearance import AMBIENT, SKY, gloss_table, lamps, layout_materials, object_material
from scenewright.stages.synthesize.arrangement import Arrangement, arrange, world_meshes
from scenewright.stages.synthesize.drive import plan_drive
from scenewright.stages.synthesize.free_space import find_free_space
from scenewright.stages.synthesize.furniture import Catalogue
from scenewright.stages.synthesize.opening import TwoStates, open_some
from scenewright.stages.synthesize.parameters import SynthesizeParameters
from scenewright.stages.synthesize.recipes import Recipe, load_recipe, rescaled
from scenewright.stages.synthesize.seen_surface import SeenSurface
from scenewright.stages.synthesize.truth import object_boxes, scene_bodies, true_graph, true_mesh, true_objects
from scenewright.stages.synthesize.viewpoints import blocked_floor, choose_views
from scenewright.stages.synthesize.walk import Walk, frame_times, plan_walk
from scipy.spatial.transform import Rotation

CAMERAS = {CAMERA_FRAME: 0.0, "camera_left": 60.0, "camera_right": -60.0}
"""Cameras by name: how far each is turned to the left of the one ahead, about the vertical [deg]."""
VIEW_STREAM, TREMOR_STREAM, NOISE_STREAM, PICTURE_STREAM, OPENED_STREAM = 1, 2, 3, 4, 5
"""Numbers of the streams of random draws; what draws from one leaves the others as they are."""


@dataclass(frozen=True)
class Recording:
    """What the camera did and saw."""

    times: np.ndarray
    world_from_camera: np.ndarray
    visible_pixels: np.ndarray
    depth_share: float


def run(library: CadLibrary, *, parameters: SynthesizeParameters, context: Context) -> GroundTruth:
    """Furnish a room by the recipe, record it from a walk, and write the log and its ground truth.

    Raises UsageError for an unknown recipe, BadInput when the library lacks a class or no room can be found.
    """
    recipe = rescaled(load_recipe(parameters.recipe), parameters.rescaled)
    camera = make_camera(parameters)
    with context.progress.step("furnish"):
        catalogue = Catalogue(library)
        arranged = arrange(
            recipe, catalogue, parameters.clutter, context.seed, blocked_floor, rearranged=parameters.rearranged
        )
        states = TwoStates(arranged, arranged, arranged)
        if parameters.opened:
            states = open_some(arranged, catalogue, parameters.opened, context.random(OPENED_STREAM))
        arrangement = states.after
    with context.progress.step("light"):
        texel = float(np.clip(32.0 / parameters.width, 0.05, 0.2))
        halves = (states.before, states.after) if parameters.opened else (arrangement,)
        renderers = [make_renderer(half, recipe, texel=texel) for half in halves]
        renderer = SceneRenderer(world_meshes(states.opened)) if parameters.opened else renderers[0]
    with context.progress.step("walk"):
        space = find_free_space(renderer, arrangement.room.size)
        tremor, speed = context.random(TREMOR_STREAM), parameters.walking_speed
        if parameters.path == "tour":
            views = choose_views(renderer, states.opened, space, camera, context.random(VIEW_STREAM))
            walk = plan_walk(views, space, renderer, speed, tremor)
        else:
            walk = plan_drive(parameters.path, parameters.rounds, space, renderer, speed, tremor)
    seen_surface = SeenSurface(DepthCamera().minimum_range, DepthCamera().maximum_range)
    with context.progress.step("render"):
        recording = _record(arrangement, renderers, walk, camera, seen_surface, parameters, context)
    with context.progress.step("write truth"):
        _write_truth(states, recording, camera, seen_surface, parameters, context)
    return GroundTruth(
        context.output,
        summary={
            "recipe": parameters.recipe,
            "objects": len(arrangement.objects),
            "frames": parameters.frames,
            "seconds_walked": round(len(renderers) * walk.duration, 1),
            "depth_share": round(recording.depth_share, 3),
            "seen_points": seen_surface.count,
        },
    )


def make_camera(parameters: SynthesizeParameters) -> Camera:
    """Return the camera of the parameters: square pixels, principal point in the middle."""
    focal = 0.5 * parameters.width / float(np.tan(np.deg2rad(parameters.field_of_view) / 2))
    return Camera(
        width=parameters.width,
        height=parameters.height,
        fx=focal,
        fy=focal,
        cx=(parameters.width - 1) / 2,
        cy=(parameters.height - 1) / 2,
    )


def make_renderer(arrangement: Arrangement, recipe: Recipe, texel: float = 0.05) -> SceneRenderer:
    """Return the renderer of a furnished room with its light map; `texel` is the distance of its samples [m]."""
    materials = layout_materials(arrangement.room, recipe.shell)
    materials |= {thing.instance: object_material(thing) for thing in arrangement.objects}
    return SceneRenderer(
        world_meshes(arrangement),
        lights=lamps(arrangement.room, recipe.shell),
        ambient=AMBIENT,
        materials=materials,
        soft_light=SoftLight(SKY, texel),
    )


def _record(
    arrangement: Arrangement,
    renderers: Sequence[SceneRenderer],
    walk: Walk,
    camera: Camera,
    seen_surface: SeenSurface,
    parameters: SynthesizeParameters,
    context: Context,
) -> Recording:
    """Render and write all frames; collects what was seen. With two states of the room (`renderers`) the walk goes
    there and back, and what was seen is that of the second."""
    duration = len(renderers) * walk.duration
    times = frame_times(duration, parameters.frames, parameters.rate)
    pace = duration / times[-1]
    gloss = gloss_table(arrangement)
    noise, pictures = context.random(NOISE_STREAM), context.random(PICTURE_STREAM)
    baseline = parameters.stereo_baseline
    left_from_right = transform_from(np.eye(3), np.array([baseline, 0.0, 0.0]))
    labels = [LabelEntry(instance=k, class_name=e.class_name) for k, e in enumerate(arrangement.room.layouts, start=1)]
    labels += [LabelEntry(instance=thing.instance, class_name=thing.class_name) for thing in arrangement.objects]
    visible = np.zeros(len(gloss), dtype=np.int64)
    poses, valid = [], 0
    names = tuple(CAMERAS)[: parameters.cameras]
    with FrameWriter(
        context.output / "log.mcap",
        camera,
        cameras=dict.fromkeys(names, camera),
        labels=True,
        label_table=labels,
        baselines=dict.fromkeys(names, baseline) if baseline > 0 else None,
    ) as writer:
        for number, time in enumerate(context.progress.track(times, total=len(times), description="rendering")):
            name = names[number % len(names)]
            second_half = len(renderers) > 1 and time * pace > walk.duration
            pose = turned(walk.pose(2 * walk.duration - time * pace if second_half else time * pace), CAMERAS[name])
            renderer = renderers[-1 if second_half else 0]
            view = renderer.render(camera, pose)
            depth = view.depth
            if parameters.depth_noise:
                reflectance = view.albedo.mean(axis=2)
                depth = disturb_depth(depth, view.incidence, reflectance, gloss[view.instance], camera, noise)
            if second_half or len(renderers) == 1:
                seen_surface.add(view.depth, view.instance, pose, camera)
            visible += np.bincount(view.instance.reshape(-1), minlength=len(visible))
            valid += int(np.count_nonzero(depth))
            color, right = disturbed_picture(view.color, parameters.picture_noise, pictures), None
            if baseline > 0:
                right = renderer.render(camera, pose @ left_from_right).color
                right = disturbed_picture(right, parameters.picture_noise, pictures)
            shown_depth = depth if parameters.depth else None
            writer.write(float(time), color, shown_depth, pose, view.instance, right=right, camera_name=name)
            poses.append(pose)
    return Recording(times, np.array(poses), visible, valid / (len(times) * camera.width * camera.height))


def turned(world_from_camera: np.ndarray, degrees: float) -> np.ndarray:
    """Return a pose (4, 4) turned to the left where it stands, about the world's vertical."""
    rotation = Rotation.from_euler("z", degrees, degrees=True).as_matrix() @ world_from_camera[:3, :3]
    return transform_from(rotation, world_from_camera[:3, 3])


def disturbed_picture(color: np.ndarray, deviation: float, random: np.random.Generator) -> np.ndarray:
    """Return a picture (H, W, 3) uint8 with white noise of a standard deviation [of 255]; 0: as it is."""
    if deviation == 0:
        return color
    noisy = color + random.normal(0.0, deviation, color.shape).astype(np.float32)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _write_truth(
    states: TwoStates,
    recording: Recording,
    camera: Camera,
    seen_surface: SeenSurface,
    parameters: SynthesizeParameters,
    context: Context,
) -> None:
    """Write everything of kind ground_truth beside the log."""
    out, arrangement = context.output, states.after
    write_tum(out / "trajectory.tum", recording.times, recording.world_from_camera)
    boxes = object_boxes(arrangement)
    graph = true_graph(arrangement, boxes)
    graph.write(out / "graph.json")
    width, depth, height = (float(v) for v in arrangement.room.size)
    GroundTruthFile(
        seed=context.seed,
        recipe=parameters.recipe,
        room_size=(width, depth, height),
        camera=camera,
        frame_count=parameters.frames,
        depth_noise=parameters.depth_noise,
        objects=tuple(true_objects(arrangement, boxes, recording.visible_pixels, states.before)),
    ).write(out / "ground_truth.json")
    points, instance = seen_surface.result()
    np.savez(out / "visible.npz", points=points, instance=instance)
    true_mesh(arrangement).export(out / "mesh.ply")
    (out / "room").mkdir()
    write_scene_bundle(out / "room", scene_bodies(arrangement, boxes, graph), graph)
