"""Commands that are no steps: run, demo, batch, verify, migrate, view, models, doctor, schemas, makefile."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from scenewright.cli import edit_command
from scenewright.cli.ask_command import ask
from scenewright.cli.batch_command import batch
from scenewright.cli.collection_command import gc
from scenewright.cli.comparison_command import diff
from scenewright.cli.explain_command import explain
from scenewright.cli.follow_command import follow
from scenewright.cli.inspect_command import inspect
from scenewright.cli.output import out as _out
from scenewright.cli.output import say as _say
from scenewright.cli.record_command import record
from scenewright.cli.robot_check_command import check as check_robot
from scenewright.cli.serve_command import serve
from scenewright.cli.show_command import show
from scenewright.cli.timeline_command import timeline
from scenewright.cli.urdf_check_command import urdf_check
from scenewright.cli.urdf_protocol_command import urdf_protocol
from scenewright.cli.urdf_settle_command import urdf_settle
from scenewright.cli.view_command import view
from scenewright.cli.weights_command import convert_weights
from scenewright.schemas.errors import BadInput, UsageError

if TYPE_CHECKING:
    from scenewright.stages.engine.chain import StepReport

Paths = Annotated[list[Path], typer.Argument(help="Artifact folders.")]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Warnings only.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]
Settings = Annotated[list[str] | None, typer.Option("--set", help="variable=value; may be repeated.")]


def _settings(pairs: list[str] | None) -> dict[str, str]:
    values = {}
    for pair in pairs or []:
        name, separator, value = pair.partition("=")
        if not separator:
            raise UsageError(f"--set {pair!r}: not variable=value", hint="for example --set log=room.mcap")
        values[name] = value
    return values


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        from scenewright.stages.kit.library_versions import library_version

        _out(library_version("scenewright"))
        raise typer.Exit


def root(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and stop.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Toolkit from robot logs to scenes a robot can act in."""


def run(
    pipeline: Annotated[str, typer.Argument(help="Pipeline: a name in data/pipelines or a TOML file.")],
    out: Annotated[Path, typer.Option("--out", help="Run folder; one artifact folder per step in it.")],
    settings: Settings = None,
    only: Annotated[list[str] | None, typer.Option("--only", help="Only this step; may be repeated.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Make every artifact again.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would run, why, and what it costs.")] = False,
    max_memory: Annotated[
        str | None, typer.Option("--max-memory", help="Stop a step that uses more than this: 4GiB.")
    ] = None,
    accept: Annotated[
        list[str] | None, typer.Option("--accept", help="Outcome besides ok that exits with 0; may be repeated.")
    ] = None,
    json_output: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Run a pipeline: the same commands that the Makefile chains. Exits with the gravest code of its steps."""
    from scenewright.stages.engine.batch.outcomes import worst_exit_code
    from scenewright.stages.engine.chain import forked_steps, run_pipeline
    from scenewright.stages.engine.estimation import estimate_pipeline, warn_or_refuse
    from scenewright.stages.engine.given_inputs import check_given_inputs
    from scenewright.stages.engine.memory_limit import parse_limit
    from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline, resolve_variables

    flags = {"--force": force, "--dry-run": dry_run, "--quiet": quiet, "--debug": debug}
    extra = tuple(flag for flag, is_set in flags.items() if is_set)
    if max_memory is not None:
        parse_limit(max_memory)
        extra += ("--max-memory", max_memory)
    accepted = tuple(accept or ())
    extra += tuple(word for outcome in accepted for word in ("--accept", outcome))
    chain = read_pipeline(pipeline_path(pipeline))
    values = _settings(settings)
    resolved = resolve_variables(chain, values)
    check_given_inputs(chain, resolved, tuple(only or ()))
    expected = estimate_pipeline(chain, out, resolved, tuple(only or ()))
    warn_or_refuse(f"pipeline {chain.name}", expected.total, out)
    if dry_run:
        for line in expected.lines():
            _say(line)
    # what forks share would count for a limit
    with forked_steps(chain, tuple(only or ())) if max_memory is None else nullcontext():
        reports = run_pipeline(
            chain, out, values, extra=extra, only=tuple(only or ()), announce=(lambda text: None) if quiet else _say
        )
    for report in reports:
        status = report.facts.get("status", f"exit {report.exit_code}")
        _say(f"{report.name:24} {status:11} {report.facts.get('outcome', '')}")
        if dry_run and report.facts.get("reason"):
            _say(f"{'':24} {report.facts['reason']}")
    if json_output:
        facts = {"run": str(out), "steps": [r.facts for r in reports], "estimate": expected.as_json()}
        _out(json.dumps(facts, sort_keys=True))
    else:
        _out(str(out))
    if not dry_run and not quiet:
        _say_what_to_trust(reports)
    _say_what_was_not_ok(reports, accepted, tuple(chain.variables))
    return worst_exit_code(report.code(accepted) for report in reports)


def demo(
    out: Annotated[Path, typer.Option("--out", help="Run folder; one artifact folder per step in it.")],
    settings: Settings = None,
    json_output: Json = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Generate a room, reconstruct it, and let a robot act in it: the pipeline `demo`."""
    return run("demo", out, settings, json_output=json_output, quiet=quiet, debug=debug)


def _say_what_to_trust(reports: list[StepReport]) -> None:
    from scenewright.stages.report.outlook import Facts, outlook

    facts = {
        report.name: Facts(str(report.facts.get("outcome", "")), report.facts["summary"])
        for report in reports
        if report.facts.get("summary")
    }
    if "panoptic_map" in facts:
        for line in outlook(facts).lines():
            _say(line)


def _say_what_was_not_ok(reports: list[StepReport], accepted: tuple[str, ...], variables: tuple[str, ...]) -> None:
    """Name the outcomes after which the chain went on, and say how a step that stopped it is given its options."""
    for report in reports:
        if report.exit_code == 0 and report.code(accepted):
            outcome, reason = report.facts["outcome"], report.facts.get("summary", {}).get("reason", "see its summary")
            _say(f"error: {report.name}: outcome is {outcome!r}: {reason} (--accept {outcome} exits with 0)")
        elif report.exit_code in (2, 3):
            _say(
                f"{report.name} stopped the run; what it asks for is given as --set name=value: {', '.join(variables)}"
            )


def verify(paths: Paths, json_output: Json = False, debug: Debug = False) -> int:
    """Re-hash artifacts and follow their inputs back to the log."""
    from scenewright.stages.engine.verification import Finding
    from scenewright.stages.engine.verification import verify as verify_artifact

    findings_by_path: dict[Path, Finding] = {}
    for path in paths:
        verify_artifact(path, findings_by_path)
    for finding in findings_by_path.values():
        _say(f"{'damaged' if finding.problems else 'sound':8} {finding.kind:18} {finding.path}")
        for line in (*finding.problems, *finding.notes):
            _say(f"{'':8} {line}")
    damaged = [finding for finding in findings_by_path.values() if finding.problems]
    if json_output:
        rows = [
            {"path": str(f.path), "kind": f.kind, "problems": list(f.problems), "notes": list(f.notes)}
            for f in findings_by_path.values()
        ]
        _out(json.dumps({"sound": not damaged, "artifacts": rows}, sort_keys=True))
    if damaged:
        raise BadInput(
            f"{len(damaged)} of {len(findings_by_path)} artifacts are damaged", hint="make them again with --force"
        )
    return 0


def accept_code(
    run: Annotated[Path, typer.Argument(help="Folder of a run.")], json_output: Json = False, debug: Debug = False
) -> int:
    """Let a finished run stand though the code of its steps has changed; its manifests say so from then on."""
    from scenewright.stages.engine.accepted_code import accept_code as accept

    accepted = accept(run)
    for entry in accepted:
        _say(f"{entry.step}: made with {entry.made_with[:12] or 'unknown code'}, accepted as {entry.accepted[:12]}")
    if not accepted:
        _say("nothing to accept: every artifact was made with today's code, or that is accepted already")
    if json_output:
        _out(json.dumps({"accepted": [entry.model_dump() for entry in accepted]}, sort_keys=True))
    return 0


def migrate(
    path: Annotated[Path, typer.Argument(help="Artifact of an older schema version.")],
    out: Annotated[Path, typer.Option("--out", help="New folder.")],
    debug: Debug = False,
) -> int:
    """Bring an artifact to the current schema version, into a new folder."""
    from scenewright.stages.engine.migration import migrate as migrate_artifact

    migrate_artifact(path, out)
    _out(str(out))
    return 0


def models(
    context: typer.Context,
    add: Annotated[Path | None, typer.Option("--add", help="Copy this weight file into the cache.")] = None,
    check: Annotated[Path | None, typer.Option("--check", help="Tell which known network this file is.")] = None,
    json_output: Json = False,
    debug: Debug = False,
) -> int:
    """List the networks that steps can use (source, licence, checksum) and the weight files in the cache; serve one."""
    if context.invoked_subcommand is not None:
        return 0
    from scenewright.stages.engine.known_models import identify, known_models
    from scenewright.stages.engine.model_cache import add_model, cache_folder, cached_models

    if check is not None:
        _out(identify(check).name)
        return 0
    if add is not None:
        _out(str(add_model(add).path))
        return 0
    cached = cached_models()
    if json_output:
        files = [
            {"path": str(c.path), "name": c.name, "bytes": c.bytes, "known": c.known.name if c.known else None}
            for c in cached
        ]
        listed = [model.model_dump() for model in known_models()]
        _out(json.dumps({"models": listed, "cache": str(cache_folder()), "files": files}, sort_keys=True))
        return 0
    for model in known_models():
        _out(f"{model.name}: {model.purpose}\n  {model.file}, {model.licence}, {model.source}\n  {model.sha256}")
    _out(f"cache {cache_folder()}: {len(cached)} files, {sum(c.bytes for c in cached) / 1e6:.1f} MB")
    for entry in cached:
        known_name = entry.known.name if entry.known else "not listed in data/models.toml"
        _out(f"  {entry.name} ({known_name}), {entry.bytes / 1e6:.1f} MB, {entry.path.name}")
    return 0


def doctor(json_output: Json = False, debug: Debug = False) -> int:
    """Say what is there, what is missing and how to get it."""
    from scenewright.stages.engine.diagnosis import diagnose

    checks = diagnose()
    if json_output:
        rows = [{"name": c.name, "found": c.found, "remedy": c.remedy, "required": c.required} for c in checks]
        _out(json.dumps(rows, sort_keys=True))
    else:
        for check in checks:
            mark = "ok" if check.sound else "MISSING" if check.required else "extra"
            _out(f"{mark:8} {check.name:24} {check.found}{'  -> ' + check.remedy if check.remedy else ''}")
    return 5 if any(check.required and not check.sound for check in checks) else 0


def schemas(
    out: Annotated[Path, typer.Option("--out", help="Folder; `make rules` gives schemas/json.")], debug: Debug = False
) -> int:
    """Export the JSON Schemas of the manifest and every payload file."""
    from scenewright.stages.engine.json_schemas import json_schemas

    out.mkdir(parents=True, exist_ok=True)
    for name, text in json_schemas().items():
        (out / name).write_text(text)
    _out(str(out))
    return 0


def makefile(
    pipeline: Annotated[str, typer.Argument(help="Pipeline: a name in data/pipelines or a TOML file.")],
    debug: Debug = False,
) -> int:
    """Print the makefile of a pipeline."""
    from scenewright.stages.engine.make_rules import makefile_for
    from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline

    _out(makefile_for(read_pipeline(pipeline_path(pipeline))).removesuffix("\n"))
    return 0


COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = (
    (run, "Pipelines"),
    (demo, "Pipelines"),
    (batch, "Pipelines"),
    (view, "Artifacts"),
    (inspect, "Artifacts"),
    (ask, "Artifacts"),
    (explain, "Artifacts"),
    (verify, "Artifacts"),
    (urdf_check, "Artifacts"),
    (urdf_settle, "Artifacts"),
    (urdf_protocol, "Artifacts"),
    (accept_code, "Artifacts"),
    (migrate, "Artifacts"),
    (diff, "Artifacts"),
    (timeline, "Artifacts"),
    (gc, "Artifacts"),
    (doctor, "Installation"),
    (convert_weights, "Installation"),
    (schemas, "Installation"),
    (makefile, "Installation"),
)

GROUPS: tuple[tuple[str, Callable[..., Any], tuple[Callable[..., Any], ...], str], ...] = (
    ("models", models, (serve,), "Installation"),
)
"""Commands that do something by themselves and have commands below them."""
ALONE: tuple[tuple[str, str, tuple[Callable[..., Any], ...], str], ...] = (
    ("robot", "Look at a robot before anything is planned with it", (check_robot,), "Artifacts"),
)
"""Groups of commands without steps: what they say of themselves, and the commands."""
BESIDE_STEPS: tuple[tuple[str, Callable[..., Any]], ...] = (
    ("cutting", record),
    ("suture", follow),
    ("splat", view),
    ("predicates", show),
    *(("edit", command) for command in edit_command.COMMANDS),
)
"""Commands of a group of steps that are no steps; they are there where the group's steps are."""
