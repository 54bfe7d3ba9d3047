"""Newton's method in full coordinates: seven variables a body, joints as equations, sparse linear algebra."""
