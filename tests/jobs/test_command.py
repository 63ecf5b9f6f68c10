"""Scripts as programs: exit statuses, and names with numbers in the texts of flags."""

import dataclasses
import importlib
import re
import types

import pytest

from optimize.common import assignments, command, flags


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


def test_what_is_refused_is_said_and_the_rest_raised():
    def failing(error):
        def main(config):
            raise error

        return main

    assert left(failing(ValueError("no"))) == "job: no"
    assert left(failing(OSError("none")), refused=(OSError,)) == "job: none"
    assert left(failing(KeyboardInterrupt()), stopped="stopped") == "job: stopped"
    for error in (OSError, KeyboardInterrupt):
        with pytest.raises(error):
            command.run("job", Config, failing(error()), tune=False)


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


def as_flags(name, value):
    flag = name.replace("_", "-")
    if isinstance(value, bool):
        return [f"--{flag}" if value else f"--no-{flag}"]
    values = value if isinstance(value, tuple) else (value,)
    return [f"--{flag}", *map(str, values)]


@pytest.mark.parametrize(
    ("job", "switch"),
    [
        ("co_design", "quick"), ("identify", "quick"), ("pareto", "quick"),
        ("peak_force", "worst_case"), ("reproduce_paper", "quick"), ("robust_design", "quick"),
        ("sensitivity", "quick"), ("stability_map", "quick"), ("sweep", "quick"),
        ("work_precision", "quick"),
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
    said = [text for name in changed for text in as_flags(name, getattr(plain, name))]
    assert configure([*needed, f"--{switch.replace('_', '-')}", *said]) == plain


def test_names_with_numbers():
    assert assignments.value("fixed", "mass=2", "") == ("mass", 2.0)
    assert assignments.values("known", "mass=2, distance=0.9", "") == {"mass": 2, "distance": 0.9}
    assert assignments.span("vary", "mass=1:30", "") == ("mass", 1, 30, [])
    assert assignments.span("vary", "mass=1:30:7:linear", "")[3] == ["7", "linear"]


@pytest.mark.parametrize(
    ("read", "text"),
    [
        (assignments.value, "mass"),
        (assignments.value, "mass=heavy"),
        (assignments.values, "mass=2,"),
        (assignments.span, "mass=1"),
        (assignments.span, "mass=1:b"),
    ],
)
def test_texts_that_cannot_be_read(read, text):
    said = re.escape(f"Argument `field` must be so, but holds {text!r}.")
    with pytest.raises(ValueError, match=said):
        read("field", text, "be so")
