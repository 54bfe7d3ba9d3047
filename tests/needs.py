"""Parameters of tests that need a package which only an extra installs: skipped where it is not there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

from wholebody.methods import EXTRAS, installed_methods


def each(names: Iterable[str]) -> list[Any]:
    """Return the names of methods as parameters of a test; those whose package is not installed are skipped."""
    return [
        pytest.param(
            name,
            marks=pytest.mark.skipif(
                name not in installed_methods() and name in EXTRAS, reason=f"the method {name} is not installed"
            ),
        )
        for name in names
    ]
