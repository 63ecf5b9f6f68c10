"""Functions that bring their own derivative along several directions at once."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
from jax.extend.core import Primitive, jaxpr_as_fun
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array

Rule = Callable[[list[Any], list[Any], list[Array | None]], Sequence[Array | None]]

OPERATION = Primitive("custom_columns")
"""The operation as which such a function stands in a traced program."""
OPERATION.multiple_results = True


def custom_columns(function: Callable[..., Any], rule: Rule) -> Callable[..., Any]:
    """`function` of arrays in pytrees, whose derivatives `pushed` takes from `rule`.

    `rule(arguments, results, dots)` gets the leaves of the arguments and of the results, and the
    derivatives of the former along all directions, which are in a first axis, or `None` for zeros.
    It returns those of the results, in the same form. Under any other transformation of JAX the
    function is as without the rule. With `jax.custom_jvp` instead, JAX traces the derivative along
    a single direction first, and then along all of them.
    """

    def called(*arguments):
        program, shapes = jax.make_jaxpr(function, return_shape=True)(*arguments)
        outs = OPERATION.bind(*jax.tree.leaves(arguments), program=program, rule=rule)
        return jax.tree.unflatten(jax.tree.structure(shapes), outs)

    return called


def _plain(*operands, program, rule):
    return jaxpr_as_fun(program)(*operands)


def _avals(*operands, program, rule):
    return program.out_avals


def _in_lanes(operands, axes, *, program, rule):
    outs = jax.vmap(jaxpr_as_fun(program), axes)(*operands)
    return outs, [0] * len(outs)


def _along(primals, tangents, *, program, rule):
    moved = [i for i, dot in enumerate(tangents) if not isinstance(dot, ad.Zero)]

    def of_moved(*parts):
        every = list(primals)
        for i, part in zip(moved, parts, strict=True):
            every[i] = part
        return jaxpr_as_fun(program)(*every)

    return jax.jvp(of_moved, [primals[i] for i in moved], [tangents[i] for i in moved])


OPERATION.def_impl(_plain)
OPERATION.def_abstract_eval(_avals)
batching.primitive_batchers[OPERATION] = _in_lanes
ad.primitive_jvps[OPERATION] = _along
mlir.register_lowering(OPERATION, mlir.lower_fun(_plain, multiple_results=True))
