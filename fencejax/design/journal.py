"""A file of evaluations, one a line, from which an interrupted optimisation goes on."""

import hashlib
import json
import os
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

_FORMAT = 2


def _address(point, data: Any) -> str:
    """A digest of a point and its data, bit by bit."""
    digest = hashlib.sha256()
    for leaf in (point, *jax.tree.leaves(data)):
        array = np.ascontiguousarray(leaf, dtype=float)
        digest.update(str(array.shape).encode() + array.tobytes())
    return digest.hexdigest()[:32]


class Journal:
    """Evaluations by their point and data, kept in a file of JSON lines.

    Every evaluation is written out as soon as it is made. An optimisation is a deterministic
    function of its evaluations: run again with the same journal it takes the same way, without
    computing what is known, and goes on where it was interrupted. A last line that was cut off is
    dropped. Several runs of one problem with different data may share a journal.
    """

    def __init__(self, path: str | os.PathLike[str], key: str = ""):
        """**Arguments:**

        - `path`: the file; read if it is there, made with its folder if not.
        - `key`: what else decides the numbers (fidelity, scenes, bounds), as text. A file with
          another key is of another problem.

        Raises `ValueError` for a file of another problem or of another kind.
        """
        self.path, self.recalled = Path(path), 0
        self._known: dict[str, list[np.ndarray]] = {}
        self._lock = threading.Lock()
        self.path.parent.mkdir(parents=True, exist_ok=True)
        header = {"fencejax journal": _FORMAT, "key": hashlib.sha256(key.encode()).hexdigest()}
        text = self.path.read_text() if self.path.exists() else ""
        whole, _, _ = text.rpartition("\n")
        lines = whole.splitlines()
        if lines:
            self._read(lines, header)
        if text != "".join(f"{line}\n" for line in lines) or not lines:
            # Written beside and put in place at once: at no moment is what was known gone.
            fresh = self.path.with_name(self.path.name + ".new")
            kept = lines or [json.dumps(header)]
            fresh.write_text("".join(f"{line}\n" for line in kept))
            fresh.replace(self.path)

    def _read(self, lines: list[str], header: dict) -> None:
        try:
            first, *rows = [json.loads(line) for line in lines]
            kind = first["fencejax journal"]
            known = {row["address"]: [np.asarray(p) for p in row["numbers"]] for row in rows}
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(
                f"Argument `path` must name a journal of evaluations, but {self.path} is none: "
                f"{error}. Name another file, or remove this one."
            ) from error
        if kind != _FORMAT or first["key"] != header["key"]:
            raise ValueError(
                f"Argument `path` must name a journal of the same problem, but {self.path} was "
                "written with other settings. Name another file or folder, or remove this one."
            )
        for name, parts in known.items():
            objectives, margins = parts[0], parts[1]
            parts[3] = parts[3].reshape(margins.size, -1 if margins.size else parts[2].shape[-1])
            parts[2] = parts[2].reshape(objectives.size, -1)
            self._known[name] = [
                *(p.astype(float) for p in parts[:4]), *(p.astype(int) for p in parts[4:]),
            ]  # fmt: skip

    def __len__(self) -> int:
        """Number of evaluations that are known."""
        return len(self._known)

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
            "address": name,
            "point": np.asarray(point, dtype=float).tolist(),
            "numbers": [part.tolist() for part in parts],
        })  # fmt: skip
        with self._lock:
            self._known[name] = parts
            with self.path.open("a") as file:
                file.write(line + "\n")
                file.flush()
                os.fsync(file.fileno())
