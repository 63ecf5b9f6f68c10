"""Runs the notebooks and stores what they show in them.

    python notebooks/execute.py                    # all; needs pip install -e '.[notebooks]'
    python notebooks/execute.py first_impact       # some
    python notebooks/execute.py --check            # says which have changed since they were run

Each keeps a digest of its code cells beside its outputs: outputs belong to the code they stand
under.
"""

import argparse
import hashlib
import json
import sys
import time
from pathlib import Path

FOLDER = Path(__file__).parent
KEY = "outputs_of"


def digest(cells) -> str:
    """What tells the code of a notebook from another's."""
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    return hashlib.sha256("\n\0".join(code).encode()).hexdigest()[:16]


def stale(path: Path) -> str:
    """Why a notebook's outputs are not those of its code; nothing where they are."""
    content = json.loads(path.read_text(encoding="utf-8"))
    found = content["metadata"].get(KEY)
    if found is None:
        return "has not been run"
    return "" if found == digest(content["cells"]) else "has changed since it was run"


def execute(path: Path) -> None:
    """Run a notebook from top to bottom and store its outputs."""
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=None, resources={"metadata": {"path": str(FOLDER)}}).execute()
    for cell in notebook.cells:
        # When and how often a cell ran is no part of what it shows.
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", ()):
            if output.get("name") == "stderr":
                output["text"] = ""
        if cell.cell_type == "code":
            cell.outputs = [o for o in cell.outputs if o.get("text", " ")]
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
        KEY: digest(notebook.cells),
    }
    nbformat.write(notebook, path)


def main(arguments=None) -> int:
    flags = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    flags.add_argument("names", nargs="*", help="notebooks, without their ending; by default all")
    flags.add_argument("--check", action="store_true", help="run nothing, say what has changed")
    given = flags.parse_args(arguments)
    paths = [FOLDER / f"{name}.ipynb" for name in given.names] or sorted(FOLDER.glob("*.ipynb"))
    if given.check:
        found = {path.stem: why for path in paths if (why := stale(path))}
        for name, why in found.items():
            print(f"{name} {why}: python notebooks/execute.py {name}")
        return int(bool(found))
    for path in paths:
        began = time.perf_counter()
        print(f"{path.stem} ...", end=" ", flush=True)
        execute(path)
        print(f"{time.perf_counter() - began:.0f} s, {path.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
