"""Verifying artifacts: every byte re-hashed, every input followed back to the log."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from scenewright.schemas.errors import BadInput, ScenewrightError
from scenewright.schemas.manifest import MANIFEST_NAME, InputRecord, Manifest
from scenewright.stages.engine.accepted_code import is_accepted
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.digests import content_digest, payload_files
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.reading import check_sizes, check_version, input_place, read_manifest
from scenewright.stages.engine.store import TIMINGS_NAME
from scenewright.stages.kit.digests import external_digest, sha256_of_file


@dataclass(frozen=True)
class Finding:
    """One artifact's verdict. `problems` is empty when it is sound; `notes` tell what could not be checked."""

    path: Path
    kind: str
    problems: tuple[str, ...]
    notes: tuple[str, ...] = ()


def _check_bytes(root: Path, manifest: Manifest) -> list[str]:
    problems = []
    recorded = {record.path: record for record in manifest.files}
    for path in payload_files(root):
        if path.relative_to(root).as_posix() not in recorded:
            problems.append(f"{path}: not in the manifest")
    for record in manifest.files:
        if (root / record.path).is_file() and sha256_of_file(root / record.path) != record.sha256:
            problems.append(f"{root / record.path}: its bytes changed since it was written")
    if content_digest(manifest.files) != manifest.content_digest:
        problems.append(f"{root / MANIFEST_NAME}: content digest does not match its own file list")
    return problems


def _check_models(root: Path, manifest: Manifest) -> list[str]:
    problems = []
    if manifest.outcome == "ok":
        kind = check_version(root, manifest)
        optional = {name: model for name, model in kind.optional_json_files.items() if (root / name).exists()}
        for name, model in (kind.json_files | optional).items():
            try:
                model.read(root / name)
            except BadInput as error:
                problems.append(error.message)
    return problems


@dataclass
class _Visit:
    """An artifact whose inputs are being followed."""

    root: Path
    manifest: Manifest
    problems: list[str]
    notes: list[str] = field(default_factory=list)
    followed: int = 0
    """How many of its inputs have been."""

    def finding(self) -> Finding:
        return Finding(self.root, self.manifest.kind, tuple(self.problems), tuple(self.notes))


class _Digests:
    """Digests of what inputs name, each taken once: many artifacts read the same log."""

    def __init__(self) -> None:
        self._external: dict[Path, str] = {}
        self._content: dict[Path, str] = {}

    def external(self, place: Path) -> str:
        """Return the digest of a raw file or folder. Raises BadInput."""
        if place not in self._external:
            self._external[place] = external_digest(place)
        return self._external[place]

    def content(self, place: Path) -> str:
        """Return the content digest that an artifact states. Raises ScenewrightError."""
        if place not in self._content:
            self._content[place] = read_manifest(place).content_digest
        return self._content[place]


def verify(root: Path, seen: dict[Path, Finding] | None = None) -> list[Finding]:
    """Re-hash an artifact and follow its inputs back to the log, each artifact once, however many ways lead there.

    Returns one finding per artifact reached that was not in `seen`; inputs that lead in a circle are a problem of the
    artifact that closes it.
    """
    seen = {} if seen is None else seen
    digests = _Digests()
    reached: list[Path] = []
    path: dict[Path, _Visit] = {}
    """The artifacts between the first and the one that is looked at, in this order."""

    def enter(place: Path) -> None:
        reached.append(place)
        visit = _open_visit(place)
        if isinstance(visit, Finding):
            seen[place] = visit
        else:
            path[place] = visit

    try:
        root = Path(root).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise BadInput(f"{root}: {getattr(error, 'strerror', None) or error}", hint="give an artifact folder") from None
    if root in seen:
        return []
    enter(root)
    while path:
        visit = next(reversed(path.values()))
        if visit.followed == len(visit.manifest.inputs):
            seen[visit.root] = visit.finding()
            del path[visit.root]
            continue
        record = visit.manifest.inputs[visit.followed]
        visit.followed += 1
        place = _check_input(visit, record, digests)
        if place in path:
            visit.problems.append(f"input {record.role}: leads back to {place}, which was made from this one")
        elif place is not None and place not in seen:
            enter(place)
    return [seen[place] for place in reached]


def _open_visit(root: Path) -> _Visit | Finding:
    """Return an artifact with what is wrong with itself, or the verdict on what cannot be read."""
    try:
        manifest = read_manifest(root)
        check_version(root, manifest)
    except ScenewrightError as error:
        return Finding(root, "unknown", (str(error),))
    try:
        check_sizes(root, manifest)
        problems = _check_bytes(root, manifest) + _check_models(root, manifest)
        return _Visit(root, manifest, problems, _notes_on_code(manifest))
    except BadInput as error:
        return _Visit(root, manifest, [str(error)])


def _notes_on_code(manifest: Manifest) -> list[str]:
    """What cannot be said of the code that made an artifact, and what somebody accepted."""
    notes = [
        f"code of {entry.step}: {entry.made_with[:12] or 'unknown'} was accepted as {entry.accepted[:12]}, not checked"
        for entry in manifest.accepted_code
    ]
    stage = all_stages().get(manifest.stage)
    unchecked = "that its bytes come from its inputs is not checked"
    if not manifest.code:
        return [*notes, f"its manifest names no code (it was made before manifests did): {unchecked}"]
    if stage is None:
        return [*notes, f"this scenewright has no step {manifest.stage!r}: {unchecked}"]
    today = step_code(stage).digest
    if today != manifest.code and not is_accepted(manifest, today):
        notes.append(f"made with code {manifest.code[:12]} of {stage.name}, which is {today[:12]} here: {unchecked}")
    return notes


def _check_input(visit: _Visit, record: InputRecord, digests: _Digests) -> Path | None:
    """Compare an input with its record; return the artifact that it is, or lies in, or None."""
    try:
        source = input_place(visit.root, record.path)
        if not source.exists():
            visit.notes.append(f"input {record.role} is no longer at {source}")
        elif record.kind != "external":
            if digests.content(source) != record.digest:
                visit.problems.append(f"input {record.role} ({source}) was made again with another result since")
            return source
        elif digests.external(source) != record.digest:
            visit.problems.append(f"input {record.role} ({source}) is not what the artifact was made from")
        elif (source.parent / MANIFEST_NAME).exists():  # a payload file of an artifact, such as a generated log
            return source.parent
        elif (source / TIMINGS_NAME).exists() and (source / MANIFEST_NAME).exists():  # a log that `export` wrote
            return source
    except ScenewrightError as error:
        visit.problems.append(f"input {record.role}: {error}")
    return None
