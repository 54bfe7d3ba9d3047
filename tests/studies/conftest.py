"""Studies do their jobs beside each other in threads, each with a child process, as on a cluster.

joblib's own processes, each of which imports the package for seconds, are looked at in tests/base/test_batches.py.
"""

from __future__ import annotations

from collections.abc import Iterator

import joblib
import pytest


@pytest.fixture(autouse=True, scope="module")
def jobs_in_threads() -> Iterator[None]:
    """Let joblib do jobs in threads of this process."""
    with joblib.parallel_config(backend="threading"):
        yield
