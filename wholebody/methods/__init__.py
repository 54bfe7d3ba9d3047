"""How a posture is found: one module or folder a method."""

METHODS = ("qp", "ccd", "newton", "placo", "dls")
"""Names of all methods, the same in Python, in task files and on the command line."""
