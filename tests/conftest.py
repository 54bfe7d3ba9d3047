"""What every test may use: the real input data where it is present, and reproducible random cases."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parent.parent

settings.register_profile("default", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile(
    "ci", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True, database=None
)
settings.load_profile("ci" if os.environ.get("CI") else "default")


@pytest.fixture(scope="session")
def root() -> Path:
    """Return the top of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of real motions and props; skip the test where it is absent.

    It is named by WHOLEBODY_DATA, or lies in ``../shared/data`` beside the checkout.
    """
    named = os.environ.get("WHOLEBODY_DATA")
    folder = Path(named) if named else ROOT.parent / "shared" / "data"
    if not folder.is_dir():
        if named:
            pytest.fail(f"WHOLEBODY_DATA names {folder}, which is not a folder")
        pytest.skip("no real input data here; WHOLEBODY_DATA names its folder")
    return folder
