"""Speed and accuracy of the fidelities, and what each part of a scene costs. Skipped unless
`pytest --bench DIR` asks for it.

Writes `speed.json` and `speed.txt` into DIR: medians over repeats, the least of several rounds;
errors against `Fidelity.reference()` over sixteen impacts of different distance, mass and drive
angle; `parts.md`: state, operations and times from the rigid wall to the whole sort; and
`groups.json`: random impacts in groups as they come, and in the order of their contacts' lengths.
"""

import json
import time

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fencejax as fj
from fencejax.simulate import prepared
from fencejax.study import in_groups

pytestmark = pytest.mark.bench

START = jnp.array([0.045, 3.0e9, 1130.0, 0.05, 0.132, 0.45, 0.75, 1.53])
ROUNDS = 7
FIDELITIES = {
    "coarse": fj.Fidelity.coarse(),
    "fast": fj.Fidelity.fast(),
    "standard": fj.Fidelity.standard(),
    "reference": fj.Fidelity.reference(),
}


def peak(fidelity, x, distance=1.0, mass=15.0, angle=0.30):
    """Peak force in eight design variables."""
    material = fj.Material(x[1], x[2], x[3])
    fence = fj.Fence(x[5], x[6], x[4], x[0], material)
    scene = fj.scenes.oblique_impact(
        fence=fence,
        distance=distance,
        drive_angle=angle,
        parcel=fj.Parcel(mass=mass),
        drive=fj.HarmonicDrive(top_speed=x[7]),
        duration=0.13,
    )
    return fj.simulate(scene, fidelity=fidelity, history=False).peak_force


def compiled(function, *arguments):
    start = time.perf_counter()
    program = jax.jit(function).lower(*arguments).compile()
    return program, time.perf_counter() - start


def median_time(program, *arguments, repeats=15):
    jax.block_until_ready(program(*arguments))
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(program(*arguments))
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def sixteen():
    rng = np.random.default_rng(1)
    distance = rng.uniform(0.65, 1.06, 16)
    mass = np.exp(rng.uniform(np.log(2), np.log(25), 16))
    return jnp.asarray(distance), jnp.asarray(mass), jnp.asarray(rng.uniform(0.2, 0.4, 16))


def elasticities(fidelity):
    function = jax.value_and_grad(lambda x, *case: peak(fidelity, x, *case))
    value, gradient = jax.jit(jax.vmap(function, in_axes=(None, 0, 0, 0)))(START, *sixteen())
    return np.asarray(value), np.asarray(gradient) * np.asarray(START) / np.asarray(value)[:, None]


def in_rounds(programs):
    """Medians (rounds, programs) [s] by name, of which the least counts: other programs on the
    machine add to a time, for seconds and minutes, and nothing takes from it."""
    medians = {name: [] for name in programs}
    for _ in range(ROUNDS):
        for name, several in programs.items():
            medians[name].append([
                median_time(program, given, repeats=15 if lanes == 1 else 3)
                for _, program, given, lanes in several
            ])  # fmt: skip
    return {name: np.array(rows) for name, rows in medians.items()}


def spread():
    """4,096 designs about the start."""
    shares = np.random.default_rng(0).uniform(0.95, 1.05, (4096, START.size))
    return START[None] * jnp.asarray(shares)


def timed(name, fidelity):
    """Programs of a fidelity: title, program, argument, lanes in it; and its row so far."""
    one = lambda x: peak(fidelity, x)  # noqa: E731
    both, row = jax.value_and_grad(one), {"fidelity": name}
    value, row["compile value [s]"] = compiled(one, START)
    gradient, row["compile gradient [s]"] = compiled(both, START)
    programs = [("value [ms]", value, START, 1), ("gradient [ms]", gradient, START, 1)]
    if name != "reference":
        # One after the other in groups: as many as fill the processor's vectors and caches.
        grouped = (("values", one, 64, 4096), ("gradients", both, 16, 512))
        for kind, function, group, lanes in grouped:
            batch = spread()[:lanes]
            program, _ = compiled(
                lambda b, f=function, n=group: jax.lax.map(f, b, batch_size=n), batch
            )
            programs.append((f"{kind}/s on one core", program, batch, lanes))
    return programs, row


def test_speed(bench_directory):
    truth, slopes = elasticities(FIDELITIES["reference"])
    prepared = {name: timed(name, fidelity) for name, fidelity in FIDELITIES.items()}
    medians = in_rounds({name: programs for name, (programs, _) in prepared.items()})
    rows = []
    for name, (programs, row) in prepared.items():
        rounds = medians[name]
        least = rounds.min(axis=0)
        for (title, _, _, lanes), seconds in zip(programs, least, strict=True):
            row[title] = 1e3 * seconds if lanes == 1 else lanes / seconds
        row["gradient / value"] = row["gradient [ms]"] / row["value [ms]"]
        row["median round over the least"] = float(np.max(np.median(rounds, axis=0) / least))
        if name != "reference":
            value, gradient = elasticities(FIDELITIES[name])
            row["value error, largest"] = float(np.max(np.abs(value / truth - 1)))
            size = np.linalg.norm(slopes, axis=1)
            error = np.linalg.norm(gradient - slopes, axis=1) / size
            row["gradient error, largest"] = float(np.max(error))
        rows.append(row)
        print(row, flush=True)
    (bench_directory / "speed.json").write_text(json.dumps(rows, indent=1) + "\n")
    keys = list(dict.fromkeys(key for row in rows for key in row))
    lines = [
        f"{key:>28}" + "".join(
            f"{row.get(key, ''):>14.4g}" if isinstance(row.get(key), float)
            else f"{row.get(key, ''):>14}"
            for row in rows
        )
        for key in keys
    ]
    (bench_directory / "speed.txt").write_text("\n".join(lines) + "\n")
    assert all(row["value [ms]"] > 0 for row in rows)


CORNERS = {"fence_corners": (1, 2, 3, 4), "border_corners": (1, 2, 3, 4)}
STILL = {"belt": None, "fence_friction": None, "velocity": (2.0, 0.0, 0.0)}
RIGID = fj.Fidelity(modes=0, geometry="small")
SCENES = {
    "rigid wall": (lambda m: fj.scenes.rigid_wall(parcel=parcel(m)), fj.Fidelity()),
    "fence held still, normal direction": (
        lambda m: fj.scenes.normal_impact(fence=fj.Fence(), parcel=parcel(m)), fj.Fidelity()
    ),
    "parcel on the belt": (
        lambda m: fj.scenes.free_motion(parcel=parcel(m), duration=0.13), fj.Fidelity()
    ),
    "rigid fence swings, no belt, no friction": (
        lambda m: impact(m, **STILL), RIGID
    ),
    "flexible fence": (lambda m: impact(m, **STILL), fj.Fidelity()),
    "with the belt": (lambda m: impact(m, fence_friction=None), fj.Fidelity()),
    "oblique impact: with friction at the fence": (lambda m: impact(m), fj.Fidelity()),
    "two corners at the fence": (
        lambda m: fj.scenes.along_fence(parcel=parcel(m), duration=0.13), fj.Fidelity()
    ),
    "whole sort of 1.36 s, 2 + 2 corners": (
        lambda m: fj.scenes.whole_sort(parcel=parcel(m)), fj.Fidelity()
    ),
    "whole sort, 4 + 4 corners": (
        lambda m: fj.scenes.whole_sort(parcel=parcel(m), **CORNERS), fj.Fidelity()
    ),
}


def parcel(mass):
    return fj.Parcel(mass=mass)


def impact(mass, **parts):
    return fj.scenes.oblique_impact(parcel=parcel(mass), duration=0.13, **parts)


def state_size(scene, fidelity):
    """Numbers carried from step to step."""
    if isinstance(scene, fj.NormalScene):
        return None
    memory = jax.eval_shape(lambda: prepared(scene, fidelity))[2]
    return sum(leaf.size for leaf in jax.tree.leaves(memory))


def test_parts(bench_directory):
    """What a scene does not hold costs nothing."""
    masses = jnp.asarray(np.random.default_rng(0).uniform(5, 20, 64))
    rows = [
        "| scene, 0.13 s unless said | state | operations | one [ms] | a lane of 64 [ms] |",
        "| --- | --- | --- | --- | --- |",
    ]
    programs, counts = {}, {}
    for name, (make, fidelity) in SCENES.items():
        def run(mass, make=make, fidelity=fidelity):
            result = fj.simulate(make(mass), fidelity=fidelity, only=["peak_force", "final"])
            return result.peak_force, result.final

        program, _ = compiled(run, 15.0)
        counts[name] = program.as_text().count(" = ")
        batch, _ = compiled(jax.vmap(run), masses)
        programs[name] = [("one", program, jnp.asarray(15.0), 1), ("batch", batch, masses, 64)]
    for name, times in in_rounds(programs).items():
        one, batch = 1e3 * times.min(axis=0)
        make, fidelity = SCENES[name]
        size = state_size(make(15.0), fidelity)
        shown = "" if size is None else size
        rows.append(f"| {name} | {shown} | {counts[name]} | {one:.3f} | {batch / 64:.4f} |")
        print(rows[-1], flush=True)
    (bench_directory / "parts.md").write_text("\n".join(rows) + "\n")
    number = list(counts.values())
    assert number[0] < number[1] < number[4] < number[6] < number[-1]


def test_groups(bench_directory):
    """A group's lanes wait for the longest of them: what their order is worth."""
    rng, lanes = np.random.default_rng(0), 4096
    numbers = jnp.asarray(np.stack([rng.uniform(1, 25, lanes), rng.uniform(0.5, 1.1, lanes)], 1))

    def scene(lane):
        return impact(lane[0], distance=lane[1])

    def force(lane):
        return fj.simulate(scene(lane), only="peak_force").peak_force

    # Without a place of touch there is no length, and lanes stay as they come.
    orders = {"as they come": lambda _: fj.scenes.whole_sort(), "by length": scene}
    programs = {
        name: jax.jit(lambda x, n, of=of: in_groups(jax.vmap(force), x, 64, n, of))
        for name, of in orders.items()
    }
    count, rows, forces = np.int32(lanes), {}, {}
    for name, program in programs.items():
        forces[name] = np.asarray(program(numbers, count))
    # In turn, by processor time, which other programs on the machine disturb least.
    times = {name: [] for name in programs}
    for _ in range(5):
        for name, program in programs.items():
            begin = time.process_time()
            jax.block_until_ready(program(numbers, count))
            times[name].append(time.process_time() - begin)
    rows = {name: {"impacts/s on one core": lanes / np.median(t)} for name, t in times.items()}
    print(rows, flush=True)
    (bench_directory / "groups.json").write_text(json.dumps(rows, indent=1) + "\n")
    # The order changes no number.
    np.testing.assert_array_equal(*forces.values())
