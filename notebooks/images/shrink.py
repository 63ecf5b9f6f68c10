"""Store the README's pictures with 128 colours each, which is a third of their size.

    python notebooks/images/shrink.py     # every *.png beside this file, in place
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

COLOURS = 128


def shrink(path: Path) -> None:
    """Replace a picture by its version of few colours, where that is smaller."""
    with Image.open(path) as image:
        if image.mode == "P":
            return
        few = image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        dots = image.info.get("dpi", (150, 150))
    small = path.with_suffix(".small")
    few.save(small, "PNG", optimize=True, dpi=dots)
    if small.stat().st_size < path.stat().st_size:
        small.replace(path)
    else:
        small.unlink()


if __name__ == "__main__":
    for path in sorted(Path(__file__).parent.glob("*.png")):
        before = path.stat().st_size
        shrink(path)
        print(f"{path.name}: {before / 1e3:.0f} kB to {path.stat().st_size / 1e3:.0f} kB")
