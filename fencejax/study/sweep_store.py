"""A sweep's dataset on the disk: a Zarr store. Chunks that are incomplete or of another job are
computed again."""

import contextlib
import hashlib
import importlib
import json
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray

FILE = "sweep.zarr"
"""Name of the Zarr store with the whole sweep, in its folder."""

# A chunk's record: the digest of its job, its number, the digest of its numbers.
_RECORD = "record"
_BYTES = 32 + 8 + 32


def sweep_library(name: str) -> Any:
    """One of the libraries that sweeps in a folder need.

    Raises `ImportError` where it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise ImportError(
            f"A sweep kept in a folder needs xarray, zarr and dask, but {error.name} is not "
            "installed. Write pip install -e '.[sweep]'; a sweep by jax.vmap needs none of them."
        ) from error


def digest(configuration: Mapping[str, Any]) -> str:
    """SHA-256 of a configuration of plain numbers, names, lists and dictionaries."""
    text = json.dumps(configuration, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


class Store:
    """The lanes of one sweep in a folder, in chunks 0 ... K - 1.

    Each chunk carries a record of 72 bytes: the digest of its job (32), its number (8, big-endian)
    and the SHA-256 of its numbers (32). A chunk counts only if it has a matching record: one left
    incomplete by a kill, a full disk or another program is computed again. No lock is needed, as
    every process that computes a chunk of the same job writes the same numbers.
    """

    def __init__(self, path: Path, empty: "xarray.Dataset", chunk: int):
        """**Arguments:**

        - `path`: of the Zarr store; created with its folder where it is missing.
        - `empty`: from `sweep_table.lanes`, with lazy data, whose values are never computed.
        - `chunk`: lanes in a chunk.

        Raises `ValueError` where the folder has another sweep, naming the differences, or something
        else, and `OSError` where it cannot be read or written.
        """
        self.path, self.chunk = path, chunk
        self.count = empty.sizes["lane"]
        self.chunks = -(-self.count // chunk)
        self.columns: dict[str, np.dtype] = {
            name: empty[name].dtype for name in sorted(map(str, empty.data_vars))
        }
        self._job = bytes.fromhex(empty.attrs["job"])
        with _with_remedy(f"Folder {path.parent} must take a sweep, but it cannot be written"):
            path.parent.mkdir(parents=True, exist_ok=True)
            if not self.path.exists():
                self._claim(empty)
        self._group = _opened(self.path)
        # Read back, as another process may have created it.
        there = self._group.attrs
        if there["job"] != empty.attrs["job"]:
            old, new = (json.loads(str(a["configuration"])) for a in (there, empty.attrs))
            raise ValueError(
                f"Folder {path.parent} must be empty or hold the same sweep, but it holds another "
                f"one: {_differences(old, new)}. Choose another folder, or delete this one."
            )
        try:
            shapes = {self._group[name].shape for name in self.columns}
        except Exception as error:
            raise _unreadable(path, error) from error
        if shapes != {(self.count,)}:
            raise _unreadable(path, f"its columns have the shapes {shapes}")
        self._records = _records(self._group, self.chunks)

    def _claim(self, empty: "xarray.Dataset") -> None:
        """Create the store without its chunks.

        It is written under another name and then renamed, which fails where a store exists: one of
        several processes creates it, and none ever sees an incomplete one.
        """
        array = sweep_library("dask.array")
        records = array.zeros((self.chunks, _BYTES), dtype=np.uint8, chunks=(1, _BYTES))
        whole = empty.assign({_RECORD: (("chunk", "byte"), records)})
        # All bits are stored as they are: no number stands for a missing one.
        encoding: dict[str, dict[str, Any]] = {str(n): {"_FillValue": None} for n in whole}
        for name in empty.coords:
            encoding[str(name)] = {"_FillValue": None, "chunks": (self.count,)}
        part = self.path.with_name(f".{FILE}.{uuid.uuid4().hex}")
        try:
            whole.to_zarr(
                part, mode="w", compute=False, consolidated=False, zarr_format=3, encoding=encoding
            )
            try:
                part.rename(self.path)
            except OSError:
                if not self.path.exists():
                    raise
        finally:
            shutil.rmtree(part, ignore_errors=True)

    def _lanes(self, number: int) -> slice:
        return slice(number * self.chunk, min(self.count, (number + 1) * self.chunk))

    def write(self, number: int, arrays: Mapping[str, np.ndarray]) -> None:
        """Write a chunk: all of its columns, each of shape (lanes,).

        Raises `OSError` where it cannot be written.
        """
        xarray = sweep_library("xarray")
        kept = {name: np.asarray(arrays[name], dtype) for name, dtype in self.columns.items()}
        record = np.frombuffer(self._record(number, kept), np.uint8)
        data = {name: ("lane", column) for name, column in kept.items()}
        part = xarray.Dataset(data | {_RECORD: (("chunk", "byte"), record[None])})
        region = {"lane": self._lanes(number), "chunk": slice(number, number + 1)}
        with _with_remedy(f"Chunk {number} of the sweep cannot be written into {self.path}"):
            part.to_zarr(self.path, region=region, consolidated=False, zarr_format=3)
        self._records[number] = record

    def _record(self, number: int, arrays: Mapping[str, np.ndarray]) -> bytes:
        found = hashlib.sha256()
        for name in self.columns:
            column = np.ascontiguousarray(arrays[name])
            found.update(f"{name} {column.dtype.str} {column.shape} ".encode() + column.tobytes())
        return self._job + number.to_bytes(8, "big") + found.digest()

    def read(self, number: int) -> dict[str, np.ndarray] | None:
        """A chunk's columns; `None` where it is missing, incomplete or of another job."""
        record = self._records[number].tobytes()
        if not any(record):
            return None
        lanes = self._lanes(number)
        try:
            arrays = {name: np.asarray(self._group[name][lanes]) for name in self.columns}
        except Exception:
            # A decoder may raise any error for a damaged file.
            return None
        return arrays if self._record(number, arrays) == record else None


def load(folder: Path | str) -> "xarray.Dataset":
    """The dataset of a sweep's folder, in memory, every chunk checked.

    Raises `ValueError` where there is none, or where chunks are missing or damaged.
    """
    path = Path(folder) / FILE if (Path(folder) / FILE).exists() else Path(folder)
    xarray = sweep_library("xarray")
    _opened(path)
    try:
        there = xarray.open_zarr(path, chunks=None, consolidated=False, decode_cf=True)
        configuration = json.loads(there.attrs["configuration"])
        lanes = there.drop_vars(_RECORD)
        names = lanes.attrs["variables"]
        points = np.stack([lanes[name].to_numpy() for name in names], axis=1)
        store = Store(path, lanes, int(configuration["chunk"]))
        known = configuration["samples"]["values"]
    except Exception as error:
        raise _unreadable(path, error) from error
    if hashlib.sha256(points.tobytes()).hexdigest() != known:
        raise _unreadable(path, "its points are not those of its configuration")
    found = [store.read(number) for number in range(store.chunks)]
    parts = [part for part in found if part is not None]
    if len(parts) < len(found):
        raise ValueError(
            f"Folder {folder} must hold a whole sweep, but {len(found) - len(parts)} of its "
            f"{len(found)} chunks are missing or damaged. Run the same sweep again: what is "
            "missing is then computed."
        )
    whole = {n: np.concatenate([part[n] for part in parts]) for n in store.columns}
    return lanes.load().assign({n: lanes[n].copy(data=column) for n, column in whole.items()})


def _opened(path: Path) -> Any:
    """The Zarr group of a sweep's store."""
    zarr = sweep_library("zarr")
    try:
        group = zarr.open_group(path, mode="r")
        missing = {"job", "configuration"} - set(group.attrs)
        if missing or _RECORD not in group:
            raise ValueError("it is no sweep's")
        return group
    except Exception as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, reason: Any) -> ValueError:
    text = " ".join(str(reason).split())
    return ValueError(
        f"Folder {path} must be the Zarr store of a sweep, but it cannot be read ({text}). Choose "
        "another folder, or delete it."
    )


def _records(group: Any, chunks: int) -> np.ndarray:
    """The readable records, zeros for the others, (K, 72)."""
    try:
        return np.array(group[_RECORD][:])
    except Exception:
        found = np.zeros((chunks, _BYTES), np.uint8)
        for number in range(chunks):
            with contextlib.suppress(Exception):
                found[number] = group[_RECORD][number]
        return found


@contextlib.contextmanager
def _with_remedy(what: str) -> Iterator[None]:
    """Raise an `OSError` of the system again, with a remedy."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise OSError(
            f"{what} ({reason}). What was computed is kept: make room or choose another folder, "
            "and run the same sweep again."
        ) from error


def _differences(old: Any, new: Any, most: int = 4) -> str:
    """The differing entries of two configurations, as text."""
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
