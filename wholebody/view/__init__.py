"""The viewer: a scene in Meshcat, live, as a file, as a picture or a movie."""

from __future__ import annotations

from wholebody.base.imports import exported

__getattr__, __dir__, __all__ = exported(__name__, __file__)
