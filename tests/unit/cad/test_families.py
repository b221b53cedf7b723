"""Families read the dimensions of furniture off its surface, by boxes of which all is known."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import GraphNode
from scenewright.stages.cad.carcasses import Patches, patches_of
from scenewright.stages.cad.families.fitting import Fitted, explains_clearly_more, fit
from scenewright.stages.cad.families.forms import Form, Piece, Reading, box_piece
from scenewright.stages.cad.families.stand_in import class_of, inferred_of, likeliest, write_form
from scenewright.stages.kit.formats.cad_models import read_model
from scenewright.stages.kit.formats.entity_meshes import EntityMesh
from scenewright.stages.kit.geometry.transforms import transform_from_yaw
from scipy.spatial import cKDTree

from tests.panoptic_maps import floor_mesh, placed, seen_surface
from tests.unit.cad import models

EYES = [(-2.2, -2.4, 1.7), (2.2, -2.4, 1.6), (2.3, 2.2, 1.6), (-2.3, 2.2, 1.7), (0.0, -2.5, 0.4), (0.1, 2.4, 0.5)]
FINE = 0.02
"""Surface is sampled every 13 mm, and nothing is read better than that [m]."""


class Known:
    """Free space as if cameras had been everywhere: empty is what is 3 cm from all boxes, but for what is `hidden`."""

    def __init__(self, boxes, pose, hidden=()):
        self.boxes, self.pose, self.hidden = boxes, pose, hidden

    def is_empty(self, points, own=None):
        local = (points - self.pose[:3, 3]) @ self.pose[:3, :3]
        inside = [np.all((local > np.array(a) - 0.03) & (local < np.array(b) + 0.03), axis=1) for a, b in self.boxes]
        inside += [np.all((local > np.array(a)) & (local < np.array(b)), axis=1) for a, b in self.hidden]
        return ~np.any(inside, axis=0)

    def depth_within(self, points):
        return np.zeros(len(points))


def reading_of(boxes, *, yaw=0.3, unseen=(), hidden=(), noise=0.002, at=(0.2, -0.1, 0.0), eyes=EYES) -> Reading:
    """The surface of boxes (low, high) but for those of the numbers `unseen`, as cameras would see it: all around."""
    pose = transform_from_yaw(yaw, np.array(at))
    whole = [placed(trimesh.creation.box(bounds=box), at, yaw) for box in boxes]
    shown = trimesh.util.concatenate([mesh for k, mesh in enumerate(whole) if k not in unseen])
    mesh = seen_surface({1: shown}, eyes, noise=noise)[1]
    entity = EntityMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), np.zeros((len(mesh.vertices), 3), np.uint8))
    return Reading(patches_of(entity), 0.0, np.eye(3), Known(boxes, pose, hidden), cKDTree(entity.vertices))


def legs(x, y, z, width=0.05, inset=0.0):
    sides = [(a * (x / 2 - inset - width / 2), b * (y / 2 - inset - width / 2)) for a in (-1, 1) for b in (-1, 1)]
    return [((a - width / 2, b - width / 2, 0.0), (a + width / 2, b + width / 2, z)) for a, b in sides]


def table(x, y, z, inset=0.03):
    return [((-x / 2, -y / 2, z - 0.03), (x / 2, y / 2, z)), *legs(x, y, z - 0.03, 0.05, inset)]


def chair(seat=0.45):
    slats = [((-0.2, 0.17, z), (0.2, 0.2, z + 0.06)) for z in (0.62, 0.86)]
    posts = [((x, 0.17, seat), (x + 0.04, 0.2, 0.96)) for x in (-0.22, 0.18)]
    return [((-0.22, -0.2, seat - 0.03), (0.22, 0.2, seat)), *posts, *slats, *legs(0.44, 0.4, seat - 0.03, 0.04)]


def shelf(boards=(0.1, 0.5, 0.9, 1.3), x=0.9, y=0.35):
    level = [((-x / 2, -y / 2, z - 0.02), (x / 2, y / 2, z)) for z in boards]
    return [*level, *(((a, -y / 2, 0.0), (a + 0.02, y / 2, 1.3)) for a in (-x / 2, x / 2 - 0.02))]


def fitted_at_least(share, family, reading) -> Form:
    found = fit(family, reading)
    assert isinstance(found, Fitted), found
    assert found.explained > share and found.form.family == family
    return found.form


def fitted(family, reading) -> Form:
    return fitted_at_least(0.95, family, reading)


def extents(*pieces: Piece) -> np.ndarray:
    return np.ptp(np.concatenate([piece.corners for piece in pieces]), axis=0)


def off_middle(piece: Piece, form: Form) -> np.ndarray:
    (top,) = named(form, "top")
    return (piece.corners.mean(axis=0) - 0.5 * (top.corners.min(axis=0) + top.corners.max(axis=0)))[:2]


def named(form: Form, name: str) -> list[Piece]:
    return [piece for piece in form.pieces if piece.name == name]


@pytest.mark.parametrize(
    ("size", "classes"),
    [
        ((1.4, 0.8, 0.75), ("table", "desk")),
        ((1.2, 0.35, 0.45), ("bench", "table", "stool")),
        ((0.36, 0.34, 0.62), ("stool", "table")),
    ],
)
@pytest.mark.parametrize("yaw", [-0.6, 0.3])
def test_a_table_has_its_dimensions_back(size, classes, yaw):
    form = fitted("table", reading_of(table(*size), yaw=yaw))
    assert form.classes == classes
    (top,) = named(form, "top")
    assert sorted(extents(top)[:2]) == pytest.approx(sorted(size[:2]), abs=FINE)
    assert top.corners[:, 2].max() == pytest.approx(size[2], abs=0.005)
    assert extents(top)[2] == pytest.approx(0.03, abs=0.01), "by its underside"
    assert len(named(form, "leg")) == 4 and all(leg.seen for leg in named(form, "leg"))
    for leg in named(form, "leg"):
        assert extents(leg) == pytest.approx([0.05, 0.05, size[2] - 0.03], abs=FINE)
    assert extents(*form.pieces)[2] == pytest.approx(size[2], abs=0.005)


def test_a_leg_that_nobody_saw_is_where_its_partner_says_or_nowhere(tmp_path):
    boxes = table(1.4, 0.8, 0.75)
    room = [((0.5, 0.2, 0.0), (0.7, 0.4, 0.72))]
    form = fitted("table", reading_of(boxes, unseen=(4,), hidden=room))
    seen, inferred = ([leg for leg in named(form, "leg") if leg.seen is is_seen] for is_seen in (True, False))
    assert len(seen) == 3 and len(inferred) == 1 and "inferred: leg" in form.words
    assert extents(*seen, *inferred)[:2] == pytest.approx(extents(*seen)[:2], abs=0.01), "at the fourth corner"
    placement, surface = write_form(node("table"), form, tmp_path / "thing_3_table")
    told = inferred_of(placement, surface)
    assert told.what == "leg" and len(told.pieces) == 1
    where = inferred[0].corners @ form.turn.T
    assert np.min(told.pieces[0], axis=0) == pytest.approx(where.min(axis=0), abs=1e-3)
    assert np.max(told.pieces[0], axis=0) == pytest.approx(where.max(axis=0), abs=1e-3)
    empty = reading_of(boxes, unseen=(4,))
    empty = Reading(empty.patches, 0.0, empty.turn, Known(boxes[:4], empty.free_space.pose), empty.own)
    assert len(named(fitted("table", empty), "leg")) == 3, "not where cameras saw that nothing is"


def test_legs_that_nobody_saw_are_as_far_out_as_there_is_room():
    boxes = table(1.4, 0.8, 0.75)
    room = [((x - 0.03, y - 0.03, 0.0), (x + 0.03, y + 0.03, 0.72)) for x in (-0.6, 0.6) for y in (-0.3, 0.3)]
    reading = reading_of(boxes, unseen=(1, 2, 3, 4), hidden=room)
    reading = replace(reading, free_space=Known(boxes[:1], reading.free_space.pose, room))
    form = fitted("table", reading)
    found = named(form, "leg")
    assert len(found) == 4 and not any(leg.seen for leg in found)
    assert np.abs([off_middle(leg, form) for leg in found]) == pytest.approx(np.tile([0.6, 0.3], (4, 1)), abs=0.03)


def test_a_partner_is_as_thin_as_its_room():
    boxes = [((-0.7, -0.4, 0.72), (0.7, 0.4, 0.75)), *legs(1.4, 0.8, 0.72, 0.12)]
    room = [((0.62, 0.28, 0.0), (0.7, 0.33, 0.72))]
    reading = reading_of(boxes, unseen=(4,), hidden=room)
    reading = replace(reading, free_space=Known(boxes[:4], reading.free_space.pose, room))
    form = fitted("table", reading)
    (partner,) = (leg for leg in named(form, "leg") if not leg.seen)
    assert extents(partner)[:2].min() == pytest.approx(0.03, abs=0.005)
    assert np.abs(off_middle(partner, form)) == pytest.approx([0.64, 0.34], abs=0.06)


def test_a_chair_has_a_seat_a_back_and_legs():
    form = fitted("chair", reading_of(chair()))
    assert form.classes == ("chair",)
    (seat,) = named(form, "seat")
    assert extents(seat)[:2] == pytest.approx([0.44, 0.4], abs=FINE)
    assert seat.corners[:, 2].max() == pytest.approx(0.45, abs=0.005)
    assert len(named(form, "leg")) == 4 and len(named(form, "post")) == 2 and len(named(form, "rail")) == 2
    assert extents(*form.pieces) == pytest.approx([0.44, 0.4, 0.96], abs=0.03)
    back = np.concatenate([piece.corners for piece in named(form, "post")])
    assert back[:, 1].min() > seat.corners[:, 1].mean(), "behind the seat, along +y"


def test_a_chair_whose_seat_is_half_hidden_is_refused():
    """What is left of it under a table: a leg whose partner would stand where cameras saw that nothing is."""
    boxes = chair()
    half = [((-0.22, -0.2, 0.42), (0.02, 0.2, 0.45)), *boxes[1:7], *boxes[8:]]
    found = fit("chair", reading_of(half))
    assert isinstance(found, str) and "has no partner" in found


def screen(wide=0.56, high=0.34, low=0.12):
    """Of a screen what is left when a desk has its foot: a panel over a neck behind it."""
    panel = ((-wide / 2, 0.0, low), (wide / 2, 0.03, low + high))
    return [panel, ((-0.03, 0.03, 0.01), (0.03, 0.06, low + 0.1))]


def swivel_chair(seat=0.45, reach=0.3):
    """A seat on a column, a back, and four arms with castors."""
    boxes = [((-0.22, -0.2, seat - 0.06), (0.22, 0.2, seat)), ((-0.2, 0.18, seat + 0.1), (0.2, 0.22, 0.96))]
    boxes += [((-0.03, 0.19, seat - 0.06), (0.03, 0.22, 0.6)), ((-0.03, -0.03, 0.06), (0.03, 0.03, seat - 0.06))]
    for along, across in ((0, 1), (1, 0)):
        for sign in (-1, 1):
            first, last = sorted((0.0, sign * reach))
            tip, end = sorted((sign * (reach - 0.04), sign * reach))
            for low, high, z in ((first, last, (0.06, 0.09)), (tip, end, (0.0, 0.06))):
                corners = np.array([[low, -0.02, z[0]], [high, 0.02, z[1]]])
                boxes.append(tuple(corners[:, [along, across, 2]]))
    return boxes


def test_a_swivel_chair_stands_on_the_arms_of_its_star():
    form = fitted_at_least(0.85, "chair", reading_of(swivel_chair()))
    assert len(named(form, "arm")) == len(named(form, "castor")) == 4
    feet = np.concatenate([piece.corners for piece in named(form, "castor")])
    assert feet[:, 2].min() == pytest.approx(0.0, abs=1e-9)
    assert extents(*named(form, "castor"))[:2] == pytest.approx([0.6, 0.6], abs=0.05)


def test_an_arm_that_nobody_saw_is_in_the_gap_that_the_others_leave():
    boxes = swivel_chair()
    room = [boxes[-2], boxes[-1]]
    reading = reading_of(boxes[:-2], hidden=room)
    form = fitted_at_least(0.85, "chair", replace(reading, free_space=Known(boxes[:-2], reading.free_space.pose, room)))
    assert [arm.seen for arm in named(form, "arm")] == [True, True, True, False]
    assert extents(*named(form, "castor"))[:2] == pytest.approx([0.6, 0.6], abs=0.05)


def test_two_arms_are_no_star():
    found = fit("chair", reading_of(swivel_chair()[:8]))
    assert isinstance(found, str) and "would not stand" in found


def test_a_top_whose_corners_are_empty_stands_on_a_column():
    boxes = table(1.0, 1.0, 0.75)
    reading = reading_of(boxes, unseen=(1, 2, 3, 4))
    pose = reading.free_space.pose
    blind = replace(reading, free_space=Known(boxes[:1], pose, [((-0.35, -0.35, 0.0), (0.35, 0.35, 0.72))]))
    form = fitted("table", blind)
    assert form.words == "top; inferred: leg, foot"
    assert off_middle(named(form, "leg")[0], form) == pytest.approx([0.0, 0.0], abs=0.02)
    assert "nothing carries its top" in str(fit("table", replace(reading, free_space=Known(boxes[:1], pose))))


def test_a_low_table_has_its_low_shelf():
    form = fitted("table", reading_of([*table(1.1, 0.6, 0.45), ((-0.45, -0.2, 0.1), (0.45, 0.2, 0.13))]))
    (low,) = named(form, "shelf")
    assert low.corners[:, 2].max() == pytest.approx(0.13, abs=0.01)


def test_a_shelf_with_a_back_has_its_divider_and_nothing_that_stands_on_its_boards():
    boxes = [*shelf((0.03, 0.66, 1.3)), ((-0.45, 0.165, 0.0), (0.45, 0.175, 1.3))]
    boxes += [((-0.01, -0.175, 0.0), (0.01, 0.165, 1.3)), ((0.15, 0.08, 0.03), (0.3, 0.16, 1.28))]
    before = [(x, y, z) for x, y, z in EYES if y < 0]
    form = fitted_at_least(0.85, "shelf", reading_of(boxes, yaw=0.0, eyes=before))
    off = sorted(side.corners[:, 0].mean() - 0.2 for side in named(form, "side"))
    assert off == pytest.approx([-0.44, 0.0, 0.44], abs=0.03)
    assert len(named(form, "back")) == 1


@pytest.mark.parametrize("yaw", [0.3, 2.8])
def test_a_screen_stands_on_a_foot_that_a_desk_took(yaw):
    reading = reading_of(screen(), yaw=yaw)
    form = fitted("screen", reading)
    assert form.words == "panel, neck; inferred: foot" and form.classes == ("monitor",)
    (panel,), (neck,) = named(form, "panel"), named(form, "neck")
    assert extents(panel)[[0, 2]] == pytest.approx([0.56, 0.34], abs=FINE) and extents(panel)[1] < 0.08
    assert neck.corners[:, 2].min() == pytest.approx(0.0, abs=1e-9)


def test_a_neck_that_nobody_saw_is_there_where_masks_name_a_screen():
    reading = reading_of(screen()[:1])
    assert "nobody saw a neck" in str(fit("screen", reading))
    assert "inferred: neck, foot" in fitted("screen", replace(reading, class_name="monitor")).words


def test_a_shelf_has_its_boards_and_sides():
    form = fitted("shelf", reading_of(shelf()))
    tops = sorted(piece.corners[:, 2].max() for piece in named(form, "board"))
    assert tops == pytest.approx([0.1, 0.5, 0.9, 1.3], abs=0.01)
    assert extents(*named(form, "board"))[:2] == pytest.approx([0.9, 0.35], abs=FINE)
    assert len(named(form, "side")) >= 2
    assert all(board.level is not None for board in named(form, "board"))


def sofa(x=2.0, y=0.85, corner=0.0):
    """Seat, back, arms; with a `corner`, the right end of the seat is so much longer to the front."""
    boxes = [((-x / 2 + 0.15, -y / 2, 0.0), (x / 2 - 0.15, y / 2 - 0.2, 0.42))]
    boxes += [((-x / 2 + 0.15, y / 2 - 0.2, 0.0), (x / 2 - 0.15, y / 2, 0.85))]
    boxes += [((a, -y / 2, 0.0), (a + 0.15, y / 2, 0.62)) for a in (-x / 2, x / 2 - 0.15)]
    return boxes + ([((x / 2 - 0.85, -y / 2 - corner, 0.0), (x / 2 - 0.15, -y / 2, 0.42))] if corner else [])


@pytest.mark.parametrize("corner", [0.0, 0.8])
def test_a_sofa_has_seat_back_and_arms(corner):
    form = fitted("sofa", reading_of(sofa(corner=corner), yaw=0.2))
    assert form.classes == ("sofa", "bed")
    tops = {round(float(piece.corners[:, 2].max()), 1) for piece in form.pieces}
    assert tops == {0.4, 0.6, 0.8} or tops == {0.4, 0.6, 0.9}
    assert extents(*form.pieces) == pytest.approx([2.0, 0.85 + corner, 0.85], abs=0.03)
    ground = sum(np.prod(extents(piece)[:2]) for piece in form.pieces)
    assert ground == pytest.approx(2.0 * 0.85 + 0.7 * corner, rel=0.04), "an L leaves its corner empty"
    back = max(form.pieces, key=lambda piece: piece.corners[:, 2].max())
    middle = np.mean([piece.corners.mean(axis=0) for piece in form.pieces], axis=0)
    assert back.corners[:, 1].mean() > middle[1], "its back is behind, along +y"


def test_a_bed_is_as_wide_both_ways():
    boxes = [((-0.8, -1.0, 0.0), (0.8, 1.0, 0.5)), ((-0.8, 1.0, 0.0), (0.8, 1.1, 1.0))]
    assert fitted("sofa", reading_of(boxes)).classes == ("bed", "sofa")


@pytest.mark.parametrize(("along", "classes"), [(1, ("bed", "sofa")), (0, ("sofa", "bed"))])
def test_a_thin_board_at_a_short_end_is_of_a_bed(along, classes):
    board = [((-0.46, 1.0, 0.0), (0.46, 1.01, 1.0)), ((0.46, -1.0, 0.0), (0.47, 1.0, 1.0))][1 - along]
    form = fitted("sofa", reading_of([((-0.46, -1.0, 0.0), (0.46, 1.0, 0.5)), board]))
    assert form.classes == classes
    (headboard,) = named(form, "headboard")
    assert headboard.corners[:, 2].max() == pytest.approx(1.0, abs=0.02) and extents(headboard)[:2].min() < 0.1


@pytest.mark.parametrize(
    ("family", "boxes", "why"),
    [
        ("table", [((-0.4, -0.3, 0.0), (0.4, 0.3, 0.8))], "nobody saw through below its top"),
        ("table", [((-0.4, -0.02, 0.0), (0.4, 0.02, 0.8))], "it has no top"),
        ("table", chair(), "of its surface is above its largest level place"),
        ("chair", table(1.4, 0.8, 0.75), "it has no seat"),
        ("chair", table(0.4, 0.4, 0.45), "it has no back"),
        ("shelf", table(1.4, 0.8, 0.75), "it has 1 boards of one size"),
        (
            "shelf",
            [((-0.5, -0.2, 0.0), (0.5, 0.2, 0.6)), ((-0.25, -0.2, 0.6), (0.25, 0.2, 1.0))],
            "nothing where its boards would be",
        ),
        ("screen", table(1.4, 0.8, 0.75), "its face is not solid"),
        ("screen", screen(0.34, 0.56), "higher than wide"),
        ("screen", screen(low=0.0), "its face is not lifted"),
        ("screen", [screen()[0], ((-0.25, 0.06, 0.0), (0.25, 0.09, 0.12))], "as wide"),
        ("sofa", [((-0.9, -0.4, 0.0), (0.9, 0.4, 0.45))], "nothing of it is higher than its seat"),
        ("sofa", [((-0.9, -0.4, 0.0), (0.9, 0.4, 0.9))], "it has no seat"),
    ],
)
def test_what_is_none_is_refused(family, boxes, why):
    found = fit(family, reading_of(boxes))
    assert isinstance(found, str) and why in found


def test_what_explains_more_explains_it_in_many_places():
    random = np.random.default_rng(0)
    points = random.uniform(0, 1, (4000, 3)) * [1.0, 1.0, 0.01]
    patches = Patches(points, np.tile([0.0, 0, 1], (4000, 1)), np.full(4000, 1e-4))
    all_of_it, none = np.ones(4000, bool), np.zeros(4000, bool)
    one_place = np.linalg.norm(points[:, :2] - 0.45, axis=1) < 0.04
    assert explains_clearly_more(all_of_it, none, patches)
    assert not explains_clearly_more(all_of_it, all_of_it, patches)
    assert not explains_clearly_more(one_place, none, patches), "a single place may be chance"
    either = random.uniform(size=4000) < 0.5
    assert not explains_clearly_more(either, ~either, patches)


def test_of_forms_that_explain_as_much_the_one_that_masks_said_is_taken():
    reading = reading_of(table(1.4, 0.8, 0.75))
    all_of_it = np.ones(len(reading.patches.areas), bool)
    little_less = all_of_it & ~(np.arange(len(all_of_it)) % 50 == 0)
    much_less = reading.patches.points[:, 0] < reading.patches.points[:, 0].mean()
    forms = {name: SimpleNamespace(family=name) for name in ("shelf", "table")}
    shelf_fit = Fitted(forms["shelf"], little_less, 0.98)
    table_fit = Fitted(forms["table"], little_less, 0.97)
    assert likeliest([shelf_fit, table_fit], "object", {"table": 0.2, "chair": 0.9}, reading) is table_fit
    assert likeliest([shelf_fit, table_fit], "object", {}, reading) is shelf_fit, "which explains more"
    assert likeliest([shelf_fit, table_fit], "desk", {"shelf": 0.9}, reading) is table_fit
    best = Fitted(forms["shelf"], all_of_it, 1.0)
    assert likeliest([best, Fitted(forms["table"], much_less, 0.5)], "desk", {}, reading) is best


def test_what_is_left_over_is_further_pieces_but_not_what_sticks_out():
    boxes = [*table(1.4, 0.8, 0.75), ((-0.6, 0.3, 0.4), (0.6, 0.32, 0.7)), ((0.7, -0.1, 0.6), (1.2, 0.1, 0.72))]
    form = fitted_at_least(0.9, "table", reading_of(boxes))
    (piece,) = named(form, "further piece")
    assert extents(piece) == pytest.approx([1.2, 0.03, 0.3], abs=0.04), "the board at its rear"


def node(class_name: str) -> GraphNode:
    return GraphNode(id="thing_3", instance=3, class_name=class_name, node_type="rigid")


@pytest.mark.parametrize(
    ("own", "said", "carried", "expected"),
    [
        ("object", {}, ["cup"], "table"),
        ("object", {"desk": 0.1, "fridge": 0.9}, [], "desk"),
        ("object", {}, ["keyboard"], "desk"),
        ("object", {"table": 0.1}, ["keyboard"], "table"),
        ("chair", {"chair": 0.5}, [], "table"),
        ("desk", {"table": 0.9}, [], "desk"),
        ("stool", {}, [], "stool"),
    ],
)
def test_the_class_is_what_masks_said_of_what_the_form_may_be(own, said, carried, expected):
    form = SimpleNamespace(family="table", classes=("table", "desk"))
    assert class_of(node(own), form, said, carried).get("class_name", own) == expected


def test_a_form_is_a_model_with_levels_mass_and_the_same_bytes(tmp_path):
    form = fitted("table", reading_of(table(1.0, 0.6, 0.7)))
    placement, surface = write_form(node("table"), form, tmp_path / "a" / "thing_3_table")
    assert inferred_of(placement, surface) is None, "all of it was seen"
    write_form(node("table"), form, tmp_path / "b" / "thing_3_table")
    files = [{p.name: p.read_bytes() for p in sorted((tmp_path / x).rglob("*")) if p.is_file()} for x in "ab"]
    assert files[0] == files[1]
    model = surface.model
    assert model.mass == pytest.approx(70.0 * 1.0 * 0.6 * 0.7, rel=0.1), "as tables are, by their hull"
    assert len(surface.pieces["body"]) == len(form.pieces) and not model.joints
    (level,) = [plane for plane in model.states[0].planes if plane.horizontal]
    assert level.center[2] == pytest.approx(0.7, abs=0.01) and level.area == pytest.approx(0.6, rel=0.05)
    assert placement.translation[2] == pytest.approx(0.0, abs=1e-6), "it stands on the ground"


def test_a_piece_is_held_against_seen_space():
    reading = reading_of([((0, 0, 0), (0.5, 0.5, 0.5))], yaw=0.0, at=(0, 0, 0))
    assert reading.has_room(box_piece("leg", np.zeros(3), np.full(3, 0.5)))
    far = box_piece("leg", np.array([1.0, 1, 0]), np.array([1.1, 1.1, 0.5]))
    assert reading.filled(far.corners) == 1.0 and not reading.has_room(far)
    partly = box_piece("leg", np.array([0.0, 0, 0]), np.array([0.5, 0.5, 0.6]), seen=False)
    assert not reading.has_room(partly), "nothing inferred lies in space seen to be empty"


@pytest.fixture
def bench(monkeypatch):
    """A bench, of which the library has no model, on a floor; cameras saw all around it."""
    boxes = table(1.1, 0.4, 0.45)
    known = Known(boxes, np.eye(4))
    monkeypatch.setattr("scenewright.stages.cad.ours.load_free_space", lambda _: known)
    meshes = {1: floor_mesh(), 2: trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes])}
    return seen_surface(meshes, EYES, noise=0.002)


@pytest.mark.parametrize(("word", "class_name"), [("bench", "bench"), ("object", "bench")])
def test_a_scene_has_what_a_family_makes(bench, replace_objects, word, class_name):
    scene = replace_objects(bench, {1: "floor", 2: word})
    (entry,) = [entry for entry in scene.info.replacements if entry.node == f"{word}_2"]
    assert entry.decision == "cad" and entry.chosen.model_id == f"{word}_2_table"
    assert entry.reason.startswith("a table of top, 4 legs; ")
    assert entry.explained.by_model > 0.95 and entry.stays.startswith("free: ")
    assert scene.summary["of_families"] == 1 and scene.summary["cad"] == 0
    assert scene.graph.node(entry.node).class_name == class_name
    model = read_model(scene.path("models") / entry.chosen.model_id)
    assert model.recipe["family"] == "table" and model.class_name == class_name
    (tried,) = [tried for tried in entry.tries if tried.way == "family"]
    assert tried.model_id == model.id


def test_families_are_an_option(bench, replace_objects):
    scene = replace_objects(bench, {1: "floor", 2: "bench"}, families=False)
    (entry,) = [entry for entry in scene.info.replacements if entry.node == "bench_2"]
    assert entry.decision == "mesh" and "family" not in [tried.way for tried in entry.tries]
    assert scene.summary["of_families"] == 0 and not scene.path("models").exists()


def test_a_model_that_explains_as_much_stays(replace_objects, monkeypatch):
    """A table that the library has is that one, though a form would explain it too."""
    boxes = models.table(1.4, 0.7, 0.74)["parts"]["body"]
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=box) for box in boxes])
    monkeypatch.setattr("scenewright.stages.cad.ours.load_free_space", lambda _: Known(boxes, np.eye(4)))
    scene = replace_objects(seen_surface({1: floor_mesh(), 2: mesh}, EYES, noise=0.002), {1: "floor", 2: "table"})
    (entry,) = [entry for entry in scene.info.replacements if entry.node == "table_2"]
    assert entry.chosen.model_id == "table_long"
    (tried,) = [tried for tried in entry.tries if tried.way == "family"]
    assert tried.because.startswith("a table of parts is not clearly better: ")
