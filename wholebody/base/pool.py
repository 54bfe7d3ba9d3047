"""A pool of objects of which each run borrows one, and a guard against calls from a second thread."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from threading import Lock
from typing import Any, Generic, TypeAlias, TypeVar

from wholebody.base.errors import InputError

T = TypeVar("T")


class Pool(Generic[T]):
    """A thread-safe free list; no two threads hold the same object at a time."""

    def __init__(self, make: Callable[[], T], at_most: int | None = None) -> None:
        """Make an empty pool: `make` makes an object if none is free; `at_most` free ones are kept, all by default."""
        self._make, self._at_most = make, at_most
        self._free: list[T] = []

    @contextmanager
    def borrow(self, begin: Callable[[T], Any] | None = None) -> Iterator[T]:
        """Borrow an object, new if none is free, which `begin` is called with; after an exception it is discarded."""
        try:
            item = self._free.pop()  # this and append are atomic
        except IndexError:
            item = self._make()
        if begin is not None:
            begin(item)
        yield item
        if self._at_most is None or len(self._free) < self._at_most:
            self._free.append(item)


class Pooled:
    """What any number of runs share, and find objects of their own at."""

    def __init__(self) -> None:
        self._pools: dict[Any, Pool[Any]] = {}

    def pool(self, kind: type[T], make: Callable[[], T]) -> Pool[T]:
        """The pool of objects of a kind, made by `make`; one run uses one of them at a time."""
        pool: Pool[T] | None = self._pools.get(kind)
        return self._pools.setdefault(kind, Pool(make)) if pool is None else pool


Loan: TypeAlias = AbstractContextManager[T]  # a context in which an object of a pool is borrowed


class OneAtATime:
    """Guard of an object that serves one call at a time: another is refused by an `InputError` while one runs."""

    def __init__(self, what: str) -> None:
        self._what, self._lock = what, Lock()

    def __enter__(self) -> None:
        if not self._lock.acquire(blocking=False):
            raise InputError(f"this {self._what} is in use by another call; make one {self._what} for each thread")

    def __exit__(self, *_: object) -> None:
        self._lock.release()
