"""Plans: the room and the robot as they moved during execution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.message import DecodeError
from scenewright.cli.viewing.inputs import input_artifact
from scenewright.cli.viewing.robot_view import ROBOT, draw_robot, robot_of
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.plan import Plan
from scenewright.stages.kit.formats.foxglove import JPEG_START, stamp_nanoseconds, transform_matrix
from scenewright.stages.kit.formats.indexed_mcap import IndexedMcap
from scenewright.stages.kit.formats.numpy_files import read_all_arrays
from scenewright.stages.kit.viewing.canvas import SHELL, Canvas
from scenewright.stages.kit.viewing.scenes import draw_scene_folder


def draw_plan(plan: Plan, canvas: Canvas) -> None:
    """Draw the room of execution, the robot, both animated, the images that were taken, and the plan as text."""
    canvas.document("plan", plan_text(plan))
    canvas.view("world", SHELL)
    folder = _room(plan)
    if folder is not None:
        draw_scene_folder(folder, canvas, animated=True)
    path = plan.path("execution.mcap")
    if not path.exists():
        return
    with IndexedMcap(path) as log:
        draw_robot(canvas, robot_of(plan))
        _animate(log, canvas)
    for seconds, text, bad in moments(plan):
        canvas.moment(seconds, text, bad=bad)


def moments(plan: Plan) -> list[tuple[float, str, bool]]:
    """Return when each action began in execution [s], in words, and last what failed and why."""
    path, actions = plan.path("trajectory.npz"), plan.info.actions
    if not path.is_file():
        return []
    arrays = read_all_arrays(path, hint="make the plan again")
    time, action = (arrays.get(f"executed_{name}", np.zeros(0)).ravel() for name in ("time", "action"))
    if len(time) != len(action) or not len(time):
        return []
    rows: list[tuple[float, str, bool]] = []
    for number in np.unique(action[(action >= 0) & (action < len(actions))]):
        started_action = actions[int(number)]
        begins = float(time[np.flatnonzero(action == number)[0]])
        rows.append((begins, f"{int(number) + 1}. {started_action.name} {', '.join(started_action.arguments)}", False))
    end = float(time[-1])
    rows += [(end, f"{failure.kind}: {failure.message}", True) for failure in plan.info.failures]
    rows += [(end, f"not so: {c.condition} ({c.detail})", True) for c in plan.info.checks if not c.holds]
    return sorted(rows, key=lambda row: (row[0], row[2]))


def plan_text(plan: Plan) -> str:
    """Return the plan, its checks and failures in Markdown."""
    content = plan.info
    rows = [f"**{content.status}**, goal: {', '.join(content.goal) or '-'}", ""]
    rows += [f"{k}. {action.name}({', '.join(action.arguments)})" for k, action in enumerate(content.actions, 1)]
    rows += ["", *(f"- {'holds' if c.holds else 'FAILS'}: {c.condition} ({c.detail})" for c in content.checks)]
    rows += ["", *(f"- {failure.kind}: {failure.message}" for failure in content.failures)]
    return "\n".join(rows)


def _room(plan: Plan) -> Path | None:
    if plan.info.executed_in == "ground_truth":
        truth = input_artifact(plan, GroundTruth)
        return truth.path("room") if truth is not None else None
    scene = input_artifact(plan, InteractiveScene)
    return scene.root if scene is not None else None


def _topics(log: IndexedMcap, schema_name: str) -> set[int]:
    return {
        channel.id
        for channel in log.channels.values()
        if channel.schema_id in log.schemas and log.schemas[channel.schema_id].name == schema_name
    }


def _animate(log: IndexedMcap, canvas: Canvas) -> None:
    transforms, images = _topics(log, "foxglove.FrameTransforms"), _topics(log, "foxglove.CompressedImage")
    try:
        messages = [(*entry, channel) for channel in transforms | images for entry in log.indexed(channel)]
        for _, location, channel in sorted(messages, key=lambda message: (message[1].chunk, message[1].offset)):
            data = log.fetch(location)
            if channel in transforms:
                for transform in FrameTransforms.FromString(data).transforms:
                    canvas.time(stamp_nanoseconds(transform) * 1e-9)
                    pose = transform_matrix(transform.translation, transform.rotation)
                    canvas.transform(_entity(transform.child_frame_id), pose)
            else:
                image = CompressedImage.FromString(data)
                canvas.time(stamp_nanoseconds(image) * 1e-9)
                if image.data.startswith(JPEG_START):
                    canvas.picture("execution", bytes(image.data))
    except (DecodeError, ValueError) as error:
        raise BadInput(f"{log.path}: {error}", hint="make the plan again") from None


def _entity(frame: str) -> str:
    return frame if frame.startswith(ROBOT) else f"scene/{frame}"
