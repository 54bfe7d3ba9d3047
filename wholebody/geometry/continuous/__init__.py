"""Continuous collision detection: what happens between two postures, not only at them."""
