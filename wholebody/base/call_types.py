"""What numba's compiler does again and again for loops over numbers."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any


@lru_cache(maxsize=1)
def known_call_type() -> Callable[..., Any]:
    """What looks up the signature of a call, and once only that of numba's own functions: "+" has twenty candidates."""
    from numba.core.types import Function
    from numba.core.types.functions import BaseFunction

    look, known = BaseFunction.get_call_type, dict[Any, Any]()

    def get_call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or type(function) is not Function:
            return look(function, context, args, kws)
        if (function, args) not in known:
            known[function, args] = look(function, context, args, kws)
        return known[function, args]

    return get_call_type
