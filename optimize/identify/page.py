"""The page of the job: `report.html`."""

from collections.abc import Mapping, Sequence

from fencejax.study import SIGNALS, Experiment, Fit

from ..common import html_report, pages
from ..common.amounts import plain
from ..common.html_report import Report, Section, Table, Text
from .configuration import IdentifyConfig


def write(
    config: IdentifyConfig, found: Fit, experiments: Sequence[Experiment],
    deviations: Mapping[str, float], hidden: Mapping[str, float], succeeded: bool,
) -> None:  # fmt: skip
    """Write the page; `hidden`: the demonstration's own numbers, with how many standard errors the
    estimates lie away from them."""
    rows = []
    for k, one in enumerate(found.parameters):
        error = found.standard_errors[k]
        relative = one.scaling == "logarithmic"
        row = [
            plain(one.name), "" if one.unit == "1" else one.unit, f"{found.start[k]:.4g}",
            f"{found.values[k]:.4g}", f"{100 * error:.2f} %" if relative else f"{error:.2e}",
            f"{found.low[k]:.4g} ... {found.high[k]:.4g}",
        ]  # fmt: skip
        if hidden:
            apart = deviations.get(one.name)
            row += [f"{hidden[one.name]:.4g}" if one.name in hidden else "",
                    "" if apart is None else f"{apart:+.2f}"]  # fmt: skip
        rows.append(row)
    titles = ["parameter", "unit", "start", "found", "standard error",
              f"interval of {100 * found.confidence:g} %"]  # fmt: skip
    titles += ["hidden", "standard errors away"] if hidden else []
    records = [
        [e.recording.source, len(e.recording.time), ", ".join(e.recording.names)]
        for e in experiments
    ]
    noise = [[plain(n), f"{v:.3g} {SIGNALS[n]}"] for n, v in found.noise.items()]
    correlation = [
        [plain(name), *(f"{value:+.2f}" for value in row)]
        for name, row in zip(found.names, found.correlation, strict=True)
    ]
    many = len(experiments) > 1
    fits = [f"fit_{k + 1}" if many else "fit" for k in range(len(experiments))]
    captions = {name: "Recording and fit, with residuals." for name in fits}
    captions["correlation"] = "Correlation of the estimates: near ±1 they are indistinguishable."
    numbers = ", ".join(
        f"{plain(n)} {v:.4g} {p.unit if p.unit != '1' else ''}".strip()
        for n, v, p in zip(found.names, found.values, found.parameters, strict=True)
    )
    Report(
        "Parameters from recordings",
        f"Which {', '.join(plain(name) for name in found.names)} make the simulation reproduce "
        f"{len(records)} recording{'s' if len(records) > 1 else ''}?",
        pages.sentences(numbers, "" if found.converged else "the search did NOT converge"),
        succeeded,
        [
            Section("The recordings", [Table(["source", "rows", "signals"], records)]),
            Section("What is known", [pages.scene_table(experiments[0].scene)]),
            Section("Results", [
                Table(titles, rows, "Parameters"),
                Table(["signal", "standard deviation of the residuals"], noise, "Residuals"),
                Table(["", *map(plain, found.names)], correlation, "Correlation of the estimates"),
            ]),
            Section("Figures",
                    html_report.figures(config.out, captions) if config.plots else []),
            Section("Statuses and checks", [
                f"The search ended after {found.evaluations} evaluations: "
                f"{found.stop.rstrip('.')}.",
                f"Condition {found.condition:.3g}, misfit {found.misfit:.3g}.",
                Text("\n".join(f"- warning: {text}" for text in found.warnings)),
            ]),
            pages.assumptions(
                "The noise is independent from row to row and of constant size, and the model is "
                "true: what it leaves out is in no standard error.",
            ),
            pages.again(config, "identify"),
        ],
    ).write(config.out)  # fmt: skip
