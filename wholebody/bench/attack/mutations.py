"""Mutations of text: bytes, lines, numbers, words, encodings, and what parsers have stumbled over."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

NUMBERS = (
    b"nan", b"inf", b"-inf", b"NaN", b"Infinity", b"1e400", b"-1e308", b"1e300", b"1e-320", b"0", b"-0.0", b"-1",
    b"9" * 400,
    b"9" * 5000, b"0x7fffffff", b"1_000", b"1e5", b"+.5", b"1e", b"--1", b"1,5", b"\xd9\xa3", b"2147483648",
    b"-9223372036854775809", b"3.5", b"1e-9", b"100.00001",
)  # fmt: skip
"""What a number becomes."""
VALUES = (
    b"true", b'"x"', b"''", b'""', b"[]", b"{}", b"[[[[1]]]]", b"null", b"None", b"2020-01-01", b'"""', b"[1, 'a', []]",
    b"{ a = 1 }", b"\\ud800", b'"\\u0000"', b'"../../../../etc/passwd"', b'"/dev/null"', b'"' + b"a" * 5000 + b'"',
    b'"."',
)  # fmt: skip
"""What a value becomes."""
ODD = (
    b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"\x1b[31m", "é".encode(), "é".encode("latin-1"), "\u202e".encode(),
    b"<", b">", b"&", b'"', b"'", b"[", b"]", b"{", b"}", b",", b"=", b"#", b"\n", b"\\", b"%s", b"&undefined;", b"]]>",
)  # fmt: skip
"""What is put in between."""
BOMB = (
    b'<?xml version="1.0"?>\n<!DOCTYPE robot [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">'
    b'<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;"><!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;">]>\n<robot name="&d;">'
)
DEEP = (50, 3000, 200_000)
_NUMBER = re.compile(rb"(?<![A-Za-z_])-?\d+\.?\d*(?:[eE][-+]?\d+)?")
_VALUE = re.compile(rb'"[^"\n]*"|\[[^\[\]\n]*\]|-?\d+\.?\d*')
_WORD = re.compile(rb"[A-Za-z_]{2,}")


def mutated(text: bytes, rng: np.random.Generator) -> bytes:
    """Return a text with one to three mutations, seldom more."""
    count = int(rng.choice([1, 1, 1, 2, 3, 10]))
    for _ in range(count):
        text = _WAYS[int(rng.integers(len(_WAYS)))](text, rng)
    return text


def _flip(text: bytes, rng: np.random.Generator) -> bytes:
    found = bytearray(text or b"x")
    for _ in range(int(rng.integers(1, 4))):
        found[int(rng.integers(len(found)))] = int(rng.integers(256))
    return bytes(found)


def _span(text: bytes, rng: np.random.Generator) -> tuple[int, int]:
    first = int(rng.integers(len(text) + 1))
    return first, min(len(text), first + int(rng.integers(1, 60)))


def _delete(text: bytes, rng: np.random.Generator) -> bytes:
    first, last = _span(text, rng)
    return text[:first] + text[last:]


def _repeat(text: bytes, rng: np.random.Generator) -> bytes:
    first, last = _span(text, rng)
    return text[:last] + text[first:last] + text[last:]


def _cut(text: bytes, rng: np.random.Generator) -> bytes:
    return text[: int(rng.integers(len(text) + 1))]


def _insert(text: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(text) + 1))
    return text[:at] + ODD[int(rng.integers(len(ODD)))] + text[at:]


def _replaced(text: bytes, pattern: re.Pattern[bytes], by: Callable[[bytes], bytes], rng: np.random.Generator) -> bytes:
    found = list(pattern.finditer(text))
    if not found:
        return text
    one = found[int(rng.integers(len(found)))]
    return text[: one.start()] + by(one.group()) + text[one.end() :]


def _number(text: bytes, rng: np.random.Generator) -> bytes:
    return _replaced(text, _NUMBER, lambda _: NUMBERS[int(rng.integers(len(NUMBERS)))], rng)


def _value(text: bytes, rng: np.random.Generator) -> bytes:
    return _replaced(text, _VALUE, lambda _: VALUES[int(rng.integers(len(VALUES)))], rng)


def _word(text: bytes, rng: np.random.Generator) -> bytes:
    words = _WORD.findall(text) or [b"x"]
    return _replaced(text, _WORD, lambda _: words[int(rng.integers(len(words)))], rng)


def _misspelt(text: bytes, rng: np.random.Generator) -> bytes:
    def swapped(word: bytes) -> bytes:
        at = int(rng.integers(len(word) - 1))
        return word[:at] + word[at + 1 : at + 2] + word[at : at + 1] + word[at + 2 :]

    return _replaced(text, _WORD, swapped, rng)


def _lines(text: bytes, rng: np.random.Generator) -> bytes:
    lines = text.split(b"\n")
    a, b = int(rng.integers(len(lines))), int(rng.integers(len(lines)))
    what = int(rng.integers(3))
    if what == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif what == 1:
        lines.insert(b, lines[a])
    else:
        del lines[a]
    return b"\n".join(lines)


def _encoded(text: bytes, rng: np.random.Generator) -> bytes:
    what = int(rng.integers(6))
    if what == 0:
        return text.decode("utf-8", errors="replace").encode("utf-16")
    if what == 1:
        return b"\xef\xbb\xbf" + text
    if what == 2:
        return text.replace(b"\n", b"\r\n")
    if what == 3:
        return text.replace(b"\n", b"\r")
    name = (b"klingon", b"utf-16", b"us-ascii", b"latin-1")[int(rng.integers(4))]
    return text.replace(b'encoding="utf-8"', b'encoding="' + name + b'"')


def _nested(text: bytes, rng: np.random.Generator) -> bytes:
    depth = int(rng.choice(DEEP, p=[0.6, 0.3, 0.1]))
    opening, closing = ((b"[", b"]"), (b"{a=", b"}"), (b"<link>", b"</link>"), (b'{"a":', b"}"))[int(rng.integers(4))]
    return _replaced(text, _VALUE, lambda old: opening * depth + old + closing * depth, rng)


def _bomb(text: bytes, rng: np.random.Generator) -> bytes:
    return BOMB + text.partition(b">")[2].partition(b">")[2] if rng.random() < 0.2 else _insert(text, rng)


def _empty(text: bytes, rng: np.random.Generator) -> bytes:
    return (b"", b"\n", b"\x00" * 100, text * 50)[int(rng.integers(4))]


_WAYS = (
    *(_number,) * 6, *(_value,) * 4, *(_word,) * 3, _misspelt, _misspelt, _flip, _delete, _delete, _repeat, _cut,
    _insert,
    _insert, _lines, _lines, _encoded, _nested, _bomb, _empty,
)  # fmt: skip
