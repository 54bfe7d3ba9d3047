"""Continuous collision detection: contacts during the motion between two postures."""
