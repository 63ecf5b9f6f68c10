"""The front of the worst peak force against what it costs.

    python -m optimize.pareto --against tip_deflection --out out

The peak force trades off against the tip's deflection, the cycle time, the fence's mass or the
drive's torque. The job steps a limit on one of these quantities and minimises the worst peak force
over several parcels, under the other limits. The result is the front with the design of every
point, each measured again at the reference fidelity, and a bound that no fence can beat: the stop
at a constant force, 1/2 m v_n^2 / travel.

The cycle time is the shortest time from parcel to parcel. The spacing of the parcels along the
belt, front to front, is the belt's speed times the cycle time, and 3600 s over it is the number of
parcels an hour.

Every evaluation is written to `evaluations.jsonl` at once: the same command with the same folder
resumes an interrupted job.
"""

import dataclasses
import time

import numpy as np

from fencejax.design import Stop
from fencejax.plot import non_dominated

from ..common import command, designs, evaluations, nearby
from ..common.report import ended, failed_start, verified, write_json
from . import figures, page
from .configuration import ParetoConfig, configure
from .constant_force import blows
from .outcome import Front
from .problem import Tradeoff
from .trace import Point, Tracer


def _good(points: list[Point]) -> np.ndarray:
    """Which points are feasible and not dominated by another feasible one."""
    feasible = np.array([p.optimum.feasible for p in points])
    force = np.where(feasible, [p.force for p in points], np.inf)
    other = np.where(feasible, [p.other for p in points], np.inf)
    return feasible & non_dominated(np.column_stack([force, other]))


def _least_force(tradeoff: Tradeoff, point: Point) -> float:
    """The largest value over the encounters of 1/2 m v_n^2 / travel [N]; the travel is the tip's
    deflection plus the parcel's indentation in the encounter itself."""
    lanes = point.found.lanes
    travel = lanes["tip_deflection"] + lanes["indentation"]
    every = blows(tradeoff, point.optimum.point)
    return max(b.least_force(float(s)) for b, s in zip(every, travel, strict=True))


def _row(tradeoff: Tradeoff, point: Point, good: bool, least: float | None) -> dict:
    optimum, space = point.optimum, tradeoff.space
    row = {
        "design": space.named(point.values),
        "on_bounds": designs.on_bounds(space, point.values),
        "peak_force": point.force,
        tradeoff.quantity.name: point.other,
        "bound": point.bound,
        "on_front": good,
        "constant_force_bound": least,
        **ended(optimum),
        "sound": point.sound,
        "smallest_margin": float(np.min(optimum.margins)),
        "statuses": point.found.statuses,
        "measured": point.found.lanes,
    }
    if tradeoff.quantity.name == "cycle_time":
        row["spacing"] = float(tradeoff.belt.speed) * point.other
        row["parcels_an_hour"] = 3600 / point.other
    if point.verified is not None and point.finer is not None:
        row["verified"] = verified(tradeoff.config.verify, point.verified) | {
            "peak_force": point.finer.force,
            tradeoff.quantity.name: point.finer.other,
            "statuses": point.finer.statuses,
        }
    return row


def main(config: ParetoConfig | None = None, *, quiet: bool = False) -> Front:
    """Run the job, print its progress, and write its files into `config.out`."""
    say = command.begin(quiet)
    begin = time.perf_counter()
    config = ParetoConfig() if config is None else config
    tradeoff = Tradeoff(config)
    tradeoff.check()
    config.out.mkdir(parents=True, exist_ok=True)
    journal = evaluations.journal(config, say)
    for line in config.notes:
        say(line)
    say(
        f"peak force against {config.against.replace('_', ' ')}: {tradeoff.encounters.lanes} "
        f"{config.kind}, variables {', '.join(tradeoff.space.names)}"
    )

    def keep(points):
        write(points, None)

    def write(points, least):
        good = _good(points)
        bounds = [None] * len(points) if least is None else list(least)
        content = {
            "config": dataclasses.asdict(config),
            "quantity": {"name": tradeoff.quantity.name, "unit": tradeoff.quantity.unit},
            "encounters": [tradeoff.encounters.named(i) for i in range(tradeoff.encounters.lanes)],
            "complete": least is not None,
            "evaluations": tracer.evaluations,
            "recalled": journal.recalled,
            "elapsed": time.perf_counter() - begin,
            "start": {
                "design": tradeoff.space.named(tradeoff.space.from_shares(tradeoff.start)),
                "peak_force": tracer.start.force,
                tradeoff.quantity.name: tracer.start.other,
            },
            "points": [
                _row(tradeoff, p, bool(g), b) for p, g, b in zip(points, good, bounds, strict=True)
            ],
        }
        fresh = config.out / "front.json.new"
        write_json(fresh, content)
        fresh.replace(config.out / "front.json")

    tracer = Tracer(tradeoff, journal, say, keep)
    points = tracer.run()
    points.sort(key=lambda p: p.other)
    least = np.array([_least_force(tradeoff, point) for point in points])
    write(points, least)
    front = Front(
        config, tradeoff, points, _good(points), least, tracer.evaluations,
        time.perf_counter() - begin,
    )  # fmt: skip
    if front.knee is not None:
        stiff = tradeoff.stiff(points[front.knee].optimum.point)
        front = dataclasses.replace(front, stiff=stiff)
    if config.plots:
        figures.front(tradeoff, points, front.on_front, least, tracer.start, config.out)
        figures.designs(tradeoff, points, front.on_front, config.out)
    page.write(front, _verdict(front, tracer), tracer.unit)
    say("\n" + _verdict(front, tracer))
    if front.knee is not None:
        point = points[front.knee]
        rows = page.rows(front, point, tracer.unit)
        say("\n" + nearby.price_text(tradeoff.space, point.optimum, rows, "N"))
        say("\n" + page.mine(front))
    say(f"wrote {config.out} ({front.elapsed:.1f} s in all)")
    return front


def _verdict(front: Front, tracer: Tracer) -> str:
    points, name = front.points, front.tradeoff.quantity.name.replace("_", " ")
    kept = [i for i, good in enumerate(front.on_front) if good]
    if tracer.ends[0].stop is Stop.FAILED_START:
        return failed_start(front.tradeoff.encounters.text, tracer.start.lanes["status"])
    if not all(end.feasible for end in tracer.ends):
        worst = max(tracer.ends, key=lambda end: end.residual.violation)
        return (
            "no feasible design found: the least-violating one breaks a limit by "
            f"{100 * worst.residual.violation:.3g} %. Relax that limit or widen the bounds."
        )
    if len(kept) < 2:
        return (
            f"no front: one point beats all others in force and {name}. Either both fall together "
            "here, or the first search ended too high: give more --starts"
        )
    ratios = [points[i].force / front.least_force[i] for i in kept]
    sound = sum(points[i].sound for i in kept)
    exact = sum(points[i].optimum.converged for i in kept)
    return (
        f"{len(kept)} points on the front, {len(points) - len(kept)} left out; {sound} sought to "
        f"the end and confirmed, {exact} of all shown to be optimal; {front.evaluations} "
        "evaluations\n"
        f"peak force {min(ratios):.2f} to {max(ratios):.2f} times that of a constant-force stop "
        "over the same travel"
    )


def run():
    """The job from the command line."""
    command.run("pareto", configure, main, stopped=command.RESUMED)
