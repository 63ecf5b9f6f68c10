"""Figures and films of results, studies and optimisations. Each function draws on axes and returns
them.

- a scene from above at given times, and as an animation: `draw_scene`, `animate`;
- signals over time: `histories`, `energies`, `force`, `tip_deflection`;
- a fence for the workshop: `fence_drawing` (a sheet to scale), `write_dxf`, `fence_outline`;
- charts: `heat_map`, `front`, `convergence`, `gradient_bars`, `shock_spectrum`;
- every output of a sweep: `sweep`.

matplotlib and ezdxf are imported at their first use, and matplotlib's global state is not changed.
Without given axes a new figure is made, which is `axes.figure`.

May import: `results` and what is below it.

>>> scene = fj.scenes.oblique_impact()
>>> axes = fj.plot.draw_scene(scene, fj.simulate(scene), times=(0.0, 0.05))
>>> axes.figure.savefig("impact.png")
"""

from . import (
    style as style,
)
from .animation import (
    Film as Film,
    animate as animate,
)
from .charts import (
    convergence as convergence,
    front as front,
    gradient_bars as gradient_bars,
    heat_map as heat_map,
    non_dominated as non_dominated,
)
from .fence_drawing import (
    fence_drawing as fence_drawing,
)
from .fence_dxf import (
    LAYERS as LAYERS,
    write_dxf as write_dxf,
)
from .fence_outline import (
    FenceOutline as FenceOutline,
    fence_outline as fence_outline,
)
from .fence_shape import (
    FORCES as FORCES,
    outline as outline,
)
from .scene_drawing import (
    draw_scene as draw_scene,
    reference_force as reference_force,
)
from .shock_spectrum import (
    shock_spectrum as shock_spectrum,
)
from .style import (
    COLORS as COLORS,
    figure as figure,
    legend as legend,
    legend_above as legend_above,
    panel as panel,
    prepared as prepared,
)
from .sweep_figures import (
    sweep as sweep,
)
from .time_series import (
    SIGNALS as SIGNALS,
    Signals as Signals,
    Trace as Trace,
    energies as energies,
    force as force,
    histories as histories,
    tip_deflection as tip_deflection,
)
