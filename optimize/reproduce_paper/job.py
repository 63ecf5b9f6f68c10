"""The paper recomputed: every numerical result, for both of its fences.

    python -m optimize.reproduce_paper --out out

runs the impact near the tip and the sliding sort over the drive's whole cycle, maps the impact over
parcel mass and place, differentiates the peak force in the fence's numbers, and judges the paper's
statements one by one. It prints a table *the paper says / we get / agrees?*, repeats it over the
numbers that the paper leaves open, and writes a figure for each of Figs. 8-11, one of the
sensitivities, and result.json.

T. Piatkowski, "Active fence with flexible link", Journal of Theoretical and Applied Mechanics
48(1), 87-109, 2010.
"""

import concurrent.futures
import dataclasses
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import fencejax as fj

from ..common import command
from ..common.report import write_json
from . import cycle as cycles, figures, maps, page, sensitivity, tables
from .case import Case, lane, starts, undeformable
from .configuration import PaperConfig, configure
from .cycle import Cycle, first_and_last
from .fences import NAMES
from .further import MASSES, FurtherEvidence, judge_further
from .maps import Maps
from .open_numbers import VARIANTS, Setting
from .outcome import Outcome
from .sensitivity import VARIABLES
from .statements import Evidence, Finding, judge


def _joined(parts: list):
    return jax.tree.map(lambda *leaves: np.concatenate([np.asarray(x) for x in leaves]), *parts)


class _Clock:
    """Prints and records the time [s] of each part of the job."""

    def __init__(self, say):
        self._say, self._begin = say, time.perf_counter()
        self._last, self.elapsed = self._begin, {}

    def lap(self, part: str) -> None:
        now = time.perf_counter()
        self.elapsed[part] = now - self._last
        self._last = now
        self._say(f"  {part}: {self.elapsed[part]:.1f} s")

    def stop(self) -> dict[str, float]:
        """The laps and the total."""
        return self.elapsed | {"total": time.perf_counter() - self._begin}


def _sorts(
    settings: list[Setting], cases: list[Case], fidelity: fj.Fidelity
) -> tuple[list[Cycle], list[Cycle], Cycle]:
    """Impact and slide of every setting, and both of the first setting by an undeformable fence:
    all lanes in one program."""
    count, each = len(NAMES), len(settings)
    lanes = _joined(cases)
    touching = jax.device_get(starts(lanes, fidelity))
    if float(np.min(touching.offset)) < 0:
        raise ValueError(
            "Arguments `distance` and `drive_angle` must let the parcel ride in beside the border, "
            f"but it would lie {-float(np.min(touching.offset)):.3g} m beyond it. Raise them."
        )
    sliding = [setting.sliding() for setting in settings]
    rigid = undeformable(lane(cases[0], slice(0, 1)))
    begin = _joined([touching, *sliding, *(lane(s, slice(0, 1)) for s in (touching, sliding[0]))])
    found = jax.device_get(cycles.run(_joined([lanes, lanes, rigid, rigid]), begin, fidelity))
    pick = [lane(found, slice(count * k, count * (k + 1))) for k in range(2 * each + 1)]
    return pick[:each], pick[each : 2 * each], pick[-1]


def main(config: PaperConfig | None = None, *, quiet: bool = False) -> Outcome:
    """Run the job, print its results, and write its files into `config.out`."""
    say = command.begin(quiet)
    config = PaperConfig() if config is None else config
    config.out.mkdir(parents=True, exist_ok=True)
    clock, fidelity = _Clock(say), config.knobs
    default = Setting(
        distance=config.distance, drive_angle=config.drive_angle, front=config.front
    )
    variants = VARIANTS if config.open_numbers else ()
    settings = [default, *(variant.of(default) for variant in variants)]
    cases = [setting.cases() for setting in settings]

    places = np.linspace(0.5, 1.1, config.sensitivity_points)
    with concurrent.futures.ThreadPoolExecutor(max_workers=1) as pool:
        # The longest compilation, in parallel with the others.
        slopes = pool.submit(sensitivity.along, cases[0], places, fidelity)
        say(f"whole sorts, {2 * len(NAMES) * len(settings) + 2} lanes in one program:")
        impacts, slides, rigid = _sorts(settings, cases, fidelity)
        stiff = jax.device_get(cycles.run_stiff(_joined(cases), fidelity))
        speed, masses = jnp.asarray(stiff.speed[0]), jnp.asarray(MASSES)
        restitution = jax.device_get(cycles.restitutions(speed, masses, fidelity))
        clock.lap("impact, slide and rigid obstacle")
        say("maps:")
        fine, coarse = _maps(config, cases, fidelity, say)
        clock.lap("maps")
        found = slopes.result()
    clock.lap("sensitivities, beside these")

    each = len(NAMES)
    evidence = [
        Evidence(impact, slide, stiff.peak[each * k : each * (k + 1)], drawn)
        for k, (impact, slide, drawn) in enumerate(zip(impacts, slides, coarse, strict=True))
    ]
    judged = [judge(one) for one in evidence]
    findings = judge(dataclasses.replace(evidence[0], maps=fine))
    own = lane(stiff, slice(0, each))
    findings += judge_further(FurtherEvidence(impacts[0], slides[0], own, fine, restitution))
    outcome = Outcome(
        impacts[0], slides[0], rigid, own, fine, found, findings,
        judged[0], list(zip(variants, judged[1:], strict=True)), {},
    )  # fmt: skip
    outcome = dataclasses.replace(outcome, elapsed=clock.stop())
    write_json(config.out / "result.json", _content(config, outcome, default))
    if config.plots:
        _draw(config, outcome)
        clock.lap("figures")
        outcome = dataclasses.replace(outcome, elapsed=clock.stop())
    page.write(config, outcome)
    _report(config, outcome, say)
    return outcome


def _report(config: PaperConfig, outcome: Outcome, say) -> None:
    say("\n" + tables.statement_table(outcome.findings) + "\n" + tables.CHOSEN)
    stiff, rigid = outcome.stiff, outcome.rigid
    say(
        f"\nnormal approach speed {stiff.speed[0]:.2f} m/s at R = {config.distance:g} m, "
        f"{stiff.tip_speed[0]:.2f} m/s at the tip itself\n"
        f"N_stiff = {stiff.peak[0]:.0f} N against a rigid obstacle\n"
        f"{rigid.peak_force[0]:.0f} N by an undeformable fence in the same sort, belt and friction "
        "included"
    )
    if outcome.variants:
        say("\nthe numbers that the paper leaves open, one at a time (maps on the coarse grid):")
        say(tables.dependence_table(outcome.coarse, outcome.variants))
    say(f"\nwrote {config.out} ({outcome.elapsed['total']:.1f} s in all)")


def _maps(config: PaperConfig, cases: list[Case], fidelity, say) -> tuple[Maps, list[Maps]]:
    """The fine maps of the default, and coarse ones of every setting."""

    def progress(done: int, total: int, left: float) -> None:
        say(f"  {done:6d} of {total} impacts, {left:5.1f} s left")

    masses = np.linspace(*config.masses, config.grid)
    places = np.linspace(*config.distances, config.grid)
    (fine,) = maps.sweep(
        cases[:1], masses, places, fidelity, chunk=config.chunk, progress=progress
    )
    counts = ", ".join(f"{name} {number}" for name, number in fine.counts().items())
    say(f"  statuses: {counts}")
    coarse = maps.sweep(
        cases,
        np.linspace(*config.masses, config.coarse_grid),
        np.linspace(config.distances[0], min(1.08, config.distances[1]), config.coarse_grid),
        fidelity,
        chunk=config.chunk,
        progress=progress if config.open_numbers else None,
    )
    return fine, coarse


def _draw(config: PaperConfig, outcome: Outcome) -> None:
    parcel = fj.Parcel()
    slide = lane(outcome.rigid, slice(1, 2))
    drawn = {
        "figure_08_impact": figures.cycle_figure(outcome.impact, parcel, outcome.stiff, None),
        "figure_09_force": figures.map_figure(outcome.maps, "force"),
        "figure_10_tip": figures.map_figure(outcome.maps, "tip"),
        "figure_11_slide": figures.cycle_figure(outcome.slide, parcel, None, slide),
        "sensitivities": figures.sensitivity_figure(outcome.sensitivities),
    }
    figures.save(drawn, config.out)


def _sort_numbers(cycle: Cycle) -> dict[str, dict[str, Any]]:
    """The numbers of a sort by fence [SI]."""
    numbers = {}
    for index, name in enumerate(NAMES):
        one = lane(cycle, index)
        first, last = first_and_last(one)
        numbers[name] = {
            "peak_force": float(one.peak_force),
            "tip_deflection": float(one.tip_deflection),
            "status": fj.Status(int(one.status)).name,
            "contacts": cycles.contacts(one),
            "point_1": {"time": one.time[first], "x": one.x[first], "y": one.y[first]},
            "point_2": {"time": one.time[last], "x": one.x[last], "y": one.y[last]},
            "end_of_cycle": {"x": one.x[-1], "y": one.y[-1], "angle": one.angle[-1]},
        }
    return numbers


def _plain_findings(findings: list[Finding]) -> list[dict]:
    return [dataclasses.asdict(finding) for finding in findings]


def _content(config: PaperConfig, outcome: Outcome, default: Setting) -> dict[str, Any]:
    drawn, slopes = outcome.maps, outcome.sensitivities
    return {
        "config": dataclasses.asdict(config),
        "setting": dataclasses.asdict(default),
        "fences": list(NAMES),
        "agrees": outcome.agrees,
        "statements": _plain_findings(outcome.findings),
        "impact": _sort_numbers(outcome.impact),
        "slide": _sort_numbers(outcome.slide),
        "rigid_obstacle": {
            "approach_speed": outcome.stiff.speed[0],
            "approach_speed_at_the_tip": outcome.stiff.tip_speed[0],
            "peak_force": outcome.stiff.peak[0],
        },
        "undeformable_fence": {
            "impact_peak_force": outcome.rigid.peak_force[0],
            "slide_peak_force": outcome.rigid.peak_force[1],
        },
        "maps": {**drawn._asdict(), "statuses": drawn.counts()},
        "sensitivities": {"variables": list(VARIABLES), **slopes._asdict()},
        "open_numbers": {
            "default": _plain_findings(outcome.coarse),
            "variants": [
                {
                    "number": variant.title,
                    "value": variant.label,
                    "changes": variant.changes,
                    "verdicts_changed": tables.changes(outcome.coarse, findings),
                    "statements": _plain_findings(findings),
                }
                for variant, findings in outcome.variants
            ],
        },
        "elapsed": outcome.elapsed,
    }


def run():
    """The job from the command line."""
    command.run("reproduce_paper", configure, main, succeeded=lambda outcome: outcome.agrees)
