"""The fence for parcels as they come.

    python -m optimize.robust_design --severity drop_height --out out

Mass, size, stiffness, place, angle, timing and friction of the parcels are drawn from spans, each
set by a flag. With a sorter file they are drawn from its distributions, or by their weights from
the parcels that it lists or that its CSV file holds. The objective is the mean, the CVaR (the mean
of the worst 5 %) or the worst case of the peak force, of the g-load or of the equivalent drop
height; each limit must hold for a stated fraction of the parcels. One compiled program simulates
thousands of whole sorts.

There are two methods: one sample of parcels throughout, whose statistics are an ordinary design
problem, or a fresh batch at every step. Both the paper's fence and the final design are then judged
on a fresh sample that the search has not used, with confidence intervals: bootstrap for the
measure, exact ones for the shares of parcels that hold the limits.

Parcels in numerical doubt at the chosen fidelity are computed again at a finer one. Those without
numbers are left out of the measure, reported, and count as breaking the limits.
Every evaluation is written to `evaluations.jsonl` at once: the same command with the same folder
resumes an interrupted job.
"""

import dataclasses
import time
from typing import Any

import numpy as np

from fencejax.design import Journal
from fencejax.results import counted

from ..common import command, designs, evaluations, machine, nearby, report
from ..common.encounters import Encounter
from ..common.files import write_arrays
from . import confidence, page
from .configuration import RobustConfig, configure
from .descent import by_batches, by_sample
from .outcome import Judgement, Outcome
from .parcels import FRESH, draw
from .problem import Population


def _judgement(population: Population, read: dict[str, np.ndarray], fresh: Encounter) -> Judgement:
    config, good = population.config, read["valid"]
    if not np.any(good):
        raise ValueError(report.failed_start(fresh.text, read["status"]))
    measures = {
        name: confidence.bootstrap(
            read["severity"][good], name, config.level, config.resamples, config.confidence,
            config.seed,
        )
        for name in ("mean", "cvar", "worst")
    }  # fmt: skip
    shares = {
        limit.name: confidence.share(
            good & (np.asarray(limit.margin_of(read[limit.name])) >= 0), config.confidence
        )
        for limit in population.limits
    }
    excluded = float(1 - np.mean(good))
    return Judgement(measures, shares, counted(read["status"]), excluded, read)


def main(config: RobustConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, print its progress, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = RobustConfig() if config is None else config
    population = Population(config)
    population.check()
    config.out.mkdir(parents=True, exist_ok=True)
    journal = evaluations.journal(config, say)
    for line in machine.notes(config.machine):
        say(line)
    count = config.sample if config.method == "sample" else config.batch
    say(
        f"{count} {config.scenes} a step, variables {', '.join(population.space.names)}; "
        "compiling (minutes, the first time) ..."
    )
    search = by_sample if config.method == "sample" else by_batches
    found = search(population, journal, say)
    say(f"\nstopped: {found.stop}\n{config.fresh} fresh parcels, {config.check_fidelity} ...")
    fresh = draw(config, config.fresh, FRESH)
    read = {
        "before": population.judge(population.start, fresh),
        "after": population.judge(found.point, fresh),
    }
    judged = {name: _judgement(population, lanes, fresh) for name, lanes in read.items()}
    both = read["before"]["valid"] & read["after"]["valid"]
    pairs = np.column_stack([lanes["severity"][both] for lanes in read.values()])
    ratio = confidence.bootstrap(
        pairs, config.measure, config.level, config.resamples, config.confidence, config.seed
    )
    before, after = (
        np.asarray(population.space.from_shares(z)) for z in (population.start, found.point)
    )
    outcome = Outcome(
        config, found, before, after, judged, ratio, population.stiff(found.point, fresh),
        time.perf_counter() - begin,
    )  # fmt: skip
    _write(population, outcome, fresh, both, journal)
    say("\n" + _table(population, outcome) + "\n\n" + _verdict(outcome))
    if found.optimum is not None:
        rows = page.rows(population)
        prices = nearby.price_text(population.space, found.optimum, rows, config.unit)
        say("\n" + prices)
    say("\n" + page.mine(outcome))
    say(f"wrote {config.out} ({outcome.elapsed:.1f} s in all)")
    return outcome


def _table(population: Population, outcome: Outcome) -> str:
    config, judged = outcome.config, outcome.judged
    wide = 30
    lines = [f"{'':<30}{'before':>{wide}}{'after':>{wide}}"]
    values = zip(population.space.variables, outcome.before, outcome.after, strict=True)
    for variable, old, new in values:
        title = f"{variable.name.replace('_', ' ')} [{variable.unit}]"
        lines.append(f"{title:<30}{old:>{wide}.5g}{new:>{wide}.5g}")

    def row(title, intervals, factor=1.0):
        cells = []
        for interval in intervals:
            value, lower, upper = (f"{factor * number:.4g}" for number in interval)
            cells.append(f"{f'{value} ({lower} ... {upper})':>{wide}}")
        lines.append(f"{title:<30}{''.join(cells)}")

    for name in ("mean", "cvar", "worst"):
        title = f"{name} {config.severity.replace('_', ' ')} [{config.unit}]"
        row(title, [judged[when].measures[name] for when in ("before", "after")])
    for limit in population.limits:
        row(
            f"{limit.name.replace('_', ' ')} holds [%]",
            [judged[when].shares[limit.name] for when in ("before", "after")],
            100.0,
        )
    lines.append(f"(fresh parcels; {100 * config.confidence:g} % intervals in brackets)")
    for when in ("before", "after"):
        counts = ", ".join(f"{name} {n}" for name, n in judged[when].statuses.items())
        lines.append(f"{when}: {counts}")
    return "\n".join(lines)


def _verdict(outcome: Outcome) -> str:
    config, ratio, after = outcome.config, outcome.ratio, outcome.judged["after"]
    text = (
        f"{config.measure} of the {config.severity.replace('_', ' ')} on the same fresh parcels: "
        f"{100 * (ratio.value - 1):+.1f} % ({100 * (ratio.lower - 1):+.1f} ... "
        f"{100 * (ratio.upper - 1):+.1f} %)"
    )
    own = outcome.found.objective
    if np.isfinite(own):
        seen = after.measures[config.measure].value
        text += f"; the search's own sample says {100 * (own / seen - 1):+.1f} % of the fresh one"
    for name, share in after.shares.items():
        if share.upper < config.fraction:
            text += (
                f"\nthe limit of the {name.replace('_', ' ')} holds for {100 * share.value:.1f} % "
                f"of the parcels, NOT for {100 * config.fraction:g} %"
            )
    if not outcome.found.ended:
        text += f"\nthe search did not end as it should: {outcome.found.stop}"
    if after.excluded > config.excluded_most:
        text += f"\n{100 * after.excluded:.1f} % of the fresh parcels had to be left out: too many"
    return text


def _write(population: Population, outcome: Outcome, fresh, both, journal: Journal) -> None:
    config, found = outcome.config, outcome.found
    space = population.space

    def content_of(judgement: Judgement) -> dict[str, Any]:
        return {
            "measures": {k: v._asdict() for k, v in judgement.measures.items()},
            "limits_held": {k: v._asdict() for k, v in judgement.shares.items()},
            "statuses": judgement.statuses,
            "excluded": judgement.excluded,
        }

    content = {
        "config": dataclasses.asdict(config),
        "succeeded": outcome.succeeded,
        "stop": found.stop,
        "design": {"before": space.named(outcome.before), "after": space.named(outcome.after)},
        "on_bounds": designs.on_bounds(space, outcome.after),
        "unit": config.unit,
        "fresh": {when: content_of(judgement) for when, judgement in outcome.judged.items()},
        "ratio": outcome.ratio._asdict(),
        "own_sample": found.objective,
        "does_not_bend": outcome.stiff,
        "steps": [step._asdict() for step in found.steps],
        "recalled": journal.recalled,
        "elapsed": outcome.elapsed,
    }
    report.write_json(config.out / "robust.json", content)
    columns = {f"parcel_{name}": np.asarray(part) for name, part in fresh._asdict().items()}
    for when, judgement in outcome.judged.items():
        columns |= {f"{when}_{name}": part for name, part in judgement.lanes.items()}
    write_arrays(config.out / "fresh.npz", **columns)
    if config.plots:
        from . import figures

        before, after = (outcome.judged[when].lanes for when in ("before", "after"))
        figures.exceedance(config, before, after, both, config.out)
        figures.by_mass(config, np.asarray(fresh.mass), before, after, both, config.out)
        figures.search(config, found, config.out)
    page.write(population, outcome, fresh, _verdict(outcome))


def run():
    """The job from the command line."""
    command.run("robust_design", configure, main, stopped=command.RESUMED)
