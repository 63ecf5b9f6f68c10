"""Many simulations: sweeps, sensitivity, identification from recordings, choice of a fidelity.

May import: everything below it. A study varies named numbers of scenes (`SceneFamily`,
`fencejax.scene_numbers`) and returns a table.

>>> samples = fj.sampling.given({"mass": [5.0, 15.0]})
>>> fj.Sweep(fj.SceneFamily("oblique_impact", ["mass"]), samples).samples.count
2
"""

from . import (
    identify as identify,
    recording as recording,
    sampling as sampling,
    scene_family as scene_family,
    scene_groups as scene_groups,
    sensitivity as sensitivity,
)
from .batch import simulate_many as simulate_many
from .candidates import (
    as_fine as as_fine,
    describe as describe,
    expected_cost as expected_cost,
    ladder as ladder,
)
from .choice import (
    Choice as Choice,
    NoFidelityError as NoFidelityError,
    choose_fidelity as choose_fidelity,
)
from .chunks import (
    CountProgress as CountProgress,
    in_chunks as in_chunks,
)
from .curvature import (
    Curvature as Curvature,
    curvature as curvature,
)
from .fit_judgement import (
    Fit as Fit,
)
from .fit_problem import (
    OFFSET as OFFSET,
    PARAMETERS as PARAMETERS,
    Experiment as Experiment,
)
from .identify import (
    fit as fit,
)
from .lane_groups import (
    contact_length as contact_length,
    in_groups as in_groups,
)
from .measured_lanes import (
    measured as measured,
)
from .posterior import (
    Posterior as Posterior,
    laplace as laplace,
)
from .recording import (
    SIGNALS as SIGNALS,
    Recording as Recording,
    read_recording as read_recording,
    write_recording as write_recording,
)
from .reliability import (
    Reliability as Reliability,
    failure_probability as failure_probability,
)
from .response import (
    Response as Response,
    quantities_of as quantities_of,
)
from .sampling import (
    Samples as Samples,
)
from .scene_family import (
    KINDS as KINDS,
    VARIABLES as VARIABLES,
    SceneFamily as SceneFamily,
)
from .sensitivity import (
    UNITS_OF_RULES as UNITS_OF_RULES,
    DerivativeMeasures as DerivativeMeasures,
    Design as Design,
    SobolIndices as SobolIndices,
)
from .sweep import (
    OUTPUTS as OUTPUTS,
    Lane as Lane,
    Sweep as Sweep,
)
from .sweep_cluster import (
    WorkerSettings as WorkerSettings,
)
from .sweep_program import (
    Plan as Plan,
)
from .sweep_run import (
    Progress as Progress,
    run_sweep as run_sweep,
)
from .sweep_store import (
    FILE as FILE,
    Store as Store,
    sweep_library as sweep_library,
)
from .sweep_table import (
    IMPOSSIBLE as IMPOSSIBLE,
    SweepTable as SweepTable,
    lanes as lanes,
)
from .trial import (
    Trial as Trial,
)
from .trigger import (
    Aligned as Aligned,
    align as align,
)
