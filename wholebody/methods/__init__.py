"""The methods that find postures: one module or folder a method."""

from importlib.util import find_spec

METHODS = ("qp", "ccd", "newton", "placo", "dls")
"""Names of all methods, the same in Python, in task files and on the command line."""

EXTRAS = {"placo": "placo"}
"""Methods whose package an extra installs -> the package; the extra has the same name."""


def installed_methods() -> tuple[str, ...]:
    """Names of the methods that can be used here: all except those whose package is not installed."""
    return tuple(name for name in METHODS if name not in EXTRAS or find_spec(EXTRAS[name]) is not None)
