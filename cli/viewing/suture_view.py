"""Suturing: the rendered pair with the true needle, estimated poses, the thread, a trial over time, figures."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.cli.viewing.sequence_view import draw_sequence
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import LARGEST_SHOWN, file_content, file_text
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.suture_needle import NeedleEstimateRecord, SutureNeedle, SutureThread
from scenewright.schemas.suture_scene import StereoRigRecord, SutureScene
from scenewright.schemas.suture_trial import SutureEvaluation, SutureTrial
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.meshes import draw_solid
from scenewright.stages.suture import NEEDLE_RADIUS, REMOTE_CENTRES, RIDGE_HALF_WIDTH, RIDGE_HEIGHT, YAW_TO_TIP

STEEL, THREAD, TIP, TRUE = (0.75, 0.2, 0.18), (0.48, 0.31, 0.69), (0.9, 0.55, 0.1), (0.2, 0.7, 0.3)
"""Colours of estimated needle, thread and tip, and of the truth (sRGB, 0 to 1)."""
ARM_COLORS = ((0.18, 0.44, 0.7), (0.3, 0.6, 0.42))
"""Colours of the right and the left arm (sRGB, 0 to 1)."""
PAD = (0.12, 0.12, 0.004)
"""Size of the pad [m]."""
HALF_LENGTH = 0.05
"""Half the drawn length of the wound [m]."""
ARMS = ("right", "left")
WIRE, LINE = 0.0005, 0.0003
"""Radii of the drawn needle and thread [m]."""
ARC = np.linspace(0.0, np.pi, 40)
"""Angles on a half circle, of the needle and the ridge [rad]."""


def arc_points(pose: np.ndarray, radius: float) -> np.ndarray:
    """Return the needle's arc (40, 3) [m] from the tip to the swage, by its pose (4, 4)."""
    flat = np.stack([radius * np.cos(ARC), radius * np.sin(ARC), np.zeros_like(ARC)], axis=1)
    return apply(pose, flat)


def draw_suture_scene(scene: SutureScene, canvas: Canvas) -> None:
    """Draw the pictures over time and the true needle and thread in the world of the pad."""
    draw_sequence(scene, canvas)
    file = scene.truth
    for view in file.views:
        canvas.time(1.0 + view.frame / 10.0)
        world = np.linalg.inv(np.array(view.camera_from_world))
        arc = arc_points(world @ np.array(view.camera_from_needle), file.needle_radius)
        canvas.line("truth/needle", [arc], [TRUE], radius=WIRE)
        canvas.points("truth/tip", arc[:1], np.array([[230, 140, 40]], np.uint8), radius=2 * WIRE)
        (thread,) = read_arrays(scene.path("threads.npz"), f"thread_{view.frame:06d}")
        canvas.line("truth/thread", [apply(world, thread)], [THREAD], radius=LINE)


def draw_suture_needle(needle: SutureNeedle, canvas: Canvas) -> None:
    """Draw poses in the left camera's frame over time, with the pictures."""
    file = needle.info
    rows = [f"{file.statement}", f"masks: {file.masks_from}; estimator {file.estimator}; filter {file.filter}"]
    rows += [f"- frame {each.frame}: {each.estimate.abstained or 'known'}" for each in file.frames]
    canvas.document("needle", "\n\n".join(rows))
    _eyes(file.rig, canvas)
    for each in file.frames:
        canvas.time(each.time)
        _pose("needle", each.estimate, file.needle_radius, canvas)
        path = needle.path(f"pictures/{each.frame:06d}.png")
        if path.is_file():
            canvas.picture("eyes/needle", file_content(path, LARGEST_SHOWN))
    if file.filtered is not None:
        _pose("filtered", file.filtered, file.needle_radius, canvas)


def draw_suture_thread(thread: SutureThread, canvas: Canvas) -> None:
    """Draw the curves in the left camera's frame over time, with the pictures."""
    file = thread.info
    rows = [f"- frame {each.frame}: {each.status}" for each in file.frames]
    canvas.document("thread", "\n\n".join([file.statement, f"masks: {file.masks_from}", *rows]))
    _eyes(file.rig, canvas)
    for each in file.frames:
        canvas.time(each.time)
        if each.points:
            (points,) = read_arrays(thread.path("threads.npz"), f"points_{each.frame:06d}")
            canvas.line("thread", [points], [THREAD], radius=LINE)
        path = thread.path(f"pictures/{each.frame:06d}.png")
        if path.is_file():
            canvas.picture("eyes/thread", file_content(path, LARGEST_SHOWN))


def draw_suture_trial(trial: SutureTrial, canvas: Canvas) -> None:
    """Draw the recorded trial: both drivers and the needle as they move, the thread at the key frames."""
    canvas.document("trial", "```\n" + file_text(trial.path("trial.txt"), LARGEST_SHOWN) + "```")
    canvas.picture("strip/panels", file_content(trial.path("strip.png"), LARGEST_SHOWN))
    top = Box(center=(0.0, 0.0, -PAD[2] / 2), size=PAD)
    draw_solid("pad", top, (0.93, 0.78, 0.7), canvas)
    wound = ridge()
    canvas.mesh("wound", wound, np.tile(np.array([217, 153, 128], np.uint8), (len(wound.vertices), 1)))
    names = ("seconds", "arm", "world_from_tool", "world_from_needle")
    seconds, arms, tools, needles = read_arrays(trial.path("motions.npz"), *names)
    if not len(seconds) == len(arms) == len(tools) == len(needles):
        raise BadInput(f"{trial.path('motions.npz')}: its arrays differ in length", hint="make the trial again")
    for row in range(len(seconds)):
        canvas.time(float(seconds[row]))
        _driver(int(arms[row]), tools[row], canvas)
        _needle(needles[row], canvas)
    at, driver_poses, needle_poses, threads = read_arrays(
        trial.path("frames.npz"), "seconds", "world_from_tool", "world_from_needle", "thread"
    )
    for event, moment in enumerate(at):
        canvas.time(float(moment))
        for arm in (0, 1):
            _driver(arm, driver_poses[event, arm], canvas)
        _needle(needle_poses[event], canvas)
        canvas.line("thread", [threads[event]], [THREAD], radius=LINE)


def draw_suture_evaluation(evaluation: SutureEvaluation, canvas: Canvas) -> None:
    """Show the tables and the plots."""
    canvas.document("figures", file_text(evaluation.path("table.md"), LARGEST_SHOWN))
    for path in sorted(evaluation.path("plots").glob("*.png")):
        canvas.picture(f"plots/{path.stem}", file_content(path, LARGEST_SHOWN))


def _eyes(rig: StereoRigRecord, canvas: Canvas) -> None:
    canvas.camera("left_eye", rig.camera)
    pose = np.eye(4)
    pose[0, 3] = rig.baseline
    canvas.transform("right_eye", pose)
    canvas.camera("right_eye", rig.camera)


def _pose(path: str, estimate: NeedleEstimateRecord, radius: float, canvas: Canvas) -> None:
    """Draw a pose, orange where it was abstained from, with its tip."""
    if estimate.camera_from_needle is None:
        return
    arc = arc_points(np.array(estimate.camera_from_needle), radius)
    canvas.line(path, [arc], [TIP if estimate.abstained else STEEL], radius=WIRE, labels=[estimate.abstained or path])
    canvas.points(f"{path}_tip", arc[:1], np.array([[230, 140, 40]], np.uint8), radius=2 * WIRE)


def ridge() -> trimesh.Trimesh:
    """Return the raised wound as a mesh [m]."""
    x, z = RIDGE_HALF_WIDTH * np.cos(ARC), RIDGE_HEIGHT * np.sin(ARC)
    ends = [np.stack([x, np.full_like(x, y), z], axis=1) for y in (-HALF_LENGTH, HALF_LENGTH)]
    return trimesh.Trimesh(np.concatenate(ends)).convex_hull


def _needle(pose: np.ndarray, canvas: Canvas) -> None:
    arc = arc_points(pose, NEEDLE_RADIUS)
    canvas.line("needle", [arc], [STEEL], radius=WIRE)
    canvas.points("needle_tip", arc[:1], np.array([[230, 140, 40]], np.uint8), radius=2 * WIRE)


def _driver(arm: int, tool: np.ndarray, canvas: Canvas) -> None:
    """Draw a driver's jaw, along the tool's z, and its shaft from the wrist to the arm's remote centre."""
    tip, wrist = tool[:3, 3], tool[:3, 3] - YAW_TO_TIP * tool[:3, 2]
    canvas.line(
        f"driver_{ARMS[arm]}",
        [np.stack([tip, wrist]), np.stack([wrist, REMOTE_CENTRES[ARMS[arm]]])],
        [ARM_COLORS[arm], ARM_COLORS[arm]],
        radius=0.0015,
    )
