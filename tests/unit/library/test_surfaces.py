"""Surface planes: exposed area, covers, support regions."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.solids import box, cylinder
from scenewright.stages.library.surfaces import surface_planes


def horizontals(solids):
    return [plane for plane in surface_planes(solids) if plane.horizontal]


def test_a_box_has_six_planes_with_their_areas_and_corners():
    planes = surface_planes([box((0, 1), (0, 2), (0, 3))])
    assert sorted(round(plane.area, 6) for plane in planes) == [2, 2, 3, 3, 6, 6]
    for plane in planes:
        corners = np.asarray(plane.corners)
        assert corners.shape == (4, 3)
        assert corners @ np.asarray(plane.normal) + plane.offset == pytest.approx(np.zeros(4), abs=1e-9)
        area = np.linalg.norm(np.cross(corners[1] - corners[0], corners[3] - corners[0]))
        assert area == pytest.approx(plane.area)
        assert np.cross(corners[1] - corners[0], corners[2] - corners[1]) @ plane.normal > 0
    assert sum(plane.horizontal for plane in planes) == 1


def test_what_a_table_top_covers_of_its_legs_is_no_surface():
    legs = [box((x, x + 0.3), (y, y + 0.3), (0, 0.7)) for x in (0, 0.9) for y in (0, 0.5)]
    tops = horizontals([*legs, box((0, 1.2), (0, 0.8), (0.7, 0.74))])
    assert [round(plane.center[2], 6) for plane in tops] == [0.74]
    assert len(horizontals(legs)) == 4, "without the top the legs' ends are surfaces"


def test_underside_loses_what_stands_against_it():
    top = box((0, 1.2), (0, 0.8), (0.7, 0.74))
    leg = box((0, 0.6), (0, 0.8), (0, 0.7))
    under = [plane for plane in surface_planes([top, leg]) if plane.normal[2] < -0.9 and abs(plane.offset - 0.7) < 1e-6]
    assert [round(plane.area, 6) for plane in under] == [0.48]


def test_shelves_beside_an_upright_are_two_supports_and_coplanar_doors_one_plane():
    board = box((0, 2), (0, 0.4), (0, 0.02))
    upright = box((0.99, 1.01), (0, 0.4), (0.02, 0.8))
    supports = [plane for plane in horizontals([board, upright]) if plane.center[2] < 0.1]
    assert sorted(round(plane.area, 4) for plane in supports) == [0.396, 0.396]
    doors = [box((0, 0.499), (0, 0.02), (0, 1)), box((0.501, 1), (0, 0.02), (0, 1))]
    front = [plane for plane in surface_planes(doors) if plane.normal[1] < -0.9]
    assert [round(plane.area, 4) for plane in front] == [0.998]


def test_a_surface_without_room_above_is_no_support():
    low, hang = box((0, 1), (0, 1), (0, 0.1)), box((0, 1), (0, 1), (0.11, 0.5))
    assert [round(plane.center[2], 6) for plane in horizontals([low, hang])] == [0.5]


def test_a_round_wall_gives_no_planes():
    planes = surface_planes([cylinder(0.3, (0, 1), count=16)])
    assert sorted(round(plane.normal[2]) for plane in planes) == [-1, 1]


def test_a_rim_is_no_support():
    floor = box((0, 1), (0, 1), (0, 0.01))
    walls = [
        box((0, 0.02), (0, 1), (0.01, 0.3)),
        box((0.98, 1), (0, 1), (0.01, 0.3)),
        box((0.02, 0.98), (0, 0.02), (0.01, 0.3)),
        box((0.02, 0.98), (0.98, 1), (0.01, 0.3)),
    ]
    assert [round(plane.center[2], 6) for plane in horizontals([floor, *walls])] == [0.01]
