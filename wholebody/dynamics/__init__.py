"""Rigid bodies that move by themselves: motion, impacts, resting contact."""
