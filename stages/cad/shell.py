"""Ours: the room's shell: plates behind the planes that bound the room, closed up to each other, with their openings.

A plate begins at the face towards the room and goes away from it. It goes on where nobody looked, to the walls beside
it, the floor and the ceiling, and has a hole wherever cameras saw through it: nothing that was seen empty is filled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.cad_scene import ShellFile, ShellHinge, ShellPanel
from scenewright.schemas.contact_graph import ContactGraphFile, GraphNode
from scenewright.schemas.panoptic_map import LayoutFile, LayoutPlane
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.cad.panels import closed_plate, rectangles_of, without_corner_contacts
from scenewright.stages.cad.panes import GAP, IN_WALL, PANE_THICKNESS, Hinge, Pane, pane_of
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.layout_slabs import (
    FLOOR_THICKNESS,
    WALL_THICKNESS,
    box_under,
    level_of_layout,
    level_slab,
)
from scenewright.stages.kit.geometry.transforms import apply, inverse, transform_from
from scipy.spatial import cKDTree

CELL = 0.05
"""Edge of the squares in which a plate is asked whether cameras saw through it [m]: about that of their free space."""
MOST_BOXES = 32
"""Collision pieces of a body, as `urdf` allows."""
FINEST_DRAWN = 0.08
"""Longest edge of a drawn square [m]: as fine as colours are told."""
GOES_ON = 1.0
"""A wall goes on by at most so much where nobody looked, to what closes it [m]: furniture in a corner hides less."""
PAST = 0.87 * WALL_THICKNESS
"""A wall ends so far within the one that it meets [m]: past its face, and not at its back, where edges would coincide
and be of four faces."""
DEPTHS = (0.3, 0.6, 0.9)
"""Where a plate is asked whether it was seen empty, as shares of its thickness."""
OWN = 0.1
"""A wall's surface lies within this of its plane, and a drawn corner was seen so near to what was seen [m]."""
CROSSING = 0.5
"""Two walls meet where the cosine of their angle is below this; by eye."""
INFERRED_COLOR, INFERRED_SHARE = np.array([140.0, 89.0, 217.0]), 0.35
"""Colour of what nobody saw (sRGB), and how much of it is mixed into that of its plate; by eye."""
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Panel:
    """A plate: where it is, and which of its squares are full."""

    node: str
    frame: np.ndarray
    """world_from_panel (4, 4): x along the face, y across it, z into the room; the face is at z = 0."""
    columns: np.ndarray
    rows: np.ndarray
    """Edges of the squares in x and y [m], ascending."""
    solid: np.ndarray
    """(columns - 1, rows - 1) bool."""
    thickness: float
    hinge: Hinge | None = None

    @property
    def edge(self) -> float:
        """Of its squares [m]."""
        return float(self.columns[1] - self.columns[0])

    def area(self, box: tuple[int, int, int, int]) -> float:
        """Return the area [m²] of a rectangle of squares: first column, first row, end column, end row."""
        left, low, right, top = box
        return float((self.columns[right] - self.columns[left]) * (self.rows[top] - self.rows[low]))

    def middles(self) -> np.ndarray:
        """Return the middles (N, M, 2) of the squares, in the frame [m]."""
        x, y = (0.5 * (edges[1:] + edges[:-1]) for edges in (self.columns, self.rows))
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)

    def at(self, depth: float) -> np.ndarray:
        """Return the middles of the squares (N * M, 3) in the world, `depth` [m] behind the face."""
        flat = self.middles().reshape(-1, 2)
        return apply(self.frame, np.column_stack([flat, np.full(len(flat), -depth)]))


def shell_of(
    graph: ContactGraphFile, layout: LayoutFile, meshes: Mapping[str, EntityMesh], free_space: FreeSpace
) -> list[Panel]:
    """Return the plates of floor, walls and ceiling; none for layout nodes that the map's layout does not know.

    `meshes`: layout node -> what was seen of it, world frame.
    """
    panels = [_level(node, graph) for node in graph.nodes if node.class_name in ("floor", "ceiling") and node.box]
    walls = [node for node in graph.nodes if node.class_name == "wall" and node.id in meshes]
    planes = [plane for plane in layout.planes if plane.bounds and plane.kind == "wall"]
    if not walls or not planes:
        return panels
    faces = [_face(plane, layout) for plane in planes]
    tops = _tops(faces, layout)
    owners = [_owner(face, walls, meshes) for face in faces]
    seen = np.concatenate([meshes[node.id].vertices for node in walls])
    panes = _panes(graph, faces, seen)
    plates: dict[str, list[Panel]] = {}
    for number, (plane, face, owner) in enumerate(zip(planes, faces, owners, strict=True)):
        others = [other for k, other in enumerate(faces) if k != number]
        whole = _cut(_closed(face, others, tops[number]), owner)
        plates.setdefault(owner, []).append(_coarser(_pierced(whole, plane, panes, seen, free_space)))
    of_walls = [panel for own in plates.values() for panel in _with_few_boxes(own) if panel.solid.any()]
    return [*panels, *of_walls, *(_plate(pane) for pane in panes)]


def _panes(graph: ContactGraphFile, faces: Sequence[Face], seen: np.ndarray) -> list[Pane]:
    """Return the doors and windows of a room with these walls; `seen` (N, 3): points of the walls."""
    nodes = [node for node in graph.nodes if node.class_name in ("door", "window")]
    frames, floor = [face.frame for face in faces], float(faces[0].frame[2, 3])
    found = (pane_of(node, frames, seen.mean(axis=0), floor) for node in nodes)
    return [pane for pane in found if pane is not None]


def _plate(pane: Pane) -> Panel:
    """Return a door or window as a full plate."""
    columns, rows = (np.linspace(0.0, size, max(2, round(size / (2 * CELL)) + 1)) for size in (pane.width, pane.height))
    solid = np.ones((len(columns) - 1, len(rows) - 1), bool)
    return Panel(pane.node, pane.frame, columns, rows, solid, PANE_THICKNESS, pane.hinge)


def _with_few_boxes(panels: Sequence[Panel]) -> list[Panel]:
    """Return the plates of a node with at most MOST_BOXES boxes: scraps between ragged holes go, the smallest first."""
    result = list(panels)
    while True:
        boxes = [(panel.area(box), k, box) for k, panel in enumerate(result) for box in rectangles_of(panel.solid)]
        if len(boxes) <= MOST_BOXES:
            return result
        for _, k, (left, low, right, top) in sorted(boxes)[: len(boxes) - MOST_BOXES]:
            result[k].solid[left:right, low:top] = False
        result = [replace(panel, solid=without_corner_contacts(panel.solid)) for panel in result]


def _coarser(panel: Panel) -> Panel:
    """Return a plate of squares twice as long, full where all that they are made of are."""
    columns, rows = (np.arange(0, size, 2) for size in panel.solid.shape)
    solid = np.logical_and.reduceat(np.logical_and.reduceat(panel.solid, columns, axis=0), rows, axis=1)
    across, up = np.append(panel.columns[columns], panel.columns[-1]), np.append(panel.rows[rows], panel.rows[-1])
    return Panel(panel.node, panel.frame, across, up, without_corner_contacts(solid), panel.thickness)


def shell_file(panels: Sequence[Panel], meshes: Mapping[str, EntityMesh]) -> ShellFile:
    """Return shell.json of the plates."""
    return ShellFile(panels=tuple(_record(panel, meshes[panel.node]) for panel in panels if panel.node in meshes))


def drawn(panels: Sequence[Panel], mesh: EntityMesh) -> EntityMesh:
    """Return the closed surface of the plates of a node, in the colours that were seen of it (`mesh`)."""
    parts, first = [], 0
    for panel in panels:
        finer = math.ceil(panel.edge / FINEST_DRAWN)
        solid = np.repeat(np.repeat(panel.solid, finer, axis=0), finer, axis=1)
        edges = (_finer(panel.columns, finer), _finer(panel.rows, finer))
        vertices, faces = closed_plate(solid, *edges, panel.thickness)
        colors = _colors(apply(panel.frame, vertices * [1.0, 1.0, 0.0]), mesh)  # the back has those of the face
        parts.append((apply(panel.frame, vertices), faces + first, colors))
        first += len(vertices)
    vertices, faces, colors = (np.concatenate(column) for column in zip(*parts, strict=True))
    return EntityMesh(vertices, faces, colors)


@dataclass(frozen=True)
class Face:
    """The face of a wall: a frame, and how far it goes in it [m]."""

    frame: np.ndarray
    left: float
    right: float
    low: float
    top: float


def _face(plane: LayoutPlane, layout: LayoutFile) -> Face:
    """Return the upright face of a wall as far as it was seen; y is the height over the floor."""
    normal = np.array([*plane.normal[:2], 0.0])
    normal /= np.linalg.norm(normal)
    start, end = np.array(plane.start), np.array(plane.end)
    floor = layout.floor if layout.floor is not None else min(start[2], end[2])
    along = np.cross(UP, normal)
    origin = 0.5 * (start + end)
    origin[2] = floor
    left, right = sorted((along @ (start - origin), along @ (end - origin)))
    low, top = sorted((start[2] - floor, end[2] - floor))
    return Face(transform_from(np.column_stack([along, UP, normal]), origin), left, right, low, top)


def _tops(faces: Sequence[Face], layout: LayoutFile) -> list[float]:
    """Return how high over the floor each wall goes [m]: to the ceiling, or as high as the highest, if that is near."""
    floor = float(faces[0].frame[2, 3])
    ceilings = [-plane.offset - floor for plane in layout.planes if plane.bounds and plane.kind == "ceiling"]
    highest = max(face.top for face in faces)
    tops = []
    for face in faces:
        above = [height for height in (*ceilings, highest) if face.top <= height <= face.top + GOES_ON]
        tops.append(min(above, default=face.top))
    return tops


def _closed(face: Face, others: Sequence[Face], top: float) -> Face:
    """Return a face that goes on to the floor, into the walls that it meets, and up."""
    left, right = face.left, face.right
    for other in others:
        normal = other.frame[:3, 2]
        if abs(normal @ face.frame[:3, 2]) > CROSSING:
            continue
        # where the two planes cross, along this face
        at = normal @ (other.frame[:3, 3] - face.frame[:3, 3]) / (normal @ face.frame[:3, 0])
        along_other = other.frame[:3, 0] @ (face.frame[:3, 3] + at * face.frame[:3, 0] - other.frame[:3, 3])
        if not other.left - GOES_ON <= along_other <= other.right + GOES_ON:
            continue
        if face.left - GOES_ON <= at <= face.left + OWN:
            left = min(left, at - PAST)
        elif face.right - OWN <= at <= face.right + GOES_ON:
            right = max(right, at + PAST)
    return replace(face, left=left, right=right, low=0.0 if face.low <= GOES_ON else face.low, top=top)


def _cut(face: Face, node: str) -> Panel:
    """Return a face as a full plate of squares of about CELL."""
    columns = np.linspace(face.left, face.right, max(2, round((face.right - face.left) / CELL) + 1))
    rows = np.linspace(face.low, face.top, max(2, round((face.top - face.low) / CELL) + 1))
    solid = np.ones((len(columns) - 1, len(rows) - 1), bool)
    return Panel(node, face.frame, columns, rows, solid, WALL_THICKNESS)


def _pierced(panel: Panel, plane: LayoutPlane, panes: Sequence[Pane], seen: np.ndarray, free_space: FreeSpace) -> Panel:
    """Return a plate without the squares that cameras saw through, that an opening of the layout takes up, or in which
    a door or window stands."""
    solid, middles = panel.solid.copy(), panel.middles()
    shape = solid.shape
    local = apply(inverse(panel.frame), seen)
    own = cKDTree(seen[np.abs(local[:, 2]) < OWN])
    for share in DEPTHS:
        solid &= ~free_space.is_empty(panel.at(share * panel.thickness), own).reshape(shape)
    start, end = (apply(inverse(panel.frame), np.array([corner]))[0] for corner in (plane.start, plane.end))
    way = 1.0 if end[0] >= start[0] else -1.0
    for opening in plane.openings:
        first, last = sorted((start[0] + way * opening.left, start[0] + way * (opening.left + opening.width)))
        solid &= ~_within(middles, (first, opening.sill, last, opening.head))
    for pane in panes:
        corners = apply(inverse(panel.frame), pane.corners)
        if np.abs(corners[:, 2]).max() < IN_WALL:
            # no square that it reaches into is full: it would rub
            room = 0.5 * panel.edge + GAP
            (left, low), (right, top) = corners[:, :2].min(axis=0) - room, corners[:, :2].max(axis=0) + room
            solid &= ~_within(middles, (left, low, right, top))
    return replace(panel, solid=solid)


def _within(points: np.ndarray, rectangle: tuple[float, float, float, float]) -> np.ndarray:
    left, low, right, top = rectangle
    x, y = points[..., 0], points[..., 1]
    return (left < x) & (x < right) & (low < y) & (y < top)


def _owner(face: Face, walls: Sequence[GraphNode], meshes: Mapping[str, EntityMesh]) -> str:
    """Return the wall node that has most of its surface about a face."""

    def count(node: GraphNode) -> int:
        local = apply(inverse(face.frame), meshes[node.id].vertices)
        along = (face.left < local[:, 0]) & (local[:, 0] < face.right)
        return int(np.count_nonzero(along & (np.abs(local[:, 2]) < OWN)))

    return max(walls, key=count).id


def _level(node: GraphNode, graph: ContactGraphFile) -> Panel:
    """Return the plate of a floor or ceiling, as large as its slab in physics."""
    assert node.box is not None
    is_floor = node.class_name == "floor"
    height = level_of_layout(node.id, node.class_name, node.planes, node.box, None, graph)
    slab = level_slab(box_under(node.id, node.box, graph), height, downwards=is_floor)
    frame = slab.world_from_slab.copy()
    frame[2, 3] = height
    if not is_floor:  # its face looks down
        frame[:3, 1:3] *= -1.0
    sizes = (float(slab.size[0]), float(slab.size[1]))
    columns, rows = (np.linspace(-0.5 * size, 0.5 * size, max(2, round(size / (2 * CELL)) + 1)) for size in sizes)
    solid = np.ones((len(columns) - 1, len(rows) - 1), bool)
    return Panel(node.id, frame, columns, rows, solid, FLOOR_THICKNESS)


def _record(panel: Panel, mesh: EntityMesh) -> ShellPanel:
    boxes = [
        (panel.columns[left], panel.rows[low], panel.columns[right], panel.rows[top])
        for left, low, right, top in rectangles_of(panel.solid)
    ]
    areas = np.diff(panel.columns)[:, None] * np.diff(panel.rows)
    distance, _ = cKDTree(mesh.vertices).query(panel.at(0.0), distance_upper_bound=OWN)
    seen = np.isfinite(distance).reshape(panel.solid.shape)
    full = float(areas[panel.solid].sum())
    return ShellPanel(
        node=panel.node,
        world_from_panel=as_transform(panel.frame),
        thickness=panel.thickness,
        boxes=tuple(tuple(round(float(value), 4) for value in box) for box in boxes),  # type: ignore[misc]
        open_area=round(float(areas[~panel.solid].sum()), 3),
        seen=round(float(areas[panel.solid & seen].sum()) / full, 3) if full > 0 else 0.0,
        hinge=None if panel.hinge is None else ShellHinge(**asdict(panel.hinge)),
    )


def _finer(edges: np.ndarray, finer: int) -> np.ndarray:
    steps = np.arange(finer * (len(edges) - 1) + 1) / finer
    return np.interp(steps, np.arange(len(edges)), edges)


def _colors(vertices: np.ndarray, mesh: EntityMesh) -> np.ndarray:
    """Return the colours (V, 3) uint8 of what was seen nearest, and, where nothing was, of all of it towards violet."""
    distance, nearest = cKDTree(mesh.vertices).query(vertices, distance_upper_bound=OWN)
    unseen = (1 - INFERRED_SHARE) * np.median(mesh.colors, axis=0) + INFERRED_SHARE * INFERRED_COLOR
    colors = np.tile(np.rint(unseen).astype(np.uint8), (len(vertices), 1))
    near = np.isfinite(distance)
    colors[near] = mesh.colors[nearest[near]]
    return colors
