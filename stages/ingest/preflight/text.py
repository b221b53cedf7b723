"""The report for a terminal: the verdict first, then what it rests on, one line each."""

from __future__ import annotations

from collections.abc import Iterator

from scenewright.stages.ingest.preflight.poses import BY_DEPTH, BY_FEATURES
from scenewright.stages.ingest.preflight.report import CameraReport, Hypothesis, InspectionReport, StreamReport

MARKS = {"wasted": "WASTED", "doubtful": "doubt", "note": "note"}


def as_text(report: InspectionReport) -> str:
    """Return the report as lines of text."""
    return "\n".join(_lines(report)) + "\n"


def _row(label: str, value: str) -> str:
    return f"{label:12} {value}"


def _lines(report: InspectionReport) -> Iterator[str]:
    words = {
        "ready": "ready: nothing speaks against a chain on it",
        "doubtful": "doubtful: a chain would run, look at the doubts first",
        "wasted": "wasted: a chain on it would be wasted",
    }
    yield _row("verdict", words[report.verdict])
    for finding in report.findings:
        camera = f"{finding.camera}: " if finding.camera else ""
        yield _row(MARKS[finding.severity], f"{camera}{finding.message}")
        if finding.fix:
            yield _row("", f"-> {finding.fix}")
    yield ""
    yield _row("log", f"{report.path}: {report.format} ({report.rule})")
    frames = report.frames
    span = f" over {frames.end - frames.start:.2f} s" if frames.start is not None and frames.end is not None else ""
    yield _row(
        "frames", f"{frames.in_log} in the log, {frames.selected} usable by list{span}, {frames.looked_at} looked at"
    )
    for name, counts in (("dropped", frames.drops), ("unusable", frames.unusable)):
        if counts:
            yield _row(name, ", ".join(f"{reason} {count}" for reason, count in counts.items()))
    for line in report.damage:
        yield _row("damage", line)
    for stream in report.streams:
        yield _row("stream", stream_line(stream))
    for line in report.clocks:
        yield _row("clocks", line)
    for camera_report in report.cameras:
        yield from _camera_lines(camera_report)
    if report.other_cameras:
        yield _row("others", f"cameras that were not asked for: {', '.join(report.other_cameras)}")
    tilt = f", {report.gravity.tilt:g} deg from the log's z" if report.gravity.tilt is not None else ""
    yield _row("gravity", f"{report.gravity.method}{tilt}: {report.gravity.detail}")
    for note in report.notes:
        yield _row("assumed", note)
    yield ""
    if report.command:
        yield _row("run it", report.command)
        yield ""
    for step in report.steps:
        state = "ready" if step.ready else "needs " + ", ".join(step.missing) if step.missing else "not in this version"
        yield _row("step", f"{step.step:32} {state}")


def stream_line(stream: StreamReport) -> str:
    """Return a stream on one line."""
    columns = [f"{stream.name:28} {stream.role:12} {stream.count:6}"]
    columns.append(f"{stream.rate:7.4g}/s" if stream.rate is not None else " " * 9)
    if stream.gaps.count:
        columns.append(f"{stream.gaps.count} gaps, longest {stream.gaps.longest:.3g} s at {stream.gaps.longest_at:.3f}")
    if stream.duplicates:
        columns.append(f"{stream.duplicates} duplicates")
    if stream.reversals:
        columns.append(f"{stream.reversals} reversals")
    if stream.detail:
        columns.append(stream.detail)
    return "  ".join(columns).rstrip()


def _camera_lines(report: CameraReport) -> Iterator[str]:
    camera, calibration = report.camera, report.calibration
    yield ""
    if camera.width == 0:
        yield _row("camera", f"{report.name}: no image of it can be decoded")
        return
    yield _row(
        "camera",
        f"{report.name}: {camera.width}x{camera.height}, fx {camera.fx:.5g} fy {camera.fy:.5g} cx {camera.cx:.5g} "
        f"cy {camera.cy:.5g}, field of view {calibration.field_of_view[0]:.0f} x {calibration.field_of_view[1]:.0f} "
        f"deg; {', '.join(report.streams) or 'nothing usable'}",
    )
    depth = report.depth
    if depth is not None:
        factor = f", should be {depth.factor:.4g} times that" if depth.factor is not None else ""
        yield _row(
            "depth",
            f"median {depth.median:.3g} m{factor}, {depth.low:.3g} to {depth.high:.3g} m (5 to 95 %), "
            f"{100 * depth.valid_share:.0f} % valid, steps of {1000 * depth.step:.3g} mm, unit "
            f"{'plausible' if depth.plausible and depth.factor is None else 'NOT plausible'}",
        )
    yield _row("poses", f"{report.poses.verdict}: {report.poses.detail}")
    if report.poses.best is not None:
        for title, hypothesis in (("best", report.poses.best), ("runner-up", report.poses.runner_up)):
            if hypothesis is not None:
                yield _row("", f"{title}: {hypothesis_words(hypothesis, report.poses.method)}")
        yield _row("", "decisive" if report.poses.decisive else "not decisive")
    if report.poses.scale_fit is not None and report.poses.verdict == "agree":
        yield _row("", f"translations fit best at {report.poses.scale_fit:.3g} times their length")
    drift = report.drift
    if drift is not None:
        yield _row(
            "drift",
            f"{drift.places} places that the camera comes back to are missed by {100 * drift.missed:.2g} cm (median), "
            f"neighbours by {100 * drift.neighbours_missed:.2g} cm",
        )
    motion = report.motion
    if motion is not None:
        overlap = f", neighbours share {100 * motion.overlap:.0f} %" if motion.overlap is not None else ""
        yield _row(
            "motion",
            f"{motion.length:.3g} m within {motion.extent[0]:.2f} x {motion.extent[1]:.2f} x {motion.extent[2]:.2f} m, "
            f"{motion.speed_median:.2g} m/s, a step {1000 * motion.step_median:.3g} mm and {motion.turn_median:.2g} "
            f"deg (at most {motion.step_largest:.2g} m, {motion.turn_largest:.2g} deg){overlap}",
        )
    yield _row("registered", report.registration.detail)
    if report.registration.lag_frames is not None:
        yield _row("", f"colour fits depth best at a lag of {report.registration.lag_frames:+.2g} frames")
    pictures = report.pictures
    if pictures is not None:
        yield _row(
            "images",
            f"sharpness {pictures.sharpness_median:.3g}, {100 * pictures.blurred_share:.0f} % blurred, brightness "
            f"{pictures.brightness:.0f}/255, {100 * pictures.dark_share:.0f} % black, "
            f"{100 * pictures.bright_share:.0f} % white, flicker {100 * pictures.flicker:.1f} %",
        )
    if report.stereo is not None:
        yield _row("stereo", f"baseline {report.stereo.baseline} m, {report.stereo.detail}")


def hypothesis_words(hypothesis: Hypothesis, method: str) -> str:
    """Return a hypothesis with its residual."""
    phrases = [hypothesis.convention]
    if hypothesis.translation_scale != 1:
        phrases.append(f"translations x {hypothesis.translation_scale:.4g}")
    if hypothesis.focal_factor != 1:
        phrases.append(f"focal length x {hypothesis.focal_factor:.3g}")
    if hypothesis.lag:
        phrases.append(f"lag {hypothesis.lag:+d}")
    measure = BY_FEATURES if method == "epipolar" else BY_DEPTH
    return f"{', '.join(phrases)}: {measure.words(hypothesis.residual)}"
