"""Arguments that a simulation refuses before anything is traced: numbers of a wrong type or shape,
and scenes that the fidelity does not allow."""

import jax
import jax.numpy as jnp
import numpy as np

from .fidelity import SINGLE_STEP, Fidelity
from .parts import AbstractDrive, AbstractTaper, Fence
from .scenes import NormalScene, Scene

# Largest number of steps that is counted exactly in single and in double precision [1].
_STEPS = {"float32": 2**24, "float64": 2**31 - 2}
# The same of the shortest steps, which are counted as floating-point numbers alone [1].
_SHORTEST = {"float32": 2**24, "float64": 2**53}


def refuse(scene: NormalScene | Scene, fidelity: Fidelity) -> None:
    """Raise where the scene's numbers are of a wrong type or shape, or single precision cannot give
    what the fidelity asks for."""
    vectors = (AbstractTaper, AbstractDrive)
    for path, leaf in jax.tree_util.tree_leaves_with_path(
        scene, is_leaf=lambda part: isinstance(part, vectors)
    ):
        if isinstance(leaf, vectors):
            continue
        name = jax.tree_util.keystr(path).lstrip(".")
        shape = np.shape(leaf)
        if shape:
            raise ValueError(
                f"Argument `scene` must hold one number in each field, but `{name}` has the shape "
                f"{shape}. Write jax.vmap(lambda scene: fj.simulate(scene))(scenes) for a batch."
            )
    numbers = jax.tree.leaves(scene)
    for number in numbers:
        if jnp.result_type(number) not in (jnp.float32, jnp.float64):
            raise TypeError(
                f"Argument `scene` must hold floating-point numbers in single or double precision, "
                f"but holds {number!r} of the type {jnp.result_type(number)}. Give numbers to the "
                "constructors, which convert them."
            )
    precision = fidelity.precision or str(jnp.result_type(*numbers))
    steps = scene.duration / fidelity.step
    if steps > _STEPS[precision]:
        raise ValueError(
            f"Argument `duration` / `fidelity.step` must be at most {_STEPS[precision]} [1] in "
            f"{precision}, but is {steps:g}. Raise `step` or lower `duration`."
        )
    shortest = steps * 2**fidelity.halvings
    if fidelity.step_tolerance is not None and shortest > _SHORTEST[precision]:
        raise ValueError(
            "Argument `duration` / `fidelity.step` * 2^`fidelity.halvings` must be at most "
            f"{_SHORTEST[precision]} [1] in {precision}, but is {shortest:g}. Lower `halvings`, "
            "raise `step` or lower `duration`."
        )
    if precision == "float64" or isinstance(scene, NormalScene):
        return
    if fidelity.step < SINGLE_STEP:
        raise ValueError(
            f"Argument `fidelity.step` must be at least {SINGLE_STEP:g} in single precision, but "
            f"is {fidelity.step:g}: smaller changes are lost in rounding. Raise it, or "
            'write fidelity.replace(precision="float64") with JAX\'s jax_enable_x64.'
        )


def refuse_fence(scene: NormalScene | Scene, fence: Fence, fidelity: Fidelity) -> None:
    """Raise where a part of the fence has a state that the integrator does not have."""
    slips = fence.shaft is not None and fence.shaft.slip_torque is not None
    yields = fence.pad is not None or fence.shear is not None
    if (yields or slips) and fidelity.integrator != "modal":
        raise ValueError(
            "Argument `fidelity.integrator` must be 'modal' for a fence with a pad, a clutch or "
            f"shear, which have states of their own, but is {fidelity.integrator!r}. Write "
            'fidelity.replace(integrator="modal").'
        )
    if slips and isinstance(scene, NormalScene):
        raise ValueError(
            "Argument `slip_torque` of the fence's shaft must be None in a scene of the normal "
            "direction alone, whose fence is held still. Write fj.Shaft(stiffness) without it, or "
            "use fj.scenes.oblique_impact."
        )
