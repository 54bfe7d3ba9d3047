"""Figures of robots: URDF files read, checked and written, with an extension for what our own figures add."""
