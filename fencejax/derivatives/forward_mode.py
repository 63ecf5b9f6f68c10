"""Derivatives by one batch of tangents, for any kind of differentiation around them; and functions
without second derivatives."""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jax.extend.core import jaxpr_as_fun
from jax.interpreters.partial_eval import dce_jaxpr

from .._kept_programs import keeping, kept
from .columns import pushed
from .shared_operations import shared


def by_columns(
    function: Callable[[Any], Any],
    judge: Callable[[Any, Any, Any], Any] | None = None,
    what: tuple[Any, ...] | None = None,
    alone: Callable[[Any], Any] | None = None,
) -> Callable[[Any], Any]:
    """Give `function`, a map of floating-point pytrees, a derivative made column by column.

    The Jacobian in the inputs that are really being differentiated is computed in one vectorised
    pass of forward mode, next to the value. It is then a plain matrix: `jax.jvp` multiplies by it
    and `jax.grad` by its transpose, so that forward and reverse mode cost the same and neither
    stores the trajectory. Inputs that are not being differentiated cost nothing.

    `judge(value, columns, at)` returns the first two, changed where one affects the other. The
    columns are the first axis of each leaf, and `at` are the values of the numbers that they are
    derivatives in, (columns,).

    Value and columns are again such a map, so that second derivatives (`jax.hessian`, `jax.grad` of
    `jax.grad`) are made in the same way, in one pass with a column for each pair of inputs, and
    higher ones likewise. `judge` sees the columns of the highest order.

    `what` names the map, so that its program and those of its derivatives may be kept
    (`_kept_programs.kept`). `alone` is the same map without the results that only `judge` reads,
    for use without differentiation.
    """
    plain = function if alone is None else alone
    whole = None if what is None else kept(plain, *what)

    def evaluate(inputs):
        return (plain if whole is None or not keeping() else whole)(inputs)

    return _differentiable(function, judge, evaluate, what)


def _differentiable(function, judge, evaluate, what):
    """`evaluate`, the same map as `function`, with derivatives made column by column of
    `function`."""

    @functools.cache
    def columns_in(moved, structure):
        """Value and columns of the Jacobian in the inputs numbered `moved`, as one operation that
        is opaque to the transformations around it."""

        def flat(leaves):
            return function(jax.tree.unflatten(structure, leaves))

        def value_and_columns(leaves):
            sizes = [leaves[i].size for i in moved]
            # Traced once without derivatives, so that only what the results need is differentiated.
            plain, shapes = jax.make_jaxpr(flat, return_shape=True)(leaves)
            wanted = [True] * len(plain.out_avals)
            needed, _ = dce_jaxpr(shared(plain).jaxpr, wanted, instantiate=True)
            directions, unit, at = [None] * len(leaves), np.eye(sum(sizes)), 0
            for i, size in zip(moved, sizes, strict=True):
                column = unit[:, at : at + size].reshape(-1, *leaves[i].shape)
                directions[i] = column.astype(leaves[i].dtype)
                at += size

            def both(leaves):
                given = [None if one is None else jnp.asarray(one) for one in directions]
                outs, changes = pushed(needed, plain.consts, leaves, given)
                columns = [
                    jnp.zeros((at, *out.shape), out.dtype) if change is None else change
                    for out, change in zip(outs, changes, strict=True)
                ]
                return outs, columns

            program, parts = jax.make_jaxpr(both, return_shape=True)(leaves)
            found = jaxpr_as_fun(shared(program))(*leaves)
            outs, columns = jax.tree.unflatten(jax.tree.structure(parts), found)
            results = jax.tree.structure(shapes)
            found = jax.tree.unflatten(results, outs), jax.tree.unflatten(results, columns)
            if judge is None:
                return found
            return judge(*found, jnp.concatenate([leaves[i].reshape(-1) for i in moved]))

        again = None if judge is None else _of_columns(judge)
        # Without a name the program is not kept, as a function is not identified by its fields.
        named = (function,) if what is None else (*what, "columns", moved)
        whole = kept(jax.jit(value_and_columns), *named)
        return _differentiable(value_and_columns, again, whole, None if what is None else named)

    @jax.custom_jvp
    def wrapped(inputs):
        return evaluate(inputs)

    def rule(primals, tangents):
        (inputs,), (dots,) = primals, tangents
        leaves, structure = jax.tree.flatten(inputs)
        dots = jax.tree.leaves(dots, is_leaf=lambda x: isinstance(x, SymbolicZero))
        moved = tuple(i for i, dot in enumerate(dots) if not isinstance(dot, SymbolicZero))
        if not moved:
            value = wrapped(inputs)
            return value, jax.tree.map(jnp.zeros_like, value)
        value, columns = columns_in(moved, structure)(leaves)
        flat = jnp.concatenate([dots[i].reshape(-1) for i in moved])
        change = jax.tree.map(lambda c: jnp.tensordot(flat.astype(c.dtype), c, 1), columns)
        return value, change

    wrapped.defjvp(rule, symbolic_zeros=True)
    return wrapped


def _of_columns(judge):
    """The judge of the columns' own derivatives."""

    def judged(found, columns, at):
        value, first = found
        value, second = judge(value, columns[1], at)
        return (value, first), (columns[0], second)

    return judged


_TWICE = (
    "Argument `fidelity.gradient` must be 'forward' for second derivatives, but is 'reverse', "
    'whose loops are differentiated once alone. Write fidelity.replace(gradient="forward").'
)


def once_alone(tree: Any) -> Any:
    """The `tree` itself. Its derivative cannot be differentiated again, as loops in reverse mode
    cannot: this raises a `TypeError`.

    A rule of `custom_jvp` is itself differentiated, in its arguments' values, only by a second
    derivative.
    """

    @jax.custom_jvp
    def again(tree):
        return tree

    @again.defjvp
    def _(primals, tangents):
        raise TypeError(_TWICE)

    @jax.custom_jvp
    def same(tree):
        return tree

    @same.defjvp
    def _(primals, tangents):
        return again(*primals), tangents[0]

    return same(tree)
