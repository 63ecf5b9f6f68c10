"""The points of the ladder: named rungs, each knob by itself, and a product grid."""

import dataclasses
import itertools
from typing import Any

import fencejax as fj


@dataclasses.dataclass(frozen=True)
class Point:
    """One knob changed from the base: `label` is its value in words, `size` the abscissa in
    figures."""

    knob: str
    label: str
    size: float
    fidelity: fj.Fidelity


@dataclasses.dataclass(frozen=True)
class Ladder:
    """All fidelities that are run.

    **Fields:**

    - `truth`: the reference of all total errors; `check` the same with half its step.
    - `base`: the finely converged setting in which one knob at a time is changed.
    - `rungs`: by name.
    - `knobs`: by name; the last point of each is the finest, the reference of its effect.
    - `grid`: the product grid, each point with those points of the knobs that it combines.
    """

    truth: fj.Fidelity
    check: fj.Fidelity
    base: fj.Fidelity
    rungs: dict[str, fj.Fidelity]
    knobs: dict[str, tuple[Point, ...]]
    grid: dict[fj.Fidelity, tuple[fj.Fidelity, ...]]


def smoothed(slip_speed: float) -> dict[str, Any]:
    """Smoothing of friction over `slip_speed` [m/s], static_speed fifty times that, as in the named
    settings."""
    return {"slip_speed": slip_speed, "static_speed": 50 * slip_speed}


def _knob(name: str, base: fj.Fidelity, points) -> tuple[Point, ...]:
    return tuple(
        Point(name, label, float(size), base.replace(**changes)) for label, size, changes in points
    )


def _steps(base: fj.Fidelity, steps) -> tuple[Point, ...]:
    return _knob("step", base, [(f"{1e3 * h:g} ms", h, {"step": h}) for h in steps])


def _slips(base: fj.Fidelity, slips) -> tuple[Point, ...]:
    return _knob("slip_speed", base, [(f"{e:g} m/s", e, smoothed(e)) for e in slips])


def _tolerances(base: fj.Fidelity, tolerances) -> tuple[Point, ...]:
    """Points with a step tolerance: error-controlled steps of 1 ms, doubled or shortened as the
    error allows; the finest point has fixed steps of a quarter of the base's."""
    points = [
        (f"{t:g}", t, {"step": 1e-3, "longest_stride": 2, "step_tolerance": t}) for t in tolerances
    ]
    finest = base.step / 4
    return _knob("step_tolerance", base, [*points, (f"{1e3 * finest:g} ms", 0, {"step": finest})])


def _modes(base: fj.Fidelity, counts, **changes) -> list[tuple[str, float, dict[str, Any]]]:
    every = 2 * base.elements
    return [
        ("all" if n is None else str(n), every if n is None else n, {"modes": n, **changes})
        for n in counts
    ]


def full() -> Ladder:
    """The ladder of the default run."""
    return _ladder(
        modes=(1, 2, 3, 4, 6, 8, None), bare_modes=(1, 4), elements=(10, 20),
        slips=(1e-2, 2e-3, 5e-4, 1e-4, 1e-5),
        steps=(2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5), fades=(5e-3, 1e-3),
        tolerances=(3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4),
    )  # fmt: skip


def dense() -> Ladder:
    """The same with more points a knob, in about half as long again."""
    return _ladder(
        modes=(0, 1, 2, 3, 4, 6, 8, 12, None), bare_modes=(1, 2, 4, 8), elements=(10, 20, 40),
        slips=(1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 1e-4, 1e-5),
        steps=(4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5, 3.125e-5),
        fades=(2e-2, 5e-3, 1e-3), tolerances=(1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4),
    )  # fmt: skip


def _ladder(modes, bare_modes, elements, slips, steps, fades, tolerances) -> Ladder:
    truth = fj.Fidelity(
        modes=12, geometry="chord", step=1.25e-5, step_tolerance=None, longest_stride=1,
        iterations=20, **smoothed(1e-5),
    )  # fmt: skip
    base = fj.Fidelity(
        modes=8, geometry="chord", step=6.25e-5, step_tolerance=None, longest_stride=1,
        iterations=20,
    )  # fmt: skip
    names = "coarse", "fast", "standard", "reference"
    rungs = {name: getattr(fj.Fidelity, name)() for name in names}
    bare = {"static_correction": False}
    knobs = {
        "modes": _knob("modes", base, _modes(base, modes)),
        "modes, no static correction": _knob(
            "modes, no static correction",
            base,
            _modes(base, bare_modes, **bare) + _modes(base, (None,)),
        ),
        "elements": _knob("elements", base, [(str(n), n, {"elements": n}) for n in elements]),
        "geometry": _knob(
            "geometry", base,
            [(g, k, {"geometry": g}) for k, g in enumerate(("small", "arc", "chord"))],
        ),
        "load": _knob(
            "load", base, [(g, k, {"load": g}) for k, g in enumerate(("shared", "consistent"))]
        ),
        "slip_speed": _slips(base, slips),
        "step": _steps(base, steps),
        "step_tolerance": _tolerances(base, tolerances),
        "longest_stride": _knob(
            "longest_stride", base,
            [(f"{n}", n * base.step, {"longest_stride": n}) for n in (32, 8, 1)],
        ),
        "tip_fade": _knob(
            "tip_fade", base,
            [(f"{1e3 * d:g} mm", d, {"tip_fade": d}) for d in fades],
        ),
        # Single precision does not allow the short steps of the other knobs.
        "precision": _knob(
            "precision", base.replace(step=2.5e-4),
            [("float32", 32, {"precision": "float32"}), ("float64", 64, {})],
        ),
    }  # fmt: skip
    return Ladder(
        truth, truth.replace(step=truth.step / 2), base, rungs, knobs,
        _grid(base, (1, 2, 3, 4, 6), (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4),
              (2e-3, 5e-4, 1e-4), ("small", "arc")),
    )  # fmt: skip


def quick() -> Ladder:
    """A small ladder around `fast` and `standard`."""
    truth = fj.Fidelity(
        modes=8, geometry="chord", step=1e-4, step_tolerance=None, longest_stride=1, iterations=20,
        **smoothed(2e-5),
    )  # fmt: skip
    base = fj.Fidelity(step=2.5e-4, step_tolerance=None)
    knobs = {
        "modes": _knob("modes", base, _modes(base, (1, 4))),
        "step": _steps(base, (1e-3, 2.5e-4)),
    }
    rungs = {"fast": fj.Fidelity.fast(), "standard": fj.Fidelity.standard()}
    return Ladder(truth, truth, base, rungs, knobs, {})


def integrators(everything: bool = False) -> dict[str, fj.Fidelity]:
    """The package's own integrator and diffrax's general ones on the same equations, four modes
    without static correction; the last one is the most exact. Kvaerno5, which takes minutes to
    compile and run, is there only with `everything`."""
    bare = fj.Fidelity(
        modes=4, static_correction=False, geometry="chord", step=1.25e-4, step_tolerance=None
    )
    fine = bare.replace(step=1.5625e-5)
    implicit = {"kvaerno5": fine.replace(integrator="kvaerno5")} if everything else {}
    return {
        "modal, 0.125 ms": bare,
        "modal, 0.0156 ms": fine,
        **implicit,
        "tsit5": fine.replace(integrator="tsit5"),
    }


def _grid(base: fj.Fidelity, modes, steps, slips, geometries):
    grid = {}
    for n, step, slip, geometry in itertools.product(modes, steps, slips, geometries):
        made = fj.Fidelity(
            modes=n, step=step, step_tolerance=None, geometry=geometry, **smoothed(slip)
        )
        grid[made] = (
            base.replace(modes=n),
            base.replace(step=step),
            base.replace(**smoothed(slip)),
            base.replace(geometry=geometry),
        )
    return grid
