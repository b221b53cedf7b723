"""Bringing an artifact of an older schema version up to date, into a new folder."""

from __future__ import annotations

import shutil
from pathlib import Path

from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.schemas.migrations import MIGRATIONS
from scenewright.stages.engine import store
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.engine.reading import check_sizes, read_manifest


def migrate(source: Path, out: Path) -> Manifest:
    """Write `source` in its kind's current schema version to `out`. Raises BadInput, UsageError.

    The key is kept with the schema version noted as migrated, so that the step that would make the artifact today
    does not take the migrated one for its own work.
    """
    source, out = Path(source).absolute(), Path(out).absolute()
    manifest = read_manifest(source)
    kind = KINDS.get(manifest.kind)
    if kind is None:
        raise BadInput(f"{source}: unknown kind {manifest.kind!r}", hint="upgrade scenewright")
    if manifest.schema_version == kind.schema_version:
        raise UsageError(f"{source}: is at version {kind.schema_version} already", hint="nothing to do")
    if manifest.schema_version > kind.schema_version:
        raise BadInput(f"{source}: newer than this scenewright", hint="upgrade scenewright")
    check_sizes(source, manifest)
    if out == source:
        raise UsageError("--out is the artifact itself", hint="migrations write into a new folder")
    store.check_target(out, manifest.kind)
    with store.locked(out), store.partial_folder(out) as partial, store.partial_folder(out) as scratch:
        current = source
        for version in range(manifest.schema_version, kind.schema_version):
            step = MIGRATIONS.get((manifest.kind, version))
            if step is None:
                raise BadInput(
                    f"{source}: no migration of {manifest.kind} from version {version}", hint="make it again"
                )
            following = scratch / str(version + 1)
            following.mkdir()
            step(current, following)
            current = following
        shutil.copytree(current, partial, dirs_exist_ok=True)
        for name, model in kind.json_files.items():
            model.read(partial / name)
        records = record_files(partial, kind.undigested)
        migrated = manifest.model_copy(
            update={
                "schema_version": kind.schema_version,
                "key": f"migrated-from-v{manifest.schema_version}:{manifest.key}",
                "files": records,
                "content_digest": content_digest(records),
                "inputs": (),
                "provenance": manifest.provenance.model_copy(update={"command": ("migrate", str(source))}),
            }
        )
        migrated.write(partial / MANIFEST_NAME)
        store.take_place(partial, out)
    return migrated
