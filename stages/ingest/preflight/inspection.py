"""The pre-flight: open a log, look at some of its frames, say what a chain on it would come to."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.schemas.sequence import Sequence
from scenewright.stages.ingest.detection import log_format, open_log, refuse_logs_within
from scenewright.stages.ingest.foreign import refuse_lone_recording
from scenewright.stages.ingest.losses import ADVICE
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.pose_conventions import converted
from scenewright.stages.ingest.preflight.bits import bits_finding
from scenewright.stages.ingest.preflight.calibration import calibration_findings, calibration_report
from scenewright.stages.ingest.preflight.choice import Choice, choose
from scenewright.stages.ingest.preflight.depth import depth_findings, depth_report, units_per_metre
from scenewright.stages.ingest.preflight.drift import drift_findings, drift_report
from scenewright.stages.ingest.preflight.epipolar import FeaturePairs
from scenewright.stages.ingest.preflight.looking import Look, look_at_entry
from scenewright.stages.ingest.preflight.motion import motion_findings, motion_report
from scenewright.stages.ingest.preflight.pictures import picture_findings, picture_report
from scenewright.stages.ingest.preflight.pose_findings import pose_findings, rigidity_words
from scenewright.stages.ingest.preflight.poses import (
    BY_DEPTH,
    BY_FEATURES,
    LEAST_PAIRS,
    Candidate,
    PoseOutcome,
    check_poses,
)
from scenewright.stages.ingest.preflight.registration import check_registration, registration_findings
from scenewright.stages.ingest.preflight.report import (
    CameraReport,
    Finding,
    FramesReport,
    GravityReport,
    InspectionReport,
    PoseReport,
    Severity,
    Verdict,
    exact,
    significant,
)
from scenewright.stages.ingest.preflight.reprojection import DepthPairs
from scenewright.stages.ingest.preflight.sequence_source import sequence_source
from scenewright.stages.ingest.preflight.settings import ingest_parameters
from scenewright.stages.ingest.preflight.steps import step_reports
from scenewright.stages.ingest.preflight.stereo import stereo_findings, stereo_report, with_stereo_depth
from scenewright.stages.ingest.preflight.streams import all_streams, clock_lines, stream_findings, stream_reports
from scenewright.stages.ingest.preflight.units import Reading, readings, room_extent
from scenewright.stages.ingest.preflight.upright import gravity_findings, gravity_report
from scenewright.stages.ingest.registry import all_layouts
from scenewright.stages.ingest.selection import NOT_SELECTED, select
from scenewright.stages.ingest.source import Entry, LogSource, SourceCamera, Unusable
from scenewright.stages.ingest.stage import check_cameras
from scenewright.stages.kit.stage import Progress

LEAST_FRAMES = 12
"""Fewest frames that are looked at of a camera, however many cameras there are."""
HEAVY_LOSS, LOSS = 0.5, 0.1
"""Shares of the frames that are lost from which a log is wasted, and doubtful."""
NO_POSES = PoseReport(verdict="none", method="none", detail="the frames have no poses")
TAKEN = re.compile(r"WARNING: (.* taken .*) \((--.*)\)")
"""A warning of a reader that takes one thing for another, and the option that decides."""
SEVERITIES = ("wasted", "doubtful", "note")


@dataclass(frozen=True)
class CameraMaterial:
    """What the page draws from, for one camera."""

    looks: Mapping[int, Look]
    choice: Choice
    poses: np.ndarray | None
    """(N, 4, 4) of all selected frames."""
    outcome: PoseOutcome
    times: np.ndarray


@dataclass(frozen=True)
class Inspection:
    """The report, and what the page draws from."""

    report: InspectionReport
    cameras: tuple[CameraMaterial, ...]
    streams: tuple[tuple[str, np.ndarray], ...] = ()
    """(name, stamps [ns]) of the streams, for the time line."""


def inspect_log(
    path: Path, parameters: IngestParameters, count: int, progress: Progress, keep_pictures: bool = False
) -> Inspection:
    """Inspect a log, looking at about `count` of its frames. Raises BadInput when it cannot be opened at all."""
    _refuse_what_is_nothing(path, parameters)
    with progress.step("read the log"):
        source = open_log(path, parameters)
    try:
        return inspect_source(source, path, parameters, count, progress, keep_pictures)
    finally:
        source.close()


def _refuse_what_is_nothing(path: Path, parameters: IngestParameters) -> None:
    """People who meant an artifact should hear of artifacts."""
    if not (path.is_dir() and parameters.format == "auto"):
        return
    if not any(log_format(layout).matches(path) for layout in all_layouts()):
        refuse_logs_within(path)
        refuse_lone_recording(path)
        raise BadInput(
            f"{path}: not an artifact (no {MANIFEST_NAME}), and no log in a format that is known",
            hint="docs/LOGS.md describes the layouts",
        )


def inspect_sequence(sequence: Sequence, count: int, progress: Progress, keep_pictures: bool = False) -> Inspection:
    """Inspect a sequence artifact, with what ingest noted when it wrote it."""
    source = sequence_source(sequence)
    try:
        inspection = inspect_source(source, sequence.root, ingest_parameters(()), count, progress, keep_pictures)
    finally:
        source.close()
    info = sequence.info
    gravity = inspection.report.gravity.model_copy(
        update={"method": info.gravity.method, "detail": info.gravity.detail}
    )
    frames = inspection.report.frames.model_copy(update={"in_log": info.frames_in_log, "drops": dict(info.drops)})
    return replace(inspection, report=inspection.report.model_copy(update={"gravity": gravity, "frames": frames}))


def inspect_source(
    source: LogSource,
    path: Path,
    parameters: IngestParameters,
    count: int,
    progress: Progress,
    keep_pictures: bool = False,
) -> Inspection:
    """Inspect a source that is open already; `path` is for messages."""
    findings: list[Finding] = []
    try:
        check_cameras(source, path)
    except BadInput as error:
        message = error.message.removeprefix(f"{path}: ")
        findings.append(Finding(severity="wasted", check="calibration", message=message, fix=error.hint))
    selected, drops = select(source.entries, parameters, source.has_poses)
    selected = selected[: parameters.max_frames]
    by_camera = {
        source_camera.name: [e for e in selected if e.camera_name == source_camera.name]
        for source_camera in source.cameras
    }
    each = max(LEAST_FRAMES, count // max(len(source.cameras), 1)) if len(source.cameras) > 1 else count
    unusable: Counter[str] = Counter()
    materials: list[CameraMaterial] = []
    reports: list[CameraReport] = []
    for source_camera in source.cameras:
        material = _look(by_camera[source_camera.name], source_camera, each, progress, unusable, keep_pictures)
        with progress.step("compare the frames"):
            judged, outcome, camera_findings = _judge_camera(
                source_camera, by_camera[source_camera.name], material, source, parameters
            )
            misread = bits_finding(path, parameters, source_camera, material.looks)
        materials.append(replace(material, outcome=outcome))
        reports.append(judged)
        if misread is not None:  # what else depth seems to be wrong by follows from it
            blamed = ("depth", "poses", "registration")
            camera_findings = [misread, *(finding for finding in camera_findings if finding.check not in blamed)]
        findings += camera_findings
    frames = _frames_report(source, selected, drops, materials, unusable)
    streams = stream_reports(source)
    gravity = _gravity(source, parameters, reports, materials)
    has_poses = any(report.poses.verdict != "none" for report in reports)
    findings = [
        *_frame_findings(frames, source),
        *warning_findings(source),
        *_content_findings(reports, source),
        *findings,
        *stream_findings(streams, source.notes),
        *gravity_findings(gravity, has_poses),
    ]
    if len(source.cameras) == 1:
        findings = [finding.model_copy(update={"camera": ""}) for finding in findings]
    findings.sort(key=lambda finding: SEVERITIES.index(finding.severity))
    verdict: Verdict = "ready"
    if findings and findings[0].severity != "note":
        verdict = "wasted" if findings[0].severity == "wasted" else "doubtful"
    first = findings[0] if verdict != "ready" else None
    report = InspectionReport(
        path=str(path),
        format=source.format,
        rule=source.rule,
        verdict=verdict,
        reason=first.message if first else "",
        fix=first.fix if first else "",
        findings=tuple(findings),
        frames=frames,
        damage=source.damage,
        notes=source.notes,
        streams=streams,
        clocks=clock_lines(source),
        cameras=tuple(reports),
        other_cameras=source.other_cameras,
        gravity=gravity,
        steps=step_reports(_having(reports, source)),
    )
    stamps = tuple((stream.name, np.asarray(stream.stamps)) for stream in all_streams(source))
    return Inspection(report, tuple(materials), stamps)


def _look(
    entries: list[Entry],
    source_camera: SourceCamera,
    count: int,
    progress: Progress,
    unusable: Counter[str],
    keep_pictures: bool,
) -> CameraMaterial:
    """Choose frames of one camera and load them; what cannot be used is counted."""
    times = np.array([entry.time for entry in entries], dtype=float)
    posed = bool(entries) and all(entry.world_from_camera is not None for entry in entries)
    poses = np.array([entry.world_from_camera for entry in entries]) if posed else None
    choice = choose(times, poses, count)
    looks: dict[int, Look] = {}
    for index in progress.track(choice.frames, total=len(choice.frames), description=f"frames of {source_camera.name}"):
        try:
            looks[index] = look_at_entry(entries[index], index, source_camera.camera, keep_pictures)
        except Unusable as problem:
            unusable[problem.reason] += 1
    return CameraMaterial(looks, choice, poses, PoseOutcome(NO_POSES), times)


def _judge_camera(
    source_camera: SourceCamera,
    entries: list[Entry],
    material: CameraMaterial,
    source: LogSource,
    parameters: IngestParameters,
) -> tuple[CameraReport, PoseOutcome, list[Finding]]:
    looks, choice, poses = material.looks, material.choice, material.poses
    name, findings = source_camera.name, []
    units = units_per_metre(source.notes, parameters.depth_scale)
    interval = float(np.median(np.diff(material.times))) if len(material.times) > 1 else 0.0
    depth = depth_report(looks.values())
    stereo = stereo_report(looks, source_camera.baseline)
    outcome = _pose_outcome(source_camera, material, depth is not None)
    calibration = calibration_report(source_camera.camera)
    best, ways = outcome.report.best, []
    if best is not None and outcome.report.decisive:
        if best.focal_factor != 1:
            calibration = calibration.model_copy(update={"focal_fit": significant(best.focal_factor, 3)})
        only_scale = best.convention == "as-is" and best.translation_scale != 1
        if depth is not None and outcome.best is not None and best.translation_scale != 1:
            ways = _readings(outcome.best, material, units, depth.median)
            if only_scale and "depth_scale" in ways[0].changes:
                depth = depth.model_copy(update={"factor": exact(units / ways[0].depth_scale), "factor_by": "poses"})
    registration = check_registration(looks, choice.runs, source_camera.registered)
    pictures = picture_report(looks, choice.runs)
    motion = motion_report(poses, material.times, looks, choice.runs) if poses is not None else None
    findings += calibration_findings(calibration, source_camera.camera, name)
    if depth is not None:
        findings += depth_findings(depth, units, name, has_poses=poses is not None)
    if stereo is not None:
        findings += stereo_findings(stereo, name)
    if poses is not None:
        findings += pose_findings(
            outcome.report,
            ways,
            source_camera.camera,
            interval,
            name,
            convention=parameters.pose_convention,
            pose_scale=parameters.pose_scale,
        )
    if motion is not None:
        findings += motion_findings(motion, outcome.report.verdict == "agree", name)
    unregistered = registration_findings(registration, interval, name)
    findings += unregistered
    drift = None
    if poses is not None and not unregistered and (outcome.report.verdict, outcome.report.method) == ("agree", "depth"):
        drift = drift_report(poses, looks)
    if drift is not None:
        findings += drift_findings(drift, name)
    if pictures is not None:
        findings += picture_findings(pictures, name)
    have = {
        "color": pictures is not None,
        "depth": depth is not None,
        "right": stereo is not None,
        "labels": source.has_labels,
        "pose": poses is not None,
    }
    report = CameraReport(
        name=name,
        camera=source_camera.camera,
        registered=source_camera.registered,
        frames=len(entries),
        streams=tuple(stream for stream, present in have.items() if present),
        calibration=calibration,
        depth=depth,
        poses=outcome.report,
        registration=registration,
        pictures=pictures,
        motion=motion,
        drift=drift,
        stereo=stereo,
    )
    return report, outcome, findings


def _pose_outcome(source_camera: SourceCamera, material: CameraMaterial, has_depth: bool) -> PoseOutcome:
    """Check the poses by depth, else by depth from the stereo pair, else by colour."""
    if material.poses is None:
        return PoseOutcome(NO_POSES)
    looks, pairs = material.looks, material.choice.pairs
    if not has_depth and source_camera.baseline is not None and source_camera.baseline > 0:
        looks = {index: with_stereo_depth(look, source_camera.baseline) for index, look in looks.items()}
    by_depth = DepthPairs(looks, pairs)
    if len(by_depth) < LEAST_PAIRS:
        return check_poses(FeaturePairs(looks, pairs), material.poses, material.times, BY_FEATURES)
    outcome = check_poses(by_depth, material.poses, material.times, BY_DEPTH)
    if outcome.report.verdict in ("agree", "not checked") or outcome.report.decisive:
        return outcome
    colour = check_poses(FeaturePairs(looks, pairs), material.poses, material.times, BY_FEATURES).report
    changes = {
        "colour_verdict": colour.verdict,
        "colour_residual": colour.hypotheses[0].residual if colour.hypotheses else None,
    }
    return replace(outcome, report=outcome.report.model_copy(update=changes))


def _readings(best: Candidate, material: CameraMaterial, units: float, median_depth: float) -> list[Reading]:
    """Return how depth, read with `units` a metre, and translations may agree as a hypothesis says."""
    assert material.poses is not None
    poses = best.poses(material.poses)
    room = room_extent([(look, poses[index]) for index, look in material.looks.items()])
    return readings(best.scale, units, median_depth, room)


def _gravity(
    source: LogSource, parameters: IngestParameters, reports: list[CameraReport], materials: list[CameraMaterial]
) -> GravityReport:
    """Try gravity with the poses as they are, or as they would agree."""
    all_poses, posed, untouched = [np.zeros((0, 4, 4))], [], parameters.pose_convention == "as-is"
    for report, material in zip(reports, materials, strict=True):
        if material.poses is None:
            continue
        poses, best = material.poses, material.outcome.best
        if report.poses.verdict == "contradict" and not report.poses.decisive:
            return GravityReport(method="none", detail="not tried: the poses contradict the images")
        if report.poses.decisive and best is not None:
            poses = converted(poses, best.convention, best.scale)
            untouched &= best.convention == "as-is"
        all_poses.append(poses)
        posed += [(look, poses[index]) for index, look in material.looks.items()]
    return gravity_report(source, parameters, np.concatenate(all_poses), posed, untouched)


def _frames_report(
    source: LogSource,
    selected: list[Entry],
    drops: Counter[str],
    materials: list[CameraMaterial],
    unusable: Counter[str],
) -> FramesReport:
    times = [entry.time for entry in selected]
    return FramesReport(
        in_log=len(source.entries),
        selected=len(selected),
        looked_at=sum(len(material.choice.frames) for material in materials),
        drops=dict(sorted(drops.items())),
        unusable=dict(sorted(unusable.items())),
        start=significant(min(times), 15) if times else None,
        end=significant(max(times), 15) if times else None,
    )


def _frame_findings(frames: FramesReport, source: LogSource) -> list[Finding]:
    findings = []

    def add(severity: str, message: str, fix: str = "") -> None:
        findings.append(Finding(severity=severity, check="frames", message=message, fix=fix))  # type: ignore[arg-type]

    lost = {reason: count for reason, count in frames.drops.items() if reason != NOT_SELECTED}
    listed = ", ".join(f"{reason} {count}" for reason, count in sorted(lost.items(), key=lambda item: -item[1]))
    share = sum(lost.values()) / max(sum(lost.values()) + frames.selected, 1)
    bad = ", ".join(f"{reason} {count}" for reason, count in frames.unusable.items())
    worst = max({**frames.unusable, **lost}.items(), key=lambda item: item[1], default=("", 0))[0]
    advice = ADVICE.get(worst, "")
    bad_share = sum(frames.unusable.values()) / max(frames.looked_at, 1)
    why = ""
    if lost.get("non_rigid_pose", 0) > LOSS * frames.in_log:
        why = "; the poses are not rigid: " + rigidity_words(_matrices(source))
    if not frames.in_log:
        add("wasted", "there are no frames in the log", "does it hold images of a camera? see the streams")
    elif not frames.selected:
        add("wasted", f"no usable frame: {listed or 'none is selected'}{why}", advice)
    elif frames.looked_at and bad_share == 1:
        add("wasted", f"no usable frame among the {frames.looked_at} looked at: {bad}", advice)
    else:
        if share > LOSS:
            add(
                "wasted" if share > HEAVY_LOSS else "doubtful",
                f"{100 * share:.0f} % of the frames are lost: {listed}{why}",
                advice,
            )
        elif lost:
            add("note", f"frames left out: {listed}")
        if bad_share > LOSS:
            severity = "wasted" if bad_share > HEAVY_LOSS else "doubtful"
            add(severity, f"{100 * bad_share:.0f} % of the frames looked at cannot be used: {bad}", advice)
        elif frames.unusable:
            add("note", f"frames looked at that cannot be used: {bad}")
    if source.damage:
        further = f" (and {len(source.damage) - 1} more)" if len(source.damage) > 1 else ""
        add("doubtful", f"the log is damaged: {source.damage[0]}{further}", "what is whole is used")
    return findings


def warning_findings(source: LogSource) -> list[Finding]:
    """Return the reader's warnings about times and depth: what it took in the place of what the log seems to say."""
    found = (TAKEN.fullmatch(note) for note in source.notes)
    return [Finding(severity="doubtful", check="reading", message=match[1], fix=match[2]) for match in found if match]


def _matrices(source: LogSource) -> np.ndarray:
    poses = [entry.world_from_camera for entry in source.entries if entry.world_from_camera is not None]
    return np.array([matrix for matrix in poses if matrix.shape == (4, 4)]).reshape(-1, 4, 4)


def _content_findings(reports: list[CameraReport], source: LogSource) -> list[Finding]:
    """What whole streams are missing."""
    findings: list[Finding] = []
    looked = [report for report in reports if report.streams]
    if not looked:
        return findings
    streams = {stream for report in looked for stream in report.streams}
    stereo = "right" in streams and any(report.stereo and report.stereo.baseline for report in looked)

    def add(severity: Severity, check: str, message: str, fix: str = "") -> None:
        findings.append(Finding(severity=severity, check=check, message=message, fix=fix))

    def why(stream: str) -> str:
        return f" ({source.missing[stream]})" if stream in source.missing else ""

    if "depth" not in streams and not stereo:
        advice = "record depth; colour alone can only be looked at"
        if "pose" in streams and "color" in streams:
            advice = "record depth; of images with poses a splat can be learned: ingest, then scenewright splat build"
        add("wasted", "depth", f"there is no depth and no stereo pair with a baseline{why('depth')}", advice)
    elif "depth" not in streams:
        add("doubtful", "depth", "there is no depth, but a stereo pair", "make depth with the step disparity")
    if "color" not in streams:
        add("doubtful", "pictures", "there is no colour: nothing can be recognised, only shapes", "record colour too")
    if "pose" not in streams:
        advice = "run reconstruct-without-poses, which estimates them, or give ingest or fuse your own --trajectory"
        add("doubtful", "poses", f"the frames have no poses, which fuse needs{why('pose')}", advice)
    return findings


def _having(reports: list[CameraReport], source: LogSource) -> set[str]:
    """Return what of NEEDS the log has."""
    streams = {stream for report in reports for stream in report.streams}
    words = {"color": "colour", "depth": "depth", "pose": "poses", "labels": "labels"}
    have = {words[stream] for stream in streams if stream in words}
    if streams & {"color", "depth"}:
        have.add("usable frames")
    if any(report.stereo is not None and report.stereo.baseline for report in reports):
        have.add("a stereo pair with a baseline")
    if not source.has_labels:
        have.discard("labels")
    return have
