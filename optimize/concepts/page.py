"""The page of the job: `report.html`."""

from fencejax.results import counted

from ..common import pages
from ..common.amounts import plain
from ..common.html_report import Part, Report, Section, Table
from . import words
from .means import MEANS
from .outcome import Outcome
from .quantities import LOAD

_FIGURES = {
    "concepts": "Each concept's front over parcels an hour, and what its designs of least force "
    "cost. A cross breaks a limit; a hollow mark is not confirmed.",
}


def write(outcome: Outcome, wins: str) -> None:
    """Write the page; `wins`: the best concepts, in words."""
    config, machine = outcome.config, outcome.groups[0].problem.machine
    title = machine.title or config.sorter
    Report(
        f"Concepts of softening: {title}",
        f"Which concept hits the {machine.parcels.count} parcels and places of {title} the least, "
        "at which rate, and for what torque and mass?",
        pages.sentences(wins),
        outcome.succeeded,
        [
            Section("The machine", pages.machine_tables(machine)),
            Section("The concepts", [_means()]),
            pages.figures(config.out, _FIGURES if config.plots else {}),
            *(Section(f"Least {plain(n)}", _tables(outcome, n)) for n in outcome.minimised),
            Section("The winners' designs", [_designs(outcome)]),
            Section("Statuses and checks", _checks(outcome)),
            pages.assumptions(
                "Every point is a local optimum: the best of searches from the design at the next "
                "rate, from the best of the concepts that are special cases of it, and from the "
                "best with a rigid fence and the same means. Another start may lead lower, and a "
                "concept may lose by its search alone.",
                "A rate is reached where the drive is home, and the returning fence out of the "
                "next parcel's way, within the period; the belt's speed is the sorter's.",
                "The limit on the tip's deflection holds for all by which the tip gets behind "
                "where the motor holds it, a turn of the shaft and a slip of the clutch included; "
                "the ringing is limited from when the drive is home.",
                "A motion of any form may be as quick as what the sorter says of its motor allows: "
                "of a motor whose torque alone is known, as quick as the fence's own inertia lets "
                "it be. Give its rotor's inertia, gear and speed.",
                "What a clutch has slipped is put back at no cost and in no time before the next "
                "parcel.",
                "A rigid fence has the sorter's own shape, and its mass; a cover weighs nothing.",
                "The shaft's own deflection is in no stress: it is not designed.",
            ),
            pages.again(config, "concepts"),
        ],
    ).write(config.out)


def _means() -> Table:
    rows = [
        [name.replace("_", "-"), one.meaning,
         ", ".join(plain(number.path.partition(".")[2]) for number in one.numbers)]
        for name, one in MEANS.items()
    ]  # fmt: skip
    return Table(
        ["means", "what it is", "what is free"], rows, "What a concept may hold",
        "Of every concept the drive and the time at which it starts are free.",
    )  # fmt: skip


def _tables(outcome: Outcome, minimised: str) -> list[Part | str]:
    tables = []
    for rate in outcome.config.paces:
        found = words.rows(outcome, minimised, rate)
        best = frozenset({0}) if outcome.winner(minimised, rate) else frozenset()
        caption = f"{rate:g} parcels an hour, at {outcome.config.verify}"
        tables.append(Table(list(words.TITLES), found, caption, strong=best))
    return tables


def _designs(outcome: Outcome) -> Table:
    rows = []
    for name in outcome.minimised:
        for rate in outcome.config.paces:
            best = outcome.winner(name, rate)
            if best is not None:
                of = "g" if name == LOAD.name else "force"
                rows.append([f"{of}, {rate:g}/h", best.concept.title,
                             words.design_text(outcome, best)])  # fmt: skip
    return Table(["least", "concept", "design"], rows, "Winners")


def _checks(outcome: Outcome) -> list[Part | str]:
    counts: dict[str, int] = {}
    for point in outcome.points:
        for status, count in counted(point.finer.measured.statuses).items():
            counts[status] = counts.get(status, 0) + count
    sure = sum(point.confirmed for point in outcome.points)
    others = [
        f"- {p.concept.title}, {p.rate:g}/h, least {plain(p.minimised)}: {p.verdict}"
        for p in outcome.points if not p.confirmed
    ]  # fmt: skip
    head = (
        f"{outcome.searches} searches in {outcome.evaluations} evaluations; of "
        f"{len(outcome.points)} points {sure} are confirmed at {outcome.config.verify}."
    )
    parts: list[Part | str] = [head, pages.status_table(counts, "Sorts of all points")]
    return [*parts, "The others:", "\n".join(others)] if others else parts
