"""Derivatives of traced programs: several directions in one pass of forward mode (`by_columns`,
`pushed`) with common operations computed once (`shared`), and the form that a loop's carry needs
for that (`complete`, `one_a_lane`). Nothing here depends on a scene.

May import: `_kept_programs` alone. Any room may import this one. A shorter derivative of an
operation than by JAX's own rule is a function in `column_rules.py` with a row in `RULES`. An
operation that contains programs, such as a loop, has its function in `columns.py`, its row in
`_LOOPS`, and its dependences in `dependence.py`. A function that knows its derivative along all
directions better, such as a root, brings it by `custom_columns`.

>>> float(jax.grad(fj.derivatives.by_columns(lambda x: x**3))(jnp.array(2.0)))
12.0
"""

from .columns import pushed as pushed
from .custom_columns import custom_columns as custom_columns
from .forward_mode import (
    by_columns as by_columns,
    once_alone as once_alone,
)
from .loop_carry import (
    complete as complete,
    one_a_lane as one_a_lane,
)
from .shared_operations import shared as shared
