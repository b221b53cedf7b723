"""`scenewright gc`: what can go, and how much it frees. Nothing goes that is locked, not ours, or somebody's result.

leftover      what a killed run left beside its target: partial folders, replaced artifacts, journals, the state of a
              long step from which it would go on
superseded    made from an input that has been made again since, with another result
intermediate  read by other artifacts, and remade to the same key by its step from inputs that are all there
result        everything else that a step wrote: never deleted
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import secrets
import shutil
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from pydantic import ValidationError
from scenewright.schemas.errors import BadInput, MachineFailure, ScenewrightError
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME, InputRecord, Manifest
from scenewright.stages.engine import store
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.keys import artifact_key
from scenewright.stages.engine.reading import input_place, read_manifest
from scenewright.stages.kit.digests import external_digest

Category = Literal["leftover", "superseded", "intermediate", "result"]
_SUFFIX = r"(?:partial-\d+-[0-9a-f]{8}|old-[0-9a-f]{8}|kept-[0-9a-f]{16}|journal)"
LEFTOVER = re.compile(rf"\.(?P<target>.+)\.{_SUFFIX}")
"""Names that `store` gives to what must not outlive a run."""

LONGEST_REASON = 300
"""Letters after which the way to the first cause is no longer told."""


@dataclass(frozen=True)
class Item:
    """One thing that gc looked at."""

    path: Path
    category: Category
    kind: str
    """Kind of the artifact, empty for leftovers."""
    bytes: int
    reason: str
    """Why it is in its category, or why it stays, for people."""
    collectable: bool = False
    """Whether it goes under the options given."""
    key: str = ""
    """Key of the artifact when it was looked at: what has been made again since is left alone."""


@dataclass
class _Artifact:
    """An artifact of the survey with its place in the graph of inputs."""

    path: Path
    manifest: Manifest
    inputs: list[tuple[InputRecord, Path, Path | None]] = field(default_factory=list)
    """Record, path, and the surveyed artifact that the path is or lies in."""
    users: set[Path] = field(default_factory=set)
    odd: str = ""
    """Why nothing can be said about how it would be made again; empty for what a step wrote."""
    stale: str = ""
    """Why it is not what its inputs would give today; empty when it is."""
    ours: bool = True
    """Whether it is within the folders asked about; others only count as users."""


def survey(
    paths: Iterable[Path], *, superseded: bool = False, intermediate: bool = False, keep: Collection[str] = ()
) -> list[Item]:
    """List what stands in run folders (or folders of runs), and mark what goes under the options.

    Raises BadInput for a path that is not there, and for a kind in `keep` that does not exist.
    """
    unknown = sorted(set(keep) - set(KINDS))
    if unknown:
        raise BadInput(f"no kind {unknown[0]!r}", hint=f"kinds: {', '.join(sorted(KINDS))}")
    roots = [Path(os.path.realpath(path)) for path in paths]
    for root in roots:
        if not os.path.isdir(root):
            raise BadInput(f"{root}: no such folder", hint="give run folders, or a folder of runs")
    leftovers, folders = _find(roots)
    artifacts = _read_artifacts(folders, roots)
    items = [_leftover_item(target, leftover_paths) for target, leftover_paths in sorted(leftovers.items())]
    chosen = {
        path: _classify(path, artifacts, superseded=superseded, intermediate=intermediate, keep=keep)
        for path, artifact in sorted(artifacts.items())
        if artifact.ours
    }
    return items + list(_without_used(chosen, artifacts).values())


def collect(items: Iterable[Item]) -> tuple[list[Item], list[Item]]:
    """Delete what is marked. Returns what is gone, and what stayed after all, with the reason."""
    gone, stayed = [], []
    for item in items:
        if not item.collectable:
            continue
        try:
            if item.category == "leftover":
                with store.locked(item.path):  # holding the lock recovers and sweeps
                    pass
            else:
                _remove(item)
            gone.append(item)
        except (ScenewrightError, OSError, RecursionError) as error:
            stayed.append(replace(item, collectable=False, reason=str(error)))
    return gone, stayed


# --- what is there ---------------------------------------------------------------------------------------------


def _find(roots: Iterable[Path]) -> tuple[dict[Path, list[Path]], set[Path]]:
    """Return target -> its leftovers, and the artifact folders, anywhere under the roots; links are not followed."""
    leftovers: dict[Path, list[Path]] = {}
    artifacts: set[Path] = set()
    waiting = list(roots)
    while waiting:
        folder = waiting.pop()
        if (folder / MANIFEST_NAME).is_file():
            artifacts.add(folder)
            continue
        with contextlib.suppress(PermissionError):
            for entry in sorted(os.scandir(folder), key=lambda e: e.name):
                match = LEFTOVER.fullmatch(entry.name)
                if match and (folder / f".{match['target']}.lock").exists():
                    leftovers.setdefault(folder / match["target"], []).append(Path(entry.path))
                elif entry.is_dir(follow_symlinks=False):
                    waiting.append(Path(entry.path))
    for root in roots:  # a root that is an artifact itself: what lies beside it is part of the question
        if root in artifacts:
            pattern = re.compile(re.escape(f".{root.name}.") + _SUFFIX)
            beside = [Path(e.path) for e in os.scandir(root.parent) if pattern.fullmatch(e.name)]
            if beside and (root.parent / f".{root.name}.lock").exists():
                leftovers[root] = sorted(beside)
    return leftovers, artifacts


def _read_artifacts(folders: set[Path], roots: list[Path]) -> dict[Path, _Artifact]:
    """Read the manifests of the artifacts and of their neighbours, which may read them, and link them up."""
    artifacts: dict[Path, _Artifact] = {}
    for folder in sorted(folders | _neighbours(roots)):
        try:
            artifacts[folder] = _Artifact(folder, read_manifest(folder), ours=folder in folders)
        except BadInput:
            continue  # torn, or not ours: nothing is known of it, so nothing is done to it
    for artifact in artifacts.values():
        for record in artifact.manifest.inputs:
            try:
                path = input_place(artifact.path, record.path)
            except BadInput as error:
                artifact.odd = str(error)
                continue
            owner = next((ancestor for ancestor in (path, *path.parents) if ancestor in artifacts), None)
            artifact.inputs.append((record, path, owner))
            if owner is not None:
                artifacts[owner].users.add(artifact.path)
    _follow_inputs(artifacts)
    return artifacts


def _neighbours(roots: list[Path]) -> set[Path]:
    """Artifacts in sibling folders of the roots, two levels deep: other runs that may read these."""
    siblings: set[Path] = set()
    for parent in {root.parent for root in roots}:
        for pattern in (f"*/{MANIFEST_NAME}", f"*/*/{MANIFEST_NAME}"):
            with contextlib.suppress(OSError):
                siblings |= {path.parent for path in parent.glob(pattern)}
    return siblings


def folder_bytes(path: Path) -> int:
    """Return the size of a file, or of all files in a folder [bytes]; links count as themselves."""
    if not path.is_dir() or path.is_symlink():
        return path.lstat().st_size if path.exists() else 0
    total = 0
    for folder, _, names in os.walk(path):
        for name in names:
            with contextlib.suppress(FileNotFoundError):
                total += os.lstat(os.path.join(folder, name)).st_size
    return total


def is_locked(target: Path) -> bool:
    """Whether a run holds the lock of a target now."""
    try:
        descriptor = os.open(target.with_name(f".{target.name}.lock"), os.O_RDONLY | os.O_NONBLOCK)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


# --- what can go -----------------------------------------------------------------------------------------------


def _leftover_item(target: Path, paths: list[Path]) -> Item:
    size = sum(folder_bytes(path) for path in paths)
    if is_locked(target):
        return Item(target, "leftover", "", size, "a run is writing it now")
    reason = "left by a run that was killed"
    if any(path.name.endswith(".journal") for path in paths):
        if not target.exists():
            size = 0  # one of them becomes the artifact
        reason = "a replacement was interrupted; it is completed first"
    return Item(target, "leftover", "", size, reason, collectable=True)


def _classify(
    path: Path, artifacts: dict[Path, _Artifact], *, superseded: bool, intermediate: bool, keep: Collection[str]
) -> Item:
    artifact = artifacts[path]
    manifest = artifact.manifest
    item = Item(path, "result", manifest.kind, folder_bytes(path), "nothing else reads it", key=manifest.key)
    if artifact.odd:
        item = replace(item, reason=artifact.odd)
    elif artifact.stale:
        item = replace(item, category="superseded", reason=artifact.stale, collectable=superseded)
    elif artifact.users:
        missing = _cannot_be_remade(artifact)
        readers = ", ".join(sorted({user.name for user in artifact.users}))
        if missing:
            item = replace(item, reason=f"read by {readers}, and cannot be remade: {missing}")
        else:
            reason = f"read by {readers}; making it took {manifest.provenance.seconds:.1f} s"
            item = replace(item, category="intermediate", reason=reason, collectable=intermediate)
    if item.collectable and manifest.kind in keep:
        return replace(item, collectable=False, reason=f"stays as asked; {item.reason}")
    if item.collectable and is_locked(path):
        return replace(item, collectable=False, reason="a run is writing it now")
    return item


def _follow_inputs(artifacts: dict[Path, _Artifact]) -> None:
    """Note of every artifact whether it is stale or odd, inputs before what was made from them, each once."""
    external: dict[Path, str] = {}
    done: set[Path] = set()
    for first in sorted(artifacts):
        path = {} if first in done else {first: iter(artifacts[first].inputs)}
        while path:
            current, following = next(reversed(path.items()))
            artifact = artifacts[current]
            for _, _, owner in following:
                if owner is None:
                    continue
                if owner in path:
                    artifact.odd = artifact.odd or f"its inputs lead in a circle, by {owner.name}"
                    continue
                if owner not in done:
                    path[owner] = iter(artifacts[owner].inputs)
                    break
            else:
                _note_inputs(artifact, artifacts, external)
                done.add(current)
                del path[current]


def _note_inputs(artifact: _Artifact, artifacts: dict[Path, _Artifact], external: dict[Path, str]) -> None:
    """Note what the inputs of an artifact, which have been noted before, say about it."""
    for record, input_path, owner in artifact.inputs:
        if owner is None or owner == artifact.path:
            continue
        owner_artifact = artifacts[owner]
        if owner_artifact.odd and not artifact.odd:
            artifact.odd = _made_from(owner, owner_artifact.odd)
        if artifact.stale:
            continue
        if _digest_now(record, input_path, owner_artifact, external) != record.digest:
            artifact.stale = f"{owner.name} was made again with another result since"
        elif owner_artifact.stale:
            artifact.stale = _made_from(owner, owner_artifact.stale)


def _made_from(owner: Path, reason: str) -> str:
    return f"made from {owner.name}: {reason}" if len(reason) < LONGEST_REASON else reason


def _digest_now(record: InputRecord, input_path: Path, owner: _Artifact, external: dict[Path, str]) -> str | None:
    """Digest of an input as its artifact states it now; None when it is no longer there."""
    if input_path == owner.path:
        if record.kind != "external":
            return owner.manifest.content_digest
        if input_path not in external:
            external[input_path] = external_digest(input_path)
        return external[input_path]
    name = input_path.relative_to(owner.path).as_posix()
    digest_of = {file.path: file.sha256 for file in owner.manifest.files}
    return digest_of.get(name, record.digest if input_path.is_dir() else None)


def _cannot_be_remade(artifact: _Artifact) -> str:
    """Why making an artifact again would not give it back; empty when it would.

    Inputs that are artifacts need no look: each is there with the digest that was read (else this one is superseded),
    and goes only if it can be remade itself.
    """
    manifest = artifact.manifest
    stage = all_stages().get(manifest.stage)
    if stage is None:
        return f"this scenewright has no step {manifest.stage}"
    if manifest.code != step_code(stage).digest:
        return f"the code of {manifest.stage} has changed since"
    try:
        parameters = stage.parameters(**manifest.parameters)
        digests = {record.role: record.digest for record in manifest.inputs}
        key = artifact_key(stage, parameters, digests, manifest.seed, manifest.device_kind)
    except (ValidationError, ScenewrightError) as error:
        return f"its parameters are not those of today ({str(error).splitlines()[0]})"
    if key != manifest.key:
        return "libraries or data files have changed since"
    gone = next(
        (input_path for _, input_path, owner in artifact.inputs if owner is None and not input_path.exists()), None
    )
    return f"its input {gone} is gone" if gone else ""


def _without_used(chosen: dict[Path, Item], artifacts: dict[Path, _Artifact]) -> dict[Path, Item]:
    """Keep what is superseded as long as something reads it that stays."""
    changed = True
    while changed:
        changed = False
        for path, item in chosen.items():
            if item.category != "superseded" or not item.collectable:
                continue
            staying = [u for u in artifacts[path].users if not (u in chosen and chosen[u].collectable)]
            if staying:
                chosen[path] = replace(item, collectable=False, reason=f"read by {staying[0].name}, which stays")
                changed = True
    return chosen


def _remove(item: Item) -> None:
    """Delete an artifact that is still the one that was looked at, first out of sight, then for good."""
    with store.locked(item.path):
        manifest = read_manifest(item.path)
        if manifest.key != item.key:
            raise MachineFailure(f"{item.path} was made again meanwhile", hint="look again")
        if item.category == "intermediate":
            for record in manifest.inputs:
                input_path = (item.path / record.path).resolve()
                if record.kind == "external" and input_path.exists() and external_digest(input_path) != record.digest:
                    raise BadInput(
                        f"{item.path}: its input {input_path} is another one now", hint="it could not be remade"
                    )
        hidden = item.path.with_name(f".{item.path.name}.old-{secrets.token_hex(4)}")
        os.rename(item.path, hidden)
        store.sync_folder(item.path.parent)
        shutil.rmtree(hidden)
