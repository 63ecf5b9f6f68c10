"""The record of searches as the table of `TRUST.md`."""

import json
from pathlib import Path

import figures

# The largest errors that pages show by themselves.
_SHOWN = (
    "realistic, value, `standard`", "realistic, value, `fast`", "realistic, value, `coarse`",
    "normal impact, realistic, gradient, `standard`", "impact, realistic, gradient, `standard`",
    "sorts, realistic, gradient, `standard`", "sorts, realistic, value, `standard`",
    "sorts, realistic, value, `fast`", "sorts, realistic, value, `coarse`",
)  # fmt: skip


def write(record: Path, rungs: tuple[str, ...]) -> None:
    """Write the record of searches into `figures.json` as a table: the largest error found under a
    good status, by kind of scene and by rung."""
    found = json.loads(record.read_text())
    rows, most, judged = {}, {}, 0
    for key, finding in found.items():
        kind, bounds, of, name = key.split(" | ")
        column = f"{of}, `{name}`" if name in rungs else f"{of}, tolerance {name}"
        # Others have the same key, and found less.
        searches = finding, *finding.get("others", ())
        lanes = sum(each["lanes"] * (1 + each["generations"]) for each in searches)
        unsure = "" if finding["sure"] else ", truth unsure"
        error = float(f"{100 * finding['error, found']:.2g}")
        rows.setdefault(f"{kind}, {bounds}", {})[column] = f"{error:g} % of {lanes:,}{unsure}"
        of_which = f"{'sorts, ' if kind.startswith('sort') else ''}{bounds}, {column}"
        for which in (of_which, f"{kind}, {bounds}, {column}"):
            most[which] = max(error, most.get(which, 0.0))
        judged += lanes
    columns = sorted({c for row in rows.values() for c in row}, key=lambda c: ("toler" in c, c))
    command = (
        "cd tests && python -m robustness.search --out robustness/search.json; "
        "cd tests && python -m robustness.search --record"
    )
    known = figures.record()
    known["found by searching"] = figures.table(command, "scenes", rows, columns)
    found_most = {"designs": (judged, "1"), **{name: (most[name], "%") for name in _SHOWN}}
    known["searched"] = figures.group(command, found_most)
    figures.write(known)
