"""The pre-flight as one page that needs nothing else: pictures and drawings are inside it."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup
from scenewright.schemas.errors import MachineFailure
from scenewright.stages.ingest.preflight.charts import curve, histogram, path_from_above, timeline
from scenewright.stages.ingest.preflight.inspection import CameraMaterial, Inspection
from scenewright.stages.ingest.preflight.pictures import RELATIVE_BLUR, sharpnesses
from scenewright.stages.ingest.preflight.poses import Candidate
from scenewright.stages.ingest.preflight.report import CameraReport, Hypothesis
from scenewright.stages.ingest.preflight.text import hypothesis_words
from scenewright.stages.ingest.preflight.views import (
    Picture,
    depth_in_colors,
    embedded,
    in_color,
    jumps_over_color,
    residuals_over_color,
)

FOLDER = Path(__file__).resolve().parent
SAMPLES = 6
"""Most frames that are shown."""


@dataclass(frozen=True)
class Row:
    """A hypothesis in the table."""

    words: str
    residual: str
    cost: float
    kind: str
    """`given`, `best`, `still` or empty."""


@dataclass(frozen=True)
class CameraView:
    """What the page shows of one camera beside its report."""

    report: CameraReport
    samples: tuple[tuple[Picture, ...], ...]
    pairs: tuple[Picture, ...]
    rows: tuple[Row, ...]
    histogram: Markup | None
    lags: Markup | None
    sharpness: Markup | None
    brightness: Markup | None
    path: Markup | None


def write_page(found: Inspection, path: Path) -> None:
    """Write the page, whole or not at all. Raises MachineFailure when it cannot be written."""
    text = render(found)
    partial = path.with_name(f".{path.name}.partial-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding="utf-8")
        os.replace(partial, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise MachineFailure(f"{path}: {error.strerror}", hint="choose a writable --html") from None


def render(found: Inspection) -> str:
    """Return the page as HTML. Everything that comes from the log is escaped."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    style = Markup((FOLDER / "style.css").read_text(encoding="utf-8"))
    values: dict[str, Any] = {
        "report": found.report,
        "style": style,
        "timeline": timeline(found.streams),
        "cameras": [_camera_view(r, m) for r, m in zip(found.report.cameras, found.cameras, strict=True)],
    }
    return environment.get_template("template.html.j2").render(**values)


def _camera_view(report: CameraReport, material: CameraMaterial) -> CameraView:
    looks = material.looks
    indices = sorted(looks)
    chosen = [indices[k] for k in np.unique(np.linspace(0, len(indices) - 1, min(SAMPLES, len(indices))).astype(int))]
    end = report.depth.high * 1.15 if report.depth is not None else 1.0
    depth_marks = [(report.depth.median, f"median {report.depth.median:.3g} m")] if report.depth is not None else []
    sharp = sharpnesses(looks)
    limit = RELATIVE_BLUR * float(np.median(list(sharp.values()))) if sharp else None
    start = float(material.times.min()) if len(material.times) else 0.0
    brightness = [(looks[k].time - start, float(g.mean())) for k in indices if (g := looks[k].gray) is not None]
    return CameraView(
        report=report,
        samples=tuple(_sample(looks[index], end, start) for index in chosen),
        pairs=_pair_pictures(report, material),
        rows=_rows(report),
        histogram=histogram(report.depth.histogram, report.depth.histogram_end, depth_marks) if report.depth else None,
        lags=curve(
            [(float(lag), score) for lag, score in report.registration.lag_scores],
            "frames by which colour is late",
            "score of colour against depth by lag",
            level=1.0,
        ),
        sharpness=curve(
            [(looks[index].time - start, value) for index, value in sharp.items()],
            "seconds",
            "sharpness of the frames",
            level=limit,
            marked=[looks[i].time - start for i, value in sharp.items() if limit is not None and value < limit],
        ),
        brightness=curve(brightness, "seconds", "brightness of the frames"),
        path=_path(material),
    )


def _sample(look: Any, end: float, start: float) -> tuple[Picture, ...]:
    pictures = []
    seconds = f"{look.time - start:.2f} s, {look.name}"
    if look.gray is not None:
        pictures.append(embedded(in_color(look, look.gray.shape), f"colour at {seconds}"))
    if look.depth is not None:
        pictures.append(embedded(depth_in_colors(look.depth, end), f"depth at {seconds}"))
        if look.gray is not None and look.gray.shape == look.depth.shape:
            pictures.append(embedded(jumps_over_color(look), f"depth jumps over colour at {seconds}"))
    return tuple(pictures)


def _pair_pictures(report: CameraReport, material: CameraMaterial) -> tuple[Picture, ...]:
    """The median and the worst pair with the poses as they are, and the same two in the best reading."""
    outcome, poses = material.outcome, material.poses
    if outcome.as_is is None or outcome.pairs is None or poses is None or report.poses.method != "depth":
        return ()
    with_depth = [
        k
        for k, (i, j) in enumerate(outcome.pairs.pairs)
        if i in material.looks and material.looks[i].depth is not None and material.looks[j].depth is not None
    ]
    if not with_depth:
        return ()
    order = sorted(with_depth, key=lambda k: (outcome.as_is.fit.costs[k], k))  # type: ignore[union-attr]
    readings: list[tuple[str, Candidate]] = [("as they are", outcome.as_is)]
    if outcome.best is not None and report.poses.best is not None:
        readings.append((hypothesis_words(report.poses.best, report.poses.method).rpartition(":")[0], outcome.best))
    pictures = []
    for words, candidate in readings:
        candidate_poses = candidate.poses(poses)
        for title, k in (("a usual pair", order[len(order) // 2]), ("the worst pair", order[-1])):
            i, j = outcome.pairs.pairs[k]
            first, second = material.looks[i], material.looks[j]
            residual = f"{100 * candidate.fit.residuals[k]:.2g} %"
            caption = f"poses {words}, {title}: {first.name} in {second.name}, median residual {residual}"
            pictures.append(
                embedded(residuals_over_color(first, second, candidate_poses[i], candidate_poses[j]), caption)
            )
    return tuple(pictures)


def _rows(report: CameraReport) -> tuple[Row, ...]:
    poses = report.poses
    if not poses.hypotheses:
        return ()

    def row(hypothesis: Hypothesis, kind: str) -> Row:
        words, _, residual = hypothesis_words(hypothesis, poses.method).rpartition(":")
        return Row(words, residual.strip(), hypothesis.cost, kind)

    rows = [row(poses.hypotheses[0], "given")]
    rows += [row(h, "best" if h == poses.best else "") for h in poses.hypotheses[1:]]
    if poses.motionless is not None:
        rows.append(row(poses.motionless, "still"))
    return tuple(sorted(rows, key=lambda r: r.cost))


def _path(material: CameraMaterial) -> Markup | None:
    if material.poses is None or len(material.poses) < 2:
        return None
    positions = material.poses[:, :3, 3]
    extent = positions.max(axis=0) - positions.min(axis=0)
    widest = sorted(sorted(range(3), key=lambda axis: -extent[axis])[:2])
    return path_from_above(positions, (widest[0], widest[1]))
