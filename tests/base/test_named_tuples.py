"""Copies of named tuples with other values."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from wholebody.base.arrays import as_dict, with_values


class Interval(NamedTuple):
    """Two fields, one with a default."""

    low: float
    high: float = 2.0


def test_a_copy_has_the_other_values_and_the_record_stays() -> None:
    record = Interval(1.0)
    assert with_values(record, high=3.0) == Interval(1.0, 3.0) == record._replace(high=3.0)
    assert isinstance(with_values(record), Interval)
    assert record == (1.0, 2.0)


def test_values_are_named_in_the_order_of_the_fields() -> None:
    assert (
        list(as_dict(Interval(1.0)).items()) == [("low", 1.0), ("high", 2.0)] == list(Interval(1.0)._asdict().items())
    )


def test_a_field_that_is_not_there_is_refused() -> None:
    with pytest.raises(TypeError, match="middle"):
        with_values(Interval(1.0), middle=1.5)
