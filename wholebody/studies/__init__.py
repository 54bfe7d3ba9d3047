"""One task many times: many problems at once, studies of people, targets and layouts, reach maps."""

from __future__ import annotations

from wholebody.base.imports import exported

__getattr__, __dir__, __all__ = exported(__name__, __file__)
