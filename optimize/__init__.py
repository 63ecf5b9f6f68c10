"""The jobs, each `python -m optimize.NAME`."""

import sys

# Only where one of them is run, and before its long imports: then the first argument is still "-m".
if sys.argv[:1] == ["-m"]:
    from .common import interrupts

    interrupts.watch()

    from .common import flags

    flags.answer(sys.orig_argv)
