"""Tables of the study."""

import numpy as np

from fencejax.study import UNITS_OF_RULES

from .study import Global, Local

_WIDE = 30


def elasticity_table(place: str, outputs, names, found: Local, index: int) -> str:
    """Elasticities at one point, the largest first, and the residuals of the unit rules."""
    elasticity = found.elasticity[index]
    lines = [f"elasticities at {place} [% per %]"]
    lines.append(" " * _WIDE + "".join(f"{q.name.replace('_', ' '):>16}" for q in outputs))
    shown = [f"{v:.5g} {q.unit}" for v, q in zip(found.values[index], outputs, strict=True)]
    lines.append(f"{'value':<{_WIDE}}" + "".join(f"{text:>16}" for text in shown))
    order = np.argsort(-np.max(np.abs(np.nan_to_num(elasticity)), axis=0), kind="stable")
    for j in order:
        cells = "".join(f"{e:>+16.4f}" for e in elasticity[:, j])
        lines.append(f"{names[j].replace('_', ' '):<{_WIDE}}{cells}")
    for k, unit in enumerate(UNITS_OF_RULES):
        cells = "".join(f"{r:>+16.1e}" for r in found.rules[index, :, k])
        lines.append(f"{'left over by units of ' + unit:<{_WIDE}}{cells}")
    return "\n".join(lines)


def global_table(output: str, names, found: Global, row: int) -> str:
    """Sobol' indices and bounds of one output, the largest total first, with their intervals."""
    single, total = found.indices.first, found.indices.total
    bound = found.measures.bound

    def cell(estimate, j):
        low, high = estimate.low[row, j], estimate.high[row, j]
        return f"{f'{estimate.value[row, j]:.3f} ({low:.3f} ... {high:.3f})':>26}"

    lines = [
        f"shares of the variance of the {output.replace('_', ' ')}",
        " " * _WIDE + f"{'alone, S_i':>26}{'total, S_Ti':>26}{'bound on S_Ti':>26}",
    ]
    for j in np.argsort(-total.value[row], kind="stable"):
        cells = "".join(cell(estimate, j) for estimate in (single, total, bound))
        lines.append(f"{names[j].replace('_', ' '):<{_WIDE}}{cells}")
    return "\n".join(lines)
