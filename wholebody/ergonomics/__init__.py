"""Ergonomics of postures: RULA, REBA, OWAS, the NIOSH lifting equation, torques against strength, the field of view."""

from __future__ import annotations

from wholebody.base.imports import exported

__getattr__, __dir__, __all__ = exported(__name__, __file__)
