"""The optimiser against others, with and without derivatives, on the package's own problems.

The cost, in simulation-equivalents, to come within 20, 5, 1 and 0.1 % of the best feasible value
found by any method. `pytest tests/design/test_optimizer_comparison.py --bench DIR` measures
it and writes `optimizers.md`, `optimizers.json` and `optimizers.png` into DIR.
"""

import json
import time

import numpy as np
import pytest
from peers.optimizers import methods, tasks
from peers.optimizers.ledger import Ledger, SpentError

from fencejax.plot import style

WITHIN = (0.2, 0.05, 0.01, 0.001)
# The budget in simulation-equivalents; later successes do not count.
WITH_GRADIENTS, WITHOUT_GRADIENTS = {"fence": 600, "motion": 900}, {"fence": 5000, "motion": 6000}


class _Quadratic:
    """A task in closed form: (s - 0.3)^2, s >= 0.5, which cannot be evaluated above 0.9."""

    scale, price = 1.0, 4.0

    def numbers(self, share):
        return float((share[0] - 0.3) ** 2), share - 0.5, bool(share[0] > 0.9)


def test_ledger_counts_each_point_once():
    ledger = Ledger(_Quadratic(), 3.0)
    for share in (0.4, 0.8, 0.4, 0.6):
        ledger.value(np.array([share]))
    assert ledger.cost == 3
    assert ledger.points == 3
    # 0.4 is not feasible; 0.8 and 0.6 are 0.25 and 0.09.
    np.testing.assert_allclose(ledger.best()[1], [np.inf, 0.25, 0.09])
    assert ledger.reached(0.3) == 2
    assert ledger.reached(0.05) == float("inf")
    with pytest.raises(SpentError):
        ledger.value(np.array([0.7]))


def test_numbers_that_are_unreliable_count_for_no_design():
    ledger = Ledger(_Quadratic(), 3.0)
    ledger.value(np.array([0.95]))
    np.testing.assert_array_equal(ledger.best()[1], [np.inf])


def _median(costs):
    """The median of a few, infinite where most of them are."""
    return float(np.sort(costs)[len(costs) // 2])


def _summary(runs, least):
    """The best setting's numbers: medians over the starts."""
    rows = []
    for setting, ledgers in runs.items():
        costs = [[ledger.reached((1 + w) * least) for ledger in ledgers] for w in WITHIN]
        rows.append(dict(
            setting=setting,
            cost=[_median(c) for c in costs],
            reached=[int(np.sum(np.isfinite(c))) for c in costs],
            found=[float(ledger.best()[1][-1]) for ledger in ledgers],
            spent=[ledger.cost for ledger in ledgers],
            points=[ledger.points for ledger in ledgers],
        ))  # fmt: skip
    return min(rows, key=lambda r: (*r["cost"][::-1], np.median(r["found"])))


def _compare(name):
    task = tasks.TASKS[name]()
    runs, clock = {}, {}
    for method, settings in methods.METHODS.items():
        budgets = WITHOUT_GRADIENTS if method in methods.WITHOUT else WITH_GRADIENTS
        begin = time.perf_counter()
        runs[method] = {
            setting: [
                methods.run(one, task, start, seed, budgets[name])
                for seed, start in enumerate(task.starts)
            ]
            for setting, one in settings.items()
        }
        clock[method] = time.perf_counter() - begin
        print(f"{name}: {method} {clock[method]:.1f} s", flush=True)
    least = min(
        ledger.best()[1][-1] for by in runs.values() for ledgers in by.values()
        for ledger in ledgers
    )  # fmt: skip
    rows = {method: _summary(settings, least) for method, settings in runs.items()}
    for method, row in rows.items():
        row["wall time of all its runs [s]"] = clock[method]
    return task, runs, least, rows


def _cell(cost, reached, base, spent, budget):
    """A cost, the number of successful starts, and its multiple of `base`; where most starts
    failed, the cost spent, or that the method ended by itself."""
    came = f"({reached}/{tasks.STARTS})"
    sign = "" if np.isfinite(cost) else "> "
    if not np.isfinite(cost):
        if spent < 0.9 * budget:
            return f"ended {came}"
        cost = spent
    ratio = f", {sign}{cost / base:.1f} ×" if np.isfinite(base) else ""
    return f"{sign}{cost:.0f} {came}{ratio}"


def _markdown(task, least, rows):
    base = rows[methods.OURS]["cost"]
    lines = [
        f"## {task.size} variables: {task.title}",
        "",
        f"Best known feasible worst force: {least:.2f} N, at the start {task.scale:.1f} N. One "
        f"evaluation with all derivatives takes {1e3 * task.slopes_time:.2f} ms, one value "
        f"{1e3 * task.value_time:.2f} ms: it counts {task.price:.2f}.",
        "",
        "| method | " + " | ".join(f"{100 * w:g} %" for w in WITHIN) + " | found [N] | setting |",
        "| --- | " + "--- | " * (len(WITHIN) + 2),
    ]
    for method, row in rows.items():
        budgets = WITHOUT_GRADIENTS if method in methods.WITHOUT else WITH_GRADIENTS
        end = (float(np.median(row["spent"])), budgets[task.name])
        cells = [_cell(*it, *end) for it in zip(row["cost"], row["reached"], base, strict=True)]
        found = ", ".join("none" if np.isinf(f) else f"{f:.1f}" for f in sorted(row["found"]))
        lines.append(f"| {method} | {' | '.join(cells)} | {found} | {row['setting']} |")
    return lines


def _draw(results, path):
    figure = style.figure(1.5 * style.HEIGHT)
    colors = dict(zip(methods.METHODS, style.LINES, strict=False))
    panels = figure.subplots(len(results), 1)
    for axes, (task, runs, least, rows) in zip(panels, results, strict=True):
        style.prepared(axes)
        for method, settings in runs.items():
            for index, ledger in enumerate(settings[rows[method]["setting"]]):
                cost, best = ledger.best()
                axes.step(
                    cost, 100 * (best / least - 1) + 1e-3, where="post", color=colors[method],
                    linewidth=1.6 if method == methods.OURS else 0.9,
                    linestyle="--" if method in methods.WITHOUT else "-",
                    label=None if index else method,
                )  # fmt: skip
        for within in WITHIN:
            axes.axhline(100 * within, color="black", linewidth=0.6, linestyle=":")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_ylim(2e-2, 300)
        axes.set_title(f"{task.size} variables: {task.title}", fontsize="small", loc="right")
        axes.set_ylabel("above the best [%]")
    panels[-1].set_xlabel("cost [simulation-equivalents]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2, frameon=False,
                  fontsize="x-small")  # fmt: skip
    figure.savefig(path, dpi=150)


@pytest.mark.bench
def test_optimizers_compared(bench_directory):
    begin = time.perf_counter()
    results = [_compare(name) for name in tasks.TASKS]
    text = [
        "# The optimiser against others",
        "",
        "Cost in simulation-equivalents until a feasible design (no limit broken by more than "
        f"{100 * tasks.FEASIBLE:g} %) within so much of the best known is at hand: median "
        f"over {tasks.STARTS} starts, in brackets how many came there, and as a multiple of the "
        "package's SQP. A design whose simulation calls its own numbers unreliable counts for "
        "none. One value counts 1, one value with its Jacobian what it takes in time. "
        "Budgets: "
        + "; ".join(
            f"{t.size} variables {WITH_GRADIENTS[t.name]} with derivatives, "
            f"{WITHOUT_GRADIENTS[t.name]} without"
            for t, *_ in results
        )
        + ". Of several settings the best one is shown, its search not counted. "
        "`pytest tests/design/test_optimizer_comparison.py --bench DIR` makes this page.",
    ]
    for task, _, least, rows in results:
        text += ["", *_markdown(task, least, rows)]
    (bench_directory / "optimizers.md").write_text("\n".join(text) + "\n")
    content = [
        dict(
            task=task.name, title=task.title, variables=task.space.names, best=least,
            price=task.price, value_time=task.value_time, slopes_time=task.slopes_time,
            budgets=[WITH_GRADIENTS[task.name], WITHOUT_GRADIENTS[task.name]],
            within=WITHIN, feasible=tasks.FEASIBLE, methods=rows,
        )
        for task, _, least, rows in results
    ]  # fmt: skip
    clean = json.loads(json.dumps(content), parse_constant=lambda _: None)
    (bench_directory / "optimizers.json").write_text(json.dumps(clean, indent=1) + "\n")
    _draw(results, bench_directory / "optimizers.png")
    print("\n".join(text), f"\n{time.perf_counter() - begin:.0f} s", flush=True)
    for _, _, _, rows in results:
        ours = rows[methods.OURS]
        assert ours["reached"][0] > 0
