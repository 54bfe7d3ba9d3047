"""How near things are: shapes, convex pieces, contacts, penetration, sweeps."""
