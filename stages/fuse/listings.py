"""What the segments of every frame are, in a few bytes each: the whole log's stay in memory while the map is built."""

from __future__ import annotations

import numpy as np
from scenewright.schemas.segments import FrameSegment, SegmentsFile, Witness


class Listings:
    """The segments of all frames as one table. Parsed records take thirty times as much, and would grow with the log
    beside a map that does not."""

    def __init__(self, segments: SegmentsFile) -> None:
        entries = [segment for frame in segments.frames for segment in frame.segments]
        self._ids = np.array([(s.id, s.class_id, s.instance, s.area) for s in entries], dtype=np.int32)
        self._ids = self._ids.reshape(-1, 4)
        self._is_thing = np.array([s.is_thing for s in entries], dtype=bool)
        self._score = np.array([s.score for s in entries], dtype=np.float64)
        witnesses = [witness for segment in entries for witness in segment.witnesses]
        self._said = np.array([(w.network, w.class_id) for w in witnesses], dtype=np.int32).reshape(-1, 2)
        self._witness_score = np.array([w.score for w in witnesses], dtype=np.float64)
        self._witness_starts = np.cumsum([0, *(len(segment.witnesses) for segment in entries)], dtype=np.int64)
        ends = np.cumsum([len(frame.segments) for frame in segments.frames], dtype=np.int64)
        starts = np.concatenate([[0], ends[:-1]]) if len(ends) else ends
        self._rows = {
            frame.frame: (int(start), int(end)) for frame, start, end in zip(segments.frames, starts, ends, strict=True)
        }

    def __contains__(self, frame: int) -> bool:
        return frame in self._rows

    def get(self, frame: int) -> tuple[FrameSegment, ...] | None:
        """Return the segments of a frame, None for one that is not listed."""
        if frame not in self._rows:
            return None
        start, end = self._rows[frame]
        return tuple(
            FrameSegment(
                id=identifier,
                class_id=category,
                instance=instance,
                is_thing=bool(self._is_thing[row]),
                score=float(self._score[row]),
                area=area,
                witnesses=self._witnesses(row),
            )
            for row, (identifier, category, instance, area) in enumerate(self._ids[start:end].tolist(), start=start)
        )

    def _witnesses(self, row: int) -> tuple[Witness, ...]:
        start, end = self._witness_starts[row : row + 2]
        return tuple(
            Witness(network=network, class_id=category, score=score)
            for (network, category), score in zip(
                self._said[start:end].tolist(), self._witness_score[start:end].tolist(), strict=True
            )
        )
