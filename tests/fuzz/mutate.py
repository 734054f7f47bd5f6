"""Damage to bytes, as transfers, editors and enemies do it; the same seed gives the same damage."""

from __future__ import annotations

import random

INTERESTING = (0, 1, 0x7F, 0x80, 0xFF)
LARGE = (0, 1, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
TOKENS = (
    *(b"nan", b"-1", b"1e309", b"1" + b"0" * 30, b"1\xc2\xb22", b"\x00", b"[" * 3000, b'{"a":' * 3000, b"a." * 3000),
    *(b"../../etc/passwd", b"/dev/zero", b"\xef\xbb\xbf", b"\xff\xfe", b"=1+2", b"A" * 5000, b"\r\n" * 400, b"'", b'"'),
)


def mutated(content: bytes, other: bytes, chance: random.Random) -> bytes:
    """Return content after one to six damages; `other` is a file to splice in."""
    found = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 3, 6))):
        chance.choice(DAMAGES)(found, other, chance)
    return bytes(found)


def _place(found: bytearray, chance: random.Random) -> int:
    # Headers first: that is where decoders believe what they read.
    return chance.randrange(min(len(found), chance.choice((16, 256, 1 << 30))) or 1)


def _flip(found: bytearray, _: bytes, chance: random.Random) -> None:
    if found:
        found[_place(found, chance)] ^= 1 << chance.randrange(8)


def _byte(found: bytearray, _: bytes, chance: random.Random) -> None:
    if found:
        found[_place(found, chance)] = chance.choice((*INTERESTING, chance.randrange(256)))


def _number(found: bytearray, _: bytes, chance: random.Random) -> None:
    size, place = chance.choice((2, 4)), _place(found, chance)
    value = chance.choice(LARGE) & (1 << 8 * size) - 1
    found[place : place + size] = value.to_bytes(size, chance.choice(("little", "big")))


def _cut(found: bytearray, _: bytes, chance: random.Random) -> None:
    del found[_place(found, chance) :]


def _remove(found: bytearray, _: bytes, chance: random.Random) -> None:
    place = _place(found, chance)
    del found[place : place + chance.choice((1, 2, 8, 100))]


def _repeat(found: bytearray, _: bytes, chance: random.Random) -> None:
    place = _place(found, chance)
    piece = found[place : place + chance.choice((1, 4, 40, 400))]
    found[place:place] = piece * chance.choice((1, 2, 50))


def _token(found: bytearray, _: bytes, chance: random.Random) -> None:
    place = _place(found, chance)
    found[place:place] = chance.choice(TOKENS)


def _splice(found: bytearray, other: bytes, chance: random.Random) -> None:
    start = chance.randrange(len(other) or 1)
    place = _place(found, chance)
    found[place : place + chance.choice((0, 4, 64))] = other[start : start + chance.choice((4, 64, 1000))]


DAMAGES = (_flip, _byte, _number, _cut, _remove, _repeat, _token, _splice)
