"""Posing by Newton's method in full coordinates: seven numbers a body, joints as equations, sparse linear algebra."""
