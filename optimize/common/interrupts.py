"""Ctrl-C ends a job at once, with one line and status 130.

Python raises `KeyboardInterrupt` in the main thread between two of its own instructions: not while
XLA compiles, and one raised within a callback from C++ is lost. Therefore a thread waits for the
signal and ends the process, as a kill would: journals and stores survive that, so that no cleaning
up is needed. A finished job ends its process in the same way, as Python's own shutdown takes a
second or two in which it handles no signal.
"""

import atexit
import contextlib
import os
import signal
import socket
import sys
import threading
from typing import NoReturn

STATUS = 130
"""The exit status of an interrupted program: 128 + SIGINT."""

_line = "stopped"
_watching = False


def say(line: str) -> None:
    """Set the line that is printed when an interrupt ends the process."""
    global _line
    _line = line


def leave() -> None:
    """Print the line, and end the process."""
    os.write(2, f"{_line}\n".encode())
    os._exit(STATUS)


def end(leaving: SystemExit) -> NoReturn:
    """End a watched process as `leaving` would, at once; others by raising it."""
    if not _watching:
        raise leaving
    code = leaving.code
    if isinstance(code, str):
        print(code, file=sys.stderr)
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        # A pipe that nobody reads any more.
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(int(isinstance(code, str)) if not isinstance(code, int) else code)


def watch() -> None:
    """Let an interrupt end this process from now on. Where interrupts are ignored, as in the
    background, or handled already, nothing changes."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        return
    name = next((a.rpartition("optimize.")[2] for a in sys.orig_argv if "optimize." in a), "job")
    say(f"{name}: stopped")
    heard, written = socket.socketpair()
    written.setblocking(False)
    signal.set_wakeup_fd(written.fileno(), warn_on_full_buffer=False)
    signal.signal(signal.SIGINT, lambda number, frame: None)
    global _watching
    _watching = True

    def wait() -> None:
        # `written` is kept open by being named here.
        while heard.recv(1) != bytes([signal.SIGINT]) and written:
            pass
        leave()

    threading.Thread(target=wait, name="interrupts", daemon=True).start()
