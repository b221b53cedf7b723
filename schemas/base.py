"""The base of every JSON payload: strict, frozen, written canonically."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema
from scenewright.schemas.errors import BadInput, first_problem
from scenewright.schemas.outside import LARGEST_DOCUMENT, LARGEST_INTEGER, check_integers, file_content


def canonical_json(value: Any) -> str:
    """Return `value` as JSON with sorted keys and no white space; NaN and infinities raise ValueError."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)


def _check_rows(rows: int, columns: int) -> Callable[[Any], Any]:
    def check(value: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        if len(value) != rows or any(len(row) != columns for row in value):
            raise ValueError(f"expected {rows}x{columns} numbers")
        return value

    return check


Vector3 = tuple[float, float, float]
QuaternionXYZW = tuple[float, float, float, float]
Transform = Annotated[tuple[tuple[float, ...], ...], AfterValidator(_check_rows(4, 4))]
"""A 4x4 homogeneous `target_from_source` matrix, row major, metres."""


def _check_name(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,199}", value):
        raise ValueError(f"{value!r:.60} is not a plain name (ASCII letters, digits, _ . -)")
    return value


def _check_relative_path(value: str) -> str:
    for part in value.split("/"):
        _check_name(part)
    return value


Name = Annotated[str, AfterValidator(_check_name)]
"""Names that become file names and URDF links."""
RelativePath = Annotated[str, AfterValidator(_check_relative_path)]
"""A path below the artifact's folder, with /."""


def as_transform(matrix: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """Convert a (4, 4) array into the JSON form of a `Transform`."""
    return tuple(tuple(float(x) for x in row) for row in np.asarray(matrix, dtype=float).reshape(4, 4))


def as_vector(values: np.ndarray) -> Vector3:
    """Convert a (3,) array into the JSON form of a `Vector3`."""
    x, y, z = (float(v) for v in np.asarray(values, dtype=float).reshape(3))
    return (x, y, z)


SMALLEST_INT32, LARGEST_INT32 = -(2**31), 2**31 - 1
"""Range of a signed 32-bit integer."""
LARGEST_NUMBER = 1e12
"""Size of the numbers of a payload: metres, seconds since 1970, kilograms; their squares fit into a float32."""
LARGEST_SEED = 2**31 - 1
"""Largest seed of a command; those that follow from it are larger by a few."""
Seed = Annotated[int, Field(ge=0, le=2**53)]
Count = Annotated[int, Field(ge=0, le=LARGEST_INTEGER)]
"""Of bytes and the like, which no array of 32 bits has to hold."""


def bounded(schema: Any, above_zero: float = 0.0) -> Any:
    """Return a schema of pydantic's whose numbers all have bounds: those that it states, else the ones above.

    Numbers that must be greater than zero are at least `above_zero`.
    """
    if isinstance(schema, list):
        return [bounded(part, above_zero) for part in schema]
    if not isinstance(schema, dict):
        return schema
    kind = schema.get("type")
    if kind == "int":
        return {"ge": SMALLEST_INT32, "le": LARGEST_INT32, **schema}
    if kind == "float":
        least = above_zero if schema.get("gt") == 0 else -LARGEST_NUMBER
        return {"ge": least, "le": LARGEST_NUMBER, **schema}
    return {
        key: part if key in ("metadata", "serialization", "default", "expected", "ref") else bounded(part, above_zero)
        for key, part in schema.items()
    }


class Model(BaseModel):
    """A payload model. Unknown keys are errors, values are immutable, NaN is refused, and so are numbers that arrays of
    32 bits cannot hold."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, protected_namespaces=())

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Bound every number of the fields."""
        return bounded(handler(source))

    @classmethod
    def read(cls, path: Path, *, largest: int = LARGEST_DOCUMENT, hint: str = "make the artifact again") -> Self:
        """Read and validate a JSON file of at most `largest` bytes.

        Raises BadInput naming the file and the first wrong field; `hint` says what to do about it.
        """
        data = file_content(path, largest, hint=hint)
        check_integers(data, str(path), hint=hint)
        try:
            model = cls.model_validate_json(data, by_alias=True, by_name=False)
            model.check_read()
            return model
        except ValidationError as error:
            raise BadInput(f"{path}: {first_problem(error)}", hint=hint) from None
        except ValueError as error:
            raise BadInput(f"{path}: {error}", hint=hint) from None

    @classmethod
    def of_outside(cls, where: Path | str, *, hint: str = "", **values: Any) -> Self:
        """Return the model of values that a file of others states. Raises BadInput, beginning with `where`."""
        try:
            return cls(**values)
        except ValidationError as error:
            first = error.errors()[0]
            name = ".".join(str(part) for part in first["loc"])
            raise BadInput(f"{where}: {name} = {str(first.get('input')):.40}: {first['msg']}", hint=hint) from None

    def check_read(self) -> None:
        """Raise ValueError when the parts of what was read do not fit each other; kinds say here what has to."""

    def write(self, path: Path) -> None:
        """Write the model as indented JSON with sorted keys and a final newline."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True, indent=1, allow_nan=False, ensure_ascii=False)
        Path(path).write_text(text + "\n", encoding="utf-8")
