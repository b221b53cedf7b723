"""Any encoder behind HTTP: GET /info says {"label", "width", "side"}; POST /encode takes {"texts": [...]} or
{"pictures": [PNG, base64]} and answers {"vectors": [[...]]}, one row each (docs/SPLATS.md)."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import json_of
from scenewright.stages.kit.open_words.encoder import unit
from scenewright.stages.kit.services.connection import Connection

BATCH = 64
"""Crops of one request, which bounds its size."""
TIMEOUT, RETRIES, WAIT = 120.0, 3, 1.0
"""Longest wait for an answer [s], most repeats, and the pause before the first [s]."""
LARGEST_SIDE = 1024
"""Largest side of a crop that a service may ask for [px]; a bound."""
LARGEST_WIDTH = 65536
"""Most numbers of a vector that a service may send; a bound."""
_HINT = "is this an encoder of images and words? see docs/SPLATS.md"


class ServiceEncoder:
    """Asks a service. Raises MachineFailure when none answers, BadInput for what is no answer of an encoder."""

    def __init__(self, address: str) -> None:
        self._connection = Connection(address, timeout=TIMEOUT, retries=RETRIES, retry_wait=WAIT, refused_hint=_HINT)
        info = self._document(self._connection.get("/info").body)
        label, width, side = info.get("label"), info.get("width"), info.get("side")
        sound = isinstance(label, str) and 0 < len(label) <= 200 and type(width) is int and type(side) is int
        if not sound or not 1 <= width <= LARGEST_WIDTH or not 8 <= side <= LARGEST_SIDE:  # type: ignore[operator]
            raise BadInput(f"{address}/info: says no label, width and side", hint=_HINT)
        self.label, self.width, self.side = f"service {label}", int(width), int(side)  # type: ignore[arg-type]

    def pictures(self, crops: np.ndarray) -> np.ndarray:
        """Return (N, width) float32 unit vectors of crops (N, side, side, 3) uint8 RGB."""
        batches = [np.zeros((0, self.width), np.float32)]
        for start in range(0, len(crops), BATCH):
            part = [base64.b64encode(_png(crop)).decode() for crop in crops[start : start + BATCH]]
            batches.append(self._request_vectors({"pictures": part}, len(part)))
        return np.concatenate(batches)

    def texts(self, texts: Sequence[str]) -> np.ndarray:
        """Return (M, width) float32 unit vectors of texts."""
        return self._request_vectors({"texts": list(texts)}, len(texts))

    def unread(self, text: str) -> tuple[str, ...]:
        """Return nothing: what a service has read is not known."""
        return ()

    def _request_vectors(self, body: dict[str, Any], count: int) -> np.ndarray:
        answer = self._connection.post("/encode", json.dumps(body).encode(), "application/json")
        try:
            rows = np.array(self._document(answer.body).get("vectors"), np.float32)
        except (ValueError, TypeError):
            rows = np.zeros(0, np.float32)
        if rows.shape != (count, self.width) or not np.isfinite(rows).all():
            raise BadInput(
                f"{self._connection.address}: vectors of shape {rows.shape}, asked for {count} of {self.width}",
                hint="mend the service",
            )
        return unit(rows)

    def _document(self, data: bytes) -> dict[str, Any]:
        document = json_of(data, self._connection.address, hint=_HINT)
        if not isinstance(document, dict):
            raise BadInput(f"{self._connection.address}: no JSON object", hint=_HINT)
        return document


def _png(picture: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format="PNG")
    return buffer.getvalue()
