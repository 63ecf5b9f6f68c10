"""Scripts as programs: exit statuses, and names with numbers in the texts of flags."""

import dataclasses
import re
import types

import pytest

from optimize.common import assignments, command, flags


@dataclasses.dataclass(frozen=True)
class Config:
    count: int = 3

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


def test_a_switch_makes_another_configuration():
    parser = flags.parser(Config, "job", "", {"count": "how many"}, {}, quick="one")
    assert flags.configured(parser, Config, ["--count", "5"]) == Config(5)
    assert flags.configured(parser, Config, ["--count", "5", "--quick"]) == Config(1)


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
