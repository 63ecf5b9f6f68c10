"""Atomic writing of files."""

from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Write a text to a temporary file and rename it, so that a full disk or a kill leaves the old
    file unchanged."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
