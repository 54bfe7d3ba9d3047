from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def fakes() -> ModuleType:
    """Return the misbehaving methods, sent to other processes by their code, since they cannot import them."""
    import cloudpickle
    import fakes

    cloudpickle.register_pickle_by_value(fakes)
    return fakes
