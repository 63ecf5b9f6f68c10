"""Atomic writing of files."""

import io
from pathlib import Path
from typing import Any

import numpy as np


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a content, a text in UTF-8, to a temporary file and rename it, so that a full disk or a
    kill leaves the old file unchanged."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def write_figure(path: Path, figure: Any, dpi: int = 150) -> None:
    """Write a figure as a PNG file, whole."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=dpi)
    write_whole(path, stream.getvalue())


def write_arrays(path: Path, **arrays: Any) -> None:
    """Write arrays as a compressed file of NumPy (.npz), whole."""
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write_whole(path, stream.getvalue())
