"""A file of evaluations, one a line, from which an interrupted optimisation resumes."""

import contextlib
import errno
import hashlib
import json
import os
import threading
import uuid
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .._identity import edition, refused, text
from .program import Numbers

_FORMAT = 4


def _address(point, data: Any) -> str:
    """A digest of a point and its data: of the bits of every number and its position in the
    data."""
    leaves, structure = jax.tree.flatten(data)
    known = refused("data", lambda: text(structure))
    digest = hashlib.sha256(known.encode())
    for leaf in (point, *leaves):
        array = np.ascontiguousarray(leaf, dtype=float)
        digest.update(str(array.shape).encode() + array.tobytes())
    return digest.hexdigest()[:32]


class Journal:
    """Evaluations by their point and data, kept in a file of JSON lines.

    Every evaluation is written to the file at once. An optimisation is a deterministic function of
    its evaluations: run again with the same journal, it takes the same steps without computing the
    recorded evaluations again, and continues where it was interrupted. Lines damaged by a kill, a
    full disk or a defect stay in the file, but are ignored, and so are lines of another problem,
    whose digest each line carries; the others are used. Several runs of one problem with different
    data may share a journal. Another version or source of fencejax may compute other numbers, so a
    journal is refused there.

    >>> journal = fj.Journal("evaluations.jsonl")
    >>> problem = fj.Program(lambda z: (z**2, z - 0.5, jnp.zeros(1, int)))
    >>> fj.minimize(problem, [0.9], journal=journal).stop.name
    'OPTIMAL'
    >>> fj.minimize(problem, [0.9], journal=fj.Journal("evaluations.jsonl")).history[0].recalled
    True
    """

    def __init__(self, path: str | os.PathLike[str], key: str = ""):
        """**Arguments:**

        - `path`: the file; read if it exists, else created with its folder.
        - `key`: everything else that the numbers depend on (fidelity, scenes, bounds), as text. A
          file with another key belongs to another problem.

        Raises `ValueError` for a file of another problem, of another version or source of fencejax
        or of another kind, and `OSError` where it cannot be read or written.
        """
        self.path, self.recalled, self.torn, self.foreign = Path(path), 0, 0, 0
        self._known: dict[str, list[np.ndarray]] = {}
        self._lock = threading.Lock()
        header = {
            "fencejax journal": _FORMAT,
            "fencejax": edition(),
            "key": hashlib.sha256(key.encode()).hexdigest(),
        }
        start = json.dumps(header)
        self._job = hashlib.sha256(start.encode()).hexdigest()[:16]
        with self._with_remedy():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            there = self.path.exists()
            text_there = self._text() if there else ""
            if "\n" not in text_there and start.startswith(text_there):
                # The file is new, or its header was not written completely.
                _claim(self.path, start.encode() + b"\n", there)
                # Read back, as another job may have created it.
                text_there = self._text()
        first, *rows = text_there.split("\n")
        self._check(first, header)
        for row in filter(None, rows):
            try:
                job, address, numbers = _evaluation(row)
            except (ValueError, KeyError, TypeError, IndexError, OverflowError):
                self.torn += 1
                continue
            if job == self._job:
                self._known[address] = numbers
            else:
                self.foreign += 1

    def _text(self) -> str:
        return self.path.read_bytes().decode(errors="replace")

    def _check(self, first: str, header: dict) -> None:
        """Raise `ValueError` where a file's first line is not the header of this problem."""
        try:
            found = json.loads(first)
            kind, key = found["fencejax journal"], found["key"]
            by = found.get("fencejax", "an earlier one")
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(
                f"Argument `path` must name a journal of evaluations, but {self.path} is none. "
                "Name another file or folder, or remove this one."
            ) from error
        if kind != _FORMAT or by != header["fencejax"]:
            raise ValueError(
                f"Argument `path` must name a journal of this fencejax ({header['fencejax']}), but "
                f"{self.path} was written by another one ({by}), whose numbers may be others. Name "
                "another file or folder, or remove this one."
            )
        if key != header["key"]:
            raise ValueError(
                f"Argument `path` must name a journal of the same problem, but {self.path} was "
                "written with other settings. Name another file or folder, or remove this one."
            )

    @contextlib.contextmanager
    def _with_remedy(self) -> Iterator[None]:
        """Raise an `OSError` of the system again, with the file and a remedy."""
        try:
            yield
        except OSError as error:
            raise OSError(
                f"Journal {self.path} cannot be read or written "
                f"({error.strerror or error}). What it holds is kept: make room or name another "
                "folder, and run the same again."
            ) from error

    def __str__(self) -> str:
        torn = f", {self.torn} torn lines passed over" if self.torn else ""
        other = f", {self.foreign} lines of another problem passed over" if self.foreign else ""
        return f"{len(self)} evaluations known from {self.path}{torn}{other}"

    def __len__(self) -> int:
        """Number of evaluations that are known."""
        return len(self._known)

    def numbers(
        self, point, data: Any, compute: Callable[[], Numbers]
    ) -> tuple[Numbers, bool]:
        """The numbers at a point, and whether they were recorded; otherwise they are computed and
        recorded."""
        known = self.find(point, data)
        if known is not None:
            return Numbers(*known), True
        found = compute()
        self.add(point, data, found)
        return found, False

    def find(self, point, data: Any) -> list[np.ndarray] | None:
        """The numbers at a point, `None` where they are not known."""
        found = self._known.get(_address(point, data))
        if found is not None:
            self.recalled += 1
        return found

    def add(self, point, data: Any, numbers: Sequence[np.ndarray]) -> None:
        """Keep the numbers (all of them arrays) of a point."""
        name = _address(point, data)
        parts = [np.asarray(part) for part in numbers]
        line = json.dumps({
            "job": self._job,
            "address": name,
            "point": np.asarray(point, dtype=float).tolist(),
            "numbers": [part.tolist() for part in parts],
        })  # fmt: skip
        with self._lock, self._with_remedy():
            _append(self.path, line.encode() + b"\n")
            self._known[name] = parts


def _claim(path: Path, header: bytes, there: bool) -> None:
    """Create a file with its header, unless another process does so first; replace one that is
    `there` with half a header.

    The header is written under another name and then linked, which fails where a file exists: one
    of several processes creates it, and none ever sees an incomplete one.
    """
    part = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        part.write_bytes(header)
        if there:
            part.replace(path)
            return
        try:
            os.link(part, path)
        except FileExistsError:
            pass
        except OSError:
            # A file system without links.
            with contextlib.suppress(FileExistsError), path.open("xb") as file:
                file.write(header)
    finally:
        part.unlink(missing_ok=True)


def _append(path: Path, line: bytes) -> None:
    """Add a line to a file, whole or not at all, on a line of its own after an incomplete one."""
    with path.open("ab+", buffering=0) as file:
        end = file.seek(0, os.SEEK_END)
        file.seek(max(0, end - 1))
        if end and file.read(1) != b"\n":
            line = b"\n" + line
        try:
            if file.write(line) < len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(file.fileno())
        except OSError:
            with contextlib.suppress(OSError):
                file.truncate(end)
            raise


def _evaluation(line: str) -> tuple[str, str, list[np.ndarray]]:
    """Digest of the problem, address and numbers of a line.

    Raises `ValueError`, `KeyError`, `TypeError`, `IndexError` or `OverflowError` where the line is
    damaged.
    """
    row = json.loads(line)
    size = len(row["point"])
    objectives, margins, slopes, margin_slopes = (
        np.asarray(part, dtype=float) for part in row["numbers"][:4]
    )
    counts = [np.asarray(part, dtype=int) for part in row["numbers"][4:]]
    if len(counts) != 2 or any(np.any(part < 0) for part in counts):
        raise ValueError("counts")
    # A list of no rows has lost their length.
    slopes = slopes.reshape(objectives.size, size)
    margin_slopes = margin_slopes.reshape(margins.size, size)
    numbers = [objectives, margins, slopes, margin_slopes, *counts]
    return str(row["job"]), str(row["address"]), numbers
