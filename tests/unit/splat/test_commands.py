"""`splat build` and `splat render` on a small rendered log, and what they say to bad input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.trajectories import read_tum, write_tum
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.stage import Context
from scenewright.stages.splat import build_stage, render_stage
from scenewright.stages.splat.parameters import BuildParameters, RenderParameters
from scenewright.stages.splat.ply import COLUMNS, read_gaussians, write_gaussians
from scenewright.stages.splat.triangulation import with_points
from scenewright.stages.splat.turntable import opened, turn
from scenewright.stages.splat.views import posed_frames, read_view

from tests.unit.poses.textured_room import round_walk, write_sequence
from tests.unit.report.test_report import parse, report

WALK = round_walk(49)[:13]


def context(folder: Path, device: str = "cpu") -> Context:
    folder.mkdir(parents=True)
    return Context(folder, seed=3, device=device, progress=SilentProgress())


def build(sequence: Sequence, out: Path, trajectory: Trajectory | None = None, **options: object) -> Splat:
    given = {"width": 80, "steps": 30, "steps_per_second": 10.0, "hold_out_every": 4, **options}
    parameters = BuildParameters.model_validate(given)
    return build_stage.run(sequence, trajectory, parameters=parameters, context=context(out))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sequence, Splat]:
    folder = tmp_path_factory.mktemp("splat")
    sequence = write_sequence(folder / "sequence", WALK, with_pose=True, blank=(5,))
    return sequence, build(sequence, folder / "splat", refine_poses=True)


def test_a_splat_says_what_became_of_every_picture(made: tuple[Sequence, Splat]) -> None:
    built = made[1].built
    uses = [view.use for view in built.views]
    assert uses.count("held_out") == 3 and uses[5] == "dark" and uses.count("learned") == 9
    assert built.steps == 42 and built.gaussians > 500 and built.refined
    assert [view.arrived for view in built.views][:5] == [0, 1, None, 3, 4]
    moved = [view.moved for view in built.views if view.moved is not None]
    assert len(moved) == 9 and moved[0] == 0.0 and 0 < max(moved) < 0.1


def test_the_path_can_be_read_as_a_trajectory(made: tuple[Sequence, Splat]) -> None:
    times, poses = read_tum(made[1].path("trajectory.tum"))
    np.testing.assert_allclose(times, 0.1 * np.arange(13), atol=1e-6)
    assert 0 < np.abs(poses[:, :3, 3] - WALK[:, :3, 3]).max() < 0.1
    assert issubclass(Splat, Trajectory)


def test_the_file_is_one_that_others_read(made: tuple[Sequence, Splat], tmp_path: Path) -> None:
    gaussians = read_gaussians(made[1].path("splat.ply"))
    other = trimesh.load(made[1].path("splat.ply"), process=False)
    np.testing.assert_allclose(other.vertices, gaussians.means)
    data = other.metadata["_ply_raw"]["vertex"]
    assert tuple(data["properties"]) == COLUMNS
    np.testing.assert_allclose(np.asarray(data["data"]["f_rest_15"]).ravel(), gaussians.harmonics[:, 1, 1])
    np.testing.assert_allclose(np.asarray(data["data"]["rot_0"]).ravel(), gaussians.quaternions[:, 0])
    write_gaussians(tmp_path / "again.ply", gaussians)
    np.testing.assert_array_equal(read_gaussians(tmp_path / "again.ply").harmonics, gaussians.harmonics)


def test_pictures_are_compared(made: tuple[Sequence, Splat], tmp_path: Path) -> None:
    sequence, splat = made
    parameters = RenderParameters(pictures=1, turntable=4)
    views = render_stage.run(splat, sequence, parameters=parameters, context=context(tmp_path / "views"))
    assert views.outcome == "ok" and [view.frame for view in views.info.views] == [2, 6, 10]
    assert views.info.psnr > 12 and 0 < (views.info.depth_error or 0) < 0.2
    assert len(list(views.path("pictures").iterdir())) == 1
    with Image.open(views.path("turntable.gif")) as moving, Image.open(views.path("turntable.png")) as sheet:
        assert getattr(moving, "n_frames", 0) == 4 and sheet.size == (960, 720)
        shown = [np.asarray(moving.convert("RGB"), float) for k in range(4) if moving.seek(k) is None]
    page = report(tmp_path / "report", splat_views=views)
    assert page.summary["pictures"] == 2 and "3 pictures beside" in parse(page.path("report.html").read_text()).text
    assert all((picture.mean(axis=2) < 250).mean() > 0.05 for picture in shown)
    assert np.abs(shown[0] - shown[2]).mean() > 1
    all_views = render_stage.run(
        splat,
        sequence,
        parameters=RenderParameters(views="all", pictures=0, turntable=0),
        context=context(tmp_path / "all"),
    )
    assert len(all_views.info.views) == 12


def test_what_is_higher_than_the_cameras_is_left_out_of_the_turn(made: tuple[Sequence, Splat]) -> None:
    gaussians = read_gaussians(made[1].path("splat.ply"))
    height = float(np.median(gaussians.means[:, 2]))
    kept = opened(gaussians, np.array([[0.0, 0.0, height]]))
    assert 0 < len(kept) < len(gaussians) and kept.means[:, 2].max() <= height
    assert len(opened(gaussians, np.array([[0.0, 0.0, -99.0]]))) > len(kept)


def test_a_single_gaussian_turns_too(made: tuple[Sequence, Splat]) -> None:
    one = read_gaussians(made[1].path("splat.ply")).taken(np.array([0]))
    (picture,) = turn(opened(one, np.zeros((1, 3))), CompiledRasterizer(), 1)
    assert picture.shape == (360, 480, 3)


def test_the_same_seed_gives_the_same_bytes(made: tuple[Sequence, Splat], tmp_path: Path) -> None:
    again = build(made[0], tmp_path / "again", refine_poses=True)
    for name in ("splat.ply", "trajectory.tum", "splat.json"):
        assert again.path(name).read_bytes() == made[1].path(name).read_bytes()


def test_a_splat_without_held_out_views_is_an_empty_comparison(made: tuple[Sequence, Splat], tmp_path: Path) -> None:
    splat = build(made[0], tmp_path / "splat", hold_out_every=0, steps=0)
    views = render_stage.run(splat, made[0], parameters=RenderParameters(), context=context(tmp_path / "views"))
    assert views.outcome == "empty"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"with_pose": False}, "0 frames have a pose"),
        ({"with_pose": True, "with_color": False}, "no colour"),
        ({"with_pose": True, "blank": range(13)}, "all 10 pictures are dark"),
    ],
)
def test_bad_input_is_said_in_one_line(options: dict[str, object], message: str, tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence", WALK, **options)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match=message):
        build(sequence, tmp_path / "splat")
    assert not list((tmp_path / "splat").iterdir())


def test_pictures_alone_give_points_where_the_depth_is(tmp_path: Path) -> None:
    """Points lie where the measured depth says, to a few hundredths of it: pixels are few and steps short here."""
    sequence = write_sequence(tmp_path / "sequence", round_walk(49)[:24:3], with_pose=True)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        posed = posed_frames(reader, sequence, None)
        views = [view for frame, pose in posed if (view := read_view(reader, frame, pose, 320)) is not None]
    found = with_points([replace(view, depth=None) for view in views], seed=0)
    errors = []
    for view, made_up in zip(views, found, strict=True):
        assert view.depth is not None and made_up.depth is not None
        seen = (made_up.depth > 0) & (view.depth > 0)
        errors.append(np.abs(made_up.depth[seen] / view.depth[seen] - 1))
    assert sum(map(len, errors)) > 100 and np.median(np.concatenate(errors)) < 0.05


def test_pictures_that_do_not_overlap_are_said_in_one_line(tmp_path: Path) -> None:
    sequence = write_sequence(tmp_path / "sequence", round_walk(49)[::24], with_pose=True, with_depth=False)
    with pytest.raises(BadInput, match="no feature is seen from two places"):
        build(sequence, tmp_path / "splat", width=160)


def test_a_path_of_another_log_is_refused(made: tuple[Sequence, Splat], tmp_path: Path) -> None:
    (tmp_path / "path").mkdir()
    write_tum(tmp_path / "path" / "trajectory.tum", 100.0 + np.arange(3), WALK[:3])
    with pytest.raises(BadInput, match="none of its 3 poses is of one of the 13 frames.*100 s after the frames"):
        build(made[0], tmp_path / "splat", Trajectory(tmp_path / "path"))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda data: data[:-4], "torn"),
        (lambda data: b"ply\n" + data, "no PLY"),
        (lambda data: data.replace(b"f_dc_0", b"f_dc_9"), "no PLY"),
        (lambda data: data[:-4] + np.float32(np.nan).tobytes(), "not a number"),
        (lambda data: b"", "no PLY"),
    ],
)
def test_damaged_files_are_refused(made: tuple[Sequence, Splat], damage, message: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "splat.ply"
    path.write_bytes(damage(made[1].path("splat.ply").read_bytes()))
    with pytest.raises(BadInput, match=message):
        read_gaussians(path)
