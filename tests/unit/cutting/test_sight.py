"""What two depth cameras see, against closed forms and the bodies themselves; cuts through several pieces."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.cli.main import run
from scenewright.schemas.cutting_plan import CuttingPlanFile, CuttingTrialFile
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.demonstrations.trials import make_trial
from scenewright.stages.cutting.evaluate_stage import attempt
from scenewright.stages.cutting.measure.scores import score
from scenewright.stages.cutting.methods import Learned
from scenewright.stages.cutting.ours.grammar import learn
from scenewright.stages.cutting.ours.imagining import imagine
from scenewright.stages.cutting.policy import carry_out
from scenewright.stages.cutting.sight.laying import Hand, in_rows
from scenewright.stages.cutting.sight.pictured import read_pictures, write_pictures
from scenewright.stages.cutting.sight.seeing import see
from scenewright.stages.cutting.sight.surface import zero_surface
from scenewright.stages.cutting.sight.views import look
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.canonical import box_edges
from scenewright.stages.cutting.world.foods import make_food


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
    wish = imagine(objects, [(12, "cubes")], learned.grammar)
    strokes = []
    for together in (False, True):
        carving = carry_out(learned.policy_for(wish, together=together), objects, most=13)
        assert len(carving.board) == 12 and len(carving.steps) == 11
        strokes.append(carving.strokes)
    assert strokes[0] == 11 > strokes[1]


@pytest.fixture(scope="module")
def pictured(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Body]]:
    fragments = make_trial("n1m1", (3, 2)).fragments
    with closing(Hand()) as hand:
        laid = hand.lay_out(fragments)
    folder = tmp_path_factory.mktemp("pictured") / "goal"
    write_pictures(folder, look(laid, np.random.default_rng(0)), laid)
    return folder, fragments


def test_a_goal_on_pictures_is_seen_from_the_files(pictured: tuple[Path, list[Body]]) -> None:
    folder, fragments = pictured
    views = read_pictures(folder)
    assert len(views) == 2 and all(color.shape == (*view.depth.shape, 3) for view, color in views)
    found = score(see([view for view, _ in views]), fragments)
    assert found.count_exact and found.iou > 0.7 and found.volume_error < 0.15
    assert len(read_pictures(folder / "camera_1")) == 1


def test_fragments_in_rows_lie_apart() -> None:
    fragments = make_trial("n3m4", (3, 1)).fragments
    laid = in_rows(fragments, 0.3, 0.02)
    boxes = np.array([(body.vertices.min(axis=0)[:2], body.vertices.max(axis=0)[:2]) for body in laid])
    gaps = np.maximum(boxes[:, None, 0] - boxes[None, :, 1], boxes[None, :, 0] - boxes[:, None, 1]).max(axis=2)
    assert (gaps[~np.eye(len(laid), dtype=bool)] > 0.02 - 1e-9).all()
    assert np.allclose([body.volume for body in laid], [body.volume for body in fragments])


def _change(path: Path, text: str, by: str) -> None:
    path.write_text(path.read_text().replace(text, by))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f: (f / "depth.png").unlink(), "file is missing"),
        (lambda f: (f / "depth.png").write_bytes(b"no picture"), "no picture"),
        (lambda f: (f / "depth.png").write_bytes((f / "color.png").read_bytes()), "depth has 16 bits"),
        (lambda f: (f / "camera.json").unlink(), "holds no pictures"),
        (lambda f: (f / "camera.json").write_text("{"), "camera.json"),
        (lambda f: _change(f / "camera.json", '"width": ', '"width": 1'), "the camera"),
        (lambda f: _change(f / "camera.json", '"width": ', '"width": -'), "not a camera"),
    ],
)
def test_pictures_that_cannot_be_read_are_refused(
    pictured: tuple[Path, list[Body]], tmp_path: Path, change: Callable[[Path], object], said: str
) -> None:
    folder = Path(shutil.copytree(pictured[0] / "camera_0", tmp_path / "goal"))
    change(folder)
    with pytest.raises(BadInput) as refused:
        read_pictures(folder)
    assert said in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.slow
def test_a_trial_through_cameras_is_a_goal_on_pictures(tmp_path: Path) -> None:
    shown, model, plan, trial, again = (str(tmp_path / name) for name in ("shown", "model", "plan", "trial", "again"))
    small = ["--image-width", "300", "--quiet"]
    assert run(["cutting", "demonstrate", "--share", "0.3", "--seed", "1", "--out", shown, *small]) == 0
    assert run(["cutting", "learn", "--demonstrations", shown, "--out", model, "--quiet"]) == 0
    goal = ["--goal", "3 chunks", "--food", "cucumber"]
    assert run(["cutting", "plan", "--model", model, *goal, "--out", plan, *small]) == 0
    asked = ["--plan", plan, "--model", model, "--cameras"]
    assert run(["cutting", "simulate", *asked, "--out", trial, *small]) == 0
    done = CuttingTrialFile.read(tmp_path / "trial" / "trial.json")
    assert done.fragments == 3 and done.missed == 0 and "cameras saw" in done.statement
    goal = ["--goal-pictures", f"{trial}/seen", "--food", "cucumber", "--out", again]
    assert run(["cutting", "plan", "--model", model, *goal, *small]) == 0
    file = CuttingPlanFile.read(tmp_path / "again" / "plan.json")
    assert file.goal == "3 fragments seen by 2 cameras" and file.scores is not None and file.scores.iou > 0.7
    assert run(["cutting", "simulate", *asked, "--method", "bc", "--out", trial, *small]) == 2
