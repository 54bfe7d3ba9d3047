from __future__ import annotations

import pytest

from wholebody.bench.track import Track, track


@pytest.fixture(scope="session")
def short_free() -> Track:
    """Return a free reach that is over in eight quick steps."""
    return track("free", 8)


@pytest.fixture(scope="session")
def short_contact() -> Track:
    """Return a contact reach of forty steps."""
    return track("contact", 40)
