"""Text of files that other programs have saved."""

from pathlib import Path


def refuse_folder(path: Path) -> None:
    """Raise `OSError` where a folder is named in place of a file to read."""
    if path.is_dir():
        raise IsADirectoryError(f"{path} must be a file, but is a folder. Name a file in it.")


def of(path: Path) -> str:
    """A file's text: UTF-8, UTF-16 or, as spreadsheets save it, the Windows encoding of western
    Europe.

    Raises `OSError` where there is no such file, or a folder, and `ValueError` that names it where
    it is no text.
    """
    refuse_folder(path)
    data = path.read_bytes()
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding == "utf-8-sig" and 0 not in data:
            try:
                return data.decode("cp1252")
            except UnicodeDecodeError:
                pass
        raise ValueError(
            f"{path}: must be text in UTF-8, but byte {error.start} is not. Save it as CSV."
        ) from error
