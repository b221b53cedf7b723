"""Words asked of a language map from a page: where they fit, how well every Gaussian does, or that there is nothing."""

from __future__ import annotations

import base64
import time
from typing import Any

import numpy as np
from scenewright.schemas.errors import UsageError
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.geometry.boxes import box_corners
from scenewright.stages.kit.open_words.encoder import checked_text
from scenewright.stages.kit.open_words.finding import Finder, Found, heard
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.options import EncoderParameters

LEAST = 0.5
"""Probability of an answer, as `splat query` takes it unless it is told otherwise."""
MOST = 10
"""Most answers that are shown."""
COLD = 0.5
"""Relevancy from which on a Gaussian is shown warm: what fits no better than the canonical phrases has none."""
MOST_WARM = 40_000
"""Most Gaussians that are shown warm; by eye."""


class Asking:
    """One language map; its encoder is opened when it is first asked."""

    def __init__(self, language: LanguageMap) -> None:
        self.language = language
        self._finder: Finder | None = None

    def facts(self) -> dict[str, Any]:
        """Return what the page says beside the box, as JSON."""
        return {"encoder": self.language.info.encoder, "places": len(self.language.info.regions)}

    def answer(self, text: str) -> dict[str, Any]:
        """Return places that fit, the likeliest first, and how warm the Gaussians are, as JSON.

        Raises UsageError for a text that asks for nothing, and for the map of another encoder than the embedded one.
        """
        text = checked_text(text)
        if self._finder is None:
            encoder = open_encoder(EncoderParameters.model_validate({}), None)
            if encoder.label != self.language.info.encoder:
                raise UsageError(
                    f"this map was made with {self.language.info.encoder!r:.80}; a page asks our own encoder alone",
                    hint="scenewright splat query --encoder ...",
                )
            self._finder = Finder(self.language, encoder)
        began, finder, phrase = time.perf_counter(), self._finder, heard(text)
        fits, ranking = finder.fits(text, phrase), finder.find(text, phrase)
        seconds = time.perf_counter() - began
        answers = [candidate for candidate in ranking if candidate.probability >= LEAST][:MOST]
        below = next((candidate for candidate in ranking if candidate.probability < LEAST), None)
        return {
            "text": text,
            "understood": "" if phrase is None or not finder.by_names else phrase.said(),
            "answers": [self._place(candidate) for candidate in answers],
            "next_best": None if below is None else self._place(below),
            "unread": list(finder.encoder.unread(text)),
            "unknown": not answers and finder.cannot_tell(text),
            "calibrated": finder.calibration.fitted,
            "strange": finder.is_strange and not finder.by_names,
            "milliseconds": round(1e3 * seconds, 1),
            **self._warmth(fits.gaussians),
        }

    def _place(self, answer: Found) -> dict[str, Any]:
        assert self._finder is not None
        region = self._finder.info.regions[answer.region]
        return {
            "probability": round(answer.probability, 3),
            "name": f"{region.class_name}_{region.instance}" if region.class_name else "",
            "doubtful": answer.doubtful,
            "center": [round(value, 3) for value in region.box.center],
            "corners": np.round(box_corners(region.box), 4).ravel().tolist(),
        }

    def _warmth(self, relevancy: np.ndarray | None) -> dict[str, str]:
        """Return the places (K, 3) float32 of the warmest Gaussians and their warmth (K,) uint8, in base 64."""
        assert self._finder is not None
        if relevancy is None:
            return {"places": "", "warmth": ""}
        rows = np.argsort(-relevancy, kind="stable")[:MOST_WARM]
        rows = rows[(relevancy[rows] > COLD) & (self._finder.vectors.opacities[rows] > 0.15)]
        warmth = np.round(255 * np.clip((relevancy[rows] - COLD) / (1 - COLD), 0, 1)).astype(np.uint8)
        places = np.ascontiguousarray(self._finder.vectors.means[rows], "<f4")
        return {name: base64.b64encode(a.tobytes()).decode() for name, a in (("places", places), ("warmth", warmth))}
