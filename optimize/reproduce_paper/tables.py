"""The printed tables: the statements, and their dependence on open numbers."""

import textwrap
from collections.abc import Sequence

from .open_numbers import Variant
from .statements import Finding

_WIDTH = 100
CHOSEN = (
    "The paper gives neither E nor R_s. E = 3.0 GPa and R_s = 1.08 m are chosen so that the drop\n"
    "of the force and the deflection of the tip agree: these two rows are no proof of the model."
)
"""The part of the agreement that is due to a choice."""


def statement_table(findings: Sequence[Finding]) -> str:
    """*Paper says / we get / agrees?*, with an explanation below each that is not a plain yes."""
    says, found = 50, 42
    rule = "-" * _WIDTH
    lines = [f"{'the paper says':<{says}}{'we get (two-link / one-link)':<{found}}agrees?", rule]
    for finding in findings:
        left = textwrap.wrap(finding.says, says - 2)
        right = textwrap.wrap(finding.found, found - 2)
        for row in range(max(len(left), len(right))):
            cells = [part[row] if row < len(part) else "" for part in (left, right)]
            last = finding.verdict if row == 0 else ""
            lines.append(f"{cells[0]:<{says}}{cells[1]:<{found}}{last}".rstrip())
        if finding.verdict != "yes":
            why = textwrap.wrap("why: " + finding.remark, _WIDTH - 6)
            lines += [f"    {row}" for row in why]
    return "\n".join(lines)


def changes(base: Sequence[Finding], other: Sequence[Finding]) -> dict[str, tuple[str, str]]:
    """Verdicts, before and after, of the statements by key whose verdict differs."""
    return {
        before.key: (before.verdict, after.verdict)
        for before, after in zip(base, other, strict=True)
        if before.verdict != after.verdict
    }


def _number(finding: Finding) -> str:
    size = abs(finding.main)
    digits = 0 if size >= 20 else 1 if size >= 4 else 2
    return f"{finding.main:.{digits}f}"


def dependence_table(
    base: Sequence[Finding], others: Sequence[tuple[Variant, Sequence[Finding]]]
) -> str:
    """The number that decides each statement, for every open number at its low and high value.

    A star marks a verdict that differs from the one at the default; the lines below explain the
    difference, and every statement that does not hold throughout.
    """
    title = max(len(f"{v.title}: {v.label}") for v, _ in others) + 2
    heads = [f"{f.key} [{f.unit}]" for f in base]
    lines = ["columns (the two-link fence's, where each fence has its own):"]
    listed = ", ".join(f"({i}) {head}" for i, head in enumerate(heads, 1))
    lines += textwrap.wrap(listed, _WIDTH, initial_indent="  ", subsequent_indent="  ")
    lines.append(" " * title + "".join(f"{f'({i})':>6} " for i in range(1, len(heads) + 1)))
    lines.append(f"{'default':<{title}}" + "".join(f"{_number(f):>6} " for f in base))
    notes = []
    for variant, findings in others:
        changed = changes(base, findings)
        cells = [f"{_number(f):>6}{'*' if f.key in changed else ' '}" for f in findings]
        name = f"{variant.title}: {variant.label}"
        lines.append(f"{name:<{title}}" + "".join(cells))
        notes += [
            f"  {name}: \"{key}\" turns from {was} to {now}" for key, (was, now) in changed.items()
        ]
    lines.append("* the verdict differs from the default's:" if notes else "no verdict changes")
    touched = {key for _, findings in others for key in changes(base, findings)}
    for finding in base:
        if finding.key in touched:
            why = f"why, \"{finding.key}\": {finding.remark}"
            notes += textwrap.wrap(why, _WIDTH, initial_indent="  ", subsequent_indent="    ")
    return "\n".join(line.rstrip() for line in lines + notes)
