"""Damage to the bytes of a file, as disks, transfers and careless programs do it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

__all__ = ["MUTATIONS", "mutate"]

Mutation = Callable[[bytearray, np.random.Generator], None]


def _place(data: bytearray, rng: np.random.Generator) -> int:
    """Return a position; half of them lie in the first 2 % of the file, where formats keep what they believe."""
    share = rng.random() ** 8 if rng.random() < 0.5 else rng.random()
    return int(share * max(0, len(data) - 1))


def _block(data: bytearray, rng: np.random.Generator) -> slice:
    start = _place(data, rng)
    return slice(start, start + int(rng.choice([1, 4, 16, 256, 4096])))


def cut_off(data: bytearray, rng: np.random.Generator) -> None:
    del data[_place(data, rng) :]


def flip_bits(data: bytearray, rng: np.random.Generator) -> None:
    for _ in range(int(rng.choice([1, 2, 8, 64]))):
        data[_place(data, rng)] ^= 1 << int(rng.integers(8))


def clear_block(data: bytearray, rng: np.random.Generator) -> None:
    block = _block(data, rng)
    data[block] = bytes(len(data[block]))


def fill_block(data: bytearray, rng: np.random.Generator) -> None:
    block = _block(data, rng)
    data[block] = b"\xff" * len(data[block])


def random_block(data: bytearray, rng: np.random.Generator) -> None:
    block = _block(data, rng)
    data[block] = rng.bytes(len(data[block]))


def remove_block(data: bytearray, rng: np.random.Generator) -> None:
    del data[_block(data, rng)]


def repeat_block(data: bytearray, rng: np.random.Generator) -> None:
    block = _block(data, rng)
    data[block.start : block.start] = data[block] * int(rng.choice([1, 2, 50]))


def swap_blocks(data: bytearray, rng: np.random.Generator) -> None:
    one, two = sorted((_place(data, rng), _place(data, rng)))
    size = min(64, two - one)
    data[one : one + size], data[two : two + size] = data[two : two + size], data[one : one + size]


def extreme_number(data: bytearray, rng: np.random.Generator) -> None:
    """Write an extreme integer or float, as a count, an offset, a size or a coordinate."""
    numbers = [np.int64(-1), np.int32(-1), np.int32(2**31 - 1), np.int64(2**62), np.int32(0), np.float64(np.nan)]
    numbers += [np.float64(1e300), np.float64(-np.inf), np.float32(np.nan), np.int16(-1), np.float64(0.0)]
    value = numbers[int(rng.integers(len(numbers)))].tobytes()
    start = _place(data, rng) & ~3
    data[start : start + len(value)] = value


def foreign_tail(data: bytearray, rng: np.random.Generator) -> None:
    data.extend(rng.bytes(int(rng.integers(1, 5000))))


MUTATIONS: tuple[Mutation, ...] = (
    cut_off,
    flip_bits,
    clear_block,
    fill_block,
    random_block,
    remove_block,
    repeat_block,
    swap_blocks,
    extreme_number,
    foreign_tail,
)


def mutate(content: bytes, rng: np.random.Generator) -> bytes:
    """Return `content` with one to three kinds of damage; never the same bytes."""
    data = bytearray(content)
    for number in rng.integers(len(MUTATIONS), size=int(rng.integers(1, 4))):
        if data:
            MUTATIONS[number](data, rng)
    return bytes(data) if bytes(data) != content else content[:-1]
