"""A fault that is planted into a good log is named; a good log is called ready."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenewright.stages.ingest.preflight.page import render
from scenewright.stages.ingest.preflight.report import InspectionReport
from scenewright.stages.ingest.source import Entry, LoadedFrame, LogSource, SourceCamera, Unusable

from benchmarks.experiments.preflight.faults import FAULTS, doubled, on_poses, scaled_depth, shifted_color, stretched
from tests.unit.ingest.preflight.textured_room import CAMERA, inspected, source, walk

COUNT = 48
FLIPS = [
    "inverse poses",
    "OpenGL axes",
    "OpenGL view matrices",
    "ROS body axes",
    "left-handed",
    "quaternion w first",
    "translations x10",
    "translations /10",
    "translations x1000",
    "OpenGL and mm",
]


def report_of(what: LogSource) -> InspectionReport:
    return inspected(what).report


def first(report: InspectionReport, check: str) -> str:
    return next(f"{f.severity}: {f.message} -> {f.fix}" for f in report.findings if f.check == check)


def test_good_log_is_ready() -> None:
    report = report_of(source(COUNT))
    camera = report.cameras[0]
    assert report.verdict == "ready", report.findings
    assert (report.reason, report.fix) == ("", "")
    assert camera.poses.verdict == "agree" and camera.poses.hypotheses[0].residual < 0.01
    assert camera.poses.scale_fit == pytest.approx(1, abs=0.03)
    assert camera.registration.checked and camera.registration.score > 1.4
    assert camera.registration.lag_frames == pytest.approx(0, abs=0.3)
    assert camera.depth is not None and camera.depth.plausible and camera.depth.step == 0.001
    assert {step.step for step in report.steps if step.ready} >= {"ingest", "segment", "fuse", "run reconstruct"}


@pytest.mark.parametrize("name", FLIPS)
def test_poses_in_another_convention_are_named(name: str) -> None:
    plant, named = FAULTS[name]
    report = report_of(plant(source(COUNT)))
    assert report.verdict == "wasted" and named(report.cameras[0]), report.cameras[0].poses
    assert "contradict depth" in report.reason and "they agree" in report.reason
    assert "--pose-convention" in report.fix or "--pose-scale" in report.fix


def test_advice_undoes_the_fault() -> None:
    """The option that is advised, given to the pre-flight itself, makes the log ready."""
    plant, _ = FAULTS["OpenGL and mm"]
    broken = plant(source(COUNT))
    words = report_of(broken).fix.partition(" (")[0].split()
    assert words[:2] == ["ingest", "with"]
    names = [word.removeprefix("--").replace("-", "_") for word in words[2::2]]
    settings = [f"{name}={value}" for name, value in zip(names, words[3::2], strict=True)]
    assert inspected(broken, 26, *settings).report.verdict == "ready"


@pytest.mark.parametrize(("factor", "advised"), [(5.0, 5000), (0.2, 200), (10.0, 10000)])
def test_depth_units_are_named(factor: float, advised: int) -> None:
    report = report_of(scaled_depth(factor)(source(COUNT)))
    assert report.verdict == "wasted" and report.cameras[0].depth is not None
    assert report.cameras[0].depth.factor == pytest.approx(1 / factor, rel=0.05)
    assert report.reason.startswith("depth unit") and f"--depth-scale {advised}" in report.fix


def test_implausible_depth_without_poses() -> None:
    report = report_of(scaled_depth(10)(source(COUNT, posed=False)))
    assert report.verdict == "wasted" and report.reason.startswith("depth unit: the median depth is 2")
    assert report.fix.startswith("ingest with --depth-scale 10000 (2")


@pytest.mark.parametrize("frames", [3, -2])
def test_colour_shifted_in_time(frames: int) -> None:
    report = report_of(shifted_color(frames)(source(COUNT)))
    registration = report.cameras[0].registration
    assert report.verdict == "doubtful" and registration.lag_decisive
    assert registration.lag_frames == pytest.approx(frames, abs=0.5)
    assert ("late" if frames > 0 else "early") in first(report, "registration")
    assert registration.lag_frames is not None and f"({abs(registration.lag_frames) / 10:.3f} s)" in report.reason


def test_colour_shifted_in_space() -> None:
    def rolled(frame):
        return replace(frame, color=np.roll(frame.color, (0, 9), axis=(0, 1)))

    good = source(COUNT)
    moved = replace(good, entries=tuple(replace(e, load=lambda e=e: rolled(e.load())) for e in good.entries))
    report = report_of(moved)
    assert report.cameras[0].registration.offset == pytest.approx((9, 0), abs=1)
    assert "not registered" in first(report, "registration")


def test_poses_late() -> None:
    plant, named = FAULTS["poses 3 frames late"]
    report = report_of(plant(source(COUNT)))
    assert report.verdict == "doubtful" and named(report.cameras[0])
    assert "late against depth" in first(report, "poses")


def test_wrong_intrinsics() -> None:
    plant, named = FAULTS["focal length x1.3"]
    report = report_of(plant(source(COUNT)))
    assert named(report.cameras[0]) and "focal length" in first(report, "calibration")
    other = replace(source(COUNT), cameras=(SourceCamera("camera", CAMERA.model_copy(update=doubled(CAMERA))),))
    report = report_of(other)
    assert report.verdict == "wasted" and "for 320x240" in first(report, "calibration")
    assert "--fx 130" in first(report, "calibration")


def test_frozen_poses_contradict_a_moving_camera() -> None:
    plant, named = FAULTS["poses frozen"]
    report = report_of(plant(source(COUNT)))
    assert report.verdict == "wasted" and named(report.cameras[0])


def test_noise_is_no_flip() -> None:
    plant, _ = FAULTS["poses with 10 cm noise"]
    report = report_of(plant(source(COUNT)))
    assert report.verdict != "ready" and not report.cameras[0].poses.decisive


def test_camera_that_stands_still_cannot_be_judged() -> None:
    still = np.tile(walk(2)[:1], (COUNT, 1, 1))
    report = report_of(source(COUNT, poses=still))
    assert report.cameras[0].poses.verdict == "not checked"
    assert "too little motion" in report.cameras[0].poses.detail
    assert report.verdict != "wasted"


def test_one_jump_is_found_where_it_is() -> None:
    good = source(COUNT)
    entries = list(good.entries)
    for index in range(30, COUNT):
        pose = entries[index].world_from_camera.copy()
        pose[:3, 3] += 10
        entries[index] = replace(entries[index], world_from_camera=pose)
    report = report_of(replace(good, entries=tuple(entries)))
    motion = report.cameras[0].motion
    assert motion is not None and motion.jumps == 1 and motion.jump_times[0] == pytest.approx(5.0 + 29 / 10)
    assert report.verdict == "doubtful"


def test_mirrored_poses_are_told_from_other_matrices() -> None:
    mirrored = on_poses(lambda pose: pose @ np.diag([1.0, -1, 1, 1]))(source(COUNT))
    report = report_of(mirrored)
    assert report.verdict == "wasted" and "mirrored" in report.reason and report.frames.selected == 0
    scaled = on_poses(lambda pose: pose @ np.diag([0.4, 0.4, 0.4, 1.0]))(source(COUNT))
    assert "scale of 0.4" in report_of(scaled).reason


def test_colour_only_log_is_judged_by_features() -> None:
    camera = CAMERA.model_copy(update={"width": 320, "height": 240, "fx": 260.0, "fy": 260.0, "cx": 159.5, "cy": 119.5})
    textured = source(16, camera=camera, depth=False, speckled=True)
    report = report_of(textured)
    poses = report.cameras[0].poses
    assert (poses.method, poses.verdict) == ("epipolar", "agree"), poses
    assert report.verdict == "wasted" and "no depth and no stereo" in report.reason
    plant, named = FAULTS["inverse poses"]
    assert named(report_of(plant(textured)).cameras[0])
    assert report_of(on_poses(stretched(1000))(textured)).cameras[0].poses.verdict == "agree"  # length is not seen


def test_stereo_pair_is_judged_by_its_depth() -> None:
    camera = CAMERA.model_copy(update={"width": 320, "height": 240, "fx": 260.0, "fy": 260.0, "cx": 159.5, "cy": 119.5})
    pair = source(7, camera=camera, depth=False, right=0.12, speckled=True)
    report = inspected(pair, 7).report
    seen = report.cameras[0]
    assert seen.poses.method == "depth" and seen.poses.verdict == "agree", seen.poses
    assert seen.stereo is not None and seen.stereo.checked and seen.stereo.positive_share > 0.9
    assert report.verdict == "doubtful" and "stereo pair" in report.reason

    def swapped(frame):
        return replace(frame, color=frame.right, right=frame.color)

    crossed = replace(pair, entries=tuple(replace(e, load=lambda e=e: swapped(e.load())) for e in pair.entries))
    assert "swapped" in first(inspected(crossed, 7).report, "stereo")


def test_the_same_log_gives_the_same_report() -> None:
    plant, _ = FAULTS["OpenGL axes"]
    texts = {inspected(plant(source(16))).report.model_dump_json() for _ in range(2)}
    assert len(texts) == 1


def test_several_cameras_are_judged_one_by_one() -> None:
    good = source(30)
    flipped = FAULTS["inverse poses"][0](source(30))
    both = replace(
        good,
        cameras=(SourceCamera("left", CAMERA), SourceCamera("back", CAMERA)),
        entries=tuple(
            replace(entry, camera_name=name)
            for pair in zip(good.entries, flipped.entries, strict=True)
            for entry, name in zip(pair, ("left", "back"), strict=True)
        ),
    )
    report = report_of(both)
    assert [camera.poses.verdict for camera in report.cameras] == ["agree", "contradict"]
    assert report.verdict == "wasted"
    assert next(f for f in report.findings if f.severity == "wasted").camera == "back"


def broken(entry: Entry, reason: str) -> Entry:
    def load():
        raise Unusable(reason)

    return replace(entry, load=load)


def test_unusable_frames_are_counted_by_reason() -> None:
    good = source(20)
    some = [broken(e, "undecodable_color") if k % 4 == 0 else e for k, e in enumerate(good.entries)]
    report = report_of(replace(good, entries=tuple(some)))
    assert report.frames.unusable == {"undecodable_color": 5} and report.verdict == "doubtful"
    report = report_of(replace(good, entries=tuple(broken(e, "no_valid_depth") for e in good.entries)))
    assert report.verdict == "wasted" and "no_valid_depth 20" in report.reason and "--depth-scale" in report.fix
    lost = [replace(e, problem="undecodable_message") if k % 3 else e for k, e in enumerate(good.entries)]
    report = report_of(replace(good, entries=tuple(lost)))
    assert report.verdict == "wasted" and report.frames.drops == {"undecodable_message": 13}


@pytest.mark.parametrize("count", [0, 1, 2, 3])
@pytest.mark.parametrize("options", [{}, {"posed": False}, {"depth": False}, {"color": False}], ids=str)
def test_short_and_incomplete_logs_never_crash(count: int, options: dict) -> None:
    found = inspected(source(count, **options), keep_pictures=True)
    assert found.report.frames.in_log == count
    if count == 0:
        assert found.report.verdict == "wasted" and "no frames" in found.report.reason


def test_damage_is_passed_on() -> None:
    report = report_of(source(COUNT, damage=("chunk 3: checksum", "torn end")))
    assert report.verdict == "doubtful" and "chunk 3" in report.reason and "1 more" in report.reason


def test_impossible_intrinsics_are_a_finding_not_an_error() -> None:
    mad = replace(source(20), cameras=(SourceCamera("camera", CAMERA.model_copy(update={"fx": 1e-3})),))
    report = report_of(mad)
    assert report.verdict == "wasted" and "focal length" in report.reason


@pytest.mark.parametrize("size", [(160, 120), (7, 5), (1, 1)], ids=str)
@pytest.mark.parametrize("kind", ["zero", "constant", "noise", "full"])
def test_pictures_of_nothing_never_crash(size: tuple[int, int], kind: str) -> None:
    """Constant, empty and random images, of any size, under good poses and under nonsense."""
    random = np.random.default_rng(0)
    shape = (size[1], size[0])
    camera = CAMERA.model_copy(update={"width": size[0], "height": size[1]})
    values = {
        "zero": lambda: np.zeros(shape, np.uint16),
        "constant": lambda: np.full(shape, 1500, np.uint16),
        "noise": lambda: random.integers(0, 65535, shape).astype(np.uint16),
        "full": lambda: np.full(shape, 65534, np.uint16),
    }
    poses = walk(9)
    poses[5:, :3, 3] *= 1e5
    entries = tuple(
        Entry(
            f"{k}",
            k / 10,
            poses[k],
            lambda: LoadedFrame((values[kind]() % 256).astype(np.uint8)[..., None].repeat(3, axis=2), values[kind]()),
        )
        for k in range(9)
    )
    what = LogSource("noise", "noise", (SourceCamera("camera", camera),), entries)
    found = inspected(what, keep_pictures=True)
    assert found.report.verdict != "ready"
    assert found.report.model_dump_json() and render(found)
