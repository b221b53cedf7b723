"""Language in a splat: on a room of three coloured balls before a wall, with an encoder of colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scenewright.schemas.contact_graph import ContactGraph, ContactGraphFile, GraphNode
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.evaluation import Evaluation
from scenewright.schemas.language_map import LanguageMap
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat
from scenewright.schemas.vocabulary import UNNAMED
from scenewright.stages.kit.geometry.boxes import points_in_box
from scenewright.stages.kit.geometry.transforms import transform_from
from scenewright.stages.kit.open_words.calibration import NAMED_SPLAT, UNFITTED, Calibration
from scenewright.stages.kit.open_words.finding import Finder, class_vectors, source_of
from scenewright.stages.kit.open_words.relevancy import margins, query_rows
from scenewright.stages.kit.open_words.vectors import read_vectors
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.rasterizer import View
from scenewright.stages.splat import evaluate_stage, language_stage, query_stage
from scenewright.stages.splat.asked_figures import calibration_error, recall_at_rejection
from scenewright.stages.splat.language.entities import NONE, entity_of, nearest_entities
from scenewright.stages.splat.language.field import LanguageField
from scenewright.stages.splat.language.learning import learn, lesson_of
from scenewright.stages.splat.language.looks import Sight, looks
from scenewright.stages.splat.language.pieces import pieces
from scenewright.stages.splat.language.pyramid import LEVELS, pyramid
from scenewright.stages.splat.parameters import EvaluateParameters, LanguageParameters, QueryParameters
from scenewright.stages.splat.ply import write_gaussians

from benchmarks.perfect_maps import write_map
from tests.unit.open_words.stand_ins import COLORS, ColorEncoder
from tests.unit.poses.textured_room import round_walk, write_sequence
from tests.unit.splat.test_commands import build, context

CAMERA = Camera(width=160, height=120, fx=120.0, fy=120.0, cx=79.5, cy=59.5)
BALLS = {"red": (-0.7, 0.0, 2.0), "green": (0.0, 0.1, 2.2), "blue": (0.7, -0.1, 2.0)}
FIRST_HARMONIC = 0.28209479177387814


def gaussians() -> Gaussians:
    random, means, colors = np.random.default_rng(0), [], []
    for name, center in BALLS.items():
        ball = random.normal(size=(500, 3))
        means.append(np.array(center) + 0.15 * ball / np.linalg.norm(ball, axis=1, keepdims=True))
        colors.append(np.tile(COLORS[name], (500, 1)))
    grid = np.stack(np.meshgrid(np.linspace(-2, 2, 60), np.linspace(-1.5, 1.5, 45)), axis=-1).reshape(-1, 2)
    means.append(np.concatenate([grid, np.full((len(grid), 1), 3.0)], axis=1))
    colors.append(np.full((len(grid), 3), 0.6))
    whole, color = np.concatenate(means).astype(np.float32), np.concatenate(colors)
    count = len(whole)
    return Gaussians(
        whole,
        np.tile(np.array([1.0, 0, 0, 0], np.float32), (count, 1)),
        np.full((count, 3), np.log(0.035), np.float32),
        np.full(count, 3.0, np.float32),
        ((color - 0.5) / FIRST_HARMONIC).astype(np.float32)[:, None, :],
        np.zeros((count, 0), np.float32),
    )


def poses() -> list[np.ndarray]:
    return [transform_from(np.eye(3), np.array([x, 0.0, 0.0])) for x in (-0.3, 0.0, 0.3)]


@pytest.fixture(scope="module")
def shown() -> tuple[Gaussians, list[Sight]]:
    made, rasterizer, sights = gaussians(), CompiledRasterizer(), []
    for pose in poses():
        picture = rasterizer.draw(made, View(CAMERA, pose)).picture
        color = (np.clip(picture.color, 0, 1) * 255).astype(np.uint8)
        sights.append(Sight(color, picture.depth / np.maximum(picture.alpha, 1e-6), CAMERA, pose))
    return made, sights


@pytest.mark.slow
def test_pieces_keep_what_is_of_one_colour_together(shown: tuple[Gaussians, list[Sight]]) -> None:
    found = pieces(shown[0])
    for row in found:
        assert (row >= 0).all()
        owners = [set(row[500 * k : 500 * k + 500]) for k in range(3)]
        assert not owners[0] & owners[1] and not owners[1] & owners[2]
        assert not set(row[1500:]) & set.union(*owners)
    assert found[-1].max() <= found[0].max()


def test_the_pyramid_covers_the_picture_and_reads_between_its_squares(shown: tuple[Gaussians, list[Sight]]) -> None:
    levels = pyramid(shown[1][1].color, ColorEncoder())
    assert len(levels) == LEVELS and [round(levels[k].share, 3) for k in (0, -1)] == [0.1, 0.45]
    for level in levels:
        side = round(level.share * 120)
        assert level.centers[0][0] == (side - 1) / 2 and level.centers[1][-1] == 160 - side + (side - 1) / 2
        assert max(np.diff(level.centers[0])) <= np.ceil(side / 2)
    level = levels[2]
    rows, columns = np.array([level.centers[0][1]]), np.array([level.centers[1][2]])
    np.testing.assert_allclose(level.at(rows, columns)[0], level.vectors[1, 2], atol=1e-6)


@pytest.mark.slow
def test_the_field_learns_what_is_where(shown: tuple[Gaussians, list[Sight]]) -> None:
    made, sights = shown
    torch.manual_seed(0)
    field, encoder = LanguageField(made.means, 3, 2**12), ColorEncoder()
    lessons = [
        lesson_of(pyramid(s.color, encoder), made, CompiledRasterizer(), CAMERA, s.camera_from_world) for s in sights
    ]
    assert all(lesson.depths.min() > 0.5 and lesson.depths.max() < 3.2 for lesson in lessons)
    losses = list(learn(field, lessons, 60, np.random.default_rng(0)))
    assert np.mean(losses[-10:]) < 0.3 * np.mean(losses[:3])
    for number, name in enumerate(BALLS):
        front = made.means[:1500, 2] < BALLS[name][2] - 0.05
        apart = margins(field.vectors(made.means[:1500], 0.25), query_rows(encoder, name))
        best = int(np.where(front, apart, -np.inf).argmax())
        assert best // 500 == number, name


def test_looks_are_of_what_is_seen(shown: tuple[Gaussians, list[Sight]]) -> None:
    made, sights = shown
    regions = [made.means[500 * k : 500 * k + 500].astype(float) for k in range(3)]
    behind = regions[0] + [0, 0, 4.0]
    vectors, counts = looks([*regions, behind], sights, ColorEncoder())
    assert (counts[:3] == 3).all() and counts[3] == 0 and not vectors[3].any()
    assert (vectors[:3] @ ColorEncoder().texts(tuple(BALLS)).T).argmax(axis=1).tolist() == [0, 1, 2]


@pytest.fixture
def colors(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (evaluate_stage, language_stage, query_stage):
        monkeypatch.setattr(module, "open_encoder", lambda *_: ColorEncoder())


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sequence, Splat]:
    folder = tmp_path_factory.mktemp("language")
    sequence = write_sequence(folder / "sequence", round_walk(49)[:9], with_pose=True)
    return sequence, build(sequence, folder / "splat")


def language_of(room: tuple[Sequence, Splat], out: Path, panoptic_map: PanopticMap | None = None) -> LanguageMap:
    parameters = LanguageParameters(steps=5, most_views=3)
    return language_stage.run(room[1], room[0], panoptic_map, None, parameters=parameters, context=context(out))


@pytest.fixture(scope="module")
def language(room: tuple[Sequence, Splat], tmp_path_factory: pytest.TempPathFactory) -> LanguageMap:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(language_stage, "open_encoder", lambda *_: ColorEncoder())
        return language_of(room, tmp_path_factory.mktemp("made") / "language")


def ask(language: LanguageMap, text: str, out: Path, graph: ContactGraph | None = None, **options: float):  # type: ignore[no-untyped-def]
    parameters = QueryParameters.model_validate({"text": text, **options})
    return query_stage.run(language, graph, None, parameters=parameters, context=context(out))


def test_a_splat_answers(room: tuple[Sequence, Splat], language: LanguageMap, colors: None, tmp_path: Path) -> None:
    info, vectors = language.info, read_vectors(language)
    assert language.outcome == "ok" and info.gaussians == room[1].built.gaussians == len(vectors.means)
    assert info.steps == 5 and info.source == "splat" and len(info.regions) == len(vectors.regions) > 3
    answers = ask(language, "red", tmp_path / "answers", least_probability=0.0)
    found, starts = answers.info, np.load(answers.path("masks.npz"), allow_pickle=False)["starts"]
    chances = [answer.probability for answer in found.answers]
    assert chances == sorted(chances, reverse=True) and not found.calibrated and len(starts) == len(chances) + 1
    inside = points_in_box(
        found.answers[0].box,
        vectors.means[np.load(answers.path("masks.npz"), allow_pickle=False)["gaussians"][: starts[1]]],
        1e-3,
    )
    assert inside.mean() > 0.85
    none = ask(language, "red", tmp_path / "none", least_probability=1.0)
    assert none.outcome == "absent" and not none.info.answers and none.info.next_best is not None
    assert ask(language, "guitar", tmp_path / "unknown", least_probability=1.0).outcome == "unknown"
    again = language_of(room, tmp_path / "again")
    assert again.path("vectors.npz").read_bytes() == language.path("vectors.npz").read_bytes()


def evaluated(language: LanguageMap, folder: Path, toml: str, **options: float) -> Evaluation:
    folder.mkdir()
    (folder / "queries.toml").write_text(toml)
    parameters = EvaluateParameters.model_validate(options)
    return evaluate_stage.run(
        language, folder / "queries.toml", None, parameters=parameters, context=context(folder / "out")
    )


def test_what_somebody_knows_is_held_against_the_answers(language: LanguageMap, colors: None, tmp_path: Path) -> None:
    places = {name: Finder(language, ColorEncoder()).find(name)[0] for name in ("red", "blue")}
    x, y, z = Finder(language, ColorEncoder()).place(places["red"].region)
    there = '[[there]]\ntext = "{}"\nboxes = [{{center = [{}, {}, {}], size = [0.1, 0.1, 0.1]}}]\n'
    told = there.format("red", x, y, z) + there.format("blue", x + 100, y, z)
    metrics = evaluated(language, tmp_path / "all", told, least_probability=0.0).info.metrics
    assert (metrics["words/there"], metrics["words/absent"]) == (2, 0)
    assert metrics["words/recall"] == metrics["words/precision"] == 0.5
    assert metrics["words/absent_rejected"] is None and metrics["words/recall_at_rejection"] is None
    expected = calibration_error(np.array([places[n].probability for n in places]), np.array([True, False]))
    assert metrics["words/calibration_error"] == pytest.approx(expected, abs=1e-5)
    strict = evaluated(language, tmp_path / "strict", 'absent = ["green"]\n' + told, least_probability=1.0)
    assert strict.info.metrics["words/absent_rejected"] == 1 and strict.info.metrics["words/precision"] is None
    assert "rejected" in strict.path("tables/answers.md").read_text()
    unread = evaluated(language, tmp_path / "unread", 'absent = ["guitar"]\n' + told, least_probability=1.0)
    assert "| guitar | no |" in (table := unread.path("tables/answers.md").read_text()) and "| unknown |" in table
    assert unread.info.metrics["words/absent_rejected"] == 1


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        ("", "nothing is asked"),
        ('absent = ["  "]', "absent.*needs words"),
        ('[[there]]\ntext = "red"\nboxes = []', "there.0.boxes"),
        ('[[there]]\ntext = "red"\nboxes = [{center = [0, 0], size = [1, 1, 1]}]', "there.0.boxes.0.center"),
        ("absent = 3", "absent"),
        ("absent = [", "queries.toml"),
        ("presnt = []", "presnt"),
    ],
)
def test_queries_that_say_nothing_are_refused(toml: str, message: str, language: LanguageMap, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=message):
        evaluated(language, tmp_path / "asked", toml)


def test_recall_is_looked_at_where_nine_of_ten_absent_texts_are_rejected() -> None:
    absent, right = np.linspace(0.0, 1.0, 11), np.array([True, True, False, True])
    assert recall_at_rejection(np.array([0.95, 0.89, 0.99, 0.91]), right, absent) == 0.5
    assert recall_at_rejection(np.zeros(0), np.zeros(0, bool), absent) is None
    assert calibration_error(np.array([0.75, 0.75, 0.25, 0.25]), np.array([1, 1, 0, 0])) == pytest.approx(0.25)
    assert calibration_error(np.zeros(0), np.zeros(0)) is None


def test_a_piece_belongs_to_the_entity_at_whose_surface_most_of_it_lies() -> None:
    low, high = np.zeros((5, 3)), np.full((3, 3), 1.0)
    means = np.array([[0.0, 0, 0.04], [0, 0, 0.06], [1, 1, 0.98], [1, 1, 1.02]])
    owners = nearest_entities(means, [low, high])
    assert owners.tolist() == [0, NONE, 1, 1]
    assert entity_of(owners) == 1 and entity_of(owners[:2]) == 0 and entity_of(owners[:3]) == NONE
    assert entity_of(owners[1:2]) == NONE and nearest_entities(means, []).tolist() == 4 * [NONE]


def test_a_map_names_the_pieces_of_a_splat(
    room: tuple[Sequence, Splat], language: LanguageMap, colors: None, tmp_path: Path
) -> None:
    means, info = read_vectors(language).means.astype(float), language.info
    biggest = int(np.argmax([np.prod(region.box.size) for region in info.regions]))
    finder = Finder(language, ColorEncoder())
    points = means[finder.index.members(biggest)]
    around = trimesh.Trimesh(points, np.array([[0, 1, 2]]), process=False)
    for name, is_layout in (("cup", False), ("wall", True)):
        named = language_of(room, tmp_path / name, write_map(tmp_path / f"map_{name}", {7: around}, {7: name}))
        region = named.info.regions[biggest]
        assert (region.instance, region.class_name) == (7, name)
        assert (region.box == info.regions[biggest].box) == is_layout
        others = [k for k, each in enumerate(named.info.regions) if not each.instance]
        assert others and all(named.info.regions[k] == info.regions[k] for k in others)
        assert source_of(named.info) == NAMED_SPLAT and source_of(info) == "splat"


def test_the_class_of_a_piece_counts_where_it_was_fitted(language: LanguageMap, tmp_path: Path) -> None:
    first = Finder(language, ColorEncoder()).find("red")[0].region
    told = [region.model_copy(update={"class_name": "red"}) for region in language.info.regions]
    told[first] = told[first].model_copy(update={"class_name": "blue"})
    told.append(told[first].model_copy(update={"class_name": UNNAMED}))
    info = language.info.model_copy(update={"regions": tuple(told)})
    vectors = class_vectors(info, ColorEncoder())
    np.testing.assert_allclose(vectors[first], ColorEncoder().texts(("blue",))[0])
    assert np.isnan(vectors[-1]).all()
    fitted = Calibration(0.0, 1.0, 0.0, 0.0, 0.0, class_bias=-1.0, class_name=0.5)
    looks, alike = np.full(3, 0.5), np.array([0.0, 10.0, np.nan])
    chances = fitted.probabilities(looks, None, np.ones(3), alike)
    np.testing.assert_allclose(chances, 1 / (1 + np.exp([1.0, -4.0, 0.0])))


def test_an_answer_points_at_the_thing_and_not_into_the_air(language: LanguageMap) -> None:
    finder = Finder(language, ColorEncoder())
    for number in range(len(language.info.regions)):
        members = finder.vectors.means[finder.index.members(number)]
        assert np.abs(members - finder.place(number)).sum(axis=1).min() < 1e-6


def test_in_a_strange_place_hardly_anything_is_believed(language: LanguageMap) -> None:
    known, strange = (
        Finder(language, ColorEncoder(), Calibration(0.0, 1.0, 0.0, 0.0, 0.0, True, least, 0.1))
        for least in (-1.0, 2.0)
    )
    assert strange.is_strange and not known.is_strange and strange.recognised == known.recognised
    first, again = known.find("red")[0], strange.find("red")[0]
    assert first.region == again.region and again.probability == pytest.approx(0.1 * first.probability)


def test_a_room_of_balls_has_its_balls_and_no_fourth(shown: tuple[Gaussians, list[Sight]], tmp_path: Path) -> None:
    made, sights = shown
    found = pieces(made)[-1:]
    regions = [made.means[found[0] == k].astype(float) for k in range(found.max() + 1)]
    vectors, _ = looks(regions, sights, ColorEncoder())
    rows = {name: query_rows(ColorEncoder(), name) for name in BALLS}
    for number, name in enumerate(BALLS):
        best = int(margins(vectors, rows[name]).argmax())
        assert best == found[0, 500 * number]


def test_bad_input_is_said_in_one_line(language: LanguageMap, colors: None, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="10000 characters"):
        ask(language, "x" * 10_000, tmp_path / "long")
    node = GraphNode(id="cup_7", instance=7, class_name="cup", node_type="rigid")
    (tmp_path / "graph").mkdir()
    ContactGraphFile(nodes=(node,), links=()).write(tmp_path / "graph" / "graph.json")
    with pytest.raises(BadInput, match="no nodes of the contact graph"):
        ask(language, "red on blue", tmp_path / "related", ContactGraph(tmp_path / "graph"))
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn" / "language.json").write_bytes(language.path("language.json").read_bytes())
    (tmp_path / "torn" / "vectors.npz").write_bytes(language.path("vectors.npz").read_bytes()[:-100])
    with pytest.raises(BadInput, match="vectors.npz"):
        ask(LanguageMap(tmp_path / "torn"), "red", tmp_path / "asked")


def test_an_encoder_of_another_width_and_a_folder_without_language(
    room: tuple[Sequence, Splat], language: LanguageMap, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match="3 wide.*64 wide"):
        ask(language, "red mug", tmp_path / "wide")
    with pytest.raises(BadInput, match="language.json"):
        ask(LanguageMap(room[1].root), "red", tmp_path / "without")


def test_an_empty_splat_has_no_answers(room: tuple[Sequence, Splat], colors: None, tmp_path: Path) -> None:
    (tmp_path / "splat").mkdir()
    for name in ("splat.json", "trajectory.tum", "poses.json"):
        if room[1].path(name).exists():
            (tmp_path / "splat" / name).write_bytes(room[1].path(name).read_bytes())
    write_gaussians(tmp_path / "splat" / "splat.ply", gaussians().taken(np.zeros(0, int)))
    language = language_of((room[0], Splat(tmp_path / "splat")), tmp_path / "language")
    assert language.outcome == "empty" and not language.info.regions
    assert ask(language, "red", tmp_path / "answers").outcome == "absent"


def test_a_query_takes_a_tenth_of_a_second_on_fifty_thousand_gaussians() -> None:
    """Measured for the docs by `make bench`; here it must not be an order slower."""
    import time

    random = np.random.default_rng(0)
    features = random.normal(size=(50_000, 8, 64)).astype(np.float32)
    rows = random.normal(size=(5, 64)).astype(np.float32)
    margins(features, rows)
    began = time.process_time()
    margins(features, rows)
    assert time.process_time() - began < 1.0
    assert not UNFITTED.fitted and Finder is not None
