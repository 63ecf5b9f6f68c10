"""Ctrl-C ends a job at once, with one line and status 130, whatever it is doing.

Python raises `KeyboardInterrupt` in the main thread between two of its own instructions: while XLA
compiles nothing happens, and one that is raised within a callback from C++ is lost. Here a thread
waits for the signal instead and ends the process, as a kill would: journals and stores survive
that, so nothing has to be put in order first. A job that is done ends its process in the same way:
Python would take its modules apart first, for a second or two in which it hears no signal.
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
"""What a program leaves with that an interrupt has ended: 128 + SIGINT."""

_line = "stopped"
_watching = False


def say(line: str) -> None:
    """What is said where an interrupt ends the process from here on."""
    global _line
    _line = line


def leave() -> None:
    """Say it, and end the process."""
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
    """From here on an interrupt ends this process. Where interrupts are ignored, as in the
    background, or handled already, nothing is changed."""
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
