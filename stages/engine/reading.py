"""Opening artifacts as inputs: kind, version and sizes are checked first, hashes before a step works on them."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

from scenewright.schemas.artifact import Artifact
from scenewright.schemas.errors import BadInput
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import FORMAT_VERSION, LARGEST_MANIFEST, MANIFEST_NAME, Manifest
from scenewright.stages.engine.digests import content_digest
from scenewright.stages.engine.store import complete_interrupted
from scenewright.stages.kit.digests import sha256_of_file


def read_manifest(root: Path) -> Manifest:
    """Read the manifest of an artifact folder. Raises BadInput when there is none that this version can read."""
    root = Path(root)
    try:
        complete_interrupted(root)
        if not root.exists():
            raise BadInput(f"{root}: no such artifact", hint="run the step that makes it")
        path = root / MANIFEST_NAME
        if not path.exists():
            raise BadInput(f"{root}: not an artifact (no {MANIFEST_NAME})", hint="give the folder that a step wrote")
        manifest = Manifest.read(path, largest=LARGEST_MANIFEST)
    except (OSError, ValueError, RuntimeError) as error:  # no permission, too long, with a zero byte, a loop of links
        raise BadInput(f"{root}: {getattr(error, 'strerror', None) or error}", hint="give an artifact folder") from None
    if manifest.format_version > FORMAT_VERSION:
        raise BadInput(f"{root}: written by a newer scenewright", hint="upgrade scenewright")
    return manifest


def input_place(root: Path, path: str) -> Path:
    """Return where an input stood that the manifest at `root` names. Raises BadInput for what can be no place."""
    try:
        resolved = (root / path).resolve()
        os.stat(resolved)
    except (FileNotFoundError, NotADirectoryError):
        pass  # no longer there, which is no fault
    except (OSError, ValueError, RuntimeError) as error:  # too long, a zero byte, a loop of links
        reason = getattr(error, "strerror", None) or "a loop of links"
        raise BadInput(f"{root}: input {path!r:.80}: {reason}", hint="make the artifact again") from None
    if resolved == Path(root).resolve():
        raise BadInput(f"{root}: names itself as its input", hint="make the artifact again")
    return resolved


def check_version(root: Path, manifest: Manifest) -> type[Artifact]:
    """Return the class of the artifact's kind. Raises BadInput for an unknown kind or another schema version."""
    kind = KINDS.get(manifest.kind)
    if kind is None:
        raise BadInput(f"{root}: unknown kind {manifest.kind!r}", hint="upgrade scenewright")
    if manifest.schema_version > kind.schema_version:
        raise BadInput(
            f"{root}: {manifest.kind} version {manifest.schema_version} is newer than this scenewright reads "
            f"({kind.schema_version})",
            hint="upgrade scenewright",
        )
    if manifest.schema_version < kind.schema_version:
        raise BadInput(
            f"{root}: {manifest.kind} version {manifest.schema_version} is older than {kind.schema_version}",
            hint=f"run: scenewright migrate {root} --out {root}-v{kind.schema_version}",
        )
    return kind


def check_sizes(root: Path, manifest: Manifest) -> None:
    """Check that every payload file is there with its size. Raises BadInput naming the first that is not."""
    real_folder = cache(os.path.realpath)
    within = real_folder(root) + os.sep
    for record in manifest.files:
        path = root / record.path
        folder, name = os.path.split(path)
        try:
            real_path = os.path.realpath(path) if os.path.islink(path) else os.path.join(real_folder(folder), name)
            inside = real_path.startswith(within)
            size = path.stat().st_size if path.is_file() else None
        except (OSError, ValueError) as error:
            raise BadInput(
                f"{root}: {record.path!r:.80}: {getattr(error, 'strerror', None) or error}",
                hint="make the artifact again",
            ) from None
        if not inside:
            raise BadInput(f"{root}: {record.path} points outside the artifact", hint="make the artifact again")
        if size is None:
            raise BadInput(f"{path}: missing", hint="make the artifact again with --force")
        if size != record.bytes:
            raise BadInput(
                f"{path}: {size} bytes, the manifest says {record.bytes}", hint="make the artifact again with --force"
            )


def check_hashes(root: Path, manifest: Manifest) -> None:
    """Check that every payload file holds the bytes it was written with. Raises BadInput naming the first one.

    Costs about a second per gigabyte: for a step that is about to work on the artifact, not to see what is up to date.
    """
    if content_digest(manifest.files) != manifest.content_digest:
        raise BadInput(f"{root}: its {MANIFEST_NAME} was edited", hint="make the artifact again with --force")
    for record in manifest.files:
        if sha256_of_file(root / record.path) != record.sha256:
            raise BadInput(
                f"{root / record.path}: its bytes changed since it was written",
                hint="make the artifact again with --force",
            )


def open_outside(root: Path, kind: type[Artifact]) -> Artifact | None:
    """Return a handle without manifest where `root` is what others write in place of an artifact of `kind`: a file, or
    a folder that holds such a file and no manifest. None for anything else."""
    root = Path(root)
    try:
        lone = root.is_file() or ((root / kind.outside).is_file() and not (root / MANIFEST_NAME).exists())
    except (OSError, ValueError):
        return None
    return kind(root=root) if kind.outside and lone else None


def open_artifact(root: Path, expected: type[Artifact] | None = None) -> Artifact:
    """Open an artifact folder as its typed handle. A subclass of the kind will do: a disparity is a sequence.

    Raises BadInput for a wrong kind, version or missing payload.
    """
    root = Path(root)
    if expected is not None and expected.outside and root.is_dir() and not (root / MANIFEST_NAME).exists():
        raise BadInput(
            f"{root}: holds neither an artifact nor {expected.outside}",
            hint=f"give the folder that a step wrote, or a file like {expected.outside}",
        )
    manifest = read_manifest(root)
    kind_class = KINDS.get(manifest.kind)
    if expected is not None and kind_class is not None and not issubclass(kind_class, expected):
        raise BadInput(
            f"{root}: holds a {manifest.kind!r} artifact, {expected.kind!r} is needed", hint="give another folder"
        )
    kind = check_version(root, manifest)
    check_sizes(root, manifest)
    return kind(root=root, outcome=manifest.outcome, summary=dict(manifest.summary), manifest=manifest)
