"""A pool of objects of which each run borrows one, and a guard against calls from a second thread."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock
from typing import Any, Generic, TypeVar

from wholebody.base.errors import InputError

T = TypeVar("T")


class Pool(Generic[T]):
    """A thread-safe free list; no two threads hold the same object at a time."""

    def __init__(self, make: Callable[[], T], at_most: int | None = None) -> None:
        """Make an empty pool: `make` makes an object if none is free; `at_most` free ones are kept, all by default."""
        self._make, self._at_most = make, at_most
        self._free: list[T] = []

    def borrow(self, begin: Callable[[T], Any] | None = None) -> Loan[T]:
        """Borrow an object while a context lasts, which `begin` is called with before."""
        return Loan(self, begin)

    def take(self) -> T:
        """A free object, or a new one."""
        try:
            return self._free.pop()  # this and append are atomic
        except IndexError:
            return self._make()

    def give(self, item: T) -> None:
        """Take an object back."""
        if self._at_most is None or len(self._free) < self._at_most:
            self._free.append(item)


class Loan(Generic[T]):
    """A context in which an object of a pool is borrowed; after an exception in it the object is discarded."""

    def __init__(self, pool: Pool[T], begin: Callable[[T], Any] | None) -> None:
        self._pool, self._begin = pool, begin

    def __enter__(self) -> T:
        """Borrow the object."""
        self._item = self._pool.take()
        if self._begin is not None:
            self._begin(self._item)
        return self._item

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Return the object."""
        if kind is None:
            self._pool.give(self._item)


class OneAtATime:
    """Guard of an object that serves one call at a time: another is refused by an `InputError` while one runs."""

    def __init__(self, what: str) -> None:
        self._what, self._lock = what, Lock()

    def __enter__(self) -> None:
        if not self._lock.acquire(blocking=False):
            raise InputError(f"this {self._what} is in use by another call; make one {self._what} for each thread")

    def __exit__(self, *_: object) -> None:
        self._lock.release()
