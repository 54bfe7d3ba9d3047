"""Quadratic programs recorded from the problem sets, kept as files, and given to every solver alone."""
