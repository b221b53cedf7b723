"""MCAP logs as a container of messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Hashable, Iterator
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.messages.container import Channel, StoredMessage
from scenewright.stages.ingest.messages.mcap_log import Location, LogMessage, McapLog


class McapMessages:
    """An MCAP log that is open for reading; see MessageLog."""

    format = "mcap"

    def __init__(self, path: Path, *, salvage: bool) -> None:
        self.path = path
        self._log = McapLog(path, salvage=salvage)
        self.damage: list[str] = self._log.damage
        self.notes: list[str] = self._log.notes
        self.metadata: dict[str, dict[str, str]] = {}
        for name, table in self._log.metadata:
            self.metadata.setdefault(name, table)
        self._channels = {number: self._channel(number) for number in sorted(self._log.channels)}
        self.channels = tuple(self._channels.values())
        self._left_out: Counter[str] = Counter()

    def _channel(self, number: int) -> Channel:
        channel = self._log.channels[number]
        schema = self._log.schemas.get(channel.schema_id)
        counts = self._log.message_counts
        return Channel(
            id=number,
            topic=channel.topic,
            type_name=schema.name if schema else "",
            message_encoding=channel.message_encoding,
            schema_encoding=schema.encoding if schema else "",
            schema=schema.data if schema else b"",
            count=None if counts is None else counts.get(number, 0),
        )

    def _as_stored(self, message: LogMessage) -> StoredMessage:
        return StoredMessage(self._channels[message.channel.id], message.log_time, message.data, message.location)

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield messages of the channels (None: all) in file order."""
        left_out: Counter[str] = Counter()
        for message in self._log.messages(channel_ids):
            if message.channel.id in self._channels:
                yield self._as_stored(message)
            else:  # defined in a chunk, and left out of a summary that has others
                left_out[message.channel.topic] += 1
        if channel_ids is None and not self._left_out:
            self._left_out = left_out
            for topic, number in sorted(left_out.items()):
                self._log.damage.found(f"a message belongs to {topic!r}, which the summary leaves out", number)

    def fetch(self, location: Hashable) -> StoredMessage:
        """Return the message at a location that `messages` gave. Raises BadInput when it has become unreadable."""
        if not isinstance(location, Location):
            raise BadInput(f"{self.path}: {location!r} is not a place in an MCAP file")
        return self._as_stored(self._log.fetch(location))

    def close(self) -> None:
        """Close the file."""
        self._log.close()


def open_mcap(path: Path, *, salvage: bool) -> McapMessages:
    """Open an MCAP log. Raises BadInput when it is none; without `salvage` also when it is torn or damaged."""
    return McapMessages(path, salvage=salvage)
