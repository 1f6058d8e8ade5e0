"""Shuffling by a keyed permutation of the index: any place of the order is computed on its own, without a list."""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Iterator
from typing import Any, Callable, overload

import numpy as np
from numpy.typing import NDArray

from . import arguments, checks

_ROUNDS = 8


@arguments.checked
class Permutation:
    """The whole numbers 0 to size - 1 in an order that a key decides: the same everywhere, for ever, however large.

    `order[place]` is the number at a place, for one place or an array of them; `order.place_of(number)` is the way
    back. A Feistel network over the next even number of bits that holds `size`, whose round function mixes with
    a key from SHA-256; what falls beyond `size` is permuted again until it lies within (Black and Rogaway,
    "Ciphers with arbitrary finite domains", 2002). It is a shuffle, not a cipher: it keeps no secrets.
    """

    def __init__(self, size: int, seed: int = 0, epoch: int = 0):
        """
        Args:
          size: how many numbers, 0 to 2**62.
          seed, epoch: the key; every pair gives an order of its own.
        """
        self.size = checks.whole_number("size", size, 0, 2**62)
        self.seed = checks.uint64("seed", seed)
        self.epoch = checks.uint64("epoch", epoch)
        half = max(1, -(-max(size - 1, 1).bit_length() // 2))
        self._shift = np.uint64(half)
        self._mask = np.uint64(2**half - 1)
        digest = b"".join(
            hashlib.sha256(f"touchstone permutation {size} {seed} {epoch} {part}".encode()).digest() for part in range(2)
        )
        self._keys = np.frombuffer(digest, "<u8")[:_ROUNDS]

    def __len__(self) -> int:
        return self.size

    def __iter__(self) -> Iterator[int]:
        for begin in range(0, self.size, 4096):
            yield from self[np.arange(begin, min(begin + 4096, self.size))].tolist()

    @overload
    def __getitem__(self, place: int | np.integer[Any]) -> int: ...

    @overload
    def __getitem__(self, place: slice | NDArray[np.integer[Any]]) -> NDArray[np.int64]: ...

    def __getitem__(self, place: int | np.integer[Any] | slice | NDArray[np.integer[Any]]) -> int | NDArray[np.int64]:
        if isinstance(place, slice):
            return self[np.arange(*place.indices(self.size))]
        if isinstance(place, np.ndarray):
            return self._walk(self._within(place), self._forward)
        number = operator.index(place)
        if not -self.size <= number < self.size:
            raise IndexError(f"place {number} of {self.size}")
        return int(self[np.array([number % self.size])][0])

    @overload
    def place_of(self, number: int | np.integer[Any]) -> int: ...

    @overload
    def place_of(self, number: NDArray[np.integer[Any]]) -> NDArray[np.int64]: ...

    def place_of(self, number: int | np.integer[Any] | NDArray[np.integer[Any]]) -> int | NDArray[np.int64]:
        """Where a number stands: place_of(order[k]) is k."""
        if isinstance(number, np.ndarray):
            return self._walk(self._within(number), self._backward)
        checked = checks.whole_number("number", number, 0, self.size - 1)
        return int(self.place_of(np.array([checked]))[0])

    def _within(self, values: NDArray[np.integer[Any]]) -> NDArray[np.uint64]:
        if values.size and not (0 <= int(values.min()) and int(values.max()) < self.size):
            raise IndexError(f"places {values.min()} to {values.max()} of {self.size}")
        return values.astype(np.uint64)

    def _walk(self, values: NDArray[np.uint64], once: Callable[[NDArray[np.uint64]], NDArray[np.uint64]]) -> NDArray[np.int64]:
        """Again and again what lies beyond `size`: as the network is a permutation, that ends within it."""
        result = once(values)
        beyond = result >= self.size
        while beyond.any():
            result[beyond] = once(result[beyond])
            beyond = result >= self.size
        return result.astype(np.int64)

    def _forward(self, values: NDArray[np.uint64]) -> NDArray[np.uint64]:
        left, right = values >> self._shift, values & self._mask
        for key in self._keys:
            left, right = right, left ^ self._mixed(right, key)
        return (left << self._shift) | right

    def _backward(self, values: NDArray[np.uint64]) -> NDArray[np.uint64]:
        left, right = values >> self._shift, values & self._mask
        for key in self._keys[::-1]:
            left, right = right ^ self._mixed(left, key), left
        return (left << self._shift) | right

    def _mixed(self, values: NDArray[np.uint64], key: np.uint64) -> NDArray[np.uint64]:
        """The finaliser of SplitMix64 (Steele, Lea and Flood 2014) of value and key."""
        x = values + key
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return (x ^ (x >> np.uint64(31))) & self._mask
