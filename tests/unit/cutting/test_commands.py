"""The commands of cutting on a small corpus, and what they refuse in one line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scenewright.cli.main import run
from scenewright.schemas.cutting_demonstrations import CuttingDemonstrationsFile
from scenewright.schemas.cutting_plan import CuttingPlanFile, CuttingTrialFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.cutting.demonstrations.cutter import follow
from scenewright.stages.cutting.demonstrations.trials import make_trial
from scenewright.stages.cutting.measure.scores import score, volume_error
from scenewright.stages.cutting.ours.grammar import Grammar, learn
from scenewright.stages.cutting.ours.imagining import imagine
from scenewright.stages.cutting.ours.items import Item, item_of
from scenewright.stages.cutting.ours.policy import OursPolicy
from scenewright.stages.cutting.policy import Stop, carry_out
from scenewright.stages.cutting.words import read_words
from scenewright.stages.cutting.world.foods import make_food
from scenewright.stages.cutting.world.mending import read_body

SMALL = ["--image-width", "300", "--quiet"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("cutting")
    made = str(out / "demonstrations")
    assert run(["cutting", "demonstrate", "--share", "0.3", "--seed", "1", "--out", made, *SMALL]) == 0
    assert run(["cutting", "learn", "--demonstrations", made, "--out", str(out / "model"), "--quiet"]) == 0
    return out


def test_a_goal_in_words_is_planned_and_cut_on_a_board(folder: Path) -> None:
    model, plan, trial = (str(folder / name) for name in ("model", "plan", "trial"))
    words = ["--goal", "4 slices, 2 chunks", "--out", plan]
    assert run(["cutting", "plan", "--model", model, *words, *SMALL]) == 0
    planned = CuttingPlanFile.read(folder / "plan" / "plan.json")
    assert len(planned.cuts) == 5 and [w.name for w in planned.wanted].count("slices") == 4
    assert run(["cutting", "simulate", "--plan", plan, "--model", model, "--out", trial, *SMALL]) == 0
    tried = CuttingTrialFile.read(folder / "trial" / "trial.json")
    assert tried.fragments == 6 and {word.name: word.made for word in tried.words} == {"slices": 4, "chunks": 2}
    assert planned.sure is None and all(cut.likeness is None for cut in planned.cuts)


def test_ours_makes_the_fragments_of_a_trial(grammar: Grammar) -> None:
    trial = make_trial("n1m1", (9, 1))
    items = [item_of(body, k) for k, body in enumerate(trial.fragments)]
    carving = carry_out(OursPolicy(grammar, items), trial.objects, most=99)
    found = score(carving.fragments, trial.fragments)
    assert found.count_exact and found.iou > 0.6 and found.iou == found.iou_thesis


def test_the_measure_is_one_for_the_same_and_counts_what_is_missing() -> None:
    fragments = follow("n1m1", ("carrot",), make_trial("n1m1", (3, 0)).objects, ("chunks",), np.random.default_rng(0))
    halves = make_trial("n1m1", (3, 1)).fragments
    same = score(halves, halves)
    assert same.iou == 1.0 and same.shape_distance == 0.0 and same.volume_error == 0.0
    fewer = score(halves[1:], halves)
    assert fewer.iou_thesis == 1.0 and fewer.iou == pytest.approx(1 - 1 / len(halves)) and fewer.count_error == 1
    assert volume_error([2.0], [1.0, 1.0]) == 1.0 and len(fragments.fragments) == 1


def test_more_volume_than_there_is_stops_with_the_numbers(grammar: Grammar) -> None:
    body = make_trial("n1m1", (3, 0)).objects[0]
    items = [Item(k, (0.02, 0.03, 0.04), body.volume) for k in range(2)]
    decided = OursPolicy(grammar, items).decide({0: body})
    assert isinstance(decided, Stop) and decided.failure is not None
    assert decided.failure.kind == "too_much_volume"
    assert decided.failure.numbers["asked"] == pytest.approx(2 * decided.failure.numbers["there"])
    thin = [Item(0, (0.0005, 0.02, 0.03), body.volume / 9), Item(1, (0.02, 0.02, 0.03), body.volume / 9)]
    decided = OursPolicy(grammar, thin).decide({0: body})
    assert isinstance(decided, Stop) and decided.failure is not None and decided.failure.kind == "too_thin"


def test_trials_that_stop_midway_teach_cuts_but_no_names(folder: Path) -> None:
    records = CuttingDemonstrationsFile.read(folder / "demonstrations" / "demonstrations.json").trials
    assert sum(record.training for record in records) == 6
    trials = [make_trial("n1m1", (0, k)) for k in range(6)]
    trials[0].finished = False
    assert learn(trials, 0).named.sum() == sum(len(trial.final) for trial in trials[1:])
    with pytest.raises(ValueError, match="cuts anything"):
        learn([], 0)


def _mesh(tmp_path: Path, mesh: trimesh.Trimesh) -> Path:
    mesh.export(tmp_path / "body.stl")
    return tmp_path / "body.stl"


def test_meshes_are_mended_where_that_can_be_and_it_is_said(tmp_path: Path) -> None:
    inverted = trimesh.creation.box((0.04, 0.05, 0.1))
    inverted.invert()
    body, mended = read_body(_mesh(tmp_path, inverted), "m")
    assert body.volume == pytest.approx(2e-4, rel=1e-5) and mended == ["faces turned outwards"]
    holed = trimesh.creation.box((40, 50, 100))
    holed.update_faces(np.arange(len(holed.faces)) > 0)
    body, mended = read_body(_mesh(tmp_path, holed), "mm")
    assert body.volume == pytest.approx(2e-4, rel=1e-5) and mended == ["holes filled"]


def _cut_open() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(radius=0.04)
    mesh.update_faces(mesh.triangles_center[:, 2] < 0.01)
    return mesh


def _pushed_through() -> trimesh.Trimesh:
    """A ball whose top comes out of its bottom."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    z = mesh.vertices[:, 2]
    mesh.vertices[:, 2] = np.where(z > 0.01, 0.01 - 2.2 * (z - 0.01), z)
    return mesh


@pytest.mark.parametrize(
    ("mesh", "said"),
    [
        (trimesh.creation.box((40, 50, 100)), "--unit mm"),
        (trimesh.creation.box((1e-4, 1e-4, 1e-4)), "at least 4 mm"),
        (_cut_open(), "open: "),
        (_pushed_through(), "self-intersecting"),
    ],
)
def test_meshes_that_cannot_be_cut_are_refused(tmp_path: Path, mesh: trimesh.Trimesh, said: str) -> None:
    with pytest.raises(BadInput) as refused:
        read_body(_mesh(tmp_path, mesh), "m")
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["", "slices", "0 cubes", "3 wedges", "2 cubes, 3 cubes", "999999 cubes", "-1 cubes"])
def test_words_that_are_no_goal_are_refused(text: str) -> None:
    with pytest.raises(UsageError):
        read_words(text)
    assert read_words("6 slices and 8 cubes") == [(6, "slices"), (8, "cubes")]


def test_a_category_that_was_never_shown_is_refused() -> None:
    trial = next(t for k in range(20) if set((t := make_trial("n1m1", (0, k))).categories.values()) == {"chunks"})
    with pytest.raises(BadInput, match="not been shown strips"):
        imagine(trial.objects, [(4, "strips")], learn([trial] * 4, 0))


def test_a_cut_of_what_does_not_lie_there_is_refused(folder: Path) -> None:
    path = folder / "demonstrations" / "demonstrations.json"
    data = json.loads(path.read_text())
    data["trials"][0]["cuts"][0]["piece"] = 7
    with pytest.raises(ValueError, match="does not lie there"):
        CuttingDemonstrationsFile.model_validate_json(json.dumps(data))


def test_bodies_that_pass_through_each_other_are_united_and_it_is_said(tmp_path: Path) -> None:
    first, second = trimesh.creation.box((0.04, 0.04, 0.1)), trimesh.creation.box((0.04, 0.1, 0.04))
    body, mended = read_body(_mesh(tmp_path, trimesh.util.concatenate([first, second])), "m")
    assert body.volume == pytest.approx(1.6e-4 * 2 - 6.4e-5, rel=1e-5)
    assert mended == ["2 bodies that pass through each other united"]
    second.apply_translation((1e-1, 0.0, 0.0))
    with pytest.raises(BadInput, match="2 bodies that do not hang together"):
        read_body(_mesh(tmp_path, trimesh.util.concatenate([first, second])), "m")


def _beside(mesh: trimesh.Trimesh, by: float, flipped: bool = False) -> trimesh.Trimesh:
    """A mesh moved along x; flipped, its faces have the other diagonals."""
    vertices = mesh.vertices * ((1, -1, 1) if flipped else (1, 1, 1)) + (by, 0, 0)
    return trimesh.Trimesh(vertices, mesh.faces[:, ::-1] if flipped else mesh.faces, process=False)


@pytest.mark.parametrize("suffix", ["stl", "obj"])
@pytest.mark.parametrize("flipped", [False, True])
def test_parts_that_share_faces_are_united(suffix: str, flipped: bool, tmp_path: Path) -> None:
    """As decompositions into convex parts are: each closed, neighbours with one face, or with its other diagonal."""
    box = trimesh.creation.box((0.04, 0.04, 0.1))
    parts = trimesh.util.concatenate([box, _beside(box, 0.04, flipped), _beside(box, 0.08)])
    parts.apply_transform(trimesh.transformations.rotation_matrix(0.7, (1, 2, 3)))
    parts.export(tmp_path / f"parts.{suffix}")
    body, mended = read_body(tmp_path / f"parts.{suffix}", "m")
    assert body.volume == pytest.approx(4.8e-4, rel=4e-3)
    assert mended[0] == "3 closed parts that share faces or edges united"


def test_faces_that_lie_over_each_other_are_told_from_holes(tmp_path: Path) -> None:
    """A box whose one side is there twice, with either diagonal; pushed in on another side it is no convex body."""
    box = trimesh.creation.box((0.04, 0.04, 0.1))
    side = [k for k, normal in enumerate(box.face_normals) if normal[0] > 0.9]
    corners = np.unique(box.faces[side])
    a, b = (corner for corner in corners if (box.faces[side] == corner).sum() == 2)
    c, d = (corner for corner in corners if corner not in (a, b))
    faces = np.concatenate([box.faces, [(a, c, d), (b, d, c)]])
    doubled = trimesh.Trimesh(box.vertices, faces, process=False)
    body, mended = read_body(_mesh(tmp_path, doubled), "m")
    assert body.volume == pytest.approx(1.6e-4, rel=1e-5) and "lie over each other" in mended[0]
    p, q, r = faces[next(k for k, normal in enumerate(box.face_normals) if normal[0] < -0.9)]
    pushed_in = np.concatenate([faces[(faces != (p, q, r)).any(axis=1)], [(p, q, 8), (q, r, 8), (r, p, 8)]])
    dent = trimesh.Trimesh(np.concatenate([box.vertices, [(-0.01, 0.0, 0.01)]]), pushed_in, process=False)
    with pytest.raises(BadInput, match="edges have three faces or more"):
        read_body(_mesh(tmp_path, dent), "m")


@pytest.mark.parametrize(
    ("mesh", "code", "said"),
    [
        (_cut_open(), 3, "open: "),
        (_pushed_through(), 3, "self-intersecting"),
        (trimesh.creation.box((40, 50, 100)), 3, "--unit mm"),
        (trimesh.creation.box((0.002, 0.05, 0.05)), 4, "cm3, there are"),
    ],
)
def test_bad_goals_are_one_line_and_lose_nothing(
    folder: Path, tmp_path: Path, mesh: trimesh.Trimesh, code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Meshes as what is cut and as what is wanted; the last holds less than is wanted of it. A plan that lies there
    stays, but for one that says why not."""
    out, model = str(tmp_path / "plan"), str(folder / "model")
    words = ["--model", model, "--goal", "4 chunks", "--out", out]
    assert run(["cutting", "plan", *words, *SMALL]) == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "plan").iterdir()}
    capsys.readouterr()
    broken = str(_mesh(tmp_path, mesh))
    wanted = tmp_path / "wanted"
    wanted.mkdir()
    trimesh.creation.box((0.06, 0.06, 0.06)).export(wanted / "cube.stl")
    asked = ["--model", model, "--mesh", broken, "--goal-meshes", str(wanted), "--out", out, *SMALL]
    assert run(["cutting", "plan", *asked]) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert sum(line.startswith("error: ") for line in lines) == 1 and said in lines[-1]
    if code == 3:
        assert before == {path.name: path.read_bytes() for path in (tmp_path / "plan").iterdir()}


def test_a_plan_of_64_fragments_has_all_of_them(grammar: Grammar) -> None:
    objects = [make_food("bread", np.random.default_rng(1))]
    carving = carry_out(OursPolicy(grammar, imagine(objects, [(64, "cubes")], grammar)), objects, most=65)
    assert len(carving.board) == 64 and carving.stopped is None
    volume = sum(body.volume for body in carving.board.values())
    assert volume == pytest.approx(objects[0].volume, rel=1e-6)
    assert max(body.volume for body in carving.board.values()) < 1.3 * volume / 64


def test_the_tree_says_how_probable_each_rule_is(folder: Path, tmp_path: Path) -> None:
    out = ["--goal", "6 slices", "--out", str(tmp_path / "plan")]
    assert run(["cutting", "plan", "--model", str(folder / "model"), *out, *SMALL]) == 0
    cuts = CuttingPlanFile.read(tmp_path / "plan" / "plan.json").cuts
    assert len(cuts) == 5 and all(cut.chance is not None and 0.0 < cut.chance < 1.0 for cut in cuts)
    picture = np.asarray(Image.open(tmp_path / "plan" / "tree.png").convert("RGB"))
    assert picture.std() > 5 and "with probability" in (tmp_path / "plan" / "plan.txt").read_text()
