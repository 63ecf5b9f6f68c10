"""The page of the job: `report.html`."""

import numpy as np

import fencejax as fj
from fencejax.printing import shown
from fencejax.study import UNITS_OF_RULES, Response

from ..common import pages
from ..common.amounts import plain
from ..common.html_report import Part, Report, Section, Table
from .configuration import SensitivityConfig
from .outcome import Outcome
from .study import Global, Local

_FIGURES = {
    "elasticities": "Elasticities at the points: what 1 % more of a number does in percent.",
    "along": "Elasticities along the line.",
    "shares": "Shares of the variance due to each input: indices of Sobol' and their bounds.",
}


def write(
    config: SensitivityConfig, outcome: Outcome, response: Response, titles: list[str], inputs
) -> None:
    """Write the page."""
    outputs = ", ".join(plain(q.name) for q in response.quantities)
    spans = [
        [plain(v.name), shown(v.lower, v.unit), shown(v.upper, v.unit), v.scaling] for v in inputs
    ]
    local = [
        _elasticities(title, response.quantities, outcome.names, found)
        for title, found in zip(titles, outcome.points.values(), strict=True)
    ]
    Report(
        f"What {outputs} depend on",
        f"Which of {len(outcome.names)} numbers move {outputs}, at a point and over whole ranges?",
        pages.sentences(*_answer(outcome, response)),
        outcome.succeeded,
        [
            Section("The scene", [pages.scene_table(response.scene)]),
            Section("Elasticities", local),
            Section("Shares of variance", [
                Table(["input", "from", "to", "scaling"], spans, "The ranges"),
                *_shares(outcome, response),
            ]),
            pages.figures(config.out, _FIGURES if config.plots else {}),
            Section("Statuses and checks", [
                pages.status_table(outcome.samples.counts, "The global study's simulations"),
                "The rule of mass, which no knob of the fidelity touches, "
                + ("holds." if outcome.balanced else "is BROKEN."),
            ]),
            pages.assumptions("Inputs vary independently of each other over their ranges."),
            pages.again(config, "sensitivity"),
        ],
    ).write(config.out)  # fmt: skip


def _answer(outcome: Outcome, response: Response) -> list[str]:
    """The inputs that count most, locally at the first point and globally."""
    lines = []
    first = next(iter(outcome.points.values()))
    for row, quantity in enumerate(response.quantities):
        sizes = np.nan_to_num(first.elasticity[0, row])
        order = np.argsort(-np.abs(sizes), kind="stable")[:3]
        largest = ", ".join(f"{plain(outcome.names[j])} {sizes[j]:+.2f}" for j in order)
        text = f"{plain(quantity.name)}: elasticities at the first point {largest}"
        if outcome.shares is not None:
            total = outcome.shares.indices.total.value[row]
            most = np.argsort(-total, kind="stable")[:3]
            largest = ", ".join(f"{plain(outcome.names[j])} {100 * total[j]:.0f} %" for j in most)
            text += f"; of its variance over the ranges {largest}"
        lines.append(text + ".")
    return lines


def _elasticities(title: str, outputs, names, found: Local) -> Table:
    """Elasticities at a point, the largest first, and the residuals of the unit rules."""
    elasticity = found.elasticity[0]
    order = np.argsort(-np.max(np.abs(np.nan_to_num(elasticity)), axis=0), kind="stable")
    values = (shown(float(v), q.unit) for v, q in zip(found.values[0], outputs, strict=True))
    rows = [
        ["value", *values],
        *([plain(names[j]), *(f"{e:+.4f}" for e in elasticity[:, j])] for j in order),
        *([f"left over by units of {unit}", *(f"{r:+.1e}" for r in found.rules[0, :, k])]
          for k, unit in enumerate(UNITS_OF_RULES)),
    ]  # fmt: skip
    status = fj.Status(int(found.status[0]))
    note = f"d ln Q / d ln p [1]. Status: {status.text}."
    return Table(["", *(plain(q.name) for q in outputs)], rows, f"At {title}", note)


def _shares(outcome: Outcome, response: Response) -> list[Part | str]:
    if outcome.shares is None:
        return [f"No shares of variance: {outcome.refused}"]
    return [
        _shares_of(plain(quantity.name), outcome.names, outcome.shares, row)
        for row, quantity in enumerate(response.quantities)
    ]


def _shares_of(title: str, names, found: Global, row: int) -> Table:
    def cells(estimate, j):
        return [f"{estimate.value[row, j]:.3f}",
                f"{estimate.low[row, j]:.3f} ... {estimate.high[row, j]:.3f}"]  # fmt: skip

    every = (found.indices.first, found.indices.total, found.measures.bound)
    rows = [
        [plain(names[j]), *(cell for estimate in every for cell in cells(estimate, j))]
        for j in np.argsort(-found.indices.total.value[row], kind="stable")
    ]
    titles = ["input", "alone, S_i", "interval", "total, S_Ti", "interval", "bound on S_Ti",
              "interval"]  # fmt: skip
    return Table(titles, rows, f"Shares of the variance of the {title}")
