"""What are the fence and the parcel made of? Parameters from recordings of impacts.

    python -m optimize.identify --records impact.csv --set distance=0.9,mass=12 --out out
    python -m optimize.identify --demo --out out

fits Young's modulus, the damping ratio, the parcel's stiffness and damping, and friction to the
recorded force or motion by nonlinear least squares, with derivatives through the simulation. It
prints the numbers with their standard errors and warns of parameters that the recordings cannot
distinguish. It writes result.json and figures: recording and fit with residuals, and the
correlation of the estimates.

`--demo` makes a recording with noise from known numbers, which it then finds again; it also writes
the recording, demo.csv, as an example of the format. The exit status is 1 if the search did not
converge or if the known numbers lie further from the estimates than noise can explain.
"""

import dataclasses
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fencejax as fj
from fencejax.printing import shown
from fencejax.study import (
    OFFSET,
    SIGNALS,
    Aligned,
    Experiment,
    Fit,
    Recording,
    identify,
    read_recording,
    write_recording,
)

from ..common import command
from ..common.files import write_figure
from ..common.report import write_json
from . import demo, figures, page
from .configuration import IdentifyConfig, configure

FURTHEST = 4.0
"""Standard errors within which the demonstration's numbers must lie: for normal errors one in
16,000 lies further away."""


class Delay(NamedTuple):
    """Time of the first contact on a recording's clock [s], with its standard error, which is 0 for
    a given time."""

    value: float
    standard_error: float


@dataclasses.dataclass(frozen=True)
class Outcome:
    """The results of the job. `delays`: one a record. `deviations`: distance of the demonstration's
    numbers from the estimates in standard errors, by name; empty for recordings."""

    fit: Fit
    experiments: list[Experiment]
    delays: list[Delay]
    deviations: dict[str, float]
    elapsed: float

    @property
    def succeeded(self) -> bool:
        """Whether the fit converged and agrees with the demonstration's numbers."""
        near = all(abs(value) <= FURTHEST for value in self.deviations.values())
        return self.fit.converged and near


def _made(config: IdentifyConfig) -> Path:
    """The demonstration's file."""
    fidelity = getattr(fj.Fidelity, config.demo_fidelity)()
    scene = config.base(config.numbers(0), demo.DURATION)
    made = demo.record(scene, fidelity, config.demo_noise, config.demo_rows, config.seed)
    path = config.out / "demo.csv"
    write_recording(path, made)
    return path


def main(config: IdentifyConfig, *, quiet: bool = False) -> Outcome:
    """Run the job, print its results, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    searched = config.searched()
    config.out.mkdir(parents=True, exist_ok=True)
    paths = [_made(config)] if config.demo else [Path(path) for path in config.records]
    aligned, signals = [], config.signals
    for index, path in enumerate(paths):
        recording = read_recording(path, signals, {} if config.demo else config.titles())
        signals = signals or recording.names
        aligned.append(config.aligned(index, recording))
        say(_used(recording, aligned[-1]))
    experiments = [one.experiment for one in aligned]
    offsets = [one.offset for one in aligned if one.offset is not None]
    if offsets and not any(_name(parameter) == OFFSET for parameter in searched):
        searched = (*searched, max(offsets, key=lambda offset: offset.upper))
    say("compiling (minutes, the first time) ...")

    last = [0.0]

    def progress(number: int, cost: float) -> None:
        if time.perf_counter() - last[0] > 1.0:
            last[0] = time.perf_counter()
            say(f"  evaluation {number:4d}, half the sum of squares {cost:.6g}, "
                f"{last[0] - begin:5.1f} s")  # fmt: skip

    found = identify.fit(
        experiments,
        searched,
        fidelity=config.knobs,
        noise=config.scales(),
        starts=config.starts,
        confidence=config.confidence,
        seed=config.seed,
        most=config.budget,
        posterior=config.posterior,
        refine=config.refine,
        progress=progress,
    )
    delays = _delays(found, aligned)
    deviations = _deviations(found, delays[0]) if config.demo else {}
    outcome = Outcome(found, experiments, delays, deviations, time.perf_counter() - begin)
    write_json(config.out / "result.json", _content(config, outcome))
    if config.plots:
        for index, (experiment, fitted) in enumerate(zip(experiments, found.fitted, strict=True)):
            name = "fit" if len(experiments) == 1 else f"fit_{index + 1}"
            drawn = figures.fit(experiment, fitted, found.noise)
            write_figure(config.out / f"{name}.png", drawn)
        write_figure(config.out / "correlation.png", figures.correlation(found))
    hidden = demo.TRUTH if config.demo else {}
    page.write(config, found, experiments, outcome.deviations, hidden, outcome.succeeded)
    _report(config, outcome, say)
    return outcome


def _name(parameter: str | fj.DesignVariable) -> str:
    return parameter if isinstance(parameter, str) else parameter.name


def _used(recording: Recording, aligned: Aligned) -> str:
    """The used rows and the missing samples of a recording, a line."""
    used = aligned.experiment.recording
    text = (
        f"{recording.source}: {len(used.time)} of {len(recording.time)} rows of "
        f"{', '.join(recording.names)}, first contact at {shown(aligned.delay, 's')}"
    )
    text += "" if aligned.offset is None else " or so"
    gaps = [f"{count} samples of {name}" for name, count in used.missing.items()]
    gaps += [f"{recording.untimed} rows without a time"] if recording.untimed else []
    return text + (f"; skipped, as missing: {', '.join(gaps)}" if gaps else "")


def _delays(found: Fit, aligned: list[Aligned]) -> list[Delay]:
    """The time of the first contact in every recording: the estimate less the offset found."""
    places = [k for k, name in enumerate(found.names) if name.startswith(OFFSET)]
    delays = []
    for index, one in enumerate(aligned):
        if not places:
            delays.append(Delay(one.delay, 0.0))
            continue
        place = places[index if len(places) > 1 else 0]
        delays.append(
            Delay(one.delay - float(found.values[place]), float(found.standard_errors[place]))
        )
    return delays


def _deviations(found: Fit, delay: Delay) -> dict[str, float]:
    """How far the demonstration's numbers lie from the estimates, in standard errors."""
    deviations = {}
    for k, parameter in enumerate(found.parameters):
        if parameter.name in demo.TRUTH:
            value, truth = found.values[k], demo.TRUTH[parameter.name]
            apart = value - truth if parameter.scaling == "linear" else np.log(value / truth)
            deviations[parameter.name] = float(apart / found.standard_errors[k])
    if delay.standard_error:
        deviations["first_touch"] = (delay.value - demo.DELAY) / delay.standard_error
    return deviations


def _report(config: IdentifyConfig, outcome: Outcome, say) -> None:
    found = outcome.fit
    say(f"\n{found}")
    noise = ", ".join(f"{name} {value:.3g} {SIGNALS[name]}" for name, value in found.noise.items())
    say(f"intervals of {100 * found.confidence:g} %; residuals: {noise} (standard deviation)")
    say(f"condition {found.condition:.3g}, misfit {found.misfit:.3g}, {found.evaluations} "
        f"evaluations: {found.stop}")  # fmt: skip
    if found.posterior is not None:
        say(str(found.posterior))
    for delay, experiment in zip(outcome.delays, outcome.experiments, strict=True):
        if delay.standard_error:
            value, error = shown(delay.value, "s", 6), shown(delay.standard_error, "s", 2)
            say(f"first contact by the clock of {experiment.recording.source}: {value}, standard "
                f"error {error}")  # fmt: skip
    for warning in found.warnings:
        say(f"warning: {warning}")
    if len(found.costs) > 1:
        same = int(np.sum(np.array(found.costs) < 1.01 * min(found.costs)))
        say(f"{same} of {len(found.costs)} starts came to the same minimum")
    for name, value in outcome.deviations.items():
        truth = (demo.TRUTH | {"first_touch": demo.DELAY})[name]
        units = {one.name: one.unit for one in found.parameters} | {"first_touch": "s"}
        say(
            f"  hidden {name.replace('_', ' ')} {shown(truth, units[name])}: {value:+.2f} standard "
            "errors away"
        )
    if not found.converged:
        say("the search did NOT converge")
    elif not outcome.succeeded:
        say("the hidden numbers lie further away than noise explains")
    say(f"wrote {config.out} ({outcome.elapsed:.1f} s in all)")


def _content(config: IdentifyConfig, outcome: Outcome) -> dict[str, Any]:
    found = outcome.fit
    return {
        "config": dataclasses.asdict(config),
        "succeeded": outcome.succeeded,
        "parameters": {
            parameter.name: {
                "unit": parameter.unit,
                "start": found.start[k],
                "value": found.values[k],
                "standard_error": found.standard_errors[k],
                "standard_error_of": "ln p" if parameter.scaling == "logarithmic" else "p",
                "interval": [found.low[k], found.high[k]],
                "bounds": [parameter.lower, parameter.upper],
            }
            for k, parameter in enumerate(found.parameters)
        },
        "correlation": found.correlation,
        "rung": found.rung,
        "posterior": found.posterior and {
            "standard_errors": found.posterior.standard_errors,
            "ratios": found.posterior.ratios,
            "correlation": found.posterior.correlation,
            "unsteadiness": found.posterior.unsteadiness,
            "holds": found.posterior.holds,
        },
        "condition": found.condition,
        "weakest_direction": dict(zip(found.names, found.weakest.tolist(), strict=True)),
        "noise": found.noise,
        "autocorrelation": found.autocorrelation,
        "misfit": found.misfit,
        "converged": found.converged,
        "evaluations": found.evaluations,
        "stop": found.stop,
        "costs": found.costs,
        "warnings": found.warnings,
        "hidden": demo.TRUTH | {"first_touch": demo.DELAY} if config.demo else None,
        "deviations": outcome.deviations,
        "records": [
            {
                "source": experiment.recording.source,
                "first_touch": delay._asdict(),
                "time": experiment.recording.time,
                "recorded": dict(experiment.recording.signals),
                "fitted": dict(zip(experiment.recording.names, fitted, strict=True)),
            }
            for experiment, fitted, delay in zip(
                outcome.experiments, found.fitted, outcome.delays, strict=True
            )
        ],
        "elapsed": outcome.elapsed,
    }


def run():
    """The job from the command line."""
    command.run("identify", configure, main)
