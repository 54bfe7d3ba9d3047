"""Motions between postures, free of collision, by `plan`; all postures that meet goals, by `solutions`."""

from __future__ import annotations

from wholebody.base.imports import exported

__getattr__, __dir__, __all__ = exported(__name__, __file__)
