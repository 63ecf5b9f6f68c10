"""The page of the job: `report.html`."""

from ..common import html_report, pages
from ..common.html_report import Report, Section
from .findings import Report as Findings

_FIGURES = {
    "front": "Time a lane over the error of the peak force and of its gradient.",
    "knobs": "Each knob by itself.",
    "tolerance": "Steps that follow their error: the tolerance asked for, and the error got.",
    "components": "Errors of each component of the gradient.",
    "random_impacts": "Errors over the random impacts.",
    "costs": "Every cost of the rungs over their errors.",
}


def write(found: Findings, document: str) -> None:
    """Write the page of the tables of a document in Markdown."""
    config = found.config
    head, *rest = html_report.of_markdown(document)
    first, sections = (rest[0], rest[1:]) if not head.parts else (head, rest)
    fronts = {kind: ", ".join(r.name for r in found.front(kind)) for kind in ("value", "gradient")}
    Report(
        "Speed against accuracy",
        "What does every fidelity cost, and how wrong is it, in value and gradient?",
        f"On the front of the value: {fronts['value']}.\n"
        f"On the front of the gradient: {fronts['gradient']}.",
        None if found.failures else True,
        [
            Section("What was measured", first.parts),
            *sections,
            pages.figures(config.out, _FIGURES if config.plots else {}),
            pages.assumptions(
                "The reference is converged: its own error stands above. Times are of this "
                "machine, whatever else ran on it.",
                model=False,
            ),
            pages.again(config, "work_precision"),
        ],
    ).write(config.out)
