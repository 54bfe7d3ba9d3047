from __future__ import annotations

from collections.abc import Iterator

import pytest

from wholebody.bench import plot_style
from wholebody.bench.measure.track import Track, track


@pytest.fixture(scope="session", autouse=True)
def coarse_pictures() -> Iterator[None]:
    """Draw charts of fewer pixels."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(plot_style.STYLE["settings"], "savefig.dpi", 40)
        yield


@pytest.fixture(scope="session")
def short_free() -> Track:
    """Return a free reach that is over in eight quick steps."""
    return track("free", 8)


@pytest.fixture(scope="session")
def short_contact() -> Track:
    """Return a contact reach of forty steps."""
    return track("contact", 40)
