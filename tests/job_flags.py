"""The text of each job's `--help`, without the job's imports.

    python tests/job_flags.py --write   # writes optimize/NAME/flags.json anew

The files are what `optimize.common.flags.described` makes of the jobs' configurations.
"""

import importlib
import json
import sys
from pathlib import Path

from optimize.common import flags

JOBS = Path(flags.__file__).parents[1]


def described() -> dict[Path, str]:
    """The text of each job's file."""
    found = {}
    for main in sorted(JOBS.glob("*/__main__.py")):
        job = importlib.import_module(f"optimize.{main.parent.name}.job")
        text = json.dumps(job.configure.described(), indent=1)
        found[main.parent / flags.DESCRIPTION] = text + "\n"
    return found


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        for file, text in described().items():
            file.write_text(text)
    else:
        print(__doc__)
