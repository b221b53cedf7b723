"""Code that a person accepts for a finished run, so that a change which decides no byte makes nothing again.

The list stands in the run's folder and in every manifest below it, and in what is made from those later.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
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
    is damaged, and MachineFailure where a step is writing one; nothing is written then.
    """
    roots = [path.parent for path in sorted(Path(run).glob(f"*/{MANIFEST_NAME}"))]
    if not roots:
        raise BadInput(f"{run}: no artifact in it", hint="give the folder of a run")
    with ExitStack() as locks:  # a step that replaced an artifact meanwhile would get the manifest of the old one
        for root in roots:
            locks.enter_context(store.locked(root))
        artifacts = {root: read_manifest(root) for root in roots}
        for root, manifest in artifacts.items():
            check_sizes(root, manifest)
        new = dict.fromkeys(entry for manifest in artifacts.values() for entry in _to_accept(manifest))
        if new:
            path = Path(run) / ACCEPTED_CODE_NAME
            before = AcceptedCodeFile.read(path).accepted if path.is_file() else ()
            entries = tuple(dict.fromkeys((*before, *new)))
            store.replace_document(AcceptedCodeFile(accepted=entries), path)
            for root, manifest in artifacts.items():
                carried = tuple(dict.fromkeys((*manifest.accepted_code, *entries)))
                store.replace_document(manifest.model_copy(update={"accepted_code": carried}), root / MANIFEST_NAME)
    return tuple(new)


def _to_accept(manifest: Manifest) -> tuple[AcceptedCode, ...]:
    """What has to be accepted so that an artifact counts as made by today's code; empty where its step is gone."""
    stage = all_stages().get(manifest.stage)
    code = step_code(stage).digest if stage is not None else manifest.code
    if code == manifest.code or is_accepted(manifest, code):
        return ()
    return (AcceptedCode(step=manifest.stage, made_with=manifest.code, accepted=code),)
