"""Running one step: check inputs, compare keys, work in a partial folder, record, take the target's place."""

from __future__ import annotations

import importlib
import json
import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput, MachineFailure, MissingDependency, ScenewrightError, UsageError
from scenewright.schemas.manifest import LONGEST_PATH, MANIFEST_NAME, InputRecord, Manifest
from scenewright.stages.engine import estimation, interruption, memory_limit, shared_artifacts, store
from scenewright.stages.engine.accepted_code import carried_on, is_accepted
from scenewright.stages.engine.code.digests import changed_modules, step_code
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.engine.discovery import package_of
from scenewright.stages.engine.keys import artifact_key, data_file_digests, library_versions, parameters_as_json
from scenewright.stages.engine.machine_faults import MACHINE_ERRORS, OUT_OF_MEMORY, first_cause
from scenewright.stages.engine.model_cache import resolve_weights, with_usual_models
from scenewright.stages.engine.provenance import processor_seconds, provenance_now
from scenewright.stages.engine.reading import check_hashes, check_sizes, open_artifact, open_outside, read_manifest
from scenewright.stages.kit.digests import external_digest, external_files
from scenewright.stages.kit.estimates import Estimate
from scenewright.stages.kit.progress import SilentProgress, showing
from scenewright.stages.kit.stage import Context, External, Optionally, Parameters, Stage

logger = logging.getLogger("scenewright")


Status = Literal["made", "taken", "up to date", "would run"]
"""`taken`: copied from the folder that runs share, where the same key had been made before."""


@dataclass(frozen=True)
class RunResult:
    """What came of a run."""

    status: Status
    reason: str
    """Why it ran, or would."""
    path: Path
    key: str
    manifest: Manifest | None
    nondeterministic: bool = False
    """The same key gave another content digest than before."""
    estimate: Estimate | None = None
    """What it would write and use, for a dry run."""

    @property
    def outcome(self) -> str:
        """Outcome of the artifact; `unknown` for one that a dry run would make."""
        return self.manifest.outcome if self.manifest else "unknown"


NO_CODE_CACHE = "cannot cache function"
"""How numba begins what it says when every folder for it is read-only."""
NO_CODE_CACHE_TEXT = "compiled code can be kept nowhere, neither beside the program nor in a home folder"
NO_CODE_CACHE_HINT = "set NUMBA_CACHE_DIR to a folder that can be written"

MODULES_SHOWN = 3
"""Changed modules that a reason to run names."""

PROCESSOR = "processor"
"""Entry of timings.json beside the parts of the step, which are wall clock: processor time of all of its process."""

Stamp = tuple[tuple[str, int, int, int], ...]
"""Path, inode, time of change [ns] and size of files: what differs once one is replaced or written to."""


@dataclass(frozen=True)
class _OpenInput:
    role: str
    kind: str
    digest: str
    path: Path
    value: Artifact | Path
    stamp: Stamp
    """Taken before anything was read."""

    def check(self) -> None:
        """Raise BadInput unless its bytes are those its manifest lists (the digest of a raw file was just taken).

        One that was made again since, with the same content, is what it was, though its timings are others.
        """
        if isinstance(self.value, Artifact) and self.value.manifest is not None:
            found = _previous_manifest(self.path)
            again = found is not None and found.content_digest == self.digest
            check_hashes(self.path, found if found is not None and again else self.value.manifest)

    def was_written(self) -> bool:
        """Whether it holds something else than when it was opened."""
        is_artifact = isinstance(self.value, Artifact) and self.value.manifest is not None
        if _stamp(self.path, is_artifact) == self.stamp:
            return False
        if not is_artifact:
            return True
        found = _previous_manifest(self.path)
        return found is None or found.content_digest != self.digest


def _stamp(path: Path, is_artifact: bool) -> Stamp:
    rows = []
    with suppress(OSError, ValueError):  # what cannot be looked at is refused where it is opened
        for file in [path / MANIFEST_NAME] if is_artifact else external_files(path):
            found = file.stat()
            rows.append((str(file), found.st_ino, found.st_mtime_ns, found.st_size))
    return tuple(rows)


@contextmanager
def _inputs_stay(opened: list[_OpenInput]) -> Iterator[None]:
    """Raise MachineFailure when an input is made again while the step reads it: what it read is then a mixture."""
    failed: Exception | None = None
    try:
        yield
    except Exception as error:
        failed = error
    for item in opened:
        if item.was_written():
            raise MachineFailure(
                f"{item.path}: was written while this step read it", hint="run the step again once that is finished"
            ) from failed
    if failed is not None:
        raise failed


def _resolved(out: Path) -> Path:
    """Return the absolute path without symbolic links: the folder a link stands for is replaced, not the link.

    Raises UsageError for names that cannot be written down, MachineFailure when it cannot be looked at.
    """
    _check_name(out, "--out")
    try:
        resolved = Path(os.path.realpath(out))
        if resolved.is_symlink():
            raise UsageError(f"{out}: links that lead in a circle", hint="choose another --out")
    except ValueError as error:
        raise UsageError(f"--out {str(out)!r}: {error}", hint="choose another --out") from None
    except OSError as error:
        raise MachineFailure(f"{str(out):.200}: {error.strerror}", hint="choose another --out") from None
    return resolved


def choose_device(wanted: str) -> str:
    """Turn `auto`, `cpu` or `cuda` into the device to use. Raises MissingDependency when cuda is absent."""
    if wanted == "cpu":
        return "cpu"
    import torch

    if torch.cuda.is_available():
        return "cuda"
    if wanted == "cuda":
        raise MissingDependency("no CUDA device is available", hint="use --device cpu")
    return "cpu"


def _check_name(path: Path, option: str) -> None:
    """Raise UsageError for a path that no manifest can hold."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise UsageError(f"{option} {os.fsencode(path)!r}: no UTF-8 name", hint="rename it") from None


def _open_inputs(stage: Stage, paths: Mapping[str, Path]) -> list[_OpenInput]:
    unknown = set(paths) - set(stage.reads)
    if unknown:
        raise UsageError(f"{stage.name}: no input {sorted(unknown)[0]!r}", hint=f"inputs: {', '.join(stage.reads)}")
    missing = [role for role in stage.required() if role not in paths]
    if missing:
        raise UsageError(f"{stage.name}: --{missing[0].replace('_', '-')} is missing", hint="see --help")
    opened = []
    for role, path in paths.items():
        _check_name(path, f"--{role.replace('_', '-')}")
        declared = stage.reads[role]
        what = declared.what if isinstance(declared, Optionally) else declared
        outside = None if isinstance(what, External) else open_outside(path, what)
        if outside is not None:
            stamp = _stamp(Path(path), False)
            opened.append(_OpenInput(role, "external", external_digest(path), Path(path), outside, stamp))
        elif isinstance(what, External):
            path = resolve_weights(path) if what.weights else path
            stamp = _stamp(Path(path), False)
            opened.append(_OpenInput(role, "external", external_digest(path), Path(path), Path(path), stamp))
        else:
            stamp = _stamp(Path(path), True)
            artifact = open_artifact(path, what)
            assert artifact.manifest is not None
            opened.append(
                _OpenInput(role, artifact.kind, artifact.manifest.content_digest, Path(path), artifact, stamp)
            )
    return opened


def _reason_to_run(
    stage: Stage, out: Path, key: str, manifest: Manifest | None, force: bool, facts: dict[str, Any]
) -> str | None:
    """Why the step has to run, or None when the artifact on disk is what it would make."""
    if manifest is None:
        return "nothing is made yet"
    accepted = is_accepted(manifest, facts["code"])
    changed = _what_changed(stage, manifest, facts, accepted) if manifest.key != key else []
    if changed or (manifest.key != key and not accepted):
        return f"changed: {', '.join(changed) or 'key format'}"
    if force:
        return "--force"
    try:
        check_sizes(out, manifest)
    except BadInput as error:
        return error.message
    return None


def _what_changed(stage: Stage, old: Manifest, new: dict[str, Any], accepted: bool) -> list[str]:
    changed = []
    if old.code != new["code"] and not accepted:
        changed.append(f"code{_modules_of(stage, old.code)}" if old.code else "its manifest names no code")
    for name in ("schema_version", "seed", "device_kind"):
        if getattr(old, name) != new[name]:
            changed.append(f"{name} {getattr(old, name)} -> {new[name]}")
    for group, before, after in (
        ("parameter", old.parameters, new["parameters"]),
        ("library", old.libraries, new["libraries"]),
        ("data file", old.data_files, new["data_files"]),
        ("input", {record.role: record.digest for record in old.inputs}, new["inputs"]),
    ):
        for name in sorted(set(before) | set(after)):
            if before.get(name) != after.get(name):
                detail = "" if group in ("input", "data file") else f" {before.get(name)!r} -> {after.get(name)!r}"
                changed.append(f"{group} {name}{detail}")
    return changed


def _modules_of(stage: Stage, old: str) -> str:
    modules = changed_modules(stage, old)
    if not modules:
        return ""
    shown = ", ".join(name.removeprefix("scenewright.") for name in modules[:MODULES_SHOWN])
    return f" ({shown}{', …' if len(modules) > MODULES_SHOWN else ''})"


@contextmanager
def _machine_errors(out: Path) -> Iterator[None]:
    """Turn a full or read-only disk, a forbidden file and exhausted memory into MachineFailure."""
    try:
        yield
    except OSError as error:
        number, reason = first_cause(error)
        if number in MACHINE_ERRORS:
            raise MachineFailure(
                f"{error.filename or out}: {reason}", hint="free space or choose another --out"
            ) from error
        raise
    except ScenewrightError:
        raise
    except Exception as error:  # native libraries say it in words of their own
        if NO_CODE_CACHE in str(error):
            raise MachineFailure(NO_CODE_CACHE_TEXT, hint=NO_CODE_CACHE_HINT) from error
        if isinstance(error, MemoryError) or OUT_OF_MEMORY.search(str(error)):
            raise MachineFailure(f"{out}: out of memory", hint="use fewer frames or larger voxels") from error
        raise


def run_stage(
    stage: Stage,
    inputs: Mapping[str, Path],
    out: Path,
    parameters: Parameters,
    *,
    seed: int = 0,
    device: str = "cpu",
    force: bool = False,
    dry_run: bool = False,
    progress: SilentProgress | None = None,
    command: tuple[str, ...] = (),
    max_memory: int | None = None,
    shared: Path | None = None,
) -> RunResult:
    """Make the artifact at `out`, unless it is there already (docs/ARCHITECTURE.md, the stage contract).

    The step is stopped when its resident memory passes `max_memory` [bytes], in the main thread only. An artifact of
    the same key in the folder `shared` is copied instead of made (not with `force`), and what is made is kept there.
    Raises BadInput, UsageError, MissingDependency or MachineFailure; whatever stood at `out` is then untouched.
    """
    out = _resolved(out)
    inputs = with_usual_models(stage.reads, parameters, inputs)
    if stage.check is not None:
        stage.check(parameters, inputs)
    if shared is not None and inputs:
        raise UsageError(f"{stage.name}: --shared is for steps without inputs", hint="leave it out")
    opened = _open_inputs(stage, inputs)
    device = choose_device(device) if device != "cpu" else device
    digests = {item.role: item.digest for item in opened}
    libraries = library_versions(stage, parameters)
    key = artifact_key(stage, parameters, digests, seed, device, libraries)
    with _machine_errors(out):
        store.check_target(out, stage.writes.kind)
    facts: dict[str, Any] = {
        "code": step_code(stage).digest,
        "schema_version": stage.writes.schema_version,
        "seed": seed,
        "device_kind": device,
        "parameters": parameters_as_json(parameters),
        "libraries": libraries,
        "data_files": data_file_digests(stage, parameters),
        "inputs": digests,
    }

    if dry_run:
        previous = _previous_manifest(out)
        reason = _reason_to_run(stage, out, key, previous, force, facts)
        status: Status = "up to date" if reason is None else "would run"
        expected = estimation.estimate_step(stage, parameters, inputs) if reason is not None else None
        return RunResult(status, reason or "", out, key, previous if reason is None else None, estimate=expected)

    with _machine_errors(out), store.locked(out):
        previous = _previous_manifest(out)
        reason = _reason_to_run(stage, out, key, previous, force, facts)
        if reason is None:
            return RunResult("up to date", "", out, key, previous)
        if shared is not None and not force:
            with store.partial_folder(out) as partial:
                manifest = shared_artifacts.take(shared, stage, key, partial)
                if manifest is not None:
                    store.take_place(partial, out)
                    return RunResult("taken", f"made before, kept in {shared}", out, key, manifest)
        logger.info("%s: %s (%s)", stage.name, stage.summary, reason)
        estimation.warn_or_refuse(stage.name, estimation.estimate_step(stage, parameters, inputs), out)
        started = datetime.now(UTC)
        progress = progress or SilentProgress()
        with store.partial_folder(out) as partial:
            kept = store.kept_folder(out, key, fresh=force)
            context = Context(output=partial, seed=seed, device=device, progress=progress, force=force, kept=kept)
            with (
                interruption.insisting(),
                _inputs_stay(opened),
                memory_limit.limited(max_memory, out),
                showing(progress),
            ):
                made = _work(stage, opened, parameters, context)
            _check_payload(stage, made, partial)
            timings = {**progress.seconds, PROCESSOR: processor_seconds()}
            (partial / store.TIMINGS_NAME).write_text(
                json.dumps({name: round(value, 3) for name, value in sorted(timings.items())}, indent=1)
            )
            records = record_files(partial, stage.writes.undigested)
            manifest = Manifest(
                kind=stage.writes.kind,
                schema_version=stage.writes.schema_version,
                stage=stage.name,
                code=facts["code"],
                key=key,
                content_digest=content_digest(records),
                files=records,
                inputs=tuple(
                    InputRecord(role=i.role, kind=i.kind, digest=i.digest, path=_path_from(i.path, out)) for i in opened
                ),
                parameters=facts["parameters"],
                seed=seed,
                libraries=facts["libraries"],
                data_files=facts["data_files"],
                device_kind=device,
                accepted_code=carried_on(item.value.manifest for item in opened if isinstance(item.value, Artifact)),
                outcome=made.outcome,
                summary=made.summary,
                provenance=provenance_now(command, device, started),
            )
            manifest.write(partial / MANIFEST_NAME)
            interruption.raise_if_requested()
            store.take_place(partial, out)
            store.forget_kept(out)
        if shared is not None:
            shared_artifacts.keep(shared, stage, key, out)
    nondeterministic = (
        previous is not None and previous.key == key and previous.content_digest != manifest.content_digest
    )
    if nondeterministic:
        logger.warning("%s: the same key gave other bytes than before: this step is not deterministic", stage.name)
    return RunResult("made", reason, out, key, manifest, nondeterministic)


def _path_from(path: Path, out: Path) -> str:
    """Return how a manifest at `out` names an input: from there, or from the root where that were too long."""
    relative = os.path.relpath(path, out)
    return relative if len(relative) <= LONGEST_PATH else os.path.abspath(path)


def _work(stage: Stage, opened: list[_OpenInput], parameters: Parameters, context: Context) -> Artifact:
    for item in opened:
        item.check()
    with interruption.waiting():
        run = importlib.import_module(f"{package_of(stage)}.{stage.module}").run
    values: dict[str, Artifact | Path | None] = dict.fromkeys(stage.reads)
    values.update({item.role: item.value for item in opened})
    return run(**values, parameters=parameters, context=context)


def _previous_manifest(out: Path) -> Manifest | None:
    try:
        return read_manifest(out)
    except BadInput:
        return None


def _check_payload(stage: Stage, made: Artifact, partial: Path) -> None:
    """What a step says it wrote has to be there and readable, before anybody else sees it."""
    if type(made) is not stage.writes or made.root != partial:
        raise TypeError(f"step {stage.name} returned {made!r}, not {stage.writes.__name__} in its output folder")
    if made.outcome == "ok":
        for name, model in stage.writes.json_files.items():
            model.read(partial / name)
