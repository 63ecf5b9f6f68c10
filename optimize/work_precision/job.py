"""Speed against accuracy: what every fidelity costs and how wrong it is, value and gradient.

    python -m optimize.work_precision --out out

compares a ladder of fidelities with a converged reference over the paper's impact, the slide, the
whole sort and random impacts. It also varies every setting by itself, screens a product grid for
points that may lie on the front, measures these and the run times, and writes work_precision.md,
work_precision.json and work-precision diagrams.

Errors are those of the peak force, the tip deflection and the impulse, and of their elasticities in
eight variables. The smoothing of dry friction changes the physics: a converged run with the same
smoothing separates its error from that of the discretisation.
"""

import functools
import time

import fencejax as fj
from fencejax.study import describe

from ..common import command
from ..common.files import write_whole
from ..common.report import write_json
from . import cases, cold, front, ladder as ladders, orders, page, tables
from .cases import Family
from .configuration import WorkPrecisionConfig, configure
from .errors import Errors, Outcome, compare, spread
from .findings import Report, Rung
from .ladder import Ladder, Point
from .measure import Bench, Times


def _stages(config: WorkPrecisionConfig) -> dict[str, Family]:
    made = {
        "slide": cases.slide,
        "sort": cases.sort,
        "sorts": lambda: cases.sorts(config.sorts, config.seed),
    }
    return {name: make() for name, make in made.items() if name in config.scene}


class _Job:
    """The parts of the measurement; each queues its runs at the bench and reads the results
    later."""

    def __init__(self, config: WorkPrecisionConfig, bench: Bench):
        self.config, self.bench = config, bench
        self.ladder: Ladder = getattr(ladders, config.ladder)()
        count = config.random if "random" in config.scene else 0
        self.impacts = cases.impacts(count, config.seed, config.duration)
        self.few = self.impacts.first(config.lanes)
        self.stages = _stages(config)
        everything = config.ladder == "dense"
        self.integrators = ladders.integrators(everything) if config.integrators else {}
        self.keys: dict = {}

    def _ask(self, name, *arguments, **settings) -> None:
        self.keys[name] = self.bench.ask(*arguments, **settings)

    def _read(self, name) -> Outcome | None:
        run = self.bench.result(self.keys[name])
        return None if run is None else run.outcome

    def need(self, name) -> Outcome:
        """The outcome of a run that serves as a reference for others."""
        found = self._read(name)
        if found is None:
            raise RuntimeError(f"The run {name} failed, and the others are measured against it.")
        return found

    def ask_errors(self) -> None:
        """Queue all runs for the errors, the longest first."""
        plan = self.ladder
        self._ask("truth", self.impacts, plan.truth, "converged reference, all impacts")
        if plan.check != plan.truth:
            self._ask("check", self.impacts.first(8), plan.check, "reference, step halved, a few")
        for name, family in self.stages.items():
            exact = plan.truth
            if name == "sorts":
                # A hundred cycles: eight modes and longer steps, friction as sharp.
                exact = plan.base.replace(**ladders.smoothed(plan.truth.slip_speed))
            for label, fidelity in (
                ("truth", exact.replace(step=2 * exact.step)), ("check", exact),
                *((n, f) for n, f in plan.rungs.items() if n != "reference"),
            ):  # fmt: skip
                self._ask((name, label), family, fidelity, f"{name}: {label}")
        for name, fidelity in plan.rungs.items():
            self._ask(("rung", name), self.impacts, fidelity, f"{name}, all impacts", keep=True)
        for point in (p for points in plan.knobs.values() for p in points):
            label = f"{point.knob}: {point.label}"
            self._ask(("knob", point.fidelity), self.few, point.fidelity, label)
        self._ask(("knob", plan.base), self.few, plan.base, "base")
        for segment in orders.SEGMENTS if self.config.orders else ():
            self.keys["order", segment] = self.bench.call(
                ("order", segment), functools.partial(orders.ladder, segment), segment
            )
        for name, fidelity in self.integrators.items():
            label = f"integrator {name}"
            self._ask(("integrator", name), self.impacts.first(1), fidelity, label, gradient=False)

    def predict(self) -> dict[fj.Fidelity, tuple[float, float]]:
        """Errors (value, gradient) of the peak force over the grid, if effects added up."""
        truth = self.need("truth").first(len(self.few.numbers))
        base = self.need(("knob", self.ladder.base))
        found = {}
        for fidelity, parts in self.ladder.grid.items():
            effects = [self._read(("knob", part)) for part in parts]
            if any(effect is None for effect in effects):
                continue
            whole = front.superposed(base, [effect for effect in effects if effect is not None])
            errors = compare(whole, truth)
            assert errors.gradient is not None
            found[fidelity] = tuple(
                spread(e[:, 0])["95 %"] for e in (errors.value, errors.gradient)
            )
        return found

    def ask_candidates(self, predicted) -> list[fj.Fidelity]:
        """Queue the grid's likely points, and runs without gradients of all points to be timed."""
        rungs = self.ladder.rungs
        open_ones = {f: e for f, e in predicted.items() if f not in rungs.values()}
        chosen = front.likely(open_ones, self.config.candidates)
        for fidelity in chosen:
            label = "grid: " + describe(fidelity)
            self._ask(("grid", fidelity), self.impacts, fidelity, label, keep=True)
        names = {f: describe(f) for f in chosen} | {f: n for n, f in rungs.items()}
        for fidelity, name in names.items():
            self._ask(("value", fidelity), self.impacts, fidelity, f"{name}, values alone",
                      gradient=False, keep=True)  # fmt: skip
        many = self.impacts.repeated(self.config.batch)
        for name, fidelity in rungs.items():
            if name != "reference":
                self._ask(("many", fidelity), many, fidelity, f"{name}, {self.config.batch} lanes",
                          gradient=False, keep=True)  # fmt: skip
        return chosen

    def rung(self, key, name: str, named: bool, own: dict | None) -> Rung | None:
        """A measured point with its times, or `None` where it failed."""
        run = self.bench.result(self.keys[key])
        if run is None:
            return None
        fidelity = self.ladder.rungs[name] if named else key[1]
        times = {}
        for label in ("value", "many"):
            if (label, fidelity) not in self.keys:
                continue
            alone = self.bench.result(self.keys[label, fidelity])
            if alone is not None and alone.timed is not None:
                lanes = len(alone.outcome.values)
                times[lanes] = Times.of(alone.timed, self.config.repeats).per(lanes)
        assert run.timed is not None
        lanes = len(run.outcome.values)
        slope_time = Times.of(run.timed, self.config.repeats).per(lanes)
        errors = compare(run.outcome, self.need("truth"))
        return Rung(
            name, named, fidelity, run.outcome, errors, times, slope_time, run.memory, own
        )

    def knobs(self) -> dict[str, list[tuple[Point, Errors]]]:
        """Each point's errors against the finest one of its knob."""
        found = {}
        for name, points in self.ladder.knobs.items():
            finest = self.need(("knob", points[-1].fidelity))
            rows = [(point, self._read(("knob", point.fidelity))) for point in points[:-1]]
            found[name] = [(point, compare(o, finest)) for point, o in rows if o is not None]
        return found

    def split(self) -> dict[str, tuple[Errors, Errors]]:
        """Errors of discretisation and of smoothing by rung, where a converged run with the rung's
        smoothing is among the knob's points."""
        base, found = self.ladder.base, {}
        if "slip_speed" not in self.ladder.knobs:
            return found
        points = self.ladder.knobs["slip_speed"]
        finest = self.need(("knob", points[-1].fidelity))
        for name, fidelity in self.ladder.rungs.items():
            same = base.replace(
                slip_speed=fidelity.slip_speed, static_speed=fidelity.static_speed
            )
            rung = self._read(("rung", name))
            if ("knob", same) in self.keys and rung is not None:
                smooth = self.need(("knob", same))
                few = rung.first(len(smooth.values))
                found[name] = (compare(few, smooth), compare(smooth, finest))
        return found

    def check(self) -> dict[str, Errors]:
        """The reference's own errors, by one more halving of its step."""
        found = {}
        if "check" in self.keys:
            finer = self.need("check")
            found["impacts"] = compare(self.need("truth").first(len(finer.values)), finer)
        for name in self.stages:
            found[name] = compare(self.need((name, "truth")), self.need((name, "check")))
        return found

    def rungs_in_stages(self) -> dict[str, dict[str, Errors]]:
        """Errors of the rungs in slide and sorts."""
        found = {}
        for stage in self.stages:
            exact = self.need((stage, "check"))
            keys = [name for name in self.ladder.rungs if (stage, name) in self.keys]
            rows = {name: self._read((stage, name)) for name in keys}
            found[stage] = {n: compare(o, exact) for n, o in rows.items() if o is not None}
        return found

    def orders(self) -> dict[str, dict]:
        """Errors and observed orders by segment."""
        keys = {s: self.keys["order", s] for s in orders.SEGMENTS if ("order", s) in self.keys}
        found = {segment: self.bench.result(key) for segment, key in keys.items()}
        return {segment: rows for segment, rows in found.items() if rows is not None}

    def general(self) -> dict[str, Errors]:
        """Errors of the values by the integrators against the most exact one."""
        if not self.integrators:
            return {}
        rows = {name: self._read(("integrator", name)) for name in self.integrators}
        *others, finest = rows
        exact = rows[finest]
        if exact is None:
            return {}
        return {name: compare(o, exact) for name in others if (o := rows[name]) is not None}


def main(config: WorkPrecisionConfig | None = None, *, quiet: bool = False) -> Report:
    """Run the measurement, print its progress, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = WorkPrecisionConfig() if config is None else config
    config.out.mkdir(parents=True, exist_ok=True)
    bench = Bench(config.threads, say)
    job = _Job(config, bench)
    try:
        say(f"errors over {len(job.impacts.numbers)} impacts and {list(job.stages)}:")
        job.ask_errors()
        bench.wait()
        predicted = job.predict()
        chosen = job.ask_candidates(predicted)
        say("points of the product grid, and values alone:")
        bench.wait()
        report = _timed(config, job, predicted, chosen, say, begin)
    finally:
        bench.close()
    _write(report, say)
    return report


def _timed(config, job: _Job, predicted, chosen, say, begin) -> Report:
    """Measure the times one by one, when nothing else runs, and collect all results."""
    say("times:")
    rungs = []
    for name, fidelity in job.ladder.rungs.items():
        own = None
        if config.cold:
            try:
                own = cold.elsewhere(fidelity, config.duration, config.repeats)
            except RuntimeError as error:
                job.bench.failures[f"{name}, own process"] = str(error)
        rungs.append(job.rung(("rung", name), name, True, own))
        say(f"  {time.perf_counter() - begin:6.1f} s  {name}")
    grid = [job.rung(("grid", f), describe(f), False, None) for f in chosen]
    say(f"  {time.perf_counter() - begin:6.1f} s  {len(grid)} points of the grid")
    return Report(
        config=config,
        ladder=job.ladder,
        truth=job.need("truth"),
        check=job.check(),
        rungs=[rung for rung in rungs if rung is not None],
        grid=[rung for rung in grid if rung is not None],
        knobs=job.knobs(),
        split=job.split(),
        stages=job.rungs_in_stages(),
        integrators=job.general(),
        orders=job.orders(),
        predicted=predicted,
        failures=dict(job.bench.failures),
        elapsed=time.perf_counter() - begin,
    )


def _write(report: Report, say) -> None:
    out = report.config.out
    write_json(out / "work_precision.json", tables.content(report))
    text = tables.document(report)
    write_whole(out / "work_precision.md", text)
    say("\n" + text)
    if report.config.plots:
        from . import figures

        figures.draw(report, out)
    page.write(report, text)
    say(f"wrote {out} ({report.elapsed:.0f} s in all)")


def run():
    """The job from the command line."""
    command.run("work_precision", configure, main, cached=False)
