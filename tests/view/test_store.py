"""The server's memory and the tabs' queues give the page the same picture as the full history would."""

from __future__ import annotations

from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st

from wholebody.view.server import Command, Op, Queue, Store

PATHS = ("/a", "/a/b", "/a/b/<object>", "/ab")


@st.composite
def commands(draw: Any) -> Command:
    """One drawing command with a payload that says what it is."""
    op = draw(st.sampled_from([Op.OBJECT, Op.TRANSFORM, Op.PROPERTY, Op.DELETE, Op.CAMERA, Op.ANIMATION]))
    path = "" if op in (Op.CAMERA, Op.ANIMATION) else draw(st.sampled_from(PATHS))
    key = {
        Op.PROPERTY: draw(st.sampled_from(["color", "visible"])),
        Op.ANIMATION: draw(st.sampled_from(["", Op.STOP])),
    }.get(op, "")
    return Command(op, path, key, repr((op, path, key, draw(st.integers(0, 3)))).encode())


class Page:
    """What a browser does with the payloads, told anew: an object replaces what was below, deleting takes all."""

    def __init__(self) -> None:
        self.state: dict[Any, Any] = {}

    def take(self, payloads: list[bytes]) -> None:
        for payload in payloads:
            op, path, key, value = eval(payload)  # of our own making
            if op == Op.DELETE:
                self.forget(lambda at, path=path: at == path or at.startswith(path + "/"))
                continue
            if op == Op.OBJECT:
                self.forget(lambda at, path=path: at == f"{path}/<object>")
                self.state = {slot: old for slot, old in self.state.items() if slot[:2] != (Op.PROPERTY, path)}
            self.state[op, path, "" if op == Op.ANIMATION else key] = None if key == Op.STOP else value
        self.state = {slot: value for slot, value in self.state.items() if slot[0] != Op.ANIMATION or value is not None}

    def forget(self, gone: Any) -> None:
        self.state = {slot: value for slot, value in self.state.items() if not slot[1] or not gone(slot[1])}


def page_of(payloads: list[bytes]) -> dict[Any, Any]:
    page = Page()
    page.take(payloads)
    return page.state


@given(st.lists(commands(), max_size=30))
@example(
    [
        Command(op, path, key, repr((op, path, key, 0)).encode())
        for op, path, key in (
            (Op.TRANSFORM, "/a/b", ""),
            (Op.PROPERTY, "/a/b/<object>", "color"),
            (Op.OBJECT, "/a/b", ""),
        )
    ]
)
def test_a_page_opened_later_shows_the_same(history: list[Command]) -> None:
    store = Store()
    for command in history:
        store.apply(command)
    assert page_of([command.payload for command in store.commands()]) == page_of([c.payload for c in history])


@given(st.lists(commands(), max_size=30), st.integers(0, 30))
def test_a_slow_tab_ends_at_the_same_picture(history: list[Command], pause: int) -> None:
    queue, page = Queue(), Page()
    for number, command in enumerate(history):
        queue.put(command)
        if number == pause:
            page.take(queue.take())
    page.take(queue.take())
    assert page.state == page_of([command.payload for command in history])


def test_a_slow_tab_is_told_only_the_last_of_many_transforms() -> None:
    queue = Queue()
    for number in range(1000):
        queue.put(Command(Op.TRANSFORM, "/a", "", b"%d" % number))
    assert queue.take() == [b"999"]


def test_the_animation_comes_last_and_can_be_left_out() -> None:
    store = Store()
    store.apply(Command(Op.ANIMATION, "", "", b"motion"))
    store.apply(Command(Op.OBJECT, "/a", "", b"object"))
    assert [command.payload for command in store.commands()] == [b"object", b"motion"]


def test_what_is_already_so_is_not_done_again() -> None:
    store = Store()
    for command in (
        Command(Op.OBJECT, "/a", "", b"1"),
        Command(Op.TRANSFORM, "/a", "", b"2"),
        Command(Op.PROPERTY, "/a", "color", b"3"),
    ):
        assert not store.has(command)
        store.apply(command)
        assert store.has(command)
        assert not store.has(command._replace(payload=b"other"))
