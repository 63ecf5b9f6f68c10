"""Run a scene."""

import dataclasses
import functools
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array

from . import _check
from ._kept_executables import compiled
from ._refusals import refuse, refuse_fence
from ._xla import fusion_barrier, many_objects, sound
from .derivatives import by_columns, once_alone
from .fidelity import Fidelity
from .integrators import (
    Clock,
    Memory,
    diffrax_reference,
    normal_direction,
    stride_counts,
    time_loop,
    units,
)
from .model import (
    SWING_STEPS,
    FlexibleLink,
    Mechanics,
    Propagator,
    Vibration,
    fence_pose,
    swung,
)
from .parts import DriveMotion
from .results import (
    MEASURES,
    Kept,
    Measure,
    NormalRecorder,
    Result,
    SceneRecorder,
    SlopeEvidence,
    Status,
    climb,
    diagnostics,
    error,
    gather,
    running,
    traced,
)
from .scenes import Body, NormalScene, Pose, Scene


def simulate(
    scene: NormalScene | Scene,
    *,
    fidelity: Fidelity | None = None,
    history: bool = True,
    only: str | Sequence[str] | None = None,
    measures: Sequence[Measure] = (),
    refine: bool = False,
    throw: bool = False,
    estimate_error: bool = False,
) -> Result:
    """Integrate a scene and return its result.

    Scenes and results are pytrees, and this is a function of JAX: `jax.vmap` makes batches of it
    (`fencejax.simulate_many` with refinement), `jax.pmap` and `jax.shard_map(..., check_vma=False)`
    spread them over devices, `jax.export` writes the compiled program to a file.

    **Arguments:**

    - `scene`: made by a function of `fencejax.scenes`. Every number in it may be traced.
    - `fidelity`: default `Fidelity.standard()`.
    - `history`: keep every sample (`Result.history`). Inside `jit` an unused history is not
      computed; outside, `history=False` is cheaper. Where steps have different lengths, so have the
      times between samples; inside `jit` the last sample is then repeated to fill the array.
    - `only`: names of the wanted fields of `Result`, or one name; the others except `status` are
      `None` and cost nothing, also in compiling a derivative. The history is then kept only if it
      is named.
    - `measures`: measures of your own, in addition to those of `fencejax.results.MEASURES`: fields
      of the result by their names, which must not be those of other fields.
    - `refine`: where the status is numerical (`Status.numerical`), compute the result again at the
      next finer rung of `Fidelity.ladder`, up to the last one; `Result.rung` is the rung of the
      result. Only outside transformations: `fencejax.simulate_many` does so for batches.
    - `throw`: raise on the host if the status is not among those with good numbers.
    - `estimate_error`: put an `ErrorEstimate` into `Result.error`, from two more runs of half as
      many steps (one where there is no friction): about twice the cost.

    **Derivatives** of the first and the second order are exact for the steps that are taken, by
    `jax.grad`, `jax.jvp`, `jax.hessian` and their compositions, but where a corner comes to rest
    within a few eps of a step's end: those of what comes later may be wrong then. A Hessian in n
    numbers has n^2 columns in addition to the n of a gradient: it costs some n times as much, less
    the part that both share, and takes several times as long to compile. Second derivatives require
    `Fidelity.gradient = "forward"`. Where friction reverses within its smoothing, or a force just
    begins or ends, they are large or jump: `fencejax.curvature` estimates the distance over which a
    Hessian is valid.

    Raises `TypeError` for arguments of the wrong kind and for second derivatives with
    `Fidelity.gradient = "reverse"`; `ValueError` for names in `only` that are not fields of
    `Result`, for `measures` with the name of another field of `Result` or of each other, where two
    different accumulators or traces have one name, and for a fidelity that the scene or JAX's
    settings do not allow; and, with `throw=True`, `RuntimeError` with the status' text.

    >>> print(fj.simulate(fj.scenes.oblique_impact(distance=1.0)))
                status  successful
            peak force  1116.05 N  at 48.11 ms
               impulse  60.192 N s
               contact  88.07 ms  from 0.00 ms to 88.07 ms
           leaves at x  0.993 m  y 0.672 m (C_s, end of the force)
        tip deflection  65.24 mm  at 48.61 ms
        bending stress  16.09 MPa  at 0.450 m from the hinge
          drive torque  1255.24 N m  largest
          border force  0.00 N  largest
         surface force  0.00 N  largest
         pressed in by  28.25 mm
       energy residual  2.13e-02 J
    """
    if not isinstance(scene, (NormalScene, Scene)):
        raise TypeError(
            f"Argument `scene` must be a scene made by a function of `fencejax.scenes`, but is a "
            f"{type(scene).__name__}."
        )
    fidelity = Fidelity.standard() if fidelity is None else fidelity
    if not isinstance(fidelity, Fidelity):
        raise TypeError(
            f"Argument `fidelity` must be a `fencejax.Fidelity`, but is {fidelity!r}. Write, for "
            "example, fidelity=fj.Fidelity.fast()."
        )
    if isinstance(scene, NormalScene) and fidelity.integrator != "modal":
        raise ValueError(
            "Argument `fidelity.integrator` must be 'modal' for a scene of the normal direction "
            f"alone, but is {fidelity.integrator!r}. Write fidelity.replace(integrator=\"modal\")."
        )
    if scene.fence is not None:
        refuse_fence(scene, scene.fence, fidelity)
    if fidelity.precision == "float64" and not jax.config.read("jax_enable_x64"):
        raise ValueError(
            "Argument `fidelity.precision` is 'float64', but JAX is set to single precision. Write "
            'jax.config.update("jax_enable_x64", True) first.'
        )
    own = _own(measures)
    if only is not None:
        only = _check.several("only", only)
        for name in only:
            _check.choice("only", name, (*MEASURES, *(m.name for m in own), *_PARTS, "status"))
        only = tuple(sorted({*only, "status"}))
        history = "history" in only
    refuse(scene, fidelity)
    result = _result(scene, fidelity, history, only, own)
    if refine:
        fidelity, result = _refined(scene, fidelity, result, history, only, own)
    if estimate_error:
        estimated = error.estimate(_result, scene, fidelity, result)
        result = dataclasses.replace(result, error=estimated)
    if throw:
        raise_for(result)
    return result


def _own(measures: Sequence[Measure]) -> tuple[Measure, ...]:
    """The measures, with names that a result can have for them."""
    names = set()
    for measure in measures:
        if not isinstance(measure, Measure):
            raise TypeError(
                f"Argument `measures` must hold `fencejax.Measure`s, but holds {measure!r}."
            )
        name = measure.name
        why = ""
        if name.startswith("_"):
            why = "which begins with an underscore"
        elif name in names:
            why = "twice"
        elif name in MEASURES or hasattr(Result, name) or name in Result.__dataclass_fields__:
            why = "which a result has for something else"
        if why:
            raise ValueError(
                "Argument `measures` must hold measures with names of their own, but holds "
                f"{name!r}, {why}. Name it otherwise."
            )
        names.add(name)
    return tuple(measures)


# The fields of a result besides its measures.
_PARTS = ("final", "energy", "start_time", "history")


def _refined(scene, fidelity: Fidelity, result: Result, history: bool, only, own):
    """The first fidelity of the ladder without a numerical status, or the last one, and its
    result."""
    if isinstance(result.status, Tracer):
        raise TypeError(
            "refine=True needs concrete numbers. Inside a transformation read `status`, or write "
            "fj.simulate_many(scenes) for a batch."
        )
    ladder = fidelity.ladder(scene)

    def compute(rung: int) -> Result:
        refuse(scene, ladder[rung])
        return _result(scene, ladder[rung], history, only, own)

    def doubted(found: Result) -> bool:
        return Status(int(found.status)).numerical

    result, rung = climb(compute, doubted, len(ladder), result)
    return ladder[rung], dataclasses.replace(result, rung=rung)


def raise_for(result: Result) -> None:
    """Raise `RuntimeError` if any lane's status is not among those with good numbers."""
    if isinstance(result.status, Tracer):
        raise TypeError("throw=True needs concrete numbers: read `status` inside a transformation.")
    outcome = Status(int(np.max(np.asarray(result.status))))
    if outcome > Status.LEFT_OVER_TIP:
        raise RuntimeError(f"{outcome.name}: {outcome.text}.")


# A compiled program takes some 30 MB, one with its gradient 50 MB, a whole sort 100 MB.
@functools.lru_cache(maxsize=32)
def _program(structure, fidelity: Fidelity, history: bool, only, own: tuple[Measure, ...]):
    """The map from a scene's numbers to its result, for scenes of one structure: plain and
    compiled. It is cached, so that it is traced and compiled once."""

    def outcome(numbers, judged=True):
        """The result and, where its slopes are `judged`, the evidence of their error."""
        if fidelity.gradient == "reverse":
            numbers = once_alone(numbers)
        given = jnp.result_type(*numbers)
        precision = given if fidelity.precision is None else jnp.dtype(fidelity.precision)
        numbers = [number.astype(precision) for number in numbers]
        scene = jax.tree.unflatten(structure, numbers)
        used = fidelity.single() if precision == jnp.float32 else fidelity
        result, slopes = _run(scene, used, history, only, own, judged)
        if slopes is not None:
            unknown = jnp.full_like(result.status, jnp.inf)
            result = dataclasses.replace(result, gradient_error=unknown)
        result, slopes = jax.tree.map(lambda leaf: leaf.astype(given), (result, slopes))
        return diagnostics.of_result(scene, result), slopes

    run = outcome
    what = structure, fidelity, history, only, own
    if fidelity.gradient == "forward":
        judge = functools.partial(
            diagnostics.of_derivatives, tolerance=fidelity.gradient_tolerance
        )
        alone = functools.partial(outcome, judged=False)
        run = by_columns(outcome, judge, what, alone)
    # The programs of other integrators are ten times as large: as one kernel they take many minutes
    # to optimise.
    modal = fidelity.integrator == "modal"
    options = None if modal else {"xla_backend_optimization_level": 0}

    # Python runs it only to trace it.
    def with_status(numbers):
        with many_objects():
            result, _ = run(numbers)
        return dataclasses.replace(result, status=result.status.astype(jnp.int32))

    return with_status, compiled(with_status, options, *what)


def _result(scene, fidelity: Fidelity, history: bool, only, own=()) -> Result:
    numbers, structure = jax.tree.flatten(scene)
    plain, ready = _program(structure, fidelity, history, only, own)
    # Within a transformation the numbers are traced already, and one `jit` less is needed.
    traced = any(isinstance(number, Tracer) for number in numbers)
    result = (plain if traced else ready)(numbers)
    samples = result.history
    # In a traced program with a constant scene, the result alone is traced.
    traced = traced or (samples is not None and isinstance(samples.time, Tracer))
    if not traced and samples is not None and samples.time.ndim == 1:
        # With longer strides the end of the array is filled with the last sample.
        times = np.asarray(samples.time)
        taken = 1 + int(np.searchsorted(times, times[-1]))
        if taken < times.size:
            short = jax.tree.map(lambda leaf: np.asarray(leaf)[:taken], samples)
            samples = jax.device_put(short)
            result = dataclasses.replace(result, history=samples)
    return result


def prepared(scene: Scene, fidelity: Fidelity) -> tuple[Mechanics, Clock, Memory]:
    """The start of the integration: the prepared parts, the clock, and the state at the start."""
    touching = scene.fence_corners or scene.border_corners or scene.surfaces
    fidelity = fidelity.settled(scene.duration if touching else 0.0)
    good = sound(scene)
    steps = time_loop.count_steps(scene.duration, fidelity.step)
    step = scene.duration / (steps * units(fidelity))
    mechanics = fusion_barrier(good, lambda s: Mechanics(s, fidelity), scene)
    begin = scene.start.time(scene.drive, scene.fence)
    zero = jnp.zeros_like(scene.parcel.mass)
    time = zero if begin is None else begin + zero
    link = mechanics.link
    maps = vibration = pose = drive = None
    if link is not None:
        assert scene.drive is not None
        lengths = [zero + step * count for count in stride_counts(fidelity)[1:]]
        if begin is not None:
            lengths.append(jnp.maximum(time / SWING_STEPS, 1e-9))
        maps = link.propagators(lengths)
        vibration = link.rest()
        if begin is not None:
            of_swing = Propagator(*(values[-1] for values in maps))
            maps = Propagator(*(values[:-1] for values in maps))
            vibration = fusion_barrier(good, swung, link, scene.drive, lengths[-1], of_swing)
        drive = link.motion(scene.drive.motion(time), vibration)
        distance = scene.start.distance()
        if distance is not None:
            pose = fusion_barrier(good, _pose, link, drive, vibration, distance)
    body = scene.start.body(scene.parcel, scene.belt, pose)
    # All numbers get the same batch dimensions, as lanes of a batch may differ in any number.
    wide = zero + time + sum(body)
    body = Body(*(q + 0 * wide for q in body))
    clock = fusion_barrier(
        good, lambda *given: Clock(given[0], fidelity, given[1], step, given[2]), link, time, maps
    )
    return mechanics, clock, Memory.at_rest(mechanics, body, vibration, drive)


def _pose(
    link: FlexibleLink, drive: DriveMotion, vibration: Vibration, distance: Array
) -> Pose:
    """The fence's point at an arc coordinate [m], in fixed axes."""
    return fence_pose(link.point_on(drive, link.shape(distance), vibration), drive)


def _run(
    scene: NormalScene | Scene,
    fidelity: Fidelity,
    history: bool,
    only: tuple[str, ...] | None,
    own: tuple[Measure, ...],
    judged: bool,
) -> tuple[Result, SlopeEvidence | None]:
    known = {**MEASURES, **{measure.name: measure for measure in own}}
    measures = {name: m for name, m in known.items() if only is None or name in only}
    wanted = {part: only is None or part in only for part in _PARTS}
    forward = fidelity.gradient == "forward" and fidelity.integrator == "modal"
    slopes = (fidelity.step_tolerance or 0.0) if forward and judged else None
    running_sums = running(tuple(measures.values()), wanted["energy"], slopes)
    traces = traced(tuple(measures.values()))
    done, unmet = 1.0, None
    if isinstance(scene, NormalScene):
        link = normal_direction.prepared(scene, fidelity)
        alike = fidelity.step_tolerance is None
        kept = Kept(running_sums, traces, alike, history)
        recorder = NormalRecorder(scene=scene, link=link, kept=kept)
        record, saved, start, unmet = normal_direction.run(
            scene, link, fidelity, recorder, recorder.saves
        )
        status = diagnostics.of_normal_record(scene, link, fidelity, record, unmet)
    else:
        steps = time_loop.count_steps(scene.duration, fidelity.step)
        mechanics, clock, memory = prepared(scene, fidelity)
        link = mechanics.link
        start, modal = clock.start, fidelity.integrator == "modal"
        alike = not modal or clock.counts[-1] == 1
        kept = Kept(running_sums, traces, alike, history)
        recorder = SceneRecorder(scene=scene, mechanics=mechanics, kept=kept)
        if modal:
            record, saved, unmet = time_loop.modal(
                mechanics, clock, memory, steps, recorder, recorder.saves
            )
        else:
            vibration = None if memory.fence is None else memory.fence.vibration
            record, saved, done = diffrax_reference.run(
                mechanics, clock, memory.body, vibration, steps, recorder
            )
        status = diagnostics.of_record(scene, mechanics, record, done, start, unmet)
    evidence = None
    if forward:
        states = record.states
        evidence = SlopeEvidence.of(states["force"], states.get("slopes"), states.get("rivals"))
    return gather(record, measures, wanted, saved, start, status, scene), evidence
