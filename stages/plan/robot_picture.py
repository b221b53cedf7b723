"""A robot as its description makes it, in one picture: at home with its reach, and its gripper with its frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from scenewright.stages.kit.drawing.plots import STYLE, save
from scenewright.stages.kit.formats.link_poses import link_poses
from scenewright.stages.kit.formats.urdf_file import parse_urdf
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.simulation.robot_description import GROUND_CLEARANCE, RobotDescription
from scenewright.stages.kit.simulation.robot_shapes import robot_shapes
from scenewright.stages.plan.robot_check import OUT_STEP, UP_STEP, RobotReport

ARM, HAND, BASE, REACHED = "#8f9bab", "#4a5563", "#c9c4b8", "#cfe3d4"
X, Y, Z = "#b0413e", "#4d9a6a", "#2f6fb3"


def draw_robot_check(path: Path, robot: RobotDescription, report: RobotReport) -> None:
    """Write the picture as PNG: on the left x over z of arm base and floor [m], on the right y over z of the tool."""
    urdf = parse_urdf(robot.urdf)
    values = dict(zip(robot.arm_joints, robot.carry.tolist(), strict=True))
    poses = link_poses(urdf, values | dict.fromkeys(robot.finger_joints, robot.opening / 2))
    shapes = robot_shapes(robot)
    mount = np.eye(4)
    mount[2, 3] = robot.pedestal_height
    world = mount @ inverse(poses[robot.arm_base])
    hand = {robot.hand_link, *robot.finger_links}
    with plt.rc_context(STYLE):
        figure, (side, front) = plt.subplots(1, 2, figsize=(10.5, 5.2), width_ratios=(1.7, 1.0))
        for out, up in report.reach.places:
            corner = (out - OUT_STEP / 2, up - UP_STEP / 2)
            side.add_patch(plt.Rectangle(corner, OUT_STEP, UP_STEP, color=REACHED, linewidth=0, zorder=0))
        radius = robot.pedestal_radius
        corners = (-radius, GROUND_CLEARANCE), 2 * radius, robot.pedestal_height - GROUND_CLEARANCE
        side.add_patch(plt.Rectangle(*corners, color=BASE, zorder=1))
        for link, meshes in shapes.items():
            for mesh in meshes:
                color = HAND if link in hand else ARM
                _silhouette(side, apply(world @ poses[link], mesh.vertices)[:, [0, 2]], mesh.faces, color)
                if link in hand:
                    points = apply(inverse(poses[robot.tool_link]) @ poses[link], mesh.vertices)
                    _silhouette(front, points[:, [1, 2]], mesh.faces, color)
        _arrows(side, world @ poses[robot.tool_link], (0, 2), 0.12)
        _arrows(front, np.eye(4), (1, 2), 0.04)
        side.axhline(0.0, color="#555555", linewidth=0.8)
        side.set_title(f"{robot.name} at home; shaded: hand down")
        side.set_xlabel("ahead of the base [m]")
        side.set_ylabel("over the floor [m]")
        front.set_title(f"gripper, open {1000 * robot.opening:.0f} mm")
        front.set_xlabel("y of the tool [m]: the fingers close along it")
        front.locator_params(nbins=4, axis="x")
        front.set_ylabel("z of the tool [m]: out of the hand")
        for axes in (side, front):
            axes.set_aspect("equal")
            axes.autoscale_view()
        save(figure, path)


def _silhouette(axes: Axes, points: np.ndarray, faces: np.ndarray, color: str) -> None:
    """Fill what the triangles of a mesh, points (N, 2) and faces (F, 3), cover."""
    axes.add_collection(PolyCollection(points[faces], facecolors=color, edgecolors=color, linewidths=0.3, zorder=2))


def _arrows(axes: Axes, pose: np.ndarray, plane: tuple[int, int], length: float) -> None:
    """Draw the axes of a frame (4, 4) as they lie in a plane of two coordinates."""
    start = pose[list(plane), 3]
    for column, (name, color) in enumerate((("x", X), ("y", Y), ("z", Z))):
        way = length * pose[list(plane), column]
        if np.linalg.norm(way) < 0.2 * length:
            continue
        axes.plot(*np.array([start, start + way]).T, color=color, linewidth=2.4, solid_capstyle="butt", zorder=4)
        beyond = start + 1.2 * way
        axes.text(float(beyond[0]), float(beyond[1]), name, color=color, ha="center", va="center", zorder=4)
