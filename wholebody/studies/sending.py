"""What is sent to other processes: values, without the scenes that these have seen already."""

from __future__ import annotations

import hashlib
import io
import pickle
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple

from wholebody.base.runner import packed
from wholebody.scene.scene import Scene


class Sent(NamedTuple):
    """What is sent to another process."""

    value: bytes  # pickled, with scenes left out
    scenes: dict[str, bytes]  # digest of each of its scenes to that scene, pickled

    def read(self) -> Any:
        """The value, with the scenes that this process has seen; KeyError for one that was not sent."""
        return _Reader(self).load()


class Sender:
    """Pickles values; every scene is pickled once as long as nothing in it moves."""

    def __init__(self) -> None:
        self._scenes: dict[tuple[int, int, int], tuple[str, bytes, Scene]] = {}

    def sent(self, value: Any, full: bool = True) -> Sent:
        """A value, ready to be sent; in full, or without the scenes to a process that has seen them."""
        into, scenes = io.BytesIO(), {}

        def leave_out(given: object) -> str | None:
            if not isinstance(given, Scene):
                return None
            key = id(given), given.revision, given.built.moves
            if key not in self._scenes:
                made = packed(given)
                self._scenes[key] = hashlib.sha256(made).hexdigest(), made, given
            digest, made, _ = self._scenes[key]
            if full:
                scenes[digest] = made
            return digest

        import cloudpickle

        pickler = cloudpickle.Pickler(into)
        pickler.persistent_id = leave_out
        pickler.dump(value)
        return Sent(into.getvalue(), scenes)


def sent_to(function: Callable[..., Any], given: Sent, *others: Any) -> Any:
    """What a function answers to a value that was sent; None where this process has not seen a scene of it."""
    try:
        value = given.read()
    except KeyError:
        return None
    return function(value, *others)


_SEEN: OrderedDict[str, Scene] = OrderedDict()
"""Scenes that were sent to this process, the newest last."""


class _Reader(pickle.Unpickler):
    def __init__(self, sent: Sent) -> None:
        super().__init__(io.BytesIO(sent.value))
        self._scenes = sent.scenes

    def persistent_load(self, digest: str) -> Scene:
        """The scene with a digest."""
        if digest not in _SEEN:
            _SEEN[digest] = pickle.loads(self._scenes[digest])
        _SEEN.move_to_end(digest)
        while len(_SEEN) > 4:
            _SEEN.popitem(last=False)
        return _SEEN[digest]
