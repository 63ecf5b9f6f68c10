"""The page of a job, and the parts of its sections."""

import importlib
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import report_pages

import fencejax as fj
from fencejax import plot
from optimize.common import flags, html_report, machine, pages
from optimize.common.html_report import Figure, Report, Section, Table, Text, Verbatim

JOBS = (
    "co_design", "concepts", "design", "identify", "pareto", "peak_force", "reproduce_paper",
    "robust_design", "sensitivity", "stability_map", "sweep", "work_precision",
)  # fmt: skip


def page(folder, *parts, **changes):
    fields = dict(title="t", question="q?", answer="a", good=True, sections=[Section("s", parts)])
    return Report(**(fields | changes)).write(folder)


def test_what_is_given_is_text_and_no_markup(tmp_path):
    nasty = "<script>alert('&')</script>"
    path = page(
        tmp_path, nasty, Text(f"- {nasty}"), Table([nasty], [[nasty]], nasty, nasty),
        Verbatim(nasty, nasty), title=nasty, question=nasty, answer=nasty,
    )  # fmt: skip
    reader = report_pages.read(path)
    # Title (twice), question, answer, paragraph, item, four of the table, two of what is verbatim.
    assert sum(found.count(nasty) for found in reader.texts) == 12


def test_figures_are_within_the_page(tmp_path):
    axes = plot.gradient_bars({"peak_force": {"thickness": 1.0}})
    axes.get_figure(root=True).savefig(tmp_path / "bars.png")
    one = Figure.of_axes(axes, "as vectors")
    section = pages.figures(tmp_path, {"bars": "as pixels", "missing": "not drawn"})
    path = page(tmp_path, sections=[Section("s", [one, *section.parts]), Section("empty", [])])
    reader = report_pages.read(path)
    assert reader.pictures == 2
    assert [a[:22] for a in reader.addresses if a.startswith("data")] == [
        "data:image/svg+xml;bas", "data:image/png;base64,",
    ]  # fmt: skip
    assert reader.headings == ["s"]
    # The same figure is the same page, byte by byte.
    assert Figure.of_axes(axes, "as vectors") == one


def test_numbers_are_distinguished_from_words():
    table = Table(["", ""], [["5 kg", ""], ["≤ 80 mm", "a 5"], ["-0.2 m/s^2", "kg^-0.4 m^-3"]])
    assert table.cells == [
        [("5 kg", True), ("", False)],
        [("≤ 80 mm", True), ("a 5", False)],
        [("-0.2 m/s²", True), ("kg^-0.4 m⁻³", False)],
    ]
    # By columns, whatever most of them is.
    mixed = Table([""], [["+0.1"], ["none"], ["> 100 %"]])
    assert [number for ((_, number),) in mixed.cells] == [True] * 3


def test_markdown_of_headings_tables_and_paragraphs():
    head, one = html_report.of_markdown(
        "# A\n\nfirst\nsecond\n\n![x](y.png)\n\n## B\n\n| a | `b` |\n| --- | --- |\n"
        "| **1** | 2 |\n\n| none |\n| --- |\n"
    )[1:]
    assert (head.title, list(head.parts)) == ("A", ["first second"])
    (table,) = one.parts
    assert (one.title, table.titles, table.rows) == ("B", ["a", "b"], [["1", "2"]])


@pytest.mark.parametrize("job", JOBS)
def test_the_command_gives_the_configuration(job, tmp_path):
    inner = "job" if job == "stability_map" else "configuration"
    configure = importlib.import_module(f"optimize.{job}.{inner}").configure
    switch = "--worst-case" if job == "peak_force" else "--quick"
    given = ["--out", str(tmp_path / "a b"), switch, *(["--demo"] if job == "identify" else [])]
    if job == "peak_force":
        given += ["--free", "thickness=20mm:80mm", "--no-plots", "--sort-masses"]
    if job == "design":
        given += ["--set", "belt.speed=2 m/s", "--picture"]
    config = configure(given)
    command = flags.command(config, f"optimize.{job}")
    assert command.startswith(f"python -m optimize.{job} --out ")
    assert configure(shlex.split(command)[3:]) == config


def test_a_sorters_numbers_with_their_units():
    sorter = machine.load("paper").machine
    parts, materials, parcels = pages.machine_tables(sorter)
    rows = {row[0]: tuple(row[1:]) for row in parts.rows}
    assert rows["belt: speed"] == ("2 m/s", "")
    assert rows["fence: thickness"] == ("45 mm", "free, 10 mm ... 90 mm")
    assert rows["fence: length ratio"] == ("", "free, 0 ... 2")
    assert rows["motor: torque"] == ("1000 N m", "at the hinge")
    assert rows["drive: law"] == ("harmonic", "")
    assert materials.rows[0][:2] == ["PA6 dry", "3 GPa"]
    assert len(parcels.rows) == sorter.parcels.count == 6
    spans = pages.parcel_table(sorter.parcels, 3)
    assert ["mass", "10 kg", "15 kg", "20 kg"] in spans.rows


def test_weights_of_parcels_stand_beside_them():
    rows = [{"mass": "2 kg", "weight": 3}, {"mass": "20 kg", "weight": 1}]
    parcels = fj.Sorter(parcels={"list": rows}).machine.parcels
    table = pages.parcel_table(parcels, 3)
    assert table.titles[-1] == "weight"
    assert [row[-1] for row in table.rows] == ["0.75", "0.25"]
    assert ["weight", "0.25", "0.5", "0.75"] in pages.parcel_table(parcels, 1).rows
    alike = fj.Sorter(parcels={"mass": ["2 kg", "20 kg"]}).machine.parcels
    assert "weight" not in pages.parcel_table(alike, 3).titles


@pytest.mark.parametrize(
    ("taper", "said"),
    [
        (fj.Uniform(), "uniform"), (fj.ConstantStrength(), "constant_strength"),
        (fj.SteppedTaper(fj.ConstantStrength(), 4), "constant_strength, in 4 steps"),
    ],
)  # fmt: skip
def test_a_profile_has_the_word_of_a_sorter_file(taper, said, tmp_path):
    dimensions, *_ = pages.fence_parts(tmp_path, fj.Fence(taper=taper), "fence")
    assert ["profile h(x)", said] in dimensions.rows


def test_limits_with_margins():
    limits = (fj.objectives.tip_deflection_limit(0.08), fj.objectives.diverted_limit(0.0))
    measured = {"tip_deflection": np.array([0.04, 0.084]), "crossing": np.array([0.14, 0.07])}
    table = pages.limit_table(limits, {"after": measured})
    assert table.rows[0] == ["tip deflection", "≤ 80 mm", "84 mm", "-0.050"]
    assert table.rows[1] == ["crossing", "≥ 0 m", "70 mm", "+0.100"]


def test_sentences():
    assert pages.sentences("one\n two.\n\n", "why?") == "One.\nTwo.\nWhy?"
    assert (pages.many(1, "impact"), pages.many(3, "impact")) == ("1 impact", "3 impacts")


def test_importing_leaves_the_pages_libraries_alone():
    # They are loaded where a page or a drawing is first written.
    import subprocess
    import sys

    code = (
        "import sys, fencejax, optimize.common.pages; "
        "assert not {'jinja2', 'ezdxf', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_the_template_is_part_of_the_package():
    template = Path(html_report.__file__).with_name("report.html.jinja")
    assert re.search(r"@page\s*{\s*size: A4", template.read_text(encoding="utf-8"))
