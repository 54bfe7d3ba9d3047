from __future__ import annotations

from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def fakes() -> ModuleType:
    """Return the misbehaving methods, sent to other processes by their code, since they cannot import them."""
    import cloudpickle

    from tests.bench.suite.compare import fakes

    cloudpickle.register_pickle_by_value(fakes)
    return fakes
