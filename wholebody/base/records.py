"""Copies of records, which are named tuples: `copy.replace` of Python 3.13, for the versions before it."""

from __future__ import annotations

from typing import Any, TypeVar, cast

Record = TypeVar("Record", bound=tuple[Any, ...])


def as_dict(record: tuple[Any, ...]) -> dict[str, Any]:
    """The values of a record by the names of its fields, in their order."""
    return dict(zip(cast(Any, type(record)).__match_args__, record, strict=True))


def with_values(record: Record, **values: Any) -> Record:
    """A copy of a record with other values of some fields; a TypeError if it has none of that name."""
    return type(record)(**{**as_dict(record), **values})
