"""What counts, and how much: derivatives at a point, along a line, and over whole ranges.

    python -m optimize.sensitivity --out out

takes a scene with the paper's numbers and prints, for each output,

- local: the elasticities d ln Q / d ln p in every input, at chosen points and along the distance R
  of the first contact, by automatic differentiation. The derivatives in *all* numbers of the scene
  must obey three sum rules, since laws of mechanics do not depend on the units of mass, length and
  time; the residuals of these rules are printed below each table. No setting of the fidelity has a
  unit with mass, so that the residual of its rule is the error of the derivatives. The residuals of
  length and time also contain the influence of the step and of the smoothing of friction, which
  have such units;
- global: the shares of the output's variance due to each input, as all of them vary over their
  ranges: indices of Sobol' by sampling, and upper bounds on them from sampled derivatives.

It writes result.json, samples.npz (every point and value of the global study) and three figures.
Exit status 1 if a value is not finite, the rule of mass is off by more than 0.01, or a bound lies
below its index by more than both intervals allow.
"""

import dataclasses
import time
from typing import Any

import numpy as np

import fencejax as fj
from fencejax.scenes import numbers as scene_numbers
from fencejax.study import UNITS_OF_RULES, Response

from ..common import command
from ..common.files import write_arrays, write_figure
from ..common.report import write_json
from . import figures, page, study, tables
from .configuration import SensitivityConfig, configure
from .outcome import Outcome
from .study import Global, Local, Samples


class _Clock:
    """Prints the progress of a part, with rate and time left, once a second."""

    def __init__(self, say):
        self._say, self.elapsed = say, {}

    def start(self, part: str) -> None:
        self._part, self._begin, self._last = part, time.perf_counter(), time.perf_counter()
        self._say(f"{part}: compiling ...")

    def progress(self, done: int, total: int) -> None:
        now = time.perf_counter()
        if now - self._last > 1.0 and done < total:
            self._last = now
            rate = done / (now - self._begin)
            left = (total - done) / rate
            self._say(f"  {done:7d} of {total} runs, {rate:6.0f} a second, {left:5.1f} s left")

    def stop(self) -> None:
        self.elapsed[self._part] = time.perf_counter() - self._begin
        self._say(f"  {self._part}: {self.elapsed[self._part]:.1f} s")


def main(config: SensitivityConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the study, print its results, and write its files into `config.out`."""
    say = command.begin(quiet)
    config = SensitivityConfig() if config is None else config
    config.check()
    scene = config.base()
    inputs, line = config.inputs(scene), config.line(scene)
    names = tuple(variable.name for variable in inputs)
    response = Response(scene, config.quantities(), config.knobs, chunk=config.chunk)
    config.out.mkdir(parents=True, exist_ok=True)
    clock = _Clock(say)

    clock.start("local study")
    points = {
        text: study.local(response, names, [place])
        for text, place in config.places(scene).items()
    }
    at, followed = np.zeros(0), None
    if line is not None:
        at = np.linspace(*line[1:], config.along_count)
        places = [{line[0]: float(value)} for value in at]
        followed = study.local(response, names, places, clock.progress)
    clock.stop()

    runs = config.samples * (len(inputs) + 2)
    clock.start(f"global study, {runs} runs and {config.gradients} gradients")
    samples = study.sample(
        response, inputs, config.samples, config.gradients, config.seed, clock.progress
    )
    _write_samples(config, names, samples)
    shares, refused = None, ""
    try:
        shares = study.judge(samples, config.confidence, config.resamples, config.seed)
    except ValueError as error:
        refused = str(error)
    clock.stop()

    outcome = Outcome(
        names, points, at, followed, samples, shares, refused, clock.elapsed
    )
    write_json(config.out / "result.json", _content(config, inputs, outcome, response, line))
    if config.plots:
        _draw(config, outcome, response, line)
    page.write(config, outcome, response, _titles(outcome), inputs)
    _report(config, outcome, response, line, say)
    return outcome


def _titles(outcome: Outcome) -> list[str]:
    marks = (("_", " "), ("=", " = "), (",", ", "))
    titles = []
    for text in outcome.points:
        for mark, shown in marks:
            text = text.replace(mark, shown)
        titles.append(text)
    return titles


def _write_samples(config: SensitivityConfig, names, samples: Samples) -> None:
    """Write every point u and value of the global study, before they are evaluated."""
    write_arrays(
        config.out / "samples.npz",
        names=np.array(names),
        outputs=np.array(config.outputs),
        u_first=samples.design.first,
        u_second=samples.design.second,
        u_mixed=samples.design.mixed,
        first=samples.first,
        second=samples.second,
        mixed=samples.mixed,
        slopes=samples.slopes,
    )


def _axis(response: Response, name: str) -> str:
    """The label of an axis over one of the scene's numbers."""
    path = scene_numbers.resolve(response.scene, name)
    words = "place of the first contact R" if name == "distance" else name.replace("_", " ")
    return f"{words} [{scene_numbers.number(response.scene, path).unit}]"


def _draw(config: SensitivityConfig, outcome: Outcome, response: Response, line) -> None:
    outputs = response.quantities
    drawn = {}
    parts = zip(*outcome.points.values(), strict=True)
    together = Local(*(np.concatenate(part) for part in parts))
    drawn["elasticities"] = figures.bars(_titles(outcome), outputs, outcome.names, together)
    if outcome.line is not None:
        label = _axis(response, line[0])
        drawn["along"] = figures.along(label, outcome.at, outputs, outcome.names, outcome.line)
    if outcome.shares is not None:
        drawn["shares"] = figures.shares(outputs, outcome.names, outcome.shares, config.confidence)
    for name, figure in drawn.items():
        write_figure(config.out / f"{name}.png", figure)


def _named(found: Local, outputs, names) -> list[dict[str, Any]]:
    """A local study by names, one entry a place."""
    return [
        {
            "status": fj.Status(int(status)).name,
            "values": {q.name: v for q, v in zip(outputs, values, strict=True)},
            "elasticities": {
                q.name: dict(zip(names, row.tolist(), strict=True))
                for q, row in zip(outputs, elasticity, strict=True)
            },
            "left_over_by_units": {
                q.name: dict(zip(UNITS_OF_RULES, row.tolist(), strict=True))
                for q, row in zip(outputs, rules, strict=True)
            },
        }
        for values, elasticity, rules, status in zip(*found, strict=True)
    ]


def _shares(shares: Global, outputs, names) -> dict[str, Any]:
    estimates = {
        "first": shares.indices.first,
        "total": shares.indices.total,
        "bound": shares.measures.bound,
        "measure": shares.measures.measure,
    }
    return {
        quantity.name: {
            name: {key: {k: v[row, j] for k, v in e._asdict().items()}
                   for key, e in estimates.items()}
            for j, name in enumerate(names)
        }
        for row, quantity in enumerate(outputs)
    }  # fmt: skip


def _content(config, inputs, outcome: Outcome, response: Response, line) -> dict[str, Any]:
    outputs, names = response.quantities, outcome.names
    return {
        "config": dataclasses.asdict(config),
        "inputs": [dataclasses.asdict(variable) for variable in inputs],
        "succeeded": outcome.succeeded,
        "points": {
            text: _named(found, outputs, names)[0]
            for text, found in outcome.points.items()
        },
        "along": None if outcome.line is None else {
            "name": line[0], "at": outcome.at, "places": _named(outcome.line, outputs, names),
        },
        "shares": None if outcome.shares is None else _shares(outcome.shares, outputs, names),
        "bounds_above_indices": None if outcome.shares is None else outcome.shares.consistent,
        "refused": outcome.refused,
        "statuses": outcome.samples.counts,
        "elapsed": outcome.elapsed,
    }  # fmt: skip


def _report(config, outcome: Outcome, response: Response, line, say) -> None:
    outputs, names = response.quantities, outcome.names
    for title, found in zip(_titles(outcome), outcome.points.values(), strict=True):
        say("\n" + tables.elasticity_table(title, outputs, names, found, 0))
        status = fj.Status(int(found.status[0]))
        if status:
            say(f"status: {status.text}")
    if not outcome.balanced:
        say("the rule of mass is BROKEN: the derivatives are not those of the scene")
    counts = ", ".join(f"{name} {count}" for name, count in outcome.samples.counts.items())
    say(f"\nstatuses of the global study: {counts}")
    if outcome.shares is None:
        say(f"no shares of variance: {outcome.refused}")
    else:
        for row, quantity in enumerate(outputs):
            say("\n" + tables.global_table(quantity.name, names, outcome.shares, row))
        fine = "none" if outcome.shares.consistent else "SOME"
        say(f"\nbounds from {config.gradients} gradients below an index: {fine}")
    say(f"wrote {config.out}")


def run():
    """The job from the command line."""
    command.run("sensitivity", configure, main)
