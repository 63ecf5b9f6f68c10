"""The race's page: its table and its figure."""

import os

import numpy as np

from fencejax.plot import style
from peers import race

ROUNDS = 15


def _three(number):
    """Three significant digits, without an exponent."""
    return f"{number:,.0f}" if number >= 100 else f"{number:.3g}"


def _milliseconds(row):
    low, high = _three(row["10 % [ms]"]), _three(row["90 % [ms]"])
    return f"{_three(row['median [ms]'])} ({low}–{high})"


def table(classes, impact, agreed):
    """race.md."""
    lines = [
        "# The smallest fair race",
        "",
        f"Peak {race.PEAK:.4f} N at {1e3 * race.PEAK_TIME:.3f} ms; gradient in h₁, E, ρ, β, l_p. "
        f"Times: median (10 %–90 %) of {ROUNDS} interleaved rounds on {os.cpu_count()} cores.",
        "",
        "Each code runs at the cheapest settings that meet the class; how each was tuned is in the "
        "docstrings of `tests/peers/`. Rows named *plain* are a code as its manual has one write "
        "it; *8 modes* gives a code the modal truncation that is fencejax's own idea; the others "
        "solve the full finite-element system in the form that suits them best. "
        "`pytest tests/peers/test_peers.py --bench DIR` makes this page again as `DIR/race.md`.",
    ]
    for found in classes:
        lines += [
            "",
            f"## At {found['accuracy']}",
            "",
            "| code | version | value [ms] | × | gradient [ms] | × | error of peak | "
            "errors of elasticities in h₁, E, ρ, β, l_p |",
            "| --- | --- | --- | --- | --- | --- | --- | --- |",
        ]
        for row in found["rows"]:
            errors = ", ".join(f"{e:.1e}" for e in row["errors of the elasticities"].values())
            lines.append(
                f"| {row['code']} | {row['version']} "
                f"| {_milliseconds(row['value'])} | {row['value']['ratio to fencejax']:.1f} "
                f"| {_milliseconds(row['gradient'])} | {row['gradient']['ratio to fencejax']:.1f} "
                f"| {row['error of the peak']:.1e} | {errors} |"
            )
        lines += [f"| {name} | absent | | | | | | |" for name in found["absent"]]
    lines += [
        "",
        "## The full oblique impact at 1 %",
        "",
        "| code | time [ms] | × | error of peak |",
        "| --- | --- | --- | --- |",
    ]
    for row in impact:
        lines.append(
            f"| {row['code']} | {_milliseconds(row)} | {row['ratio to fencejax']:.1f} "
            f"| {row['error of the peak']:.1e} |"
        )
    lines += ["", "## Agreement", ""]
    lines += [f"- {line}" for line in agreed]
    return "\n".join(lines) + "\n"


def picture(classes, path):
    """race.png: a bar for each code, value and gradient, one panel for each accuracy."""
    from matplotlib.figure import Figure

    most = [len(found["rows"]) for found in classes]
    figure = Figure(figsize=(8, 0.55 * sum(most) + 2.2), layout="constrained")
    panels = figure.subplots(len(classes), 1, height_ratios=most, sharex=True, squeeze=False)
    for axes, found in zip(panels[:, 0], classes, strict=True):
        rows = found["rows"][::-1]
        place = np.arange(len(rows))
        for kind, shift, color in (("value", 0.2, style.BLUE), ("gradient", -0.2, style.RED)):
            times = [row[kind] for row in rows]
            middle = np.array([t["median [ms]"] for t in times])
            low = middle - [t["10 % [ms]"] for t in times]
            high = np.array([t["90 % [ms]"] for t in times])
            label = "value" if kind == "value" else "value and gradient in 5 variables"
            axes.barh(place + shift, middle, 0.38, color=color, label=label)
            reach = [low, high - middle]
            axes.errorbar(
                middle, place + shift, xerr=reach, fmt="none", ecolor=style.INK, capsize=2
            )
            for y, t, end in zip(place + shift, middle, high, strict=True):
                axes.annotate(
                    _three(t), (max(t, end), y), va="center", fontsize=7, xytext=(4, 0),
                    textcoords="offset points",
                )
        axes.set_yticks(place, [row["code"] for row in rows])
        axes.set_xscale("log")
        axes.set_title(f"at {found['accuracy']}", fontsize=10)
        axes.grid(axis="x", alpha=0.3)
        axes.margins(x=0.15)
    panels[0, 0].legend(fontsize=8)
    panels[-1, 0].set_xlabel("time of one run [ms]")
    figure.savefig(path, dpi=150)
