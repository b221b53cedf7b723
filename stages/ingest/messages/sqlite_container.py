"""SQLite files of rosbag2 (`.db3`) as a container of messages.

The format carries no checksums: damage of its structure is found, a changed byte within a message is not. Tables:
https://github.com/ros2/rosbag2 (rosbag2_storage_sqlite3), schema versions 1 to 4.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Collection, Hashable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from schemas.errors import BadInput, MachineFailure
from stages.ingest.messages.container import Channel, StoredMessage
from stages.kit.formats.damage_lines import HINT, DamageLines
from stages.kit.formats.log_file import Damaged, LogFile

MAGIC = b"SQLite format 3\x00"
LARGEST_MESSAGE = 512 << 20
"""Bytes of one message that are accepted."""
_JOURNAL_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
_WAL_MAGICS = (b"\x37\x7f\x06\x82", b"\x37\x7f\x06\x83")
_ROWS = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ?"


class SqliteMessages:
    """A `.db3` file that is open for reading, never written; see MessageLog."""

    format = "rosbag2"

    def __init__(self, path: Path, *, salvage: bool) -> None:
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.notes = ["a .db3 file carries no checksums: changed bytes within messages cannot be noticed"]
        self._lines = DamageLines(path, salvage=salvage)
        self.damage: list[str] = self._lines
        self._counted = False
        self._topics: dict[Any, Channel] = {}
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        self._check_magic()
        self._database = sqlite3.connect(":memory:")
        try:
            self._database = self._connect(path.resolve(), "mode=ro&immutable=1")
            journals = self._journals()
            if journals:
                self._take_in(journals)
            self._open()
        except sqlite3.Error as error:
            self.close()
            raise BadInput(f"{path}: cannot be read as a bag: {error}", hint=HINT) from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._database.close()
        if self._copy is not None:
            self._copy.cleanup()

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield messages of the channels (None: all) in the order in which they were stored."""
        faults: Counter[str] = Counter()
        for number, topic, time, data in self._rows(channel_ids):
            if topic not in self._topics:
                faults[f"a message belongs to topic {topic!r:.40}, which the bag does not define"] += 1
            elif not _is_message(time, data):
                faults["a message holds no bytes or no time"] += 1
            else:
                yield StoredMessage(self._topics[topic], time, data, number)
        if not self._counted:
            self._counted = channel_ids is None
            for what, times in sorted(faults.items()):
                self._lines.found(what, times)

    def fetch(self, location: Hashable) -> StoredMessage:
        """Return the message at a location that `messages` gave. Raises BadInput when it has become unreadable."""
        try:
            rows = self._database.execute(_ROWS + " AND id = ?", (-1, location)).fetchall()
        except (sqlite3.Error, OverflowError) as error:
            raise BadInput(f"{self.path}: message {location!r} cannot be read: {error}", hint=HINT) from None
        if not rows or rows[0][1] not in self._topics or not _is_message(*rows[0][2:]):
            raise BadInput(f"{self.path}: {location!r} is no place in the bag")
        _, topic, time, data = rows[0]
        return StoredMessage(self._topics[topic], time, data, location)

    # --- structure -------------------------------------------------------------------------------------------

    def _check_magic(self) -> None:
        file = LogFile(self.path, "a .db3 file")
        try:
            head = file.read(0, len(MAGIC))
        except Damaged as fault:
            raise BadInput(f"{self.path}: {fault}") from None
        finally:
            file.close()
        if head != MAGIC:
            raise BadInput(f"{self.path}: is empty" if not head else f"{self.path}: is no SQLite file", hint=HINT)

    @staticmethod
    def _connect(path: Path, mode: str) -> sqlite3.Connection:
        connection = sqlite3.connect(f"file:{quote(str(path))}?{mode}", uri=True, check_same_thread=False)
        connection.text_factory = lambda text: text.decode("utf-8", "replace")
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_MESSAGE)
        connection.execute("PRAGMA trusted_schema=OFF")
        connection.execute("PRAGMA cell_size_check=ON")
        return connection

    def _journals(self) -> list[Path]:
        """Return the journals beside the file that hold what a recorder, cut short, had not moved into it."""
        found = []
        path = self.path.resolve()
        for suffix, magics in (("-wal", _WAL_MAGICS), ("-journal", (_JOURNAL_MAGIC,))):
            journal = path.with_name(path.name + suffix)
            try:
                with journal.open("rb") as file:
                    if file.read(len(_JOURNAL_MAGIC)).startswith(magics):
                        found.append(journal)
            except OSError:
                continue
        return found

    def _take_in(self, journals: list[Path]) -> None:
        """Open a copy, into which SQLite takes the journals in; the file itself is never written."""
        path = self.path.resolve()
        try:
            self._copy = tempfile.TemporaryDirectory(prefix="scenewright-")
            for file in (path, *journals):
                shutil.copyfile(file, Path(self._copy.name) / file.name)
        except OSError as error:
            raise MachineFailure(
                f"{self.path}: its journal can only be taken in from a copy, which cannot be made: {error.strerror}",
                hint="free space, or set TMPDIR",
            ) from None
        try:
            taken_in = self._connect(Path(self._copy.name) / path.name, "mode=rw")
            taken_in.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
        except sqlite3.Error as error:
            self._lines.found(f"journal beside it cannot be taken in: {error}")
            return
        self._database.close()
        self._database = taken_in
        self.notes.append("the recording ended without closing the bag; its journal was taken in")

    def _open(self) -> None:
        tables = self._tables()
        if not {"topics", "messages"} <= tables:
            raise BadInput(f"{self.path}: is a database without the tables of a bag (topics, messages)")
        try:
            found = [str(row[0]) for row in self._database.execute("PRAGMA quick_check(5)")]
        except sqlite3.Error as error:
            found = [str(error)]
        for line in found:
            if line != "ok":
                self._lines.found(f"structure is damaged: {' '.join(line.split()):.200}")
        definitions = self._definitions() if "message_definitions" in tables else {}
        counts = self._counts()
        try:
            rows = self._database.execute("SELECT id, name, type, serialization_format FROM topics ORDER BY id")
            for number, name, kind, encoding in rows:
                if not (isinstance(number, int) and isinstance(name, str) and isinstance(kind, str)):
                    self._lines.found(f"topic {number!r:.40} has no name or type")
                    continue
                schema_encoding, schema = definitions.get(kind, ("", b""))
                count = None if counts is None else counts.get(number, 0)
                self._topics[number] = Channel(number, name, kind, str(encoding), schema_encoding, schema, count)
        except sqlite3.Error as error:
            self._lines.found(f"table of topics cannot be read: {error}")
        self.channels = tuple(self._topics.values())

    def _tables(self) -> set[str]:
        """Return the names of the true tables; views and virtual tables could compute anything."""
        rows = self._database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'")
        return {
            name
            for name, sql in rows
            if not any(word in str(sql).upper() for word in ("VIRTUAL", "GENERATED", " AS ("))
        }

    def _definitions(self) -> dict[str, tuple[str, bytes]]:
        """Return type -> (encoding, definition)."""
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions ORDER BY id"
        try:
            return {
                str(kind): (str(encoding), str(text).encode()) for kind, encoding, text in self._database.execute(query)
            }
        except sqlite3.Error as error:
            self._lines.found(f"table of message definitions cannot be read: {error}")
            return {}

    def _counts(self) -> dict[int, int] | None:
        try:
            return dict(self._database.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"))
        except sqlite3.Error:
            return None

    # --- reading ---------------------------------------------------------------------------------------------

    def _rows(self, channel_ids: Collection[int] | None) -> Iterator[tuple[int, Any, Any, Any]]:
        """Yield rows by number; what cannot be read is skipped and noted."""
        query, wanted = _ROWS, tuple(channel_ids or ())
        if channel_ids is not None:
            query += f" AND topic_id IN ({','.join('?' * len(wanted))})"
        query += " ORDER BY id"
        last = -1
        while True:
            try:
                for row in self._database.execute(query, (last, *wanted)):
                    last = row[0]
                    yield row
                return
            except sqlite3.Error as error:
                following = self._readable_after(last)
                if following is None:
                    self._lines.found(f"messages after number {last} cannot be read ({error}): they are lost")
                    return
                lost = following - last - 1
                self._lines.found(f"messages {last + 1} to {following - 1} cannot be read ({error}): {lost} are lost")
                last = following - 1

    def _readable_after(self, last: int) -> int | None:
        """Return the number of the next message that can be read: steps that double, then halves."""
        bad, step = last, 1
        while not self._readable(last + step):
            bad, step = last + step, step * 2
            if step > 1 << 62:
                return None
        good = last + step
        while good - bad > 1:
            middle = (good + bad) // 2
            good, bad = (middle, bad) if self._readable(middle) else (good, middle)
        row = self._database.execute(_ROWS + " ORDER BY id LIMIT 1", (good - 1,)).fetchone()
        return None if row is None else row[0]

    def _readable(self, number: int) -> bool:
        """Whether the first message from this number on can be read, or there is none."""
        try:
            self._database.execute(_ROWS + " ORDER BY id LIMIT 1", (number - 1,)).fetchone()
        except sqlite3.Error:
            return False
        return True


def _is_message(time: Any, data: Any) -> bool:
    return isinstance(time, int) and isinstance(data, bytes)
