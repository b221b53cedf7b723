"""Stereo pairs in folders: rectified, with doffs, unrectified, side by side; and the real pairs."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.layouts.images.reader import depth_of_disparity
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.kit.geometry.cameras import intrinsic_matrix, project
from scenewright.stages.kit.geometry.transforms import inverse, transform_from

from tests.real_data import real_data
from tests.unit.ingest.depth_array_writing import write_pfm
from tests.unit.ingest.loading import loaded_frames
from tests.unit.ingest.tiny_room import png

LEFT = Camera(width=320, height=240, fx=300.0, fy=300.0, cx=158.0, cy=121.0)
BASELINE = 0.12
POINTS = np.array([[-0.5, 0.3, 2.0], [0.1, -0.4, 1.5], [0.6, 0.35, 2.5], [-0.1, 0.05, 1.2]])
"""In the left camera [m]."""


def spots(camera: Camera, points_in_camera: np.ndarray) -> np.ndarray:
    """Return a picture (H, W, 3) uint8 with a soft spot where each point is seen."""
    v, u = np.mgrid[: camera.height, : camera.width]
    picture = np.zeros((camera.height, camera.width))
    for x, y in project(points_in_camera, camera)[0]:
        picture += 250 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 2.0**2))
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def place_of_spot(picture: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return the (2,) pixel around which the spot near (x, y) lies."""
    v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
    near = np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 5.0**2)) * picture[..., 0].astype(float)
    return np.array([(near * u).sum(), (near * v).sum()]) / near.sum()


def check_pair(
    log: Path, left_from_camera: np.ndarray | None = None, tolerance: float = 0.1, **options: object
) -> None:
    """Every point is seen in the right picture fx * baseline / z further left, in the same row."""
    source, found = loaded_frames(log, **options)
    camera, baseline = source.camera, source.cameras[0].baseline
    assert baseline == pytest.approx(BASELINE, rel=1e-6)
    points = POINTS if left_from_camera is None else POINTS @ inverse(left_from_camera)[:3, :3].T
    for (x, y), z in zip(*project(points, camera), strict=True):
        left, right = (
            place_of_spot(found[0].color, x, y),
            place_of_spot(found[0].right, x - camera.fx * baseline / z, y),
        )
        np.testing.assert_allclose(left, [x, y], atol=tolerance)
        np.testing.assert_allclose(left - right, [camera.fx * baseline / z, 0], atol=tolerance)


def in_right(points: np.ndarray, left_from_right: np.ndarray) -> np.ndarray:
    """Return the points in the right camera."""
    right_from_left = inverse(left_from_right)
    return points @ right_from_left[:3, :3].T + right_from_left[:3, 3]


STRAIGHT = transform_from(np.eye(3), np.array([BASELINE, 0.0, 0.0]))


def write_pair(root: Path, left: np.ndarray, right: np.ndarray, names: tuple[str, str] = ("left", "right")) -> Path:
    """Write one pair into two folders."""
    for name, picture in zip(names, (left, right), strict=True):
        (root / name).mkdir(parents=True)
        (root / name / "000000.png").write_bytes(png(picture))
    return root


def test_middlebury_pair_with_offset_of_the_principal_points(tmp_path: Path) -> None:
    right_camera = LEFT.model_copy(update={"cx": LEFT.cx + 21.25})
    (tmp_path / "im0.png").write_bytes(png(spots(LEFT, POINTS)))
    (tmp_path / "im1.png").write_bytes(png(spots(right_camera, in_right(POINTS, STRAIGHT))))
    matrix = "[{0.fx} 0 {0.cx}; 0 {0.fy} {0.cy}; 0 0 1]"
    lines = ["cam0=" + matrix.format(LEFT), "cam1=" + matrix.format(right_camera), "doffs=21.25", "baseline=120"]
    (tmp_path / "calib.txt").write_text("\n".join([*lines, "width=320", "height=240", "ndisp=80"]))
    disparity = np.full((240, 320), LEFT.fx * BASELINE / 1.25 - 21.25)
    disparity[:10] = np.inf
    write_pfm(tmp_path / "disp0.pfm", disparity)
    check_pair(tmp_path)
    source, found = loaded_frames(tmp_path)
    assert source.camera == LEFT and "doffs 21.25" in " ".join(source.notes)
    assert (found[0].depth[10:] == 1250).all() and (found[0].depth[:10] == 0).all()


@pytest.mark.parametrize("first", [0, 2])
def test_kitti_pair(tmp_path: Path, first: int) -> None:
    names = (f"image_{first}", f"image_{first + 1}")
    log = write_pair(tmp_path / "log", spots(LEFT, POINTS), spots(LEFT, in_right(POINTS, STRAIGHT)), names)
    lines = []
    for number in range(4):
        shift = -LEFT.fx * (BASELINE * (number % 2) - 0.06 * (number // 2))
        row = [LEFT.fx, 0, LEFT.cx, shift, 0, LEFT.fy, LEFT.cy, 0, 0, 0, 1, 0]
        lines.append(f"P{number}: " + " ".join(f"{value:.12e}" for value in row))
    (log / "calib.txt").write_text("\n".join(lines))
    (log / "poses.txt").write_text("1 0 0 5 0 1 0 6 0 0 1 7\n")
    (log / "times.txt").write_text("1.5\n")
    check_pair(log)
    (entry,) = open_log(log, IngestParameters()).entries
    assert entry.time == 1.5
    # Camera 2 stands 6 cm to the left of camera 0, whose pose the data set states.
    np.testing.assert_allclose(entry.world_from_camera[:3, 3], [5 - 0.06 * (first // 2), 6, 7], atol=1e-9)


def _opencv_file(
    path: Path, left: Camera, right: Camera, left_from_right: np.ndarray, unit: float, *lens: float
) -> None:
    right_from_left = inverse(left_from_right)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (
        ("M1", intrinsic_matrix(left)),
        ("D1", np.array([[*lens, 0.0]])),
        ("M2", intrinsic_matrix(right)),
        ("D2", np.zeros((1, 5))),
        ("R", right_from_left[:3, :3]),
        ("T", right_from_left[:3, 3:] * unit),
    ):
        storage.write(name, np.asarray(value, dtype=float))
    storage.release()


def test_unrectified_pair_is_rectified(tmp_path: Path) -> None:
    turn = cv2.Rodrigues(np.array([0.02, -0.05, 0.015]))[0]
    offset = np.array([BASELINE, 0.006, -0.004])
    left_from_right = transform_from(turn, offset * BASELINE / np.linalg.norm(offset))
    right_camera = Camera(width=320, height=240, fx=310.0, fy=308.0, cx=165.0, cy=118.0)
    log = write_pair(tmp_path / "log", spots(LEFT, POINTS), spots(right_camera, in_right(POINTS, left_from_right)))
    _opencv_file(log / "calibration.yaml", LEFT, right_camera, left_from_right, 1.0, 0, 0, 0, 0)
    source, found = loaded_frames(log)
    camera, baseline = source.camera, source.cameras[0].baseline
    assert baseline == pytest.approx(BASELINE, rel=1e-6) and "rectified" in " ".join(source.notes)
    from scenewright.stages.ingest.stereo import rectifying_rotation

    points = POINTS @ rectifying_rotation(left_from_right).T
    for (x, y), z in zip(*project(points, camera), strict=True):
        left = place_of_spot(found[0].color, x, y)
        right = place_of_spot(found[0].right, x - camera.fx * baseline / z, y)
        np.testing.assert_allclose(left, [x, y], atol=0.15)
        np.testing.assert_allclose(left - right, [camera.fx * baseline / z, 0], atol=0.15)


@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_side_by_side_pictures(tmp_path: Path, unit: float) -> None:
    (tmp_path / "images").mkdir()
    both = np.concatenate([spots(LEFT, POINTS), spots(LEFT, in_right(POINTS, STRAIGHT))], axis=1)
    (tmp_path / "images" / "0.png").write_bytes(png(both))
    _opencv_file(tmp_path / "calibration.yaml", LEFT, LEFT, STRAIGHT, unit, 0, 0, 0, 0)
    check_pair(tmp_path)
    notes = " ".join(open_log(tmp_path, IngestParameters()).notes)
    assert "side by side" in notes and ("taken as millimetres" in notes) == (unit == 1000)


@pytest.mark.parametrize(("unit", "metres"), [(1.0, 0.06), (1000.0, 0.06), (100.0, None), (50.0, 0.003)])
def test_a_baseline_in_a_unit_that_is_not_clear_is_asked_for(tmp_path: Path, unit: float, metres: float | None) -> None:
    apart = transform_from(np.eye(3), np.array([0.06, 0, 0]))
    log = write_pair(tmp_path / "log", spots(LEFT, POINTS), spots(LEFT, in_right(POINTS, apart)))
    _opencv_file(log / "calibration.yaml", LEFT, LEFT, apart, unit, 0, 0, 0, 0)
    if metres is None:
        with pytest.raises(BadInput, match="baseline is 6, too long for metres") as error:
            open_log(log, IngestParameters())
        assert "--baseline 0.06 if it is in centimetres, --baseline 0.006 if in millimetres" in str(error.value.hint)
    else:
        assert open_log(log, IngestParameters()).cameras[0].baseline == pytest.approx(metres)
    assert open_log(log, IngestParameters(baseline=0.06)).cameras[0].baseline == 0.06


def test_left_and_right_files_of_one_camera_each(tmp_path: Path) -> None:
    log = write_pair(tmp_path / "log", spots(LEFT, POINTS), spots(LEFT, in_right(POINTS, STRAIGHT)))
    for name, shift in (("left", 0.0), ("right", -LEFT.fx * BASELINE)):
        matrix = [LEFT.fx, 0, LEFT.cx, 0, LEFT.fy, LEFT.cy, 0, 0, 1]
        projection = [LEFT.fx, 0, LEFT.cx, shift, 0, LEFT.fy, LEFT.cy, 0, 0, 0, 1, 0]
        (log / f"{name}.yaml").write_text(
            f"image_width: 320\nimage_height: 240\ncamera_matrix: {{rows: 3, cols: 3, data: {matrix}}}\n"
            f"distortion_model: plumb_bob\ndistortion_coefficients: {{data: [0, 0, 0, 0, 0]}}\n"
            f"rectification_matrix: {{data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}\nprojection_matrix: {{data: {projection}}}\n"
        )
    check_pair(log)


def test_kalibr_camchain(tmp_path: Path) -> None:
    log = write_pair(tmp_path / "log", spots(LEFT, POINTS), spots(LEFT, in_right(POINTS, STRAIGHT)))
    numbers = f"[{LEFT.fx}, {LEFT.fy}, {LEFT.cx}, {LEFT.cy}]"
    k = f"intrinsics: {numbers}\n  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [320, 240]"
    (log / "camchain.yaml").write_text(f"cam0:\n  {k}\ncam1:\n  {k}\n  T_cn_cnm1: {inverse(STRAIGHT).tolist()}\n")
    check_pair(log)


def test_pairs_that_are_none(tmp_path: Path) -> None:
    log = write_pair(tmp_path / "log", spots(LEFT, POINTS), spots(LEFT, POINTS))
    with pytest.raises(BadInput, match="--fx"):
        open_log(log, IngestParameters())
    (log / "intrinsics.txt").write_text("300 300 158 121")
    with pytest.raises(BadInput, match="of one camera, the images are pairs"):
        open_log(log, IngestParameters())
    (log / "intrinsics.txt").unlink()
    _opencv_file(log / "calibration.yaml", LEFT, LEFT, inverse(STRAIGHT), 1.0, 0, 0, 0, 0)
    with pytest.raises(BadInput, match="seem to be swapped.*do not tell"):
        open_log(log, IngestParameters())
    _opencv_file(log / "calibration.yaml", LEFT, LEFT, np.eye(4), 1.0, 0, 0, 0, 0)
    with pytest.raises(BadInput, match="no baseline"):
        open_log(log, IngestParameters())
    _opencv_file(log / "calibration.yaml", LEFT, LEFT, STRAIGHT, 1.0, 0, 0, 0, 0)
    with pytest.raises(UsageError, match="--fx cannot describe a stereo pair"):
        open_log(log, IngestParameters(fx=200.0))


def test_depth_of_disparity_is_the_closed_form() -> None:
    disparity = np.array([[10.0, 0.0, -5.0, np.inf, np.nan]])
    depth = depth_of_disparity(disparity, LEFT, 0.193001, 31.086)
    np.testing.assert_allclose(depth[0], [300 * 0.193001 / 41.086, 0, 0, 0, 0], rtol=1e-6)


# --- real pairs ------------------------------------------------------------------------------------------------


def test_real_middlebury_pair(tmp_path: Path) -> None:
    """Depth of the ground truth is f B / (d + doffs), and the pictures agree with it after the shift."""
    folder = real_data("middlebury_motorcycle")
    for name, eye in (("im0", "left"), ("im1", "right")):
        shutil.copy(folder / f"motorcycle_{eye}.png", tmp_path / f"{name}.png")
    disparity = np.load(folder / "motorcycle_disp.npz", allow_pickle=False)["arr_0"]
    write_pfm(tmp_path / "disp0.pfm", disparity)
    focal, center, offset, baseline = 994.978, (311.193, 254.877), 31.086, 193.001
    (tmp_path / "calib.txt").write_text(
        f"cam0=[{focal} 0 {center[0]}; 0 {focal} {center[1]}; 0 0 1]\n"
        f"cam1=[{focal} 0 {center[0] + offset}; 0 {focal} {center[1]}; 0 0 1]\n"
        f"doffs={offset}\nbaseline={baseline}\nwidth=741\nheight=500\n"
    )
    source, (frame,) = loaded_frames(tmp_path)
    known = np.isfinite(disparity) & (disparity > 0)
    expected = focal * baseline / (disparity[known] + offset)  # [mm]
    assert np.abs(frame.depth[known] - expected).max() <= 0.51 and (frame.depth[~known] == 0).all()
    assert source.cameras[0].baseline == pytest.approx(0.193001)
    # The right picture, moved: what is at u in the left is at u - f B / Z in it.
    v, u = np.mgrid[:500, :741].astype(np.float32)
    depth = np.where(known, frame.depth / 1000, 1.0)
    right = cv2.remap(frame.right, (u - focal * 0.193001 / depth).astype(np.float32), v, cv2.INTER_LINEAR)
    difference = np.abs(right.astype(int) - frame.color).mean(axis=2)
    assert np.median(difference[known]) < 6
    unmoved = cv2.remap(frame.right, (u - np.where(known, disparity, 0)).astype(np.float32), v, cv2.INTER_LINEAR)
    assert np.median(np.abs(unmoved.astype(int) - frame.color).mean(axis=2)[known]) > 12  # without doffs: elsewhere


def test_real_surgical_video() -> None:
    """Both eyes of the endoscope: rows agree to a fraction of a pixel, tissue is 5 to 16 cm away."""
    folder = real_data("surgt_stereo")
    source = open_log(folder, IngestParameters())
    assert len(source.entries) == 10 and source.camera.width == 1280 and source.camera.height == 1024
    baseline = source.cameras[0].baseline
    assert baseline == pytest.approx(4.1435e-3, rel=1e-3)
    frame = source.entries[4].load()
    again = source.entries[4].load()
    np.testing.assert_array_equal(frame.color, again.color)
    source.close()
    detector = cv2.SIFT_create(1500)
    keys, descriptors = zip(
        *(detector.detectAndCompute(image, None) for image in (frame.color, frame.right)), strict=True
    )
    pairs = cv2.BFMatcher(crossCheck=True).match(*descriptors)
    best = sorted(pairs, key=lambda pair: pair.distance)[:150]
    offsets = np.array([np.subtract(keys[0][p.queryIdx].pt, keys[1][p.trainIdx].pt) for p in best])
    assert np.median(np.abs(offsets[:, 1])) < 1.0
    depth = source.camera.fx * baseline / np.median(offsets[:, 0])
    assert 0.05 < depth < 0.16
