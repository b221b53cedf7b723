"""Ground truth: the room, what was seen of it, true boxes and graph, the log's frames."""

from __future__ import annotations

import numpy as np
from scenewright.cli.viewing.sequence_view import draw_frames, draw_path
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.viewing.canvas import Canvas
from scenewright.stages.kit.viewing.graphs import HIDDEN, draw_graph
from scenewright.stages.kit.viewing.maps import instance_colors
from scenewright.stages.kit.viewing.scenes import draw_scene_folder


def draw_ground_truth(truth: GroundTruth, canvas: Canvas) -> None:
    """Draw the true room with its graph, visible points by instance, the camera's walk and its frames."""
    description = truth.info
    if (truth.path("room") / "scene.json").exists():
        draw_scene_folder(truth.path("room"), canvas, prefix="room")
    objects = description.objects
    draw_graph(truth.graph, canvas, "visible", "camera/depth")
    points, instances = _visible(truth)
    canvas.points("visible", points, instance_colors(instances), radius=0.006)
    canvas.view("what was seen", *HIDDEN, "room", "boxes")
    if not truth.path("log.mcap").exists():
        return
    with FrameReader(truth.path("log.mcap")) as reader:
        draw_path(canvas, reader.poses()[1])
        canvas.label_names("camera/labels", [(o.instance, o.name, instance_color(o.instance)) for o in objects])
        if len(reader):
            draw_frames(canvas, reader)


def _visible(truth: GroundTruth) -> tuple[np.ndarray, np.ndarray]:
    points, instances = read_arrays(truth.path("visible.npz"), "points", "instance", hint="make the ground truth again")
    return points, instances
