"""rosbag2 as a container of messages: a folder of `.db3` or `.mcap` parts, or one `.db3` file."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Collection, Hashable, Iterator
from pathlib import Path
from typing import NamedTuple

from scenewright.schemas.errors import BadInput, MachineFailure
from scenewright.stages.ingest.messages.container import Channel, StoredMessage
from scenewright.stages.ingest.messages.damage_lines import HINT, DamageLines
from scenewright.stages.ingest.messages.log_file import Damaged, LogFile
from scenewright.stages.ingest.messages.mcap_container import McapMessages
from scenewright.stages.ingest.messages.mcap_records import MAGIC as MCAP_MAGIC
from scenewright.stages.ingest.messages.rosbag2_metadata import NAME, BagMetadata, listed_parts, read_bag_metadata
from scenewright.stages.ingest.messages.sqlite_container import LARGEST_MESSAGE, SqliteMessages
from scenewright.stages.ingest.messages.sqlite_container import MAGIC as SQLITE_MAGIC
from scenewright.stages.kit.formats.bounded_unpacking import stated_size, unpack_file, unpacked_within

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
GREATEST_RATIO = 100
"""Unpacked over packed bytes of a part that states no size; 64 MiB are always accepted."""
GREATEST_STATED_RATIO = 1000
"""Largest ratio of unpacked to packed size where the metadata states the packing; by eye."""
ALWAYS_ACCEPTED = 64 << 20
"""Bytes up to which a part is unpacked whatever its ratio; by eye."""
MOST_OPEN = 8
"""Most parts that are open at a time."""
Part = McapMessages | SqliteMessages


class Place(NamedTuple):
    """Where a message stands: in which part, and where in that."""

    part: int
    inside: Hashable


class Rosbag2Messages:
    """A rosbag2 recording that is open for reading; see MessageLog. Its parts are read one after the other."""

    format = "rosbag2"

    def __init__(self, path: Path, *, salvage: bool) -> None:
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.damage: list[str] = []
        self.notes: list[str] = []
        self._salvage = salvage
        self._lines = DamageLines(path, salvage=salvage)
        self._of_parts: dict[int, list[str]] = {}
        self._open: dict[int, Part] = {}
        self._in_use: list[int] = []
        self._unpacked: dict[int, tempfile.TemporaryDirectory[str]] = {}
        self._numbers: dict[tuple[int, int], int] = {}
        """(part, channel in the part) -> channel of the bag."""
        try:
            self._bag = self._describe()
            self._survey()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the files and remove what was unpacked."""
        for index in {*self._open, *self._unpacked}:
            self._close_part(index)

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield messages of the channels (None: all), part by part in the order in which they were stored."""
        wanted_ids = None if channel_ids is None else set(channel_ids)
        for index in self._readable:
            inside = {part_channel: number for (part, part_channel), number in self._numbers.items() if part == index}
            chosen = [
                part_channel for part_channel, number in inside.items() if wanted_ids is None or number in wanted_ids
            ]
            if wanted_ids is not None and not chosen:
                continue
            part = self._part(index)
            self._in_use.append(index)
            faults: Counter[str] = Counter()
            try:
                for message in part.messages(None if wanted_ids is None else chosen):
                    try:
                        stored = self._as_stored(index, message)
                    except ValueError as error:
                        faults[f"a packed message {error}"] += 1
                        continue
                    yield stored
            except BadInput as error:
                raise self._with_part_name(index, error) from None
            finally:
                self._in_use.remove(index)
            packed = [f"{number} times: {reason}" for reason, number in sorted(faults.items())]
            if packed and not self._salvage:
                raise BadInput(f"{self.path}: {self._name(index)}: {packed[0]}", hint=HINT)
            self._of_parts[index] = [*part.damage, *packed]
            self._refresh()

    def fetch(self, location: Hashable) -> StoredMessage:
        """Return the message at a location that `messages` gave. Raises BadInput when it has become unreadable."""
        if not isinstance(location, Place) or location.part not in self._readable:
            raise BadInput(f"{self.path}: {location!r} is not a place in the bag")
        try:
            return self._as_stored(location.part, self._part(location.part).fetch(location.inside))
        except BadInput as error:
            raise self._with_part_name(location.part, error) from None
        except ValueError as error:
            raise BadInput(f"{self.path}: {self._name(location.part)}: a packed message {error}", hint=HINT) from None

    def _as_stored(self, index: int, message: StoredMessage) -> StoredMessage:
        channel = self.channels[self._numbers[index, message.channel.id]]
        data = unpacked_within(message.data, LARGEST_MESSAGE) if self._bag.packed_messages else message.data
        return StoredMessage(channel, message.log_time, data, Place(index, message.location))

    # --- parts -----------------------------------------------------------------------------------------------

    def _describe(self) -> BagMetadata:
        if not self.path.is_dir():
            return BagMetadata((self.path,))
        if not (self.path / NAME).exists():
            self.notes.append(f"no {NAME}, as after a power failure: the parts are taken in the order of their names")
            return BagMetadata(listed_parts(self.path))
        try:
            return read_bag_metadata(self.path)
        except BadInput as error:
            if not self._salvage or "outside of the folder" in error.message:
                raise
            self._lines.note(f"{error.message}: the parts are taken in the order of their names")
            return BagMetadata(listed_parts(self.path))

    def _survey(self) -> None:
        """Open every part once, and give the channels of all of them common numbers."""
        self._readable: list[int] = []
        channels: dict[tuple[str, str, str, str, bytes], tuple[int, list[int | None]]] = {}
        reasons = []
        for index, path in enumerate(self._bag.parts):
            try:
                part = self._part(index)
            except BadInput as error:
                reasons.append(f"{path.name}: {error.message.removeprefix(f'{path}: ')}")
                self._lines.found(f"part {reasons[-1]}")
                continue
            self._readable.append(index)
            self._of_parts[index] = list(part.damage)
            for channel in part.channels:
                key = (
                    channel.topic,
                    channel.type_name,
                    channel.message_encoding,
                    channel.schema_encoding,
                    channel.schema,
                )
                number, counts = channels.setdefault(key, (len(channels), []))
                counts.append(channel.count)
                self._numbers[index, channel.id] = number
            for note in part.notes:
                if note not in self.notes:
                    self.notes.append(note)
        if not self._readable:
            reason = reasons[0] if reasons else "there are none"
            raise BadInput(f"{self.path}: no part of the bag can be read: {reason}", hint=HINT)
        self.channels = tuple(
            Channel(number, *key, None if None in counts else sum(count or 0 for count in counts))
            for key, (number, counts) in channels.items()
        )
        self._compare_counts()
        self._refresh()

    def _compare_counts(self) -> None:
        counts = [channel.count for channel in self.channels]
        stated = self._bag.message_count
        if stated is None or None in counts or any(self._of_parts.values()) or self._lines:
            return
        count_of_parts = sum(count or 0 for count in counts)
        if count_of_parts < stated:
            self._lines.found(f"{NAME} counts {stated} messages, the parts hold {count_of_parts}")

    def _refresh(self) -> None:
        lines = list(self._lines)
        for index, of_part in sorted(self._of_parts.items()):
            prefix = f"{self._name(index)}: " if self.path.is_dir() else ""
            lines += [prefix + line for line in of_part]
        self.damage[:] = lines

    def _name(self, index: int) -> str:
        return self._bag.parts[index].name

    def _part(self, index: int) -> Part:
        """Return a part, opened; the one that was used longest ago is closed when many are open."""
        part = self._open.pop(index, None)
        if part is None:
            idle = [part_index for part_index in self._open if part_index not in self._in_use]
            if len(self._open) >= MOST_OPEN and idle:
                self._close_part(idle[0])
            part = self._open_part(index)
        self._open[index] = part
        return part

    def _close_part(self, index: int) -> None:
        if index in self._open:
            self._open.pop(index).close()
        if index in self._unpacked:
            self._unpacked.pop(index).cleanup()

    def _open_part(self, index: int) -> Part:
        """Open a part; one that is packed as a whole is unpacked into a temporary folder first."""
        path = self._bag.parts[index]
        opened = path
        try:
            if _head(path).startswith(ZSTD_MAGIC):
                opened = self._unpack(index, path)
            head = _head(opened)
            if head.startswith(MCAP_MAGIC):
                return McapMessages(opened, salvage=self._salvage)
            if head.startswith(SQLITE_MAGIC):
                return SqliteMessages(opened, salvage=self._salvage)
            fault = "is neither MCAP nor SQLite (wrong first bytes)" if head else "is empty"
            raise BadInput(f"{path}: {fault}", hint=HINT)
        except BadInput as error:
            error = self._with_part_name(index, error)
            self._close_part(index)
            raise error from None
        except BaseException:
            self._close_part(index)
            raise

    def _with_part_name(self, index: int, error: BadInput) -> BadInput:
        """Return an error with the name of the part, where it has that of the unpacked file."""
        if index not in self._unpacked:
            return error
        path = self._bag.parts[index]
        return BadInput(error.message.replace(f"{self._unpacked[index].name}/{path.stem}", str(path)), hint=error.hint)

    def _unpack(self, index: int, path: Path) -> Path:
        """Unpack a part into a temporary file, within a bound that follows from its size."""
        folder = tempfile.TemporaryDirectory(prefix="scenewright-")
        self._unpacked[index] = folder
        target = Path(folder.name) / path.stem
        try:
            with path.open("rb") as packed, target.open("wb") as file:
                stated = stated_size(packed.read(64))
                packed.seek(0)
                ratio = GREATEST_RATIO if stated is None else GREATEST_STATED_RATIO
                limit = max(ALWAYS_ACCEPTED, ratio * path.stat().st_size)
                unpack_file(packed, file, limit if stated is None else min(limit, stated))
        except ValueError as error:
            self._lines.found(f"part {path.name} {error}")
        except OSError as error:
            raise MachineFailure(
                f"{path}: cannot be unpacked into {folder.name}: {error.strerror}", hint="free space, or set TMPDIR"
            ) from None
        return target


def _head(path: Path) -> bytes:
    """Return the first bytes of a part. Raises BadInput when it is missing or no file."""
    file = LogFile(path, "a part of a bag")
    try:
        return file.read(0, max(len(MCAP_MAGIC), len(SQLITE_MAGIC)))
    except Damaged as fault:
        raise BadInput(f"{path}: {fault}") from None
    finally:
        file.close()


def open_rosbag2(path: Path, *, salvage: bool) -> Rosbag2Messages:
    """Open a rosbag2 folder or `.db3` file.

    Raises BadInput when no part of it can be read; without `salvage` also when a part is missing or damaged.
    """
    return Rosbag2Messages(path, salvage=salvage)
