"""Code that a person accepts for a finished run, so that a change which decides no byte makes nothing again.

The list stands in the run's folder and in every manifest below it, and in what is made from those later.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from scenewright.schemas.accepted_code import ACCEPTED_CODE_NAME, AcceptedCode, AcceptedCodeFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.stages.engine import store
from scenewright.stages.engine.code.digests import step_code
from scenewright.stages.engine.discovery import all_stages
from scenewright.stages.engine.reading import check_sizes, read_manifest


def is_accepted(manifest: Manifest, code: str) -> bool:
    """Tell whether an artifact counts as made by code with this digest."""
    return AcceptedCode(step=manifest.stage, made_with=manifest.code, accepted=code) in manifest.accepted_code


def carried_on(manifests: Iterable[Manifest | None]) -> tuple[AcceptedCode, ...]:
    """Return what the manifests of a step's inputs carry, each entry once, in order."""
    entries = dict.fromkeys(entry for manifest in manifests if manifest is not None for entry in manifest.accepted_code)
    return tuple(sorted(entries, key=lambda entry: (entry.step, entry.made_with, entry.accepted)))


def accept_code(run: Path) -> tuple[AcceptedCode, ...]:
    """Accept today's code for every artifact of a run that other code made; return what was accepted now.

    Artifacts whose step is gone are left as they are. Raises BadInput where the folder holds no artifact, or one that
    is damaged; nothing is written then.
    """
    artifacts = {path.parent: read_manifest(path.parent) for path in sorted(Path(run).glob(f"*/{MANIFEST_NAME}"))}
    if not artifacts:
        raise BadInput(f"{run}: no artifact in it", hint="give the folder of a run")
    for root, manifest in artifacts.items():
        check_sizes(root, manifest)
    new = [
        AcceptedCode(step=manifest.stage, made_with=manifest.code, accepted=code)
        for manifest in artifacts.values()
        if (code := _code_today(manifest.stage)) not in ("", manifest.code) and not is_accepted(manifest, code)
    ]
    if not new:
        return ()
    path = Path(run) / ACCEPTED_CODE_NAME
    before = AcceptedCodeFile.read(path).accepted if path.is_file() else ()
    entries = tuple(dict.fromkeys((*before, *new)))
    store.replace_document(AcceptedCodeFile(accepted=entries), path)
    for root, manifest in artifacts.items():
        with store.locked(root):
            carried = tuple(dict.fromkeys((*manifest.accepted_code, *entries)))
            store.replace_document(manifest.model_copy(update={"accepted_code": carried}), root / MANIFEST_NAME)
    return tuple(dict.fromkeys(new))


def _code_today(step: str) -> str:
    stage = all_stages().get(step)
    return step_code(stage).digest if stage is not None else ""
