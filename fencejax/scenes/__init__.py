"""The parts that act in a scene, its start, and its numbers by name.

May import: `parts`. A new scene is a function that returns a `Scene`; a new start is a subclass of
`AbstractStart`.

>>> scene = fj.scenes.whole_sort(front=0.15, offset=0.1)
>>> scene.start
OnBelt(front=150 mm, offset=100 mm, angle=0 rad)
"""

from . import (
    names as names,
    numbers as numbers,
)
from .arguments import (
    Default as Default,
)
from .body import (
    Body as Body,
)
from .consistency import (
    consistent as consistent,
)
from .names import (
    DERIVED as DERIVED,
    NUMBERS as NUMBERS,
    PATHS as PATHS,
    Number as Number,
    element as element,
)
from .normal_direction import (
    normal_impact as normal_impact,
    rigid_wall as rigid_wall,
)
from .numbers import (
    AnyScene as AnyScene,
)
from .scene import (
    NormalScene as NormalScene,
    Scene as Scene,
)
from .sorts import (
    free_motion as free_motion,
    passive_sort as passive_sort,
    whole_sort as whole_sort,
)
from .stages import (
    along_fence as along_fence,
    border_and_fence as border_and_fence,
    oblique_impact as oblique_impact,
)
from .start import (
    AbstractStart as AbstractStart,
    AsGiven as AsGiven,
    AtTouch as AtTouch,
    BetweenBorderAndFence as BetweenBorderAndFence,
    FlushOnFence as FlushOnFence,
    OnBelt as OnBelt,
    Pose as Pose,
)
