"""Files that are whole, or as they were."""

from pathlib import Path


def write_whole(path: Path, text: str) -> None:
    """Write a text beside its place and rename it, so that a full disk or a kill leaves what was
    there before."""
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
