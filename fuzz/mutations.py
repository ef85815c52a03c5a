"""The same small changes every time: what a fuzzer does first, without one."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

_LINE = re.compile(rb'^"(.*)"$', re.MULTILINE)
_NUMBER = re.compile(rb"-?\d+(\.\d+)?")


def tokens() -> list[bytes]:
    """Those of the dictionary that libFuzzer is given."""
    text = Path(__file__).with_name("values.dict").read_bytes()
    return [found.decode("unicode_escape").encode("latin-1") for found in _LINE.findall(text)]


def mutations(seeds: Sequence[bytes], count: int, seed: int) -> Iterator[bytes]:
    """So many inputs, each a seed with one to four changes."""
    chance, values = random.Random(seed), tokens()
    for _ in range(count):
        data = chance.choice(seeds)
        for _ in range(chance.randint(1, 4)):
            data = _changed(data, values, seeds, chance)
        yield data


def _changed(
    data: bytes, values: Sequence[bytes], seeds: Sequence[bytes], chance: random.Random
) -> bytes:
    start = chance.randint(0, len(data))
    end = min(len(data), start + chance.choice((1, 2, 8, 64)))
    kind = chance.randrange(7)
    if kind == 0:  # cut off
        return data[:start]
    if kind == 1:  # taken out
        return data[:start] + data[end:]
    if kind == 2:  # twice
        return data[:end] + data[start:]
    if kind == 3:  # flipped
        flipped = bytes(byte ^ 1 << chance.randrange(8) for byte in data[start:end])
        return data[:start] + flipped + data[end:]
    if kind == 4:  # spliced with another
        other = chance.choice(seeds)
        return data[:start] + other[chance.randint(0, len(other)) :]
    numbers = list(_NUMBER.finditer(data))
    if kind == 5 and numbers:  # a number that is none, or is far off
        start, end = chance.choice(numbers).span()
    return data[:start] + chance.choice(values) + data[end:]
