"""Meshes of tableware: closed, of the volume that the formula gives, and nesting without meeting."""

import numpy as np
import pytest
from scenewright.stages.tableware.world.dish_shapes import item_mesh, shell_mesh, utensil_mesh
from scenewright.stages.tableware.world.items import DISHES, STANDARD, UTENSILS, Measures, make_item, rise

from tests.unit.tableware.volumes import shell_volume, utensil_volume


@pytest.mark.parametrize("kind", DISHES)
def test_shell_is_closed_and_has_its_volume(kind):
    mesh = shell_mesh(STANDARD[kind])
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(shell_volume(STANDARD[kind], 64), rel=1e-9)
    fine = shell_mesh(STANDARD[kind], sides=2000)
    assert fine.volume == pytest.approx(shell_volume(STANDARD[kind]), rel=1e-5)


def test_shell_volume_of_a_straight_can():
    can = Measures(height=0.1, rim_radius=0.05, foot_radius=0.05, wall=0.004)
    expected = np.pi * (0.05**2 * 0.1 - 0.046**2 * 0.096)
    assert shell_volume(can) == pytest.approx(expected, rel=1e-12)


def test_a_dish_of_impossible_measures_is_refused():
    with pytest.raises(ValueError, match="no dish"):
        shell_mesh(Measures(height=0.002, rim_radius=0.05, foot_radius=0.04, wall=0.004))


@pytest.mark.parametrize("kind", UTENSILS)
@pytest.mark.parametrize("arch", [0.0, 0.01])
def test_utensil_is_closed_and_has_its_volume(kind, arch):
    mesh = utensil_mesh(STANDARD[kind], kind == "fork", arch)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(utensil_volume(STANDARD[kind], kind == "fork"), rel=1e-9)
    extents = mesh.bounds[1] - mesh.bounds[0]
    assert extents[0] == pytest.approx(STANDARD[kind].length, abs=1e-9)
    assert extents[1] == pytest.approx(STANDARD[kind].width, rel=0.01)
    assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("upper", "lower"),
    [("cup", "cup"), ("bowl", "bowl"), ("plate", "plate"), ("cup", "bowl"), ("cup", "plate"), ("bowl", "plate")],
)
def test_stacked_dishes_touch_and_do_not_meet(upper, lower):
    """Heights by `items.rise`: every ring of the upper is inside the hollow of the lower, and one touches."""
    above, below = STANDARD[upper], STANDARD[lower]
    up = rise(above, below)
    z = np.linspace(up, min(up + above.height, below.height), 400)
    room = np.array([below.inner_radius(h) - above.outer_radius(h - up) for h in z])
    assert room.min() > -1e-9
    assert min(room.min(), up - below.wall) == pytest.approx(0.0, abs=1e-9)


def test_item_mesh_stands_where_the_item_stands():
    mesh = item_mesh(make_item("spoon_1", "spoon", 0.1, -0.2, np.pi / 2, 0.05))
    assert mesh.bounds[0] == pytest.approx([0.1 - 0.009, -0.2 - 0.08, 0.05], abs=2e-4)
