"""Tracking: dragged goals, goals along a path, and figures that follow a tracker frame by frame among things."""

from __future__ import annotations

from wholebody.base.imports import exported

__getattr__, __dir__, __all__ = exported(__name__, __file__)
