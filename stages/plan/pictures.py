"""Pictures of the execution: coloured meshes of the room and of the robot, posed as a snapshot says, ray cast."""

from __future__ import annotations

import numpy as np
import trimesh
from scenewright.schemas.interactive_scene import SceneBody
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import apply, look_at
from scenewright.stages.kit.motion.recording import Snapshot, moving_links
from scenewright.stages.kit.rendering.light_map import AreaLight
from scenewright.stages.kit.rendering.ray_casting import SceneRenderer
from scenewright.stages.kit.rendering.surfaces import TriangleSoup, build_soup, joined_soups, moved_soup
from scenewright.stages.kit.simulation.robot_description import PEDESTAL_LINK, RobotDescription, mobile_robot_urdf
from scenewright.stages.kit.simulation.shapes import has_colors, link_shapes, paint
from scenewright.stages.kit.simulation.world import PhysicsWorld

HAND, FINGER, PEDESTAL, ARM = (70, 72, 78), (40, 42, 46), (58, 66, 84), (236, 238, 240)
"""Colours of the robot."""
PALETTE = ((166, 143, 120), (139, 158, 171), (171, 139, 139), (146, 164, 136), (181, 166, 127), (150, 141, 168))
"""Colours (sRGB) of furniture that has none of its own, in turn; by eye."""


def _painted_mesh(mesh: trimesh.Trimesh, color: tuple[int, int, int]) -> trimesh.Trimesh:
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    paint(plain, np.array([*color, 255], dtype=np.uint8))
    return plain


class RoomPictures:
    """Renders snapshots of one room. Meshes are prepared once; each picture poses the moving ones anew."""

    def __init__(
        self, world: PhysicsWorld, records: dict[str, SceneBody], texts: dict[str, str], robot: RobotDescription
    ) -> None:
        self._still: list[TriangleSoup] = []
        self._shell: list[TriangleSoup] = []
        """Walls: in pictures from inside, not in those from above. Ceilings are in none: light comes from there."""
        self._moving: dict[str, TriangleSoup] = {}
        low, high = [], []
        for number, (name, record) in enumerate(records.items(), start=1):
            shapes = link_shapes(texts[name], "visual")
            joint_links = {joint.part for joint in record.joints}
            for link, meshes in shapes.items():
                colored = [
                    mesh if has_colors(mesh) else _painted_mesh(mesh, PALETTE[number % len(PALETTE)]) for mesh in meshes
                ]
                if not any(len(mesh.faces) for mesh in colored):
                    continue
                soup = build_soup([(number, mesh) for mesh in colored])
                if record.movable or link in joint_links:
                    self._moving[link] = soup
                    continue
                placed = moved_soup(soup, world.link_pose(name, link))
                if record.class_name == "wall":
                    self._shell.append(placed)
                elif record.class_name != "ceiling":
                    self._still.append(placed)
                    low.append(placed.corners.min(axis=(0, 1)))
                    high.append(placed.corners.max(axis=(0, 1)))
        self.low, self.high = np.min(low, axis=0), np.max(high, axis=0)
        self.robot = robot
        colors = {robot.hand_link: HAND, PEDESTAL_LINK: PEDESTAL} | dict.fromkeys(robot.finger_links, FINGER)
        for link, meshes in link_shapes(mobile_robot_urdf(robot)).items():
            if meshes:
                color = colors.get(link, ARM)
                self._moving[f"robot/{link}"] = build_soup([(10_000, _painted_mesh(mesh, color)) for mesh in meshes])

    def _renderer(self, snapshot: Snapshot, shell: bool) -> SceneRenderer:
        moving = [
            moved_soup(soup, snapshot.links[link]) for link, soup in self._moving.items() if link in snapshot.links
        ]
        if not shell:
            return SceneRenderer(joined_soups([*self._still, *moving]), antialias=False)
        x, y = (self.low + self.high)[:2] / 2
        lights = (
            AreaLight((x + 0.8, y - 0.6, 9.0), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0), (0.62, 0.60, 0.57)),
            AreaLight((x - 0.9, y + 0.9, 8.0), (0.5, 0.0, 0.0), (0.0, -0.5, 0.0), (0.18, 0.19, 0.21)),
        )
        return SceneRenderer(
            joined_soups([*self._still, *self._shell, *moving]), lights=lights, ambient=(0.46, 0.47, 0.49)
        )

    def sight(self, world: PhysicsWorld) -> SceneRenderer:
        """Return what cameras in the room see now, the robot aside."""
        links = moving_links(world)
        moving = [moved_soup(soup, links[link]) for link, soup in self._moving.items() if link in links]
        return SceneRenderer(joined_soups([*self._still, *self._shell, *moving]), shadows=False, antialias=False)

    def overview(self, snapshot: Snapshot, camera: Camera) -> np.ndarray:
        """Return (H, W, 3) uint8: the whole room from above and aside, without walls and ceiling."""
        return self._renderer(snapshot, False).render(camera, self.overview_pose(camera)).color

    def overview_pose(self, camera: Camera) -> np.ndarray:
        """Return world_from_camera (4, 4) of the overview."""
        middle = (self.low + self.high) / 2
        size = self.high - self.low
        distance = 0.62 * float(np.hypot(size[0], size[1])) * camera.fx / camera.width * 1.9
        direction = np.array([-0.45, -0.62, 0.75]) if size[0] >= size[1] else np.array([0.62, -0.45, 0.75])
        eye = middle + distance * direction / np.linalg.norm(direction)
        return look_at(eye, np.array([middle[0], middle[1], 0.4]))

    def near(self, snapshot: Snapshot, camera: Camera) -> np.ndarray:
        """Return (H, W, 3) uint8: the robot at work, from where most of it and of its fingers can be seen."""
        renderer = self._renderer(snapshot, True)
        robot = np.array([snapshot.links[name][:3, 3] for name in sorted(self._arm_links(snapshot))])
        hand = snapshot.links[f"robot/{self.robot.hand_link}"]
        points = np.concatenate([robot, apply(hand, np.array([[0, 0, 0.08], [0, 0, 0.11], [0, 0, 0.13]]))])
        weights = np.concatenate([np.full(len(robot), 0.5 / len(robot)), np.full(3, 0.5 / 3)])
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        best: tuple[float, np.ndarray] | None = None
        for height in (1.7, 2.15):
            for angle in np.linspace(0, 2 * np.pi, 16, endpoint=False):
                for distance in (1.6, 2.0, 2.5):
                    eye = np.array([*(middle[:2] + distance * np.array([np.cos(angle), np.sin(angle)])), height])
                    if np.any(eye[:2] < self.low[:2] + 0.15) or np.any(eye[:2] > self.high[:2] - 0.15):
                        continue
                    hidden = renderer.occluded(
                        points + 0.08 * (eye - points) / distance, np.tile(eye, (len(points), 1))
                    )
                    close = float(renderer.distance(eye[None])[0])
                    score = float(weights @ ~hidden) + min(close, 0.3) - 0.05 * abs(distance - 2.0)
                    if best is None or score > best[0] + 1e-6:
                        best = (score, eye)
        eye = best[1] if best is not None else middle + np.array([0.0, 0.0, 2.5])
        up_target = np.array([middle[0], middle[1], 0.85 * middle[2] + 0.05])
        return renderer.render(camera, look_at(eye, up_target)).color

    def _arm_links(self, snapshot: Snapshot) -> list[str]:
        """Return the names in a snapshot of the robot's links from the foot of its arm to its hand."""
        others = {"anchor", "slide_x", "slide_y", PEDESTAL_LINK, self.robot.tool_link, *self.robot.finger_links}
        links = [name for name in snapshot.links if name.startswith("robot/")]
        return [name for name in links if name.removeprefix("robot/") not in others]


def picture_camera(width: int, field_of_view: float = 1.15) -> Camera:
    """Return a camera of 3:2 pictures with a horizontal field of view [rad]."""
    height = round(width * 2 / 3)
    focal = width / 2 / np.tan(field_of_view / 2)
    return Camera(width=width, height=height, fx=focal, fy=focal, cx=(width - 1) / 2, cy=(height - 1) / 2)
