"""SQLite files of rosbag2 (`.db3`) as a container of messages.

The format carries no checksums: damage of its structure is found, a changed byte within a message is not. Tables:
https://github.com/ros2/rosbag2 (rosbag2_storage_sqlite3), schema versions 1 to 4.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Collection, Hashable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from scenewright.schemas.errors import BadInput, MachineFailure
from scenewright.stages.ingest.messages.container import Channel, StoredMessage
from scenewright.stages.ingest.messages.damage_lines import HINT, DamageLines
from scenewright.stages.ingest.messages.log_file import Damaged, LogFile

MAGIC = b"SQLite format 3\x00"
_HEAD_SIZE = 100
"""Bytes of the head of an SQLite file (SQLite file format)."""
_MOST_STEPS = 4000
"""Millions of steps of SQLite's machine that opening may take; a sound bag of 10 million messages takes about 300."""
_FAULTS = (sqlite3.Error, UnicodeDecodeError, MemoryError)
"""What Python makes of a damaged file; the second of an error message with a damaged name, the third of a row that
claims more than is accepted."""
_MOST_TOPICS = 65_536
"""Most topics of a bag; a bound against damaged files."""
_PAGE_SIZES = {1 << power for power in range(9, 17)}
"""Page sizes that SQLite allows (SQLite file format)."""
LARGEST_MESSAGE = 512 << 20
"""Most bytes of a message; a bound against damaged files."""
_JOURNAL_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
_WAL_MAGICS = (b"\x37\x7f\x06\x82", b"\x37\x7f\x06\x83")
_ROWS = "SELECT rowid, topic_id, timestamp, {data} FROM messages WHERE rowid > ?"


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
        head, size = self._read_head()
        self._database = sqlite3.connect(":memory:")
        try:
            self._database = self._connect(path.resolve(), "mode=ro&immutable=1")
            journals = self._journals()
            if journals:
                self._take_in(journals)
            else:
                self._check_size(head, size)
            steps = iter(range(_MOST_STEPS))
            self._database.set_progress_handler(lambda: next(steps, None) is None, 1_000_000)
            self._open()
            self._database.set_progress_handler(None, 0)
        except _FAULTS as error:
            self.close()
            raise BadInput(f"{path}: cannot be read as a bag: {_reason(error)}", hint=HINT) from None
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
            for reason, times in sorted(faults.items()):
                self._lines.found(reason, times)

    def fetch(self, location: Hashable) -> StoredMessage:
        """Return the message at a location that `messages` gave. Raises BadInput when it has become unreadable."""
        try:
            rows = self._database.execute(_ROWS.format(data="data") + " AND rowid = ?", (-1, location)).fetchall()
        except (*_FAULTS, OverflowError) as error:
            raise BadInput(f"{self.path}: message {location!r} cannot be read: {_reason(error)}", hint=HINT) from None
        if not rows or rows[0][1] not in self._topics or not _is_message(*rows[0][2:]):
            raise BadInput(f"{self.path}: {location!r} is not a place in the bag")
        _, topic, time, data = rows[0]
        return StoredMessage(self._topics[topic], time, data, location)

    # --- structure -------------------------------------------------------------------------------------------

    def _read_head(self) -> tuple[bytes, int]:
        """Return the head of the file and its size. Raises BadInput when it is no SQLite file."""
        file = LogFile(self.path, "a .db3 file")
        try:
            head = file.read(0, _HEAD_SIZE)
        except Damaged as fault:
            raise BadInput(f"{self.path}: {fault}") from None
        finally:
            file.close()
        if not head.startswith(MAGIC):
            wrong_start = "is not a SQLite file (wrong first bytes)" if head else "is empty"
            raise BadInput(f"{self.path}: {wrong_start}", hint=HINT)
        return head, file.size

    def _check_size(self, head: bytes, size: int) -> None:
        """Leave out a last page that is cut, whose missing end SQLite would take for zeros."""
        page, pages = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
        page = 65536 if page == 1 else page
        if len(head) < _HEAD_SIZE or page not in _PAGE_SIZES:
            raise BadInput(f"{self.path}: has no whole SQLite header", hint=HINT)
        current = head[24:28] == head[92:96]  # otherwise an old library wrote the file, and not the number of pages
        missing = page * pages - size if current else -size % page
        if missing > 0:
            self._lines.found(f"is cut: {missing} bytes less than it should have, what stood there is lost")
        if size % page:
            copy = self._copy_files([])
            os.truncate(copy, size - size % page)
            self._database.close()
            self._database = self._connect(copy, "mode=ro&immutable=1")

    def _connect(self, path: Path, mode: str) -> sqlite3.Connection:
        connection = sqlite3.connect(f"file:{quote(str(path))}?{mode}", uri=True, check_same_thread=False)
        connection.text_factory = lambda text: text.decode("utf-8", "replace")
        longest = min(LARGEST_MESSAGE, max(1 << 20, path.stat().st_size))
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, longest)
        connection.execute("PRAGMA trusted_schema=OFF")
        connection.execute("PRAGMA cell_size_check=ON")
        if self._lines.salvage:  # nothing is written; a file that is shorter than it says is read all the same
            connection.execute("PRAGMA writable_schema=ON")
        return connection

    def _journals(self) -> list[Path]:
        """Return the journals beside the file that hold what a recorder, cut short, had not moved into it."""
        journals = []
        path = self.path.resolve()
        for suffix, magics in (("-wal", _WAL_MAGICS), ("-journal", (_JOURNAL_MAGIC,))):
            journal = path.with_name(path.name + suffix)
            try:
                if journal.is_file():
                    with journal.open("rb") as file:
                        if file.read(len(_JOURNAL_MAGIC)).startswith(magics):
                            journals.append(journal)
            except OSError:
                continue
        return journals

    def _take_in(self, journals: list[Path]) -> None:
        """Open a copy, into which SQLite takes the journals in; the file itself is never written."""
        copy = self._copy_files(journals)
        try:
            taken_in = self._connect(copy, "mode=rw")
            taken_in.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
        except _FAULTS as error:
            self._lines.found(f"journal beside it cannot be taken in: {_reason(error)}")
            return
        self._database.close()
        self._database = taken_in
        self.notes.append("the recording ended without closing the bag; its journal was taken in")

    def _copy_files(self, journals: list[Path]) -> Path:
        """Copy the file and its journals into a temporary folder; return the copy."""
        path = self.path.resolve()
        try:
            self._copy = tempfile.TemporaryDirectory(prefix="scenewright-")
            for file in (path, *journals):
                shutil.copyfile(file, Path(self._copy.name) / file.name)
        except OSError as error:
            raise MachineFailure(
                f"{self.path}: can only be read from a copy, which cannot be made: {error.strerror}",
                hint="free space, or set TMPDIR",
            ) from None
        return Path(self._copy.name) / path.name

    def _open(self) -> None:
        tables = self._tables()
        if not {"topics", "messages"} <= tables:
            raise BadInput(f"{self.path}: is a database without the tables of a bag (topics, messages)")
        sound = self._check_structure()
        definitions = self._definitions() if "message_definitions" in tables else {}
        counts = self._counts() if sound else None
        try:
            rows = self._database.execute(
                "SELECT id, name, type, serialization_format FROM topics ORDER BY id LIMIT ?", (_MOST_TOPICS,)
            )
            for number, name, kind, encoding in rows:
                if not (isinstance(number, int) and isinstance(name, str) and isinstance(kind, str)):
                    self._lines.found(f"topic {number!r:.40} has no name or type")
                    continue
                schema_encoding, schema = definitions.get(kind, ("", b""))
                count = None if counts is None else counts.get(number, 0)
                self._topics[number] = Channel(number, name, kind, str(encoding), schema_encoding, schema, count)
        except _FAULTS as error:
            self._lines.found(f"table of topics cannot be read: {_reason(error)}")
        self.channels = tuple(self._topics.values())

    def _check_structure(self) -> bool:
        """Have SQLite follow all pages once; return whether it finds nothing."""
        try:
            complaints = [str(row[0]) for row in self._database.execute("PRAGMA quick_check(5)")]
        except _FAULTS as error:
            complaints = [_reason(error)]
        for line in complaints:
            if line != "ok":
                self._lines.found(f"structure is damaged: {_reason(line.removeprefix('*** in database main ***'))}")
        return complaints == ["ok"]

    def _tables(self) -> set[str]:
        """Return the names of the true tables; views and virtual tables could compute anything."""
        rows = self._database.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table' LIMIT 1000")
        return {
            name
            for name, sql in rows
            if not any(word in str(sql).upper() for word in ("VIRTUAL", "GENERATED", " AS ("))
        }

    def _definitions(self) -> dict[str, tuple[str, bytes]]:
        """Return type -> (encoding, definition)."""
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions ORDER BY id LIMIT ?"
        try:
            return {
                str(kind): (str(encoding), str(text).encode())
                for kind, encoding, text in self._database.execute(query, (_MOST_TOPICS,))
            }
        except _FAULTS as error:
            self._lines.found(f"table of message definitions cannot be read: {_reason(error)}")
            return {}

    def _counts(self) -> dict[int, int] | None:
        try:
            return dict(self._database.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"))
        except _FAULTS:
            return None

    # --- reading ---------------------------------------------------------------------------------------------

    def _rows(self, channel_ids: Collection[int] | None) -> Iterator[tuple[int, Any, Any, Any]]:
        """Yield rows of the channels by number; what cannot be read is skipped and noted.

        Rows of other channels are stepped over here and not in SQL: pages that lead in a circle would keep it there.
        """
        data, wanted_ids = "data", tuple(channel_ids or ())
        if channel_ids is not None:
            data = f"CASE WHEN topic_id IN ({','.join('?' * len(wanted_ids))}) THEN data END"
        query = _ROWS.format(data=data) + " ORDER BY rowid"
        last = -1
        while True:
            try:
                for row in self._database.execute(query, (*wanted_ids, last)):
                    if row[0] <= last:
                        raise sqlite3.DatabaseError("its pages lead in a circle")
                    last = row[0]
                    if channel_ids is None or row[1] in wanted_ids:
                        yield row
                return
            except _FAULTS as error:
                following = self._next_readable(query, wanted_ids, last)
                if following is None:
                    self._lines.found(f"messages after number {last} cannot be read ({_reason(error)}): they are lost")
                    return
                lost = following[0] - last - 1
                if lost:
                    span = f"messages {last + 1} to {following[0] - 1}"
                    self._lines.found(f"{span} cannot be read ({_reason(error)}): up to {lost} are lost")
                last = following[0]
                if channel_ids is None or following[1] in wanted_ids:
                    yield following

    def _next_readable(self, query: str, wanted_ids: tuple[int, ...], last: int) -> tuple[int, Any, Any, Any] | None:
        """Return the next row after `last` that can be read, found in steps that double, then halve; None: no more.

        sqlite3 reads one row ahead, so that the first may be the very next.
        """

        def first(number: int) -> Any:
            """Return the first row from a number on, None at the end, False when it cannot be read."""
            try:
                row = self._database.execute(query + " LIMIT 1", (*wanted_ids, number - 1)).fetchone()
            except _FAULTS:
                return False
            return row if row is None or row[0] >= number else False

        bad, step = last, 1
        while (row := first(last + step)) is False:
            bad, step = last + step, step * 2
            if last + step >= 1 << 62:
                return None
        good = last + step
        while good - bad > 1:
            middle = (good + bad) // 2
            between = first(middle)
            if between is False:
                bad = middle
            else:
                good, row = middle, between
        return row


def _reason(error: object) -> str:
    """Return what SQLite says in one line; it may quote names from damaged pages."""
    words = " ".join(str(error).split()) or "it claims more bytes than are accepted"
    return "".join(letter if letter.isprintable() else "?" for letter in words)[:200]


def _is_message(time: Any, data: Any) -> bool:
    return isinstance(time, int) and isinstance(data, bytes)
