"""The JSON documents of an artifact as pandas tables, whatever the kind: one for every list of records in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, get_args

from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model
from scenewright.schemas.errors import MissingDependency

if TYPE_CHECKING:
    import pandas

Row = dict[str, Any]
AXES = ("x", "y", "z")


def as_tables(artifact: Artifact) -> dict[str, pandas.DataFrame]:
    """Return name -> pandas.DataFrame of everything that the documents of an artifact list.

    A list of records is a table under its name in the document (`entities`, `nodes`, `bodies`, `frames`), a list inside
    the records one of its own (`frames.segments`), in which the first field of the record above stands in front
    (`frames.frame`). Names -> values (`metrics`) have the columns `name` and `value`. Records inside a record are
    columns with dots (`box.center.x`), three numbers are x, y and z; longer rows of numbers, matrices and lists of
    words stay whole. What a document says once is the one row of the table with the document's name (`info`). Where
    two documents have a list of one name, the second is `<document>.<name>`.

    Raises MissingDependency without pandas, BadInput for a document that is damaged.
    """
    try:
        import pandas
    except ImportError:
        raise MissingDependency("pandas is not installed", hint="pip install 'scenewright[notebooks]'") from None
    tables: dict[str, pandas.DataFrame] = {}
    for attribute in documents_of(type(artifact)):
        content = getattr(artifact, attribute)
        if content is None:
            continue
        rows: dict[str, list[Row]] = {}
        once = _row(content, "", rows, {}, key=None)
        if once:
            rows[attribute] = [once]
        for name, table_rows in rows.items():
            tables[name if name not in tables else f"{attribute}.{name}"] = pandas.DataFrame(_of_one_shape(table_rows))
    return tables


def documents_of(kind: type[Artifact]) -> list[str]:
    """Return the attributes of a kind that are documents, `info` first."""
    names = {name for base in kind.__mro__ for name, value in vars(base).items() if isinstance(value, Document)}
    return sorted(names, key=lambda name: (name != "info", name))


def _row(model: Model, table: str, rows: dict[str, list[Row]], above: Row, key: str | None) -> Row:
    """Return the columns of a record; the lists of records in it go to `rows`, as tables below `table`.

    `key` names the table whose records its lists belong to; None: it is the only one of its kind.
    """
    row: Row = dict(above)
    lists: dict[str, Any] = {}
    for attribute, field in type(model).model_fields.items():
        value, name = getattr(model, attribute), _name_in_file(model, attribute)
        if isinstance(value, Model):
            inner = _row(value, _below(table, name), rows, {}, key)
            row |= {f"{name}.{column}": cell for column, cell in inner.items()}
        elif _records(value, field.annotation):
            lists[name] = value
        elif not table and isinstance(value, Mapping):
            rows[name] = [{"name": word, "value": cell} for word, cell in value.items()]
        elif _is_vector(value):
            row |= {f"{name}.{axis}": number for axis, number in zip(AXES, value, strict=True)}
        else:
            row[name] = value
    first = next(iter(row), None) if key is not None else None
    labels: Row = {} if first is None else {first if "." in first else f"{key}.{first}": row[first]}
    for name, value in lists.items():
        own_table = _below(table, name)
        own_rows = rows.setdefault(own_table, [])
        pairs = value.items() if isinstance(value, Mapping) else ((None, record) for record in value)
        for word, record in pairs:
            own_rows.append(
                _row(record, own_table, rows, labels if word is None else {**labels, "name": word}, key=own_table)
            )
    return row


def _name_in_file(model: Model, attribute: str) -> str:
    """Return what the file calls a field: mostly as code does."""
    alias = type(model).model_fields[attribute].serialization_alias
    return alias if alias and model.model_config.get("serialize_by_alias") else attribute


def _of_one_shape(rows: list[Row]) -> list[Row]:
    """Return the rows without the empty cell of a record that other rows have: there it is columns with dots."""
    inside = {column[:end] for row in rows for column in row for end, letter in enumerate(column) if letter == "."}
    return [{name: cell for name, cell in row.items() if cell is not None or name not in inside} for row in rows]


def _below(table: str, name: str) -> str:
    return f"{table}.{name}" if table else name


def _records(value: Any, annotation: Any) -> bool:
    """Whether a value lists records; an empty one does when that is what its field is for."""
    if value == ():
        return any(isinstance(kind, type) and issubclass(kind, Model) for kind in get_args(annotation))
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else ()
    return bool(inner) and all(isinstance(entry, Model) for entry in inner)


def _is_vector(value: Any) -> bool:
    return isinstance(value, tuple) and len(value) == 3 and all(type(number) in (int, float) for number in value)
