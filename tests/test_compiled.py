"""Loops that numba compiles: there, or not, but never an error."""

from __future__ import annotations

from types import ModuleType

import pytest

from wholebody import compiled


def test_there_is_none_where_numba_cannot_keep_what_it_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> ModuleType:
        raise RuntimeError("cannot cache function 'settle': no locator available for file")

    monkeypatch.setattr(compiled, "find_spec", lambda name: object())
    monkeypatch.setattr(compiled, "import_module", refuse)
    assert compiled.compiled_module("wholebody.methods.qp.active_set_kernel") is None


def test_there_is_none_without_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "find_spec", lambda name: None)
    assert compiled.compiled_module("wholebody.methods.qp.active_set_kernel") is None
