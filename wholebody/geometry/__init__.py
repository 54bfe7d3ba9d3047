"""Geometry: shapes, convex pieces, contacts, penetration, sweeps."""

from wholebody.geometry.guesses import fix_box_inflation

fix_box_inflation()
