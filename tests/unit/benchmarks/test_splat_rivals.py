"""LERF and LangSplat, made small: on three coloured balls before a wall, with an encoder of colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from scenewright.stages.kit.geometry.cameras import scaled
from scenewright.stages.kit.geometry.transforms import apply, inverse, look_at
from scenewright.stages.kit.open_words.relevancy import margins, query_rows
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.rasterizer import View
from scenewright.stages.splat.language.looks import Sight
from scenewright.stages.splat.language.pieces import pieces
from scenewright.stages.splat.language.pyramid import pyramid
from scenewright.stages.splat.views import PosedView
from scipy.spatial import cKDTree

from benchmarks.experiment import Bench, Results, Trial
from benchmarks.experiments import legs
from benchmarks.splats import lerf
from benchmarks.splats.langsplat import CODE, fitted, langsplat, segmented
from benchmarks.splats.lerf import Lerf, Rays, rays_of
from tests.unit.open_words.stand_ins import ColorEncoder
from tests.unit.splat.test_language import BALLS, CAMERA, gaussians, poses

Shown = tuple[Gaussians, list[Sight]]


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def shown() -> Shown:
    made, sights = gaussians(), []
    for pose in poses():
        picture = CompiledRasterizer().draw(made, View(CAMERA, pose)).picture
        color = (np.clip(picture.color, 0, 1) * 255).astype(np.uint8)
        sights.append(Sight(color, picture.depth / np.maximum(picture.alpha, 1e-6), CAMERA, pose))
    return made, sights


def views(sights: list[Sight]) -> list[PosedView]:
    return [
        PosedView(k, 0.0, "camera", CAMERA, s.color.astype(np.float32) / 255, s.depth, s.camera_from_world)
        for k, s in enumerate(sights)
    ]


def test_an_autoencoder_gives_back_what_a_room_says() -> None:
    middles = np.eye(6)[:4]
    vectors = middles[np.random.default_rng(0).integers(0, 4, 400)].astype(np.float32)
    coder = fitted(vectors, 0)
    with torch.inference_mode():
        codes = coder.encode(torch.from_numpy(vectors))
        again = coder.decode(codes).numpy()
    assert codes.shape == (400, CODE)
    assert (np.sum(again * vectors, axis=1)).mean() > 0.9


def test_segments_are_cut_out_of_pictures(shown: Shown) -> None:
    made, sights = shown
    found = segmented(sights[1], made, pieces(made), cKDTree(made.means), CompiledRasterizer(), ColorEncoder())
    camera = found.view.camera
    for name, center in BALLS.items():
        at = np.array(center) - sights[1].camera_from_world[:3, 3]
        row, column = (round(camera.fy * at[1] / at[2] + camera.cy), round(camera.fx * at[0] / at[2] + camera.cx))
        said = found.vectors[found.labels[1:, row, column]]  # the finest are spots with black in their middle
        assert (said @ ColorEncoder().texts(tuple(BALLS)).T).argmax(axis=1).tolist() == [list(BALLS).index(name)] * 2


def test_langsplat_finds_what_is_asked_for(shown: Shown) -> None:
    made, sights = shown
    vectors = langsplat(made, sights, ColorEncoder(), CompiledRasterizer(), steps=150)
    assert vectors.shape == (len(made), 3, 3)
    front = made.means[:1500, 2] < np.repeat([center[2] for center in BALLS.values()], 500) - 0.05
    for number, name in enumerate(BALLS):
        fit = margins(vectors[:1500], query_rows(ColorEncoder(), name)).max(axis=1)
        assert int(np.where(front, fit, -np.inf).argmax()) // 500 == number, name


def test_a_wall_is_rendered_where_it_is(shown: Shown) -> None:
    """Density that is a wall 2 m away: its colour and its depth, whatever is behind."""
    torch.manual_seed(0)
    model = Lerf(views(shown[1]), 0, entries=2**10)

    def density(places: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return torch.where(places[:, 2] > 2.0, 200.0, 0.0), torch.zeros(len(places), lerf.GEOMETRY)

    model.field.density = density  # type: ignore[method-assign]
    directions = torch.tensor([[0.0, 0.0, 1.0], [0.3, -0.2, 1.0]])
    with torch.inference_mode():
        found = model.render(Rays(torch.zeros(2, 3), directions, torch.zeros(2, 3)))
    np.testing.assert_allclose(found.depth.numpy(), 2.0, atol=0.15)
    np.testing.assert_allclose(found.weights.sum(dim=1).numpy(), 1.0, atol=1e-3)


def test_rays_of_pixels_meet_what_they_show() -> None:
    pose = inverse(look_at(np.array([0.5, -1.0, 1.2]), np.array([0.0, 0.3, 0.6])))
    view = PosedView(0, 0.0, "", CAMERA, np.zeros((120, 160, 3), np.float32), None, pose)
    row, column, depth = 30, 100, 1.7
    local = np.array([(column - CAMERA.cx) / CAMERA.fx, (row - CAMERA.cy) / CAMERA.fy, 1.0]) * depth
    rays = rays_of(view, np.array([row]), np.array([column]))
    found = (rays.origins + depth * rays.directions).numpy()[0]
    np.testing.assert_allclose(found, apply(inverse(pose), local), atol=1e-5)


def test_lerf_learns_pictures_and_words(shown: Shown, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lerf, "RAYS", 64)
    monkeypatch.setattr(lerf, "LOOKED_AT", 200)
    encoder, seen = ColorEncoder(), views(shown[1])
    model = Lerf(seen, 0, [pyramid(sight.color, encoder) for sight in shown[1]], encoder.width, entries=2**10)
    before = model.looked_at(seen[1])[0]
    losses = [model.step() for _ in range(40)]
    assert np.mean(losses[-10:]) < 0.5 * np.mean(losses[:5])
    assert model.looked_at(seen[1])[0] > before + 3
    small = scaled(CAMERA, 0.1)
    vectors, points = model.view_vectors(small, seen[1].camera_from_world, (0.3,))
    assert vectors.shape == (small.height * small.width, 1, 3) and points.shape == (len(vectors), 3)
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=2), 1.0, atol=1e-4)


def test_what_adjustment_gives_back_is_a_share_of_what_drift_costs(tmp_path: Path) -> None:
    def shown(psnr: float) -> legs.Splatted:
        return legs.Splatted(psnr, 0.9, 0.05, 1000, 100, 30.0, True)

    quality = {"30s": (30.0, 26.0), "drifting": (24.0, 22.0), "mended": (28.0, 25.0)}
    records = {
        Trial("ours", f"rooms/{part}", room): shown(psnr)
        for part, found in quality.items()
        for room, psnr in zip(("kitchen-1", "office-1"), found, strict=True)
    }
    records[Trial("ours", "rooms/mended", "room-1")] = shown(1.0)  # its others were not measured
    bench = Bench(tmp_path, legs.LegsParameters(), quick=True)
    (found,) = legs.regained(Results(legs.EXPERIMENT, bench, records)).items()
    assert found[0] == "ours/rooms/mended/regained" and found[1] is not None
    assert found[1].value == pytest.approx((4 + 3) / (6 + 4))


def test_lerf_begins_when_all_pictures_are_there(shown: Shown) -> None:
    learner = legs.Volume()
    first, *rest = views(shown[1])
    learner.add(first, last=False)
    assert learner.at_once and learner.model is None and learner.steps == 0
    for view in rest:
        learner.add(view, last=view is rest[-1])
    assert learner.model is not None and len(learner.model.views) == 3
