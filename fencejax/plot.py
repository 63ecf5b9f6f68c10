"""Figures of results, studies and optimisations: each function draws on axes and returns them.

- a scene from above at an instant, and as moving pictures: `draw_scene`, `animate`;
- signals over time: `histories`, `energies`, `force`, `tip_deflection`;
- charts: `heat_map`, `front`, `convergence`, `gradient_bars`.

matplotlib is imported where it is first used, and its global state is left alone: a figure is made
where no axes are given, and belongs to them (`axes.figure`).
"""

from .animation import Film as Film, animate as animate
from .charts import (
    convergence as convergence,
    front as front,
    gradient_bars as gradient_bars,
    heat_map as heat_map,
)
from .histories import (
    SIGNALS as SIGNALS,
    Signals as Signals,
    Trace as Trace,
    energies as energies,
    force as force,
    histories as histories,
    tip_deflection as tip_deflection,
)
from .picture import draw_scene as draw_scene
