"""The viewer: a scene in Meshcat, live, as a file, as a picture or a movie."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.view.viewer import Viewer

__all__ = ["Viewer"]

__getattr__, __dir__ = exported(__name__, {"wholebody.view.viewer": "Viewer"})
