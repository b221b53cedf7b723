"""MCAP with Foxglove protobuf messages: what Foxglove, Rerun and our own `ingest` open."""

from __future__ import annotations

from scenewright.stages.export.registry import STREAMS, SequenceFormat

FORMAT = SequenceFormat(
    name="foxglove",
    order=30,
    layout="mcap",
    dialect="foxglove",
    summary="Foxglove protobuf",
    streams=STREAMS,
    log="log.mcap",
)
