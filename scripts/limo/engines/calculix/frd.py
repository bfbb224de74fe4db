"""Displacement frames from CalculiX's binary result file (.frd).

Layout: text headers; ``100CL`` starts a frame (time, number of nodes), ``-4  DISP`` and ``-5`` lines name the field, then
one record a node: its number as int32 and three float32 (format 2) or float64 (format 3). No dependency reads such files.
"""

from __future__ import annotations

import mmap
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limo.errors import ResultError

_HEADER = 300  # bytes that the headers of a frame take at least
_FORMATS = {b"2": np.dtype("<f4"), b"3": np.dtype("<f8")}


@dataclass(frozen=True)
class Frame:
    """One frame: solver ``time`` (total, s), and ``step`` and ``increment`` as CalculiX counts them; ``offset`` into the file."""

    time: float
    step: int
    increment: int
    offset: int
    count: int
    record: np.dtype


class FrdFile:
    """Frames of displacements in a binary .frd; an incomplete last frame is left out.

    Frames are read one at a time from a memory map, in constant memory. Raises ``ResultError`` for a file that is
    missing, in text format, or not an .frd.
    """

    def __init__(self, path: Path):
        self.path = Path(path)
        try:
            with self.path.open("rb") as handle:
                self._data = mmap.mmap(handle.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise ResultError(f"{path}: cannot be read ({error})") from None
        if not self._data[:6].startswith(b"    1C"):
            raise ResultError(f"{path}: not an .frd file (it does not start with 1C)")
        self.frames: list[Frame] = []
        self._index()

    def _index(self) -> None:
        position, step, increment = 0, 0, 0
        size = len(self._data)
        while (start := self._data.find(b"    1PSTEP", position)) >= 0:
            line = self._line(start)
            frame = self._line(start + len(line) + 1)
            field = self._data.find(b"\n -4  DISP", start)
            if field < 0 or size - start < _HEADER:
                return
            try:
                increment, step = int(line[36:48]), int(line[48:60])
                time, count = float(frame[12:24]), int(frame[24:36])
                real = _FORMATS[frame[74:75]]
                components = int(self._line(field + 1)[13:18])
            except (ValueError, KeyError):
                raise ResultError(f"{self.path}: damaged or not binary at byte {start} ({bytes(frame[:80])!r})") from None
            offset = field + 1
            for _ in range(components + 1):
                offset += len(self._line(offset)) + 1
            record = np.dtype([("node", "<i4"), ("u", real, 3)])
            position = offset + count * record.itemsize
            if count <= 0 or position > size:
                return
            self.frames.append(Frame(time, step, increment, offset, count, record))

    def _line(self, start: int) -> bytes:
        end = self._data.find(b"\n", start)
        return self._data[start : end if end >= 0 else len(self._data)]

    def displacements(self, frame: Frame, n_nodes: int) -> np.ndarray:
        """Displacements (n_nodes, 3) in mm of nodes 1 .. n_nodes; nodes of no element are not in the file and stay zero.

        Raises ``ResultError`` when the frame names a node beyond ``n_nodes``.
        """
        # of a copy: an array on the map itself, held by the traceback of an error, would keep the map from closing
        end = frame.offset + frame.count * frame.record.itemsize
        records = np.frombuffer(self._data[frame.offset : end], frame.record)
        nodes = records["node"]
        if nodes.min() < 1 or nodes.max() > n_nodes:
            raise ResultError(f"{self.path}: frame at {frame.time} s names node {nodes.max()}, the model has {n_nodes}")
        values = np.zeros((n_nodes, 3))
        values[nodes - 1] = records["u"]
        return values

    def close(self) -> None:
        """Release the file."""
        self._data.close()

    def __enter__(self) -> FrdFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
