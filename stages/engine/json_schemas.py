"""Exporting the JSON Schemas of the manifest and of every payload file to schemas/json/."""

from __future__ import annotations

import json

from scenewright.schemas.kinds import KINDS
from scenewright.schemas.manifest import Manifest


def json_schemas() -> dict[str, str]:
    """Return file name -> JSON Schema text, for the manifest and each `<kind>.<payload>`."""
    schemas = {"manifest.schema.json": Manifest.model_json_schema()}
    for kind, artifact in sorted(KINDS.items()):
        for name, model in (artifact.json_files | artifact.optional_json_files).items():
            stem = name.removesuffix(".json")
            schemas[f"{kind}.v{artifact.schema_version}.{stem}.schema.json"] = model.model_json_schema()
    return {name: json.dumps(schema, indent=1, sort_keys=True) + "\n" for name, schema in schemas.items()}
