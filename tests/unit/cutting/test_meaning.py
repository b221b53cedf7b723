"""Words are cut as what they mean, told by a checker of its own; what is not so is not called done."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scenewright.schemas.cutting_plan import CuttingScores, WordMet
from scenewright.schemas.plan import Failure
from scenewright.stages.cutting import policy
from scenewright.stages.cutting.meaning import Made, Thing, judge
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.imagining import Words, imagine
from scenewright.stages.cutting.ours.policy import OursPolicy
from scenewright.stages.cutting.policy import Carving, carry_out
from scenewright.stages.cutting.verdict import verdict, words_met
from scenewright.stages.cutting.world.body import Body, Plane
from scenewright.stages.cutting.world.foods import make_food
from scenewright.stages.cutting.world.knife import Knife, cut
from scenewright.stages.kit.geometry.transforms import transform_from
from scipy.spatial.transform import Rotation

from tests.unit.cutting.shapes import box_of, evenness, is_what_it_is_called

TURNED = transform_from(Rotation.from_rotvec((0.7, -0.4, 1.1)).as_matrix(), np.array([0.1, 0.0, 0.2]))
BAR, SQUARE, CUBE = (0.04, 0.05, 0.15), (0.04, 0.04, 0.16), (0.06, 0.06, 0.06)


def body_of(mesh: trimesh.Trimesh) -> Body:
    return Body.of_mesh(mesh.vertices, mesh.faces).moved(TURNED)


def thing_of(name: str) -> Body:
    made = {
        "bar": lambda: trimesh.creation.box(BAR),
        "square bar": lambda: trimesh.creation.box(SQUARE),
        "block": lambda: trimesh.creation.box(CUBE),
        "board": lambda: trimesh.creation.box((0.06, 0.2, 0.22)),  # wider than the blade is high
        "cylinder": lambda: trimesh.creation.cylinder(0.02, 0.09),
        "disc": lambda: trimesh.creation.cylinder(0.06, 0.02),
        "slab": lambda: trimesh.creation.box((0.02, 0.11, 0.12)),
        "cone": lambda: trimesh.creation.cone(0.03, 0.12),
        "capsule": lambda: trimesh.creation.capsule(0.08, 0.02, count=[12, 12]),
        "ball": lambda: trimesh.creation.icosphere(subdivisions=2, radius=0.03),
        "torus": lambda: trimesh.creation.torus(0.04, 0.015, major_sections=16, minor_sections=10),
    }
    return body_of(made[name]()) if name in made else make_food(name, np.random.default_rng(1)).moved(TURNED)


def carve(
    monkeypatch: pytest.MonkeyPatch, body: Body, words: Words, grammar: Grammar
) -> tuple[Carving, str, list[str]]:
    """Return what is cut, nothing pushed aside, with the outcome and what is said of it."""
    monkeypatch.setattr(policy, "GAP", 0.0)
    wish = imagine([body], words, grammar)
    carving = carry_out(OursPolicy(grammar, wish), [body], most=len(wish.items) + 1)
    return carving, *verdict(carving, len(wish.items), None, words_met(wish, carving))


def mesh_of(body: Body) -> trimesh.Trimesh:
    return trimesh.Trimesh(body.vertices, body.faces, process=False)


@pytest.mark.parametrize(
    ("name", "word", "counts"),
    [
        ("cylinder", "slices", (3, 6, 8, 12)),
        ("cucumber", "slices", (6, 10)),
        ("bread", "slices", (6, 12)),
        ("square bar", "slices", (3, 4, 8)),
        ("cone", "slices", (7,)),
        ("block", "slices", (4,)),
        ("disc", "slices", (6, 8, 15)),
        ("cucumber", "strips", (4, 7)),
        ("square bar", "strips", (4, 9)),
        ("board", "strips", (4, 9)),
        ("bread", "cubes", (16, 24)),
        ("block", "cubes", (8,)),
        ("square bar", "cubes", (4,)),
        ("ball", "cubes", (8,)),
        ("capsule", "chunks", (2, 4)),
        ("square bar", "chunks", (3, 4, 11)),
        ("torus", "chunks", (4,)),
    ],
)
def test_fragments_are_what_they_are_called(
    name: str, word: str, counts: tuple[int, ...], grammar: Grammar, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = thing_of(name)
    for count in counts:
        carving, outcome, said = carve(monkeypatch, body, [(count, word)], grammar)  # type: ignore[list-item]
        meshes = [mesh_of(fragment) for fragment in carving.fragments]
        assert outcome == "ok", said
        assert len(meshes) == count and all(is_what_it_is_called(word, meshes, mesh_of(body))), (name, count)
        assert evenness(word, meshes, mesh_of(body)) < (1.05 if word == "slices" else 1.3)


def test_six_slices_and_eight_cubes_of_a_cucumber_are_those(grammar: Grammar, monkeypatch: pytest.MonkeyPatch) -> None:
    body = thing_of("cucumber")
    carving, outcome, said = carve(monkeypatch, body, [(6, "slices"), (8, "cubes")], grammar)
    meshes = [mesh_of(fragment) for fragment in carving.fragments]
    right = {word: np.array(is_what_it_is_called(word, meshes, mesh_of(body))) for word in ("slices", "cubes")}
    assert outcome == "ok" and len(meshes) == 14 and (right["slices"] | right["cubes"]).all(), said
    assert right["slices"].sum() == 6 and right["cubes"].sum() == 8


def test_four_words_of_one_thing_and_slices_of_two_are_met(grammar: Grammar, monkeypatch: pytest.MonkeyPatch) -> None:
    words: Words = [(3, "slices"), (4, "strips"), (8, "cubes"), (2, "chunks")]
    carving, outcome, said = carve(monkeypatch, body_of(trimesh.creation.box((0.04, 0.04, 0.24))), words, grammar)
    assert outcome == "ok" and len(carving.board) == 17, said
    long, short = (body_of(trimesh.creation.box((0.03, 0.05, z))) for z in (0.15, 0.05))
    wish = imagine([long, short], [(8, "slices")], grammar)
    assert [len(laid.items) for laid in wish.laid] == [6, 2]
    small = body_of(trimesh.creation.box((0.01, 0.01, 0.02)))
    assert [len(laid.items) for laid in imagine([long, small], [(2, "chunks")], grammar).laid] == [1, 1]


@pytest.mark.parametrize(
    ("name", "words", "outcome", "said"),
    [
        ("square bar", [(2, "slices")], "partial", "0 of 2 are slices: the worst is 2 times as thick as the thing"),
        ("square bar", [(8, "cubes")], "partial", "are cubes: the worst is 2 times as long as thick, at most 1.5"),
        ("ball", [(2, "strips")], "partial", "0 of 2 are strips: the worst is"),
        ("disc", [(2, "chunks")], "partial", "0 of 2 are chunks: the worst is 5.97"),
        ("disc", [(4, "slices")], "partial", "0 of 4 are slices: the worst is 1.49 times as thick as the thing"),
        ("disc", [(5, "slices")], "partial", "at most 1; the thickest is 1.00 times the thinnest"),
        ("slab", [(4, "slices")], "partial", "the worst is 1.5 times as thick as the thing is thin, at most 1;"),
        ("torus", [(8, "slices")], "partial", "do not span the whole cross section"),
        ("square bar", [(161, "slices")], "not_reached", "is 0.99 mm thin, the thinnest that can be cut is 1.0 mm"),
        ("square bar", [(1, "slices")], "partial", "0 of 1 are slices"),
    ],
)
def test_what_a_word_does_not_mean_is_not_called_done(
    name: str, words: Words, outcome: str, said: str, grammar: Grammar, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, found, texts = carve(monkeypatch, thing_of(name), words, grammar)
    assert found == outcome and said in "; ".join(texts)


def test_as_many_slices_as_the_knife_can_cut_are_slices(grammar: Grammar, monkeypatch: pytest.MonkeyPatch) -> None:
    carving, outcome, _ = carve(
        monkeypatch, body_of(trimesh.creation.box((0.02, 0.02, 0.06))), [(50, "slices")], grammar
    )
    assert outcome == "ok" and len(carving.board) == 50
    assert max(box_of(mesh_of(body))[0] for body in carving.fragments) == pytest.approx(0.0012, rel=1e-3)


def test_uneven_and_lengthwise_pieces_are_told() -> None:
    """Two chunks of which one is larger by far; a bar halved along its length, whose halves are no slices."""
    body = body_of(trimesh.creation.box((0.03, 0.03, 0.07)))
    parts = cut(body, Plane.through(body.moments[0] + 0.0125 * TURNED[:3, 2], TURNED[:3, 2]), Knife())
    (met,) = judge([Thing.of(body)], [Made(part, 0) for part in parts], [("chunks", body.volume / 2)] * 2, [{}])
    assert met.made == 2 and met.evenness == pytest.approx(47.5 / 22.5) and "at most 2 is even" in met.said
    assert verdict(Carving(dict(enumerate(parts)), {}), 2, None, [met])[0] == "partial"
    halves = cut(body, Plane.through(body.moments[0], TURNED[:3, 1]), Knife())
    (met,) = judge([Thing.of(body)], [Made(part, 0) for part in halves], [("slices", body.volume / 2)] * 2, [{}])
    assert met.made == 0 and "do not span the whole cross section" in met.said


SCORES = CuttingScores(iou_thesis=0.8, iou=0.8, count_error=0, volume_error=0.0, shape_distance=0.0)
MET = WordMet(name="cubes", wanted=8, made=8, evenness=1.2, said="8 of 8 are cubes")


@pytest.mark.parametrize(
    ("count", "wanted", "scores", "words", "stopped", "outcome"),
    [
        (8, 8, SCORES, [], False, "ok"),
        (8, 7, SCORES, [], False, "partial"),
        (8, 8, SCORES.model_copy(update={"iou": 0.31}), [], False, "partial"),
        (6, 7, SCORES, [], False, "not_reached"),
        (8, 8, None, [MET], False, "ok"),
        (9, 8, None, [MET], False, "partial"),
        (8, 8, None, [MET.model_copy(update={"made": 7})], False, "partial"),
        (8, 8, None, [MET.model_copy(update={"evenness": 4.0})], False, "partial"),
        (8, 8, None, [MET], True, "not_reached"),
    ],
)
def test_done_is_what_has_the_count_and_the_shape(
    count: int, wanted: int, scores: CuttingScores | None, words: list[WordMet], stopped: bool, outcome: str
) -> None:
    block = body_of(trimesh.creation.box(CUBE))
    carving = Carving(dict.fromkeys(range(count), block), {})
    if stopped:
        carving = replace(carving, stopped=Failure(kind="too_thin", message="too thin"))
    assert verdict(carving, wanted, scores, words)[0] == outcome
