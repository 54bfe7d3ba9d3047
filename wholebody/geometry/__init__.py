"""Geometry: shapes, convex pieces, contacts, penetration, sweeps."""

from wholebody.geometry.guesses import settle_boxes

settle_boxes()
