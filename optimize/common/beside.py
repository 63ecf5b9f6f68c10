"""What takes its time to compile, beside what else is compiled: Python traces one program at a
time, and XLA compiles several at once."""

import concurrent.futures
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")


def beside(compute: Callable[[], Found]) -> concurrent.futures.Future[Found]:
    """What `compute()` returns, computed in a thread of its own."""
    pool = concurrent.futures.ThreadPoolExecutor(max_workers=1)
    found = pool.submit(compute)
    pool.shutdown(wait=False)
    return found
