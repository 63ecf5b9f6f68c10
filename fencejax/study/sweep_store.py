"""A folder that keeps the chunks of a long job: each whole or not there, none for another job."""

import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

_MANIFEST = "manifest.json"
_CHUNKS = "chunks"


def write_whole(path: Path, write: Callable[[IO[bytes]], Any]) -> None:
    """Have `write` fill a file, such that `path` holds all of it or is as it was before.

    The file is written beside it, forced to the disk, and put in its place in one go.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays as a .npz file, whole or not at all."""
    named: dict[str, Any] = dict(arrays)
    write_whole(path, lambda file: np.savez(file, **named))


def digest(configuration: Mapping[str, Any]) -> str:
    """SHA-256 of a configuration of plain numbers, names, lists and dictionaries."""
    text = json.dumps(configuration, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


class Store:
    """Chunks 0 ... K - 1 of one job in a folder, each a .npz file, and the job's configuration in
    manifest.json. Several processes may share the folder."""

    def __init__(self, folder: Path | str, configuration: Mapping[str, Any]):
        """**Arguments:**

        - `folder`: made where it is missing.
        - `configuration`: what the chunks depend on; plain numbers, names, lists, dictionaries.

        Raises `ValueError` where the folder holds chunks of another configuration, naming what
        differs, or a manifest that cannot be read.
        """
        self.folder = Path(folder)
        # As JSON gives it back, so that the two can be compared.
        self.configuration = json.loads(json.dumps(configuration))
        self.digest = digest(self.configuration)
        self._lock: IO[bytes] | None = None
        (self.folder / _CHUNKS).mkdir(parents=True, exist_ok=True)
        self._claim()

    def _claim(self) -> None:
        path = self.folder / _MANIFEST
        if path.exists():
            try:
                found = json.loads(path.read_text())
                there, configuration = found["hash"], found["configuration"]
            except (ValueError, KeyError, TypeError) as error:
                raise ValueError(
                    f"Folder {self.folder} must hold a manifest of a sweep, but {path} cannot be "
                    "read. Choose another folder."
                ) from error
            if there != self.digest:
                raise ValueError(
                    f"Folder {self.folder} must be empty or hold the same sweep, but it holds "
                    f"another one: {_differences(configuration, self.configuration)}. Choose "
                    "another folder, or delete this one."
                )
            return
        content = {"hash": self.digest, "configuration": self.configuration}
        text = json.dumps(content, indent=2).encode() + b"\n"
        write_whole(path, lambda file: file.write(text))

    def lock(self, share: int) -> None:
        """Claim a share of the chunks for this process until it ends, however it ends.

        Raises `RuntimeError` where another process holds it. Where the system knows no such locks,
        nothing is claimed.
        """
        try:
            import fcntl
        except ImportError:
            return
        file = (self.folder / f".share_{share}.lock").open("wb")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.close()
            raise RuntimeError(
                f"Folder {self.folder} is in use: another process computes share {share} of this "
                "sweep. Wait for it, or choose another folder."
            ) from error
        except OSError:
            # A file system without locks.
            file.close()
            return
        self._lock = file

    def release(self) -> None:
        """Give the share back."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def path(self, chunk: int) -> Path:
        """Where a chunk is kept."""
        return self.folder / _CHUNKS / f"{chunk:08d}.npz"

    def done(self) -> set[int]:
        """Numbers of the chunks that are there."""
        names = os.listdir(self.folder / _CHUNKS)
        return {int(n[:-4]) for n in names if n.endswith(".npz") and not n.startswith(".")}

    def write(self, chunk: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Keep a chunk, whole or not at all."""
        write_arrays(self.path(chunk), arrays)

    def tidy(self) -> None:
        """Remove what kills have left half written, once no process writes chunks any more."""
        for part in (self.folder / _CHUNKS).glob(".*.part"):
            part.unlink(missing_ok=True)

    def read(self, chunk: int) -> dict[str, np.ndarray]:
        """A chunk's arrays.

        Raises `ValueError` where the file is damaged.
        """
        path = self.path(chunk)
        try:
            # Opened here: NumPy leaves a file open that it cannot read.
            with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                return {name: arrays[name] for name in arrays.files}
        except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
            raise ValueError(
                f"Chunk {chunk} must be a .npz file, but {path} cannot be read ({error}). Delete "
                "it and run the same sweep again: it is then computed anew."
            ) from error


def _differences(old: Any, new: Any, most: int = 4) -> str:
    """The entries in which two configurations differ, as text."""
    rows = []
    a, b = _flat(old), _flat(new)
    for name in dict.fromkeys([*a, *b]):
        if a.get(name) != b.get(name):
            rows.append(f"{name} is {_short(a.get(name))} there and {_short(b.get(name))} here")
    more = f", and {len(rows) - most} more differences" if len(rows) > most else ""
    return "; ".join(rows[:most]) + more


def _flat(tree: Any, name: str = "") -> dict[str, Any]:
    if isinstance(tree, dict):
        parts = [(f"{name}.{key}" if name else str(key), part) for key, part in tree.items()]
    elif isinstance(tree, list) and any(isinstance(part, (dict, list)) for part in tree):
        parts = [(f"{name}[{index}]", part) for index, part in enumerate(tree)]
    else:
        return {name: tree}
    return {key: leaf for at, part in parts for key, leaf in _flat(part, at).items()}


def _short(value: Any) -> str:
    text = "absent" if value is None else json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
