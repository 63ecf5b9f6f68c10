"""Scripts as programs: exit statuses, and names with numbers in the texts of flags."""

import dataclasses
import errno
import importlib
import os
import re
import signal
import subprocess
import sys
import time
import types
from pathlib import Path

import job_flags
import numpy as np
import pytest

import fencejax as fj
from fencejax import plot
from optimize.common import assignments, command, flags, machine
from optimize.common.files import write_arrays
from optimize.common.report import save, write_json


@dataclasses.dataclass(frozen=True)
class Config:
    count: int = flags.field(3, "how many [kg]", least=1)
    share: float = flags.field(0.5, "which part", between=(0, 1))
    sizes: tuple[float, ...] = flags.field((1.0, 2.0), "how large [m]", above=0)
    kind: str = flags.field("a", "which", choices=("a", "b"))

    def __post_init__(self):
        flags.check(self)

    def quick(self):
        return dataclasses.replace(self, count=1)


def left(main, **settings):
    """What a program leaves Python with."""
    with pytest.raises(SystemExit) as leaving:
        command.run("job", Config, main, tune=False, **settings)
    return leaving.value.code


@pytest.mark.parametrize(("good", "status"), [(True, 0), (False, 1)])
def test_status_says_whether_it_succeeded(good, status):
    assert left(lambda config: types.SimpleNamespace(succeeded=good)) == status
    assert left(lambda config: good, succeeded=bool) == status


def failing(error):
    def main(config):
        raise error

    return main


def test_refusals_are_printed_and_other_errors_raised():
    assert left(failing(ValueError("no"))) == "job: no"
    assert left(failing(KeyError("none")), refused=(KeyError,)) == "job: 'none'"
    with pytest.raises(KeyError):
        command.run("job", Config, failing(KeyError("none")), tune=False)


def test_errors_of_the_system_are_printed_with_a_remedy(tmp_path):
    def write(place):
        return lambda config: place.mkdir(parents=True)

    (tmp_path / "file").write_text("")
    message = left(write(tmp_path / "file"))
    assert message == f"job: {tmp_path}/file: File exists. Name another folder: this is a file."
    message = left(write(tmp_path / "file" / "out"))
    assert message.endswith("Not a directory. Name another folder: there is a file in the way.")
    message = left(write(tmp_path / ("x" * 300)))
    assert message.endswith("File name too long. Write a shorter name.")
    (tmp_path / "result.json").mkdir()
    message = left(lambda config: write_json(tmp_path / "result.json", {}))
    assert message == (
        f"job: {tmp_path}/result.json: Is a directory. Name another folder: this one holds a "
        "folder where a file is to be."
    )
    full = OSError(errno.ENOSPC, "No space left on device", tmp_path / "history.json")
    assert left(failing(full)).endswith(
        "history.json: No space left on device. Make room, and run the same command again."
    )
    assert left(failing(OSError("Make room."))) == "job: Make room."
    message = left(failing(MemoryError("8 PiB")))
    assert message == "job: there is not enough memory (8 PiB). Ask for less."


def draw(path, size):
    axes = plot.prepared(None)
    axes.bar([1], [size])
    save(axes, path)


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("result.json", lambda path, size: write_json(path, {"peak_force": size})),
        ("force.png", draw),
        ("samples.npz", lambda path, size: write_arrays(path, peak_force=np.array(size))),
    ],
)
def test_a_full_disk_leaves_what_was_written_before(name, write, there, tmp_path, monkeypatch):
    """The disk takes half of the file."""
    path, real, before = tmp_path / name, Path.write_bytes, b""

    def half(self, data):
        real(self, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    if there:
        write(path, 1.0)
        before = path.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", half)
        with pytest.raises(OSError, match="No space left"):
            write(path, 2.0)
    assert [each.name for each in tmp_path.iterdir()] == ([name] if there else [])
    assert not there or path.read_bytes() == before


@pytest.mark.parametrize("read", [machine.load, fj.study.read_recording])
def test_a_folder_that_is_to_be_read_is_refused_in_one_line(read, tmp_path):
    message = left(lambda config: read(str(tmp_path)))
    assert message == f"job: {tmp_path} must be a file, but is a folder. Name a file in it."


# ---- flags


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--cuont", "3"], "there is no flag --cuont. Did you mean --count?"),
        (["--shape=2"], "there is no flag --shape. Did you mean --share?"),
        (["--nothing-like-it"], "there is no flag --nothing-like-it."),
        (["stray"], "stray belongs to no flag."),
        (["--count", "many"], "argument --count: invalid int value: 'many'."),
        (["--kind", "c"], "argument --kind: invalid choice: 'c' (choose from"),
    ],
)
def test_a_wrong_flag_is_reported_in_one_line(arguments, message, capsys):
    with pytest.raises(SystemExit) as leaving:
        flags.reader(Config, "optimize.job", "A job.")(arguments)
    assert leaving.value.code == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith(f"python -m optimize.job: {message}")
    assert printed.err.count("\n") == 1


# ---- interrupts

RUNNING = """
import sys
from optimize.common import interrupts
interrupts.watch()
import jax
from optimize.common import command

def main(config):
    print("running", flush=True)
    try:
        {work}
    except KeyboardInterrupt:
        pass
    return True

command.run("job", lambda: None, main, succeeded=bool, stopped=command.RESUMED)
"""
# Within XLA, where Python's own interrupt does not get to, and where it is swallowed.
ENDLESS = "jax.jit(lambda x: jax.lax.while_loop(lambda y: y < 2, jax.numpy.sin, x))(1.0).item()"
SWALLOWED = """
        while True:
            try:
                import time; time.sleep(0.01)
            except BaseException:
                pass
"""
# A job that is done: what is to be done at the end is done, and then Python is left at once.
ENDING = """
        import atexit, time
        class Lasting:
            def __del__(self):
                time.sleep(60)
        sys.lasting = Lasting()
        atexit.register(lambda: (print("ending", flush=True), {last}))
"""
STAGES = {
    "importing": (
        ["-X", "importtime", "-m", "optimize.sweep"], "optimize.common.interrupts", "sweep: stopped"
    ),
    "compiling": (
        ["-m", "optimize.sweep", "--points", "2", "--no-plots"], "compiling",
        f"sweep: {command.RESUMED}",
    ),
    "computing": (["-c", RUNNING.format(work=ENDLESS)], "running", f"job: {command.RESUMED}"),
    "swallowing": (["-c", RUNNING.format(work=SWALLOWED)], "running", f"job: {command.RESUMED}"),
    "ending": (
        ["-c", RUNNING.format(work=ENDING.format(last="time.sleep(60)"))], "ending",
        f"job: {command.RESUMED}",
    ),
}  # fmt: skip


@pytest.mark.parametrize("stage", STAGES)
def test_an_interrupt_ends_a_job_with_one_line(stage, tmp_path):
    arguments, awaited, line = STAGES[stage]
    process = subprocess.Popen(
        [sys.executable, *arguments], cwd=tmp_path, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert process.stdout is not None
    lines = []
    for line_now in process.stdout:
        lines.append(line_now.rstrip())
        if awaited in line_now:
            break
    # Into what comes behind that line.
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    try:
        rest, _ = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, "\n".join(lines) + rest
    after = [row for row in rest.splitlines() if not row.startswith("import time:")]
    assert after == [line]


def test_a_job_that_is_done_leaves_at_once(tmp_path):
    """Python's shutdown, which handles no signal, is skipped; registered functions are called."""
    done = subprocess.run(
        [sys.executable, "-c", RUNNING.format(work=ENDING.format(last=None))], cwd=tmp_path,
        text=True, capture_output=True, check=False, timeout=50,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "running\nending\n", "")


def test_an_interrupt_in_this_process_ends_it_too(capsys):
    assert left(failing(KeyboardInterrupt()), stopped="stopped here") == 130
    assert capsys.readouterr().err == "job: stopped here\n"


def test_importing_the_jobs_changes_no_signals():
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_switch_changes_what_no_flag_says():
    configure = flags.reader(Config, "job", "", quick="one")
    assert configure(["--count", "5"]) == Config(5)
    assert configure(["--quick"]) == Config(1)
    assert configure(["--quick", "--count", "5"]) == Config(5)
    # Not even where it says the default.
    assert configure(["--quick", "--count", "3", "--sizes", "4"]) == Config(3, sizes=(4.0,))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (["--count", "0"], "`count` must be at least 1 [kg], but is 0"),
        (["--share", "1"], "`share` must be within 0 and 1 [1], but is 1"),
        (["--sizes", "2", "-1"], "`sizes` must be above 0 [m], but is -1"),
    ],
)
def test_what_a_field_asks_is_checked(given, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        flags.reader(Config, "job", "")(given)
    with pytest.raises(ValueError, match="`kind` must be one of"):
        Config(kind="c")


@pytest.mark.parametrize(
    ("job", "flag"),
    [
        ("identify", "starts"), ("pareto", "points"), ("peak_force", "budget"),
        ("robust_design", "sample"), ("robust_design", "fresh"), ("sensitivity", "gradients"),
        ("sweep", "points"), ("sweep", "group"), ("sweep", "chunk"),
    ],
)  # fmt: skip
def test_absurd_counts_are_refused_at_once(job, flag):
    """A table with a row for each would fill any machine's memory."""
    inner = importlib.import_module(f"optimize.{job}.configuration")
    with pytest.raises(ValueError, match=f"`{flag}` must be at most .* has the memory") as refused:
        inner.configure([f"--{flag}", str(10**15), *(["--demo"] if job == "identify" else [])])
    assert "\n" not in str(refused.value)


def as_flags(name, value):
    flag = name.replace("_", "-")
    if isinstance(value, bool):
        return [f"--{flag}" if value else f"--no-{flag}"]
    values = value if isinstance(value, tuple) else (value,)
    return [f"--{flag}", *map(str, values)]


@pytest.mark.parametrize(
    ("job", "switch"),
    [
        ("co_design", "quick"), ("concepts", "quick"), ("design", "quick"), ("identify", "quick"),
        ("pareto", "quick"), ("peak_force", "worst_case"), ("peak_force", "quick"),
        ("reproduce_paper", "quick"), ("robust_design", "quick"), ("sensitivity", "quick"),
        ("stability_map", "quick"), ("sweep", "quick"), ("work_precision", "quick"),
    ],
)  # fmt: skip
def test_flags_of_every_job_win_over_its_switch(job, switch):
    inner = "job" if job == "stability_map" else "configuration"
    configure = importlib.import_module(f"optimize.{job}.{inner}").configure
    needed = ["--demo"] if job == "identify" else []
    plain = configure(needed)
    small = configure([*needed, f"--{switch.replace('_', '-')}"])
    assert small == getattr(plain, switch)()
    changed = [f for f, value in vars(plain).items() if getattr(small, f) != value]
    assert len(changed) > 1
    words = [text for name in changed for text in as_flags(name, getattr(plain, name))]
    assert configure([*needed, f"--{switch.replace('_', '-')}", *words]) == plain


def test_names_with_numbers():
    assert assignments.values("noise", "mass=2, distance=0.9", "") == {"mass": 2, "distance": 0.9}
    assert assignments.span("vary", "mass=1:30", "") == ("mass", 1, 30, [])
    assert assignments.span("vary", "mass=1:30:7:linear", "")[3] == ["7", "linear"]
    assert assignments.span("vary", "thickness=20mm:0.06", "") == ("thickness", 0.02, 0.06, [])


@pytest.mark.parametrize(
    ("read", "text"),
    [
        (assignments.values, "mass"),
        (assignments.values, "mass=heavy"),
        (assignments.values, "mass=2,"),
        (assignments.span, "mass=1"),
        (assignments.span, "mass=1:b"),
        (assignments.span, "mass=1mm:2mm"),
    ],
)
def test_texts_that_cannot_be_read(read, text):
    message = re.escape(f"Argument `field` must be so, but holds {text!r}.")
    with pytest.raises(ValueError, match=message):
        read("field", text, "be so")


@pytest.mark.parametrize(
    ("job", "flag"), [("robust_design", "--mass"), ("reproduce_paper", "--masses")]
)
def test_help_names_both_ends_of_a_span(job, flag, capsys):
    with pytest.raises(SystemExit):
        importlib.import_module(f"optimize.{job}.configuration").configure(["--help"])
    assert f" {flag} FROM TO " in capsys.readouterr().out


def test_help_on_file_is_what_the_jobs_say():
    known = {file: file.read_text() for file in job_flags.JOBS.glob(f"*/{flags.DESCRIPTION}")}
    assert known == job_flags.described(), "python tests/job_flags.py --write"


def test_help_needs_no_long_imports():
    command = [sys.executable, "-X", "importtime", "-m", "optimize.design", "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("usage: python -m optimize.design [-h] [--out OUT]")
    lines = done.stderr.splitlines()
    imported = {line.rpartition("|")[2].strip().partition(".")[0] for line in lines}
    assert "argparse" in imported
    assert not {"jax", "numpy", "fencejax"} & imported
