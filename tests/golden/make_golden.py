"""Cuts a finished small demo run down to tiny golden artifacts: python -m tests.golden.make_golden RUN (by hand, once
per schema version; the result is committed and never made again for that version)."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.engine.reading import open_artifact

FOLDER = Path(__file__).resolve().parent
LARGEST = 60_000
"""Payload files over this size are left out [bytes]."""


def cut(source: Path, target: Path) -> None:
    """Copy JSON and small payload files, shorten the long lists, and write a manifest that is true of the rest."""
    artifact = open_artifact(source)
    manifest = artifact.manifest
    assert manifest is not None
    if target.exists():
        shutil.rmtree(target)
    target.mkdir(parents=True)
    for name in (*artifact.json_files, *(n for n in artifact.optional_json_files if artifact.path(n).exists())):
        data = json.loads((source / name).read_text())
        if name == "library.json":
            data["models"] = data["models"][:2]
        if name == "segments.json":
            data["frames"] = data["frames"][:2]
        (target / name).write_text(json.dumps(data, sort_keys=True) + "\n")
    for record in manifest.files:
        kept = record.bytes <= LARGEST and "/" not in record.path and record.digested
        if kept and not (target / record.path).exists():
            shutil.copy(source / record.path, target / record.path)
    records = record_files(target, artifact.undigested)
    cut_down = manifest.model_copy(
        update={
            "files": records,
            "content_digest": content_digest(records),
            "inputs": (),
            "provenance": manifest.provenance.model_copy(update={"command": (), "platform": "", "git_commit": ""}),
        }
    )
    cut_down.write(target / MANIFEST_NAME)


if __name__ == "__main__":
    for step in sorted(Path(sys.argv[1]).iterdir()):
        if (step / MANIFEST_NAME).exists() and not step.name.startswith("geometric_"):
            kind = open_artifact(step).kind
            cut(step, FOLDER / f"v{KINDS[kind].schema_version}" / kind)
