"""`scenewright inspect`: what an artifact is and how it was made; what a log, or a sequence, is worth to a chain."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from scenewright.cli.output import out
from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.manifest import MANIFEST_NAME


def inspect(
    path: Annotated[Path, typer.Argument(help="Artifact folder, or a log: a file or a folder.")],
    expect: Annotated[
        str | None, typer.Option("--expect", help="Exit with 4 unless this is its outcome (of a log: its verdict).")
    ] = None,
    html: Annotated[Path | None, typer.Option("--html", help="Write a page of pictures (log or sequence).")] = None,
    frames: Annotated[
        int, typer.Option("--frames", min=0, help="Frames that are looked at; 0: only the manifest of a sequence.")
    ] = 60,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="Option of ingest as name=value (depth_scale=5000); repeatable.")
    ] = None,
    fx: Annotated[float | None, typer.Option("--fx", help="As for ingest [pixel], with --fy, --cx and --cy.")] = None,
    fy: Annotated[float | None, typer.Option("--fy", help="As for ingest [pixel].")] = None,
    cx: Annotated[float | None, typer.Option("--cx", help="As for ingest [pixel].")] = None,
    cy: Annotated[float | None, typer.Option("--cy", help="As for ingest [pixel].")] = None,
    depth_scale: Annotated[float | None, typer.Option("--depth-scale", help="As for ingest [units a metre].")] = None,
    depth_bits: Annotated[str | None, typer.Option("--depth-bits", help="As for ingest.")] = None,
    frame_rate: Annotated[float | None, typer.Option("--frame-rate", help="As for ingest [1/s].")] = None,
    pose_convention: Annotated[str | None, typer.Option("--pose-convention", help="As for ingest.")] = None,
    pose_scale: Annotated[float | None, typer.Option("--pose-scale", help="As for ingest.")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say what an artifact is and how it was made; of a log or a sequence, whether a chain on it would be wasted.

    Exits with 3 when it would be.
    """
    from scenewright.schemas.sequence import Sequence as FrameSequence
    from scenewright.stages.engine.reading import open_artifact
    from scenewright.stages.ingest.preflight.inspection import inspect_log, inspect_sequence
    from scenewright.stages.ingest.preflight.settings import ingest_parameters
    from scenewright.stages.kit.progress import progress_for

    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass  # whoever looks for a log says what it expects
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}", hint="give an artifact folder or a log") from None
    numbers = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "depth_scale": depth_scale}
    numbers |= {"frame_rate": frame_rate, "pose_scale": pose_scale}
    words = {"depth_bits": depth_bits, "pose_convention": pose_convention}
    settings = [
        *(settings or ()),
        *(f"{name}={value:.17g}" for name, value in numbers.items() if value is not None),
        *(f"{name}={value}" for name, value in words.items() if value is not None),
    ]
    progress = progress_for(sys.stderr.isatty(), quiet=quiet or json_output)
    if not os.path.exists(path / MANIFEST_NAME):
        if frames < 2:
            raise UsageError(f"--frames {frames}: a log is judged by its frames", hint="give at least 2")
        inspection = inspect_log(path, ingest_parameters(settings), frames, progress, keep_pictures=html is not None)
        inspection = replace(
            inspection,
            report=inspection.report.model_copy(update={"command": command_for(inspection.report, settings)}),
        )
        _show(inspection, html, json_output, {})
        return _exit_code(inspection.report, expect, inspection.report.verdict)
    if settings:
        raise UsageError("--set is for logs", hint="an artifact has the options it was made with")
    artifact = open_artifact(path)
    assert artifact.manifest is not None
    if not isinstance(artifact, FrameSequence) or artifact.outcome == "empty" or frames == 0:
        if html is not None:
            raise UsageError("--html is for logs and sequences", hint="`scenewright report` makes a page of a run")
        out(artifact.manifest.model_dump_json() if json_output else _manifest_text(artifact).removesuffix("\n"))
        return 4 if expect is not None and artifact.outcome != expect else 0
    inspection = inspect_sequence(artifact, frames, progress, keep_pictures=html is not None)
    if not json_output:
        out(_manifest_text(artifact))
    _show(inspection, html, json_output, artifact.manifest.model_dump(mode="json"))
    return _exit_code(inspection.report, expect, artifact.outcome)


def command_for(report: Any, settings: Sequence[str]) -> str:
    """Return the command that reconstructs the log with these options of ingest, ready to paste; empty where none can.

    Options that the pipeline has no variable for are left out.
    """
    from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline
    from scenewright.stages.ingest.preflight.drift import drifts

    streams = {stream for camera in report.cameras for stream in camera.streams}
    if report.verdict == "wasted" or "depth" not in streams or not streams & {"pose", "color"}:
        return ""
    refined = any(camera.drift is not None and drifts(camera.drift) for camera in report.cameras)
    name = "reconstruct" if "pose" in streams and not refined else "reconstruct-without-poses"
    variables = read_pipeline(pipeline_path(name)).variables
    assignments = [pair.partition("=") for pair in (f"log={report.path}", *settings)]
    pairs = {key.strip().lstrip("-").replace("-", "_"): value for key, _, value in assignments}
    words = [word for key, value in pairs.items() if key in variables for word in ("--set", f"{key}={value}")]
    words += ["--set", "poses_method=refine"] * refined
    folder = Path(report.path).resolve().stem or "run"
    return shlex.join([*_program(), "run", name, *words, "--out", f"outputs/{folder}"])


def _program() -> list[str]:
    """Return the words that start scenewright from here: it is on the PATH only in an active environment."""
    if shutil.which("scenewright"):
        return ["scenewright"]
    script = Path(sys.executable).with_name("scenewright")
    return [os.path.relpath(script)] if script.is_file() else [os.path.relpath(sys.executable), "-m", "scenewright"]


def _show(inspection: Any, html: Path | None, json_output: bool, manifest: dict[str, Any]) -> None:
    from scenewright.stages.ingest.preflight.text import as_text

    if html is not None:
        from scenewright.stages.ingest.preflight.page import write_page

        write_page(inspection, html)
    report = inspection.report.model_dump(mode="json")
    document = {**manifest, "preflight": report} if manifest else report
    out(json.dumps(document, sort_keys=True) if json_output else as_text(inspection.report).removesuffix("\n"))
    sys.stdout.flush()


def _exit_code(report: Any, expect: str | None, outcome: str) -> int:
    if report.verdict == "wasted" and expect != "wasted":
        raise BadInput(f"{report.path}: {report.reason}", hint=report.fix)
    return 4 if expect is not None and outcome != expect else 0


def _manifest_text(artifact: Artifact) -> str:
    manifest = artifact.manifest
    assert manifest is not None
    provenance = manifest.provenance
    lines: list[tuple[str, Any]] = [
        ("kind", f"{manifest.kind} version {manifest.schema_version}"),
        ("outcome", manifest.outcome),
        *(("summary", f"{name} = {value}") for name, value in manifest.summary.items()),
        ("made by", f"{manifest.stage}, code {manifest.code[:12] or 'unknown'}, seed {manifest.seed}"),
        *(("accepted", f"code of {a.step}: {a.made_with[:12]} as {a.accepted[:12]}") for a in manifest.accepted_code),
        *(("input", f"{i.role}: {i.kind} {i.digest[:12]} {i.path}") for i in manifest.inputs),
        *(("parameter", f"{name} = {value}") for name, value in manifest.parameters.items()),
        ("content", manifest.content_digest),
        ("files", f"{len(manifest.files)}, {sum(f.bytes for f in manifest.files) / 1e6:.1f} MB"),
        ("took", f"{provenance.seconds:.1f} s, {provenance.peak_memory_bytes / 2**20:.0f} MiB, {provenance.started}"),
        ("command", " ".join(provenance.command)),
    ]
    return "".join(f"{label:10} {value}\n" for label, value in lines)
