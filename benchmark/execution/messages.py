"""Messages between processes over standard streams: length-prefixed bytes, and headers with arrays.

A *plain message* is bytes after their length. A message *with parts* is a JSON header and buffers of numbers, which are
read straight into arrays of their own: nothing is unpickled, and no copy is made on the way.
"""

from __future__ import annotations

import json
import os
import queue
import selectors
import struct
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.processes import end_children

__all__ = ["Receiver", "listen", "receive", "receive_parts", "send", "send_parts"]

T = TypeVar("T")

#: Bit of a message's size that marks an outcome before its evaluation.
_PRELIMINARY = 1 << 63


def send(stream: IO[bytes] | None, message: bytes, *, preliminary: bool = False) -> None:
    """Write a plain message; a `preliminary` one is followed by another."""
    assert stream is not None
    stream.write(struct.pack("<Q", len(message) | (_PRELIMINARY if preliminary else 0)))
    stream.write(message)
    stream.flush()


def receive(stream: IO[bytes]) -> bytes:
    """Read a plain message; raise `EOFError` when the stream ends."""
    (size,) = struct.unpack("<Q", _exactly(stream, 8))
    return _exactly(stream, size)


def send_parts(stream: IO[bytes] | None, header: Mapping[str, Any], arrays: Sequence[NDArray[Any]] = ()) -> None:
    """Write a header that JSON holds and arrays of numbers; the order of their axes in memory is kept."""
    assert stream is not None
    turned = [array.flags.f_contiguous and not array.flags.c_contiguous for array in arrays]
    flat = [array.T if turn else array for array, turn in zip(arrays, turned, strict=True)]
    layouts = [
        {"dtype": part.dtype.str, "shape": part.shape, "turned": turn} for part, turn in zip(flat, turned, strict=True)
    ]
    send(stream, json.dumps({"header": header, "arrays": layouts}).encode())
    for part in flat:
        if part.size:
            stream.write(np.ascontiguousarray(part).data.cast("B"))
    stream.flush()


def receive_parts(stream: IO[bytes]) -> tuple[dict[str, Any], list[NDArray[Any]]]:
    """Read a header and its arrays; raise `EOFError` when the stream ends."""
    text = json.loads(receive(stream))
    arrays = []
    for layout in text["arrays"]:
        part = np.empty(layout["shape"], dtype=np.dtype(layout["dtype"]))
        if part.size:
            _fill(stream, part.data.cast("B"))
        arrays.append(part.T if layout["turned"] else part)
    return text["header"], arrays


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data


def _fill(stream: IO[bytes], target: memoryview) -> None:
    filled = 0
    while filled < len(target):
        count = stream.readinto(target[filled:])  # type: ignore[attr-defined]
        if not count:
            raise EOFError
        filled += count


def listen(
    inward: IO[bytes], read: Callable[[IO[bytes]], T], *, ending: Callable[[], None] = end_children
) -> queue.SimpleQueue[T]:
    """Return the queue of what arrives; when the stream ends, the caller has ended, and this process ends too.

    Before it calls `ending`.
    """
    messages: queue.SimpleQueue[T] = queue.SimpleQueue()

    def work() -> None:
        while True:
            try:
                messages.put(read(inward))
            except (EOFError, OSError):
                ending()
                os._exit(0)  # nobody needs the result

    threading.Thread(target=work, daemon=True).start()
    return messages


class Receiver:
    """A plain message that arrives in pieces, and the preliminary one before it."""

    def __init__(self, stream: IO[bytes] | None) -> None:
        assert stream is not None
        self._descriptor = stream.fileno()
        self._data = bytearray()
        self._size: int | None = None
        self.preliminary: bytes | None = None

    def poll(self, seconds: float) -> bytes | None:
        """Wait for at most this time; return the message when it is complete."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._descriptor, selectors.EVENT_READ)
            if not selector.select(seconds):
                return None
        piece = os.read(self._descriptor, 1 << 20)
        if not piece:
            raise EOFError
        self._data += piece
        while True:
            if self._size is None and len(self._data) >= 8:
                (self._size,) = struct.unpack("<Q", self._data[:8])
                del self._data[:8]
            if self._size is None or len(self._data) < self._size & ~_PRELIMINARY:
                return None
            size = self._size & ~_PRELIMINARY
            message = bytes(self._data[:size])
            if self._size == size:
                return message
            self.preliminary = message
            del self._data[:size]
            self._size = None
