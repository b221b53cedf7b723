"""What two depth cameras see, against closed forms and the bodies themselves; cuts through several pieces."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest
import trimesh

from stages.cutting.demonstrations.trials import make_trial
from stages.cutting.evaluate_stage import attempt
from stages.cutting.methods import Learned
from stages.cutting.ours.grammar import learn
from stages.cutting.ours.imagining import imagine
from stages.cutting.policy import carry_out
from stages.cutting.sight.perceiving import Hand
from stages.cutting.sight.seeing import see
from stages.cutting.sight.surface import zero_surface
from stages.cutting.sight.views import look
from stages.cutting.world.body import Body
from stages.cutting.world.canonical import box_edges
from stages.cutting.world.foods import make_food


@pytest.fixture(scope="module")
def learned() -> Learned:
    return Learned(learn([make_trial("n1m1", (0, k)) for k in range(12)], 0))


def test_the_zero_surface_of_a_ball_is_the_ball() -> None:
    places = np.moveaxis(np.indices((24, 24, 24)), 0, -1) - 11.3
    vertices, faces = zero_surface(8.0 - np.linalg.norm(places, axis=-1))
    body = Body.of_mesh(vertices, faces)
    assert body.volume == pytest.approx(4 / 3 * np.pi * 8.0**3, rel=0.02)
    assert np.allclose(body.moments[0], 11.3, atol=1e-2)


def test_whatever_the_field_its_surface_is_closed() -> None:
    field = np.random.default_rng(0).normal(size=(9, 9, 9))
    for axis in range(3):
        np.moveaxis(field, axis, 0)[[0, -1]] = -1.0
    mesh = trimesh.Trimesh(*zero_surface(field), process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0


def test_fragments_are_seen_apart_and_closed() -> None:
    there = dict(enumerate(make_trial("n2m1", (3, 2)).fragments[:2]))
    with closing(Hand()) as hand:
        hand.lay(there)
    found = see(look(list(there.values()), np.random.default_rng(0)))
    assert len(found) == len(there)
    for body in there.values():
        seen = min(found, key=lambda each: float(np.linalg.norm(each.moments[0] - body.moments[0])))
        assert np.linalg.norm(seen.moments[0] - body.moments[0]) < 0.003
        assert seen.volume == pytest.approx(body.volume, rel=0.15)
        assert np.allclose(box_edges(seen.moments[1]), box_edges(body.moments[1]), atol=0.003)


def test_an_empty_board_shows_nothing() -> None:
    speck = Body.of_mesh(*(lambda m: (m.vertices, m.faces))(trimesh.creation.icosphere(radius=5e-4)))
    assert see(look([speck], np.random.default_rng(0))) == []


def test_what_is_seen_is_enough_to_make_the_goal(learned: Learned) -> None:
    known, seen = (attempt(learned, method, "n1m1", 1) for method in ("ours", "ours_perceived"))
    assert seen.scores.count_exact and seen.scores.iou > known.scores.iou - 0.1


def test_one_stroke_through_several_pieces_saves_strokes(learned: Learned) -> None:
    objects = [make_food("bread", np.random.default_rng(0))]
    items, _ = imagine(objects, [(12, "cubes")], learned.grammar)
    strokes = []
    for together in (False, True):
        carving = carry_out(learned.policy_for(items, together=together), objects, most=13)
        assert len(carving.board) == 12 and len(carving.steps) == 11
        strokes.append(carving.strokes)
    assert strokes[0] == 11 > strokes[1]
