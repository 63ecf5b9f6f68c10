"""The measurement as text (markdown) and as plain numbers (JSON)."""

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from fencejax.study import describe

from .cases import QUANTITIES, RANGES, TITLES, VARIABLES
from .errors import Errors, Outcome, spread, summary
from .orders import observed

if TYPE_CHECKING:
    from .findings import Report, Rung


def percent(share: float) -> str:
    """An error as a percentage of two digits."""
    if not np.isfinite(share):
        return "--"
    return f"{100 * share:.0f} %" if share >= 0.995 else f"{100 * share:.2g} %"


def _rows(heads: list[str], rows: list[list[str]]) -> str:
    lines = ["| " + " | ".join(heads) + " |", "| " + " | ".join("---" for _ in heads) + " |"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def _three(errors: np.ndarray | None) -> str:
    if errors is None:
        return ""
    return " / ".join(percent(e) for e in spread(errors).values())


def _milliseconds(times) -> str:
    if times is None:
        return ""
    if isinstance(times, dict):
        median, low, high = times["median"], times["low"], times["high"]
    else:
        median, low, high = times.median, times.low, times.high
    return f"{1e3 * median:.3g} ms ({1e3 * low:.3g}-{1e3 * high:.3g})"


def _megabytes(count: float | None) -> str:
    return "" if count is None else f"{count / 2**20:.3g} MiB"


def rung_table(report: "Report") -> str:
    """Errors of the named rungs over all impacts: median / 95 % / worst."""
    heads = ["", *(rung.name for rung in report.rungs)]
    rows = [["knobs", *(describe(rung.fidelity) for rung in report.rungs)]]
    for k, title in enumerate(TITLES):
        rows.append([title, *(_three(r.errors.value[:, k]) for r in report.rungs)])
    for k, title in enumerate(TITLES):
        cells = []
        for rung in report.rungs:
            assert rung.errors.gradient is not None
            cells.append(_three(rung.errors.gradient[:, k]))
        rows.append([f"gradient of the {title}", *cells])
    for k, part in enumerate(("discretisation", "smoothing of friction") if report.split else ()):
        found = [report.split.get(rung.name) for rung in report.rungs]
        cells = ["" if pair is None else _value_and_gradient(pair[k]) for pair in found]
        rows.append([f"{part} alone, peak force: value; gradient (95 %)", *cells])
    return _rows(heads, rows)


def _value_and_gradient(errors: Errors) -> str:
    value = percent(spread(errors.value[:, 0])["95 %"])
    if errors.gradient is None:
        return value
    return f"{value}; {percent(spread(errors.gradient[:, 0])['95 %'])}"


def component_table(report: "Report") -> str:
    """95 % quantile of each component's error in the peak force's gradient: of the gradient's norm,
    and of the component itself."""
    rows = []
    for j, name in enumerate(VARIABLES):
        cells = [name.replace("_", " ")]
        for rung in report.rungs:
            assert rung.errors.component is not None
            assert rung.errors.own is not None
            norm = percent(spread(rung.errors.component[:, 0, j])["95 %"])
            cells.append(f"{norm}; {percent(spread(rung.errors.own[:, 0, j])['95 %'])}")
        rows.append(cells)
    return _rows(["d ln N / d ln p", *(rung.name for rung in report.rungs)], rows)


def cost_table(report: "Report") -> str:
    """The costs of the named rungs: median (10-90 %)."""
    rows: list[list[str]] = []
    for lanes in sorted({n for rung in report.rungs for n in rung.value_times}):
        row = [f"value, per lane of {lanes}"]
        row += [_milliseconds(rung.value_times.get(lanes)) for rung in report.rungs]
        rows.append(row)
    lanes = len(report.truth.values)
    gradient = [_milliseconds(rung.gradient_time) for rung in report.rungs]
    rows.append([f"with gradients of three quantities, per lane of {lanes}", *gradient])
    memory = [_megabytes(rung.memory) for rung in report.rungs]
    rows.append([f"intermediate arrays of the gradient, {lanes} lanes", *memory])
    if any(rung.cold for rung in report.rungs):
        for kind, title in (("value", "one value"), ("gradient", "one value with its gradient")):
            owns = [(rung.cold or {}).get(kind, {}) for rung in report.rungs]
            rows.append([title, *(_milliseconds(own.get("run")) for own in owns)])
            for key, part in (
                ("compile [s]", "tracing and compiling, cold"),
                ("trace [s]", "of this, tracing"),
                ("cached compile [s]", "tracing and compiling, from the cache"),
            ):
                cells = [f"{own[key]:.1f} s" if own else "" for own in owns]
                rows.append([f"{title}: {part}", *cells])
            cells = [_megabytes(own.get("peak resident [B]")) for own in owns]
            rows.append([f"{title}: peak resident memory of the process", *cells])
    return _rows(["", *(rung.name for rung in report.rungs)], rows)


def knob_table(report: "Report") -> str:
    """Each knob's own effect over the first impacts: median / 95 % of value and gradient."""
    rows = []
    for points in report.knobs.values():
        for point, errors in points:
            row = [point.knob, point.label]
            for k in range(len(QUANTITIES)):
                value = spread(errors.value[:, k])
                row.append(f"{percent(value['median'])} / {percent(value['95 %'])}")
            for k in range(len(QUANTITIES)):
                assert errors.gradient is not None
                slope = spread(errors.gradient[:, k])
                row.append(f"{percent(slope['median'])} / {percent(slope['95 %'])}")
            rows.append(row)
    gradients = [f"gradient of the {title}" for title in TITLES]
    return _rows(["knob", "at", *TITLES, *gradients], rows)


def front_table(report: "Report", kind: str) -> str:
    """The measured front of `"value"` or `"gradient"`."""
    lanes, rows = len(report.truth.values), []
    for rung in report.front(kind):
        assert rung.errors.gradient is not None
        rows.append([
            f"**{rung.name}**" if rung.named else rung.name,
            f"{1e3 * rung.value_times[lanes].median:.3g}",
            f"{1e3 * rung.gradient_time.median:.3g}",
            _three(rung.errors.value[:, 0]),
            _three(rung.errors.gradient[:, 0]),
        ])  # fmt: skip
    heads = ["point", f"value, ms a lane of {lanes}", "with gradient, ms a lane"]
    return _rows([*heads, "error of the peak force", "of its gradient"], rows)


def stage_table(report: "Report") -> str:
    """Errors of the named rungs in slide and whole sorts: value; gradient."""
    rows = []
    for stage, found in report.stages.items():
        for k, title in enumerate(TITLES):
            cells = [stage, title]
            for rung in report.rungs:
                errors = found.get(rung.name)
                if errors is None or errors.gradient is None:
                    cells.append("")
                    continue
                value, gradient = errors.value[:, k], errors.gradient[:, k]
                show = _three if len(value) > 1 else lambda one: percent(one[0])
                cells.append(f"{show(value)}; {show(gradient)}")
            rows.append(cells)
    return _rows(["scene", "quantity", *(rung.name for rung in report.rungs)], rows)


def step_orders(report: "Report") -> dict[str, dict[str, Any]]:
    """Observed orders through the contact of oblique impacts: of the median error over the
    scenes, by quantity, between neighbouring steps."""
    points = report.knobs.get("step", [])
    steps = [point.size for point, _ in points]
    found: dict[str, dict[str, Any]] = {}
    for kind in ("value", "gradient"):
        for k, title in enumerate(TITLES):
            row = [spread(getattr(errors, kind)[:, k])["median"] for _, errors in points]
            found[f"{title}, {kind}"] = {
                "steps [s]": steps, "errors": row, "orders": observed(steps, row).tolist()
            }  # fmt: skip
    return found


def order_table(report: "Report") -> str:
    """Observed orders between neighbouring steps, the coarsest first."""
    rows = [
        [segment, kind, ", ".join(f"{p:.1f}" for p in row["orders"])]
        for segment, kinds in report.orders.items()
        for kind, row in kinds.items()
    ]
    if len(report.knobs.get("step", [])) > 1:
        rows += [
            ["oblique impacts, through the contact", name,
             ", ".join(f"{p:.1f}" for p in row["orders"])]
            for name, row in step_orders(report).items()
        ]  # fmt: skip
    return _rows(["segment", "of", "order between neighbouring steps"], rows)


def superposition(report: "Report") -> float | None:
    """Largest factor [1] between an error predicted by adding effects up and the measured one, of
    peak force and gradient over the measured points of the grid."""
    factors = []
    for rung in report.grid:
        for k, kind in enumerate(("value", "gradient")):
            measured, given = rung.error(kind), report.predicted[rung.fidelity][k]
            if 0 < measured < np.inf and 0 < given < np.inf:
                factors.append(max(measured / given, given / measured))
    return max(factors) if factors else None


def document(report: "Report") -> str:
    """All tables, as markdown."""
    count, config = len(report.truth.values), report.config
    sound = int(report.truth.sound.sum())
    ranges = ", ".join(f"{k.replace('_', ' ')} {a:g}-{b:g}" for k, (a, b, _) in RANGES.items())
    parts = [
        "# Speed against accuracy",
        f"{count} oblique impacts of {config.duration:g} s: the paper's at R = 1.0 m and "
        f"{count - 1} random ones, seed {config.seed} ({ranges}; SI units). {count - sound} left "
        "out for a deflection beyond the linear beam or another unsound status. Gradients are "
        "elasticities in eight variables, their error relative to the gradient's norm. Errors read "
        "median / 95 % / worst over the impacts, times median (10-90 % of the repeats).",
        "Reference: " + describe(report.ladder.truth) + ".",
    ]
    for name, errors in report.check.items():
        parts.append(
            f"Its own error, by one more halving of the step, {name}: peak force "
            f"{_three(errors.value[:, 0])}, gradient "
            f"{_three(None if errors.gradient is None else errors.gradient[:, 0])}."
        )
    parts += ["## Rungs", rung_table(report), cost_table(report)]
    parts += ["## Each component of the gradient", component_table(report),
              "95 % of the impacts: relative to the gradient's norm; to the component itself "
              "(taken as at least 2 % of the norm)."]  # fmt: skip
    parts += ["## Front", "Peak force:", front_table(report, "value"), "Its gradient:",
              front_table(report, "gradient")]  # fmt: skip
    factor = superposition(report)
    if factor is not None:
        parts.append(
            f"{len(report.grid)} of the {len(report.predicted)} points of the product grid were "
            "measured, chosen by adding up the effects of single knobs; predicted and measured "
            f"errors differ by a factor of {factor:.2g} at most."
        )
    if report.stages:
        parts += ["## Slide and whole sorts", stage_table(report)]
    parts += [
        "## Each knob by itself",
        f"All else fixed at {describe(report.ladder.base)}; over {config.lanes} impacts, against "
        "the finest point of the knob; median / 95 %.",
        knob_table(report),
    ]
    if report.integrators:
        rows = [
            [name, *(percent(float(e)) for e in errors.value[0])]
            for name, errors in report.integrators.items()
        ]
        parts += ["Integrators, the paper's impact, four modes, against Tsit5 at 1e-7:",
                  _rows(["integrator", *TITLES], rows)]  # fmt: skip
    parts += ["## Observed order of convergence in the step", order_table(report)]
    for name, text in report.failures.items():
        parts.append(f"FAILED: {name}: {text.splitlines()[0]}")
    return "\n\n".join(parts) + "\n"


def _rung(rung: "Rung") -> dict:
    found = {
        "name": rung.name,
        "named": rung.named,
        "fidelity": dataclasses.asdict(rung.fidelity),
        "errors": summary(rung.errors),
        "value, s a lane": {n: dataclasses.asdict(t) for n, t in rung.value_times.items()},
        "gradient, s a lane": dataclasses.asdict(rung.gradient_time),
        "intermediate arrays of the gradient [B]": rung.memory,
        "own process": rung.cold,
    }
    return found | {"lanes": _lanes(rung.outcome)} if rung.named else found


def _lanes(outcome: Outcome) -> dict:
    return {
        "values": outcome.values,
        "elasticities": outcome.slopes,
        "status": outcome.status,
    }


def content(report: "Report") -> dict:
    """All numbers, plain."""
    return {
        "config": vars(report.config),
        "quantities": QUANTITIES,
        "variables": VARIABLES,
        "reference": {
            "fidelity": dataclasses.asdict(report.ladder.truth),
            "own error": {name: summary(e) for name, e in report.check.items()},
            "lanes": _lanes(report.truth),
        },
        "base": dataclasses.asdict(report.ladder.base),
        "rungs": [_rung(rung) for rung in report.rungs],
        "grid": [_rung(rung) for rung in report.grid],
        "front": {k: [rung.name for rung in report.front(k)] for k in ("value", "gradient")},
        "knobs": {
            name: [
                {"label": p.label, "fidelity": dataclasses.asdict(p.fidelity)} | summary(e)
                for p, e in points
            ]
            for name, points in report.knobs.items()
        },
        "split": {
            name: {"discretisation": summary(a), "smoothing": summary(b)}
            for name, (a, b) in report.split.items()
        },
        "stages": {
            stage: {name: summary(e) for name, e in found.items()}
            for stage, found in report.stages.items()
        },
        "integrators": {name: summary(e) for name, e in report.integrators.items()},
        "orders": report.orders,
        "orders through the contact": step_orders(report),
        "predicted": [
            {"fidelity": dataclasses.asdict(f), "value": v, "gradient": g}
            for f, (v, g) in report.predicted.items()
        ],
        "failures": report.failures,
        "elapsed": report.elapsed,
    }
