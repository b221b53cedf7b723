"""What stands in an open drawer, on an inner shelf behind open doors, and on top: parents and inner surfaces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.stages.graph.enclosing import surrounded_share
from scenewright.stages.kit.geometry.boxes import box_from_bounds

from tests.panoptic_maps import box_mesh, floor_mesh, placed, seen_surface

EYES = [(-0.5, -1.9, 1.5), (0.6, -1.8, 1.4), (0.0, -1.5, 1.6)]


def merged(*parts: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate(list(parts))


def open_box(low, high, wall: float = 0.015) -> trimesh.Trimesh:
    """A box without a lid: floor and four walls."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return merged(
        box_mesh((x0, y0, z0), (x1, y1, z0 + wall)),
        box_mesh((x0, y0, z0), (x0 + wall, y1, z1)),
        box_mesh((x1 - wall, y0, z0), (x1, y1, z1)),
        box_mesh((x0, y0, z0), (x1, y0 + wall, z1)),
        box_mesh((x0, y1 - wall, z0), (x1, y1, z1)),
    )


def drawer_unit() -> trimesh.Trimesh:
    """0.5 x 0.5 x 0.6 m; of two drawers the lower one stands open by 0.4 m, its floor at 0.115 m."""
    return merged(
        box_mesh((-0.25, 0.0, 0.32), (0.25, 0.5, 0.6)),
        box_mesh((-0.25, 0.48, 0.0), (0.25, 0.5, 0.32)),
        box_mesh((-0.25, 0.0, 0.0), (-0.235, 0.5, 0.32)),
        box_mesh((0.235, 0.0, 0.0), (0.25, 0.5, 0.32)),
        open_box((-0.23, -0.4, 0.1), (0.23, 0.05, 0.3)),
    )


def open_cabinet() -> trimesh.Trimesh:
    """0.8 x 0.45 x 0.9 m, an inner board at 0.47 m, one door open by a right angle."""
    return merged(
        box_mesh((-0.4, 0.43, 0), (0.4, 0.45, 0.9)),
        box_mesh((-0.4, 0.0, 0), (-0.38, 0.45, 0.9)),
        box_mesh((0.38, 0.0, 0), (0.4, 0.45, 0.9)),
        box_mesh((-0.4, 0.0, 0.0), (0.4, 0.45, 0.05)),
        box_mesh((-0.4, 0.02, 0.45), (0.4, 0.45, 0.47)),
        box_mesh((-0.4, 0.0, 0.88), (0.4, 0.45, 0.9)),
        box_mesh((-0.42, -0.4, 0.02), (-0.4, 0.0, 0.88)),
    )


@pytest.fixture(scope="module")
def meshes() -> dict[int, trimesh.Trimesh]:
    cup = trimesh.creation.cylinder(radius=0.04, height=0.1)
    return seen_surface(
        {
            1: floor_mesh((-1.5, -2.0), (2.0, 1.0)),
            2: placed(drawer_unit(), (-0.7, 0.0, 0.0)),
            3: placed(cup, (-0.75, -0.2, 0.165)),
            4: placed(box_mesh((0, 0, 0), (0.12, 0.08, 0.06)), (-0.65, -0.3, 0.115)),
            5: placed(open_cabinet(), (0.7, 0.0, 0.0)),
            6: placed(cup, (0.6, 0.12, 0.52)),
            7: placed(cup, (0.9, 0.15, 0.1)),
            8: placed(cup, (0.7, 0.2, 0.95)),
            9: placed(cup, (-0.7, 0.2, 0.65)),
        },
        EYES,
        noise=0.001,
    )


CLASSES = {1: "floor", 2: "drawer_unit", 3: "cup", 4: "box", 5: "cabinet", 6: "cup", 7: "cup", 8: "cup", 9: "cup"}
EXPECTED = {
    "cup_3": ("drawer_unit_2", "contains", 0.115),
    "box_4": ("drawer_unit_2", "contains", 0.115),
    "cup_6": ("cabinet_5", "contains", 0.47),
    "cup_7": ("cabinet_5", "contains", 0.05),
    "cup_8": ("cabinet_5", "supports", 0.9),
    "cup_9": ("drawer_unit_2", "supports", 0.6),
}


@pytest.mark.parametrize("named", [True, False])
def test_parents_and_inner_surfaces(meshes, build_graph, named: bool):
    classes = CLASSES if named else CLASSES | {2: "object", 5: "object"}
    graph: ContactGraphFile = build_graph(meshes, classes)
    for name, (parent, relation, height) in EXPECTED.items():
        parent = parent if named else f"object_{parent.rsplit('_', 1)[1]}"
        link = graph.parent_link(name)
        assert (link.source, link.relation) == (parent, relation), name
        plane = graph.node(parent).planes[link.plane]
        assert plane.horizontal and plane.center[2] == pytest.approx(height, abs=0.015), name
        assert link.contact is not None and link.contact[2] == pytest.approx(height, abs=0.015)
        if relation == "contains":
            assert link.inside is not None and link.inside > 0.9, name
        else:
            assert link.inside is None
        assert np.hypot(*np.subtract(link.contact[:2], graph.node(name).box.center[:2])) < 0.05, name


def upright(*angles: float, height: float = 0.5) -> np.ndarray:
    """Points of a sheet around the origin over each pair of angles [degrees], 0.3 m away."""
    around = np.radians(np.concatenate([np.arange(a, b, 2.0) for a, b in zip(angles[::2], angles[1::2], strict=True)]))
    heights = np.arange(0.0, height, 0.02)
    ring = 0.3 * np.stack([np.cos(around), np.sin(around)], axis=1)
    return np.column_stack([np.repeat(ring, len(heights), axis=0), np.tile(heights, len(ring))])


@pytest.mark.parametrize(
    ("points", "share"),
    [
        (upright(1, 90), 4 / 16),
        (upright(1, 270), 12 / 16),
        (upright(1, 360), 1.0),
        (upright(1, 360, height=0.02), 0.0),
        (4 * upright(1, 360), 0.0),
        (np.zeros((0, 3)), 0.0),
    ],
)
def test_a_share_of_directions_has_a_side(points: np.ndarray, share: float) -> None:
    assert surrounded_share(points, box_from_bounds((-0.05, -0.05, 0.0), (0.05, 0.05, 0.2))) == pytest.approx(share)
