"""Code that somebody accepted for artifacts which other code made."""

from __future__ import annotations

from scenewright.schemas.base import Model

ACCEPTED_CODE_NAME = "accepted_code.json"


class AcceptedCode(Model):
    """One step's artifact counts as made by the code `accepted`, though the code `made_with` made it."""

    step: str
    made_with: str
    """Digest of the code in the artifact's manifest; empty for one that was made before manifests named it."""
    accepted: str


class AcceptedCodeFile(Model):
    """`accepted_code.json` of a run folder."""

    format_version: int = 1
    accepted: tuple[AcceptedCode, ...] = ()
