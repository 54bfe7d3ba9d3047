"""Geometry: shapes, convex pieces, contacts, penetration, sweeps."""

from wholebody.geometry.memory_views import fix_box_inflation

fix_box_inflation()
