"""`python -m optimize`: the list of jobs."""

import ast
from pathlib import Path

from fencejax.printing import Table


def jobs() -> Table:
    """Every job with the first sentence of its page."""
    pages = sorted(Path(__file__).parent.glob("*/job.py"))
    sources = {page.parent.name: ast.parse(page.read_text()) for page in pages}
    rows = [
        (name, (ast.get_docstring(source) or "").partition("\n")[0])
        for name, source in sources.items()
    ]
    return Table("Jobs: python -m optimize.NAME, with --help for its flags", tuple(rows))


if __name__ == "__main__":
    print(jobs())
