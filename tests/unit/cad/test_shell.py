"""The shell of a room: closed plates that meet in the corners, with holes where cameras saw through."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import trimesh
from scenewright.schemas.cad_scene import ShellFile
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile, GraphNode
from scenewright.schemas.panoptic_map import LayoutFile, LayoutPlane, Opening
from scenewright.schemas.scene_parts import Box, SurfacePlane
from scenewright.stages.cad.free_space import NOTHING_KNOWN, NOWHERE, FreeSpace
from scenewright.stages.cad.shell import MOST_BOXES, drawn, shell_file, shell_of
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.formats.scene_bundle import BundleBody, write_scene_bundle
from scenewright.stages.kit.geometry.boxes import box_from_bounds
from scenewright.stages.kit.geometry.layout_slabs import WALL_THICKNESS
from scenewright.stages.kit.measurement.layout_pieces import plates_of

HALF, HEIGHT, HIDDEN = 2.0, 2.4, 0.7
"""Half the edge of the room, its height, and how much of a wall a wardrobe in a corner hides [m]."""


def wall(normal, start, end, openings=()):
    offset = float(np.dot(normal, start))
    return LayoutPlane(
        kind="wall", bounds=True, normal=normal, offset=offset, area=5.0, start=start, end=end,
        reasons={}, log_odds=3.0, openings=openings,
    )  # fmt: skip


def room(openings=()) -> LayoutFile:
    """Four walls; the first was not seen to its right end, nor below 0.3 m, nor above 2.2 m."""
    a = HALF
    walls = (
        wall((0, -1, 0), (-a, a, 0.3), (a - HIDDEN, a, 2.2), openings),
        wall((-1, 0, 0), (a, a, 0.0), (a, -a, HEIGHT)),
        wall((0, 1, 0), (a, -a, 0.0), (-a, -a, HEIGHT)),
        wall((1, 0, 0), (-a, -a, 0.0), (-a, a, HEIGHT)),
    )
    return LayoutFile(floor=0.0, planes=walls)


FLOOR = SurfacePlane(normal=(0, 0, 1), offset=0.0, area=16.0, center=(0, 0, 0), horizontal=True)


def nodes(*more: GraphNode) -> ContactGraphFile:
    root = GraphNode(id=SCENE_NODE, instance=0, class_name=SCENE_NODE, node_type="scene")
    floor = GraphNode(
        id="floor_1", instance=1, class_name="floor", node_type="layout", planes=(FLOOR,),
        box=Box(center=(0, 0, 0), size=(4.0, 4.0, 0.02)),
    )  # fmt: skip
    walls = GraphNode(id="wall_2", instance=2, class_name="wall", node_type="layout")
    return ContactGraphFile(nodes=(root, floor, walls, *more), links=())


def seen() -> dict[str, EntityMesh]:
    """Points of the walls every 5 cm, and of the floor: faces do not matter."""
    along, up = np.meshgrid(np.arange(-HALF, HALF, 0.05), np.arange(0.0, HEIGHT, 0.05))
    s, z, full = along.ravel(), up.ravel(), np.full(along.size, HALF)
    walls = np.concatenate([np.column_stack(c) for c in ((s, full, z), (full, s, z), (s, -full, z), (-full, s, z))])
    floor = np.column_stack([s, np.zeros(len(s)), np.zeros(len(s))])
    grey = lambda points: np.full((len(points), 3), 200, np.uint8)  # noqa: E731
    none = np.zeros((0, 3), np.int64)
    return {"wall_2": EntityMesh(walls, none, grey(walls)), "floor_1": EntityMesh(floor, none, grey(floor))}


class Through(FreeSpace):
    """Cameras saw through a part of the wall at y = HALF."""

    def __init__(self, low, high) -> None:
        super().__init__(NOWHERE, NOWHERE)
        object.__setattr__(self, "part", (np.array(low), np.array(high)))

    def is_empty(self, points, own=None):
        low, high = self.part
        return ((points > low) & (points < high)).all(axis=1)


def closed(panels, node="wall_2") -> trimesh.Trimesh:
    surface = drawn([panel for panel in panels if panel.node == node], seen()[node])
    return trimesh.Trimesh(surface.vertices, surface.faces)


def inside(shell: ShellFile, point) -> bool:
    slabs = plates_of(shell)["wall_2"]
    local = [np.linalg.inv(slab.world_from_slab) @ [*point, 1.0] for slab in slabs]
    return any((np.abs(at[:3]) <= 0.5 * slab.size + 1e-9).all() for at, slab in zip(local, slabs, strict=True))


def test_walls_meet_in_the_corners_and_go_down_to_the_floor():
    panels = shell_of(nodes(), room(), seen(), NOTHING_KNOWN)
    for node in ("wall_2", "floor_1"):
        assert closed(panels, node).is_watertight and closed(panels, node).is_winding_consistent
    shell, beyond = shell_file(panels, seen()), HALF + 0.5 * WALL_THICKNESS
    for around in np.linspace(-beyond, beyond, 83):
        for height in (0.02, 1.0, HEIGHT - 0.02):
            for point in ((around, beyond), (around, -beyond), (beyond, around), (-beyond, around)):
                assert inside(shell, (*point, height)), f"a gap at {point}, {height}"
    assert not inside(shell, (0.0, HALF - 0.01, 1.0)), "a plate goes away from the room"
    first = shell.panels[1]
    assert first.open_area == 0.0 and 0.75 < first.seen <= 1.0


@pytest.mark.parametrize("told", ["free space", "an opening", "a door"])
def test_a_doorway_is_a_hole(told):
    """0.9 m wide and 2 m high, its left edge 1 m right of the corner, seen from the room."""
    low, high = (-1.0, HALF - 0.2, -0.1), (-0.1, HALF + 0.2, 2.0)
    free, openings, more = NOTHING_KNOWN, (), ()
    if told == "free space":
        free = Through(low, high)
    elif told == "an opening":
        openings = (Opening(left=1.0, width=0.9, sill=0.0, head=2.0),)
    else:
        corners = ((-1.0, HALF, 0.05), (-0.1, HALF, 0.05), (-0.1, HALF, 2.0), (-1.0, HALF, 2.0))
        leaf = SurfacePlane(normal=(0, -1, 0), offset=HALF, area=1.8, center=(-0.55, HALF, 1.0), corners=corners)
        more = (GraphNode(id="door_3", instance=3, class_name="door", node_type="layout", planes=(leaf,)),)
    panels = shell_of(nodes(*more), room(openings), seen(), free)
    shell = shell_file(panels, seen())
    assert closed(panels).is_watertight
    behind = HALF + 0.5 * WALL_THICKNESS
    assert not any(inside(shell, (x, behind, z)) for x in (-0.95, -0.55, -0.15) for z in (0.05, 1.0, 1.9))
    assert all(inside(shell, (x, behind, 1.0)) for x in (-1.15, 0.05)) and inside(shell, (-0.5, behind, 2.15))
    assert shell.panels[1].open_area == pytest.approx(0.9 * 2.0, abs=0.35)


def test_a_ragged_wall_keeps_few_boxes_and_stays_closed():
    class Ragged(FreeSpace):
        def is_empty(self, points, own=None):
            cells = np.floor(points / 0.21).astype(int)
            return (cells * [7, 13, 5]).sum(axis=1) % 5 == 0

    panels = shell_of(nodes(), room(), seen(), Ragged(NOWHERE, NOWHERE))
    shell = shell_file(panels, seen())
    assert 1 < sum(len(panel.boxes) for panel in shell.panels if panel.node == "wall_2") <= MOST_BOXES
    assert closed(panels).is_watertight


def door_node(corners) -> GraphNode:
    first, second = np.subtract(corners[1], corners[0]), np.subtract(corners[3], corners[0])
    normal = np.cross(first, second) / np.linalg.norm(np.cross(first, second))
    leaf = SurfacePlane(
        normal=tuple(normal), offset=0.0, area=1.8, center=tuple(np.mean(corners, axis=0)), corners=corners
    )
    box = Box(center=tuple(np.mean(corners, axis=0)), size=(0.9, 0.05, 1.95))
    return GraphNode(id="door_3", instance=3, class_name="door", node_type="layout", planes=(leaf,), box=box)


def leaf_at(hinge, end) -> tuple[tuple[float, float, float], ...]:
    """An upright rectangle 2 m high from the hinge (x, y) to the other edge."""
    return ((*hinge, 0.05), (*end, 0.05), (*end, 2.0), (*hinge, 2.0))


@pytest.mark.parametrize(
    ("end", "angle", "at_left"),
    [
        ((-0.1, HALF), 0.0, True),  # shut: which side is inferred
        ((-1.0 + 0.9 * np.cos(1.0), HALF - 0.9 * np.sin(1.0)), 1.0, True),  # open into the room by 57 degrees
        ((-1.0, HALF - 0.9), np.pi / 2, True),
        ((-1.0 - 0.9 * np.cos(0.5), HALF - 0.9 * np.sin(0.5)), 0.5, False),
        ((-1.0 + 0.9 * np.cos(1.0), HALF + 0.9 * np.sin(1.0)), -1.0, True),  # open to the other side
    ],
)
def test_a_door_turns_where_it_meets_its_wall(end, angle, at_left):
    """Its hinge 1 m right of the left corner, in the wall at y = HALF."""
    panels = shell_of(nodes(door_node(leaf_at((-1.0, HALF), end))), room(), seen(), NOTHING_KNOWN)
    door = next(panel for panel in panels if panel.node == "door_3")
    assert door.hinge is not None and door.hinge.at_left is at_left
    assert door.hinge.angle == pytest.approx(angle, abs=1e-6)
    edge = door.columns[0] if at_left else door.columns[-1]
    x, y, z = (door.frame @ [edge, 0.0, 0.0, 1.0])[:3]
    assert (x, y) == pytest.approx((-1.0, HALF), abs=1e-6) and 0.0 < z < 0.03
    shell = shell_file(panels, seen() | {"door_3": seen()["wall_2"]})
    middle = -0.55 if at_left else -1.45
    assert not inside(shell, (middle, HALF + 0.05, 1.0)), "there is a hole for it"


def test_a_scene_has_the_door_as_a_leaf_that_swings_free(tmp_path):
    """In MuJoCo it goes through its whole range and touches nothing, and in the start it stands as it was seen."""
    graph = nodes(door_node(leaf_at((-1.0, HALF), (-1.0 + 0.9 * np.cos(1.0), HALF - 0.9 * np.sin(1.0)))))
    panels = shell_of(graph, room(), seen(), NOTHING_KNOWN)
    meshes = seen() | {"door_3": seen()["wall_2"]}
    shell, plates = shell_file(panels, meshes), plates_of(shell_file(panels, meshes))
    door = next(panel for panel in shell.panels if panel.node == "door_3")
    bodies = []
    for node in graph.nodes[1:]:
        surface = drawn([panel for panel in panels if panel.node == node.id], meshes[node.id])
        mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
        body = BundleBody(
            node.id, node.class_name, None, "supports", np.eye(4), False, node.box or box_from_bounds(*mesh.bounds),
            mesh=mesh, slabs=tuple(plates[node.id]), door=door if node.id == "door_3" else None,
        )  # fmt: skip
        bodies.append(body)
    written = write_scene_bundle(tmp_path, bodies, graph)
    (joint,) = written.bodies[-1].joints
    assert written.bodies[-1].joint_values == {joint.name: pytest.approx(1.0)}
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.mjcf.xml"))
    data = mujoco.MjData(model)
    for angle in np.linspace(joint.lower, joint.upper, 19):
        data.qpos[:] = angle
        mujoco.mj_forward(model, data)
        assert data.ncon == 0, f"it meets something at {angle:.2f} rad"
    data.qpos[:] = 1.0
    mujoco.mj_forward(model, data)
    low, high = np.array([-1.0, HALF]), np.array([-1.0 + 0.9 * np.cos(1.0), HALF - 0.9 * np.sin(1.0)])
    assert data.xipos[model.body("door_3__leaf").id][:2] == pytest.approx(0.5 * (low + high), abs=0.03)
    assert written.light is not None and written.light.position[2] < HEIGHT
