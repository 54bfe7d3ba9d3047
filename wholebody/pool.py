"""What one run uses at a time: objects that are lent and given back, and calls that a second thread may not enter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Generic, TypeVar

from wholebody.errors import InputError

T = TypeVar("T")


class Pool(Generic[T]):
    """A free list that any number of threads may use; no two ever hold the same object."""

    def __init__(self, make: Callable[[], T]) -> None:
        """Begin empty.

        Args:
            make: makes an object where none is free.
        """
        self._make = make
        self._free: list[T] = []

    @contextmanager
    def lend(self) -> Iterator[T]:
        """An object for as long as the context lasts; one whose run broke off by an exception is not used again."""
        try:
            item = self._free.pop()  # this and append are atomic
        except IndexError:
            item = self._make()
        yield item
        self._free.append(item)


class OneAtATime:
    """Refuses a call while another one is under way, where what calls change cannot be shared."""

    def __init__(self, what: str) -> None:
        """Name the object whose calls these are, such as "tracker"."""
        self._what, self._lock = what, Lock()

    def __enter__(self) -> None:
        """Enter a call.

        Raises:
            InputError: another one is under way.
        """
        if not self._lock.acquire(blocking=False):
            raise InputError(f"this {self._what} is within another call; make one {self._what} for each thread")

    def __exit__(self, *_: object) -> None:
        """Leave it."""
        self._lock.release()
