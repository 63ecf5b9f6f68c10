"""The pages' measured figures come from the record, all of them, each with its command."""

import importlib.util
import re
import shlex
import subprocess
import sys

import figures
import headlines
import pytest

PAGES = {page.name: page.read_text() for page in figures.PAGES}
# What the pages may say outside their blocks: what was given, not what was measured.
GIVEN = {"0.13 s"}
MEASURED = re.compile(r"\d[\d.,]*\s?(?:%|ms|us|s|N|m|mm|kg|×|MB|GHz|minutes)(?!\w)")


@pytest.mark.parametrize("page", PAGES)
def test_page_shows_the_record(page):
    assert figures.written(PAGES[page]) == PAGES[page], "run python tests/figures.py --write"


def test_every_block_stands_in_one_page():
    names = [name for text in PAGES.values() for name, _ in figures.BLOCK.findall(text)]
    assert sorted(names) == sorted(figures.blocks()[0])


def test_the_readme_is_read_in_one_sitting():
    assert len(PAGES["README.md"].splitlines()) <= 200


@pytest.mark.parametrize("page", figures.PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    """Every file that a page shows or refers to is there."""
    links = re.findall(r"\]\(([^)#]+)\)", page.read_text())
    assert [link for link in links if not (page.parent / link).exists()] == []


def test_every_figure_is_shown():
    assert figures.blocks()[1] == []


@pytest.mark.parametrize("page", PAGES)
def test_no_measured_number_stands_outside_the_blocks(page):
    rest = re.sub(r"```.*?```", "", figures.BLOCK.sub("", PAGES[page]), flags=re.DOTALL)
    assert {found for found in MEASURED.findall(rest) if found not in GIVEN} == set()


def _exists(command: str) -> bool:
    """Whether what a command runs is there."""
    # Of a package of the tests, which stands in their folder.
    program, *arguments = shlex.split(command.removeprefix("cd tests && "))
    if program == "pytest":
        return not arguments or (figures.ROOT / arguments[0]).exists()
    if arguments[0] == "-m":
        return importlib.util.find_spec(arguments[1]) is not None
    return program == "python" and (figures.ROOT / arguments[0]).exists()


@pytest.mark.parametrize("name", figures.record())
def test_every_group_has_its_command(name):
    commands = figures.record()[name]["command"]
    if not commands.startswith("none: "):
        assert all(_exists(part.removeprefix("errors: ")) for part in commands.split("; "))


def test_a_figure_is_shown_with_format_and_unit():
    figure = figures.Figure(1237.36, "N")
    assert f"{figure:.0f u}, {figure:.1f}, {figure}" == "1237 N, 1237.4, 1,237.36"
    assert f"{figures.Figure([0.02, 0.2], '%'): u}" == "0.02 / 0.2 %"
    assert f"{figures.Figure('1.5 to 2', '1')}" == "1.5 to 2"


def test_a_table_is_shown_with_its_units():
    rows = {
        "time": {"unit": "ms", "values": [0.29, [1, 2], None]},
        "cost": {"unit": "", "values": [33000, "never", 5]},
    }
    table = figures.Group({"columns": ["", "a", "b", "c"], "rows": rows}, set())
    assert f"{table}".splitlines() == [
        "|  | a | b | c |", "| --- | --- | --- | --- |", "| time | 0.29 ms | 1 / 2 ms |  |",
        "| cost | 33,000 | never | 5 |",
    ]  # fmt: skip


def test_a_cell_of_a_table_and_the_sum_of_several():
    rows = {
        "time, in all": {"unit": "ms", "values": ["good", 0.29, 2]},
        "b": {"unit": "ms", "values": ["good", 1.5, 3]},
    }
    table = figures.Group({"columns": ["", "says", "`x`", "y (usual)"], "rows": rows}, set())
    shown = "{t[time, in all, `x`]: u}, {t[time, in all + b, y (usual)]}, {t[b, says]}"
    assert shown.format_map({"t": table}) == "0.29 ms, 5, good"
    with pytest.raises(KeyError):
        table["c, `x`"]


def test_the_record_is_written_as_it_is_read(tmp_path, monkeypatch):
    text, groups = figures.RECORD.read_text(), figures.record()
    monkeypatch.setattr(figures, "RECORD", tmp_path / "figures.json")
    figures.write(groups)
    assert figures.RECORD.read_text() == text


# --- The jobs' figures -----------------------------------------------------------------------


def test_jobs_on_record_have_their_figures():
    for name, job in headlines.RUNS.items():
        assert importlib.util.find_spec(f"optimize.{job.module}")
        known = figures.record().get(name, {"figures": {}})["figures"]
        assert {label: figure.unit for label, figure in job.figures.items()} == {
            label: figure["unit"] for label, figure in known.items() if label in job.figures
        }


def test_a_job_is_told_by_its_processor_time_and_ends_in_time():
    """A quarter of a second of work; asleep for a minute, ended after a tenth of a second."""
    busy = "import time\nwhile time.process_time() < 0.25: pass\nraise SystemExit(3)"
    asleep = "import time; time.sleep(60)"
    status, seconds = headlines.ended(subprocess.Popen([sys.executable, "-c", busy]), 60.0)
    # Python's start is the rest.
    assert status == 3
    assert 0.25 <= seconds < 2.0
    status, seconds = headlines.ended(subprocess.Popen([sys.executable, "-c", asleep]), 0.1)
    assert status == 124
    assert seconds < 2.0


def test_a_figure_off_the_record_is_told():
    known = figures.record()["pareto"]["figures"]
    label, figure = next(iter(headlines.RUNS["pareto"].figures.items()))
    value = known[label]["value"]
    found = {"status": 0, "seconds": 1, label: value * (1 + 0.9 * figure.tolerance)}
    found["numbers in doubt"] = 0
    assert headlines.differences("pareto", found, known) == []
    found[label] = value * (1 + 1.1 * figure.tolerance)
    assert len(headlines.differences("pareto", found, known)) == 1
    assert len(headlines.differences("pareto", {**found, "status": 1}, known)) == 2
    assert len(headlines.differences("pareto", found | {"numbers in doubt": 1}, known)) == 2
    assert len(headlines.differences("pareto", {"status": 0}, known)) == 2
    assert headlines.recorded("pareto", found)["figures"][label]["value"] == found[label]
