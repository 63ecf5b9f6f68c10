"""The identification problem: the parameters, and the weighted residuals to minimise."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..design import DesignVariable
from ..results import Status
from ..scenes import AnyScene, numbers as scene_numbers
from . import sampling
from .fit_signals import curvature_of, program_of
from .recording import Recording

OFFSET = "time_offset"
"""Name of the time [s] by which the scene's clock is ahead of the recording's: at the recording's
time t the scene is at t + time_offset."""

_BOUNDS = {
    "youngs_modulus": (0.2e9, 50e9),
    "density": (300.0, 9000.0),
    "damping_ratio": (1e-3, 0.6),
    "stiffness": (1e7, 1e12),
    "damping": (3e3, 3e7),
    "fence_kinetic_friction": (0.01, 1.5),
    "fence_static_friction": (0.01, 1.5),
    "belt_kinetic_friction": (0.01, 1.5),
    "belt_static_friction": (0.01, 1.5),
}
PARAMETERS: Mapping[str, DesignVariable] = {
    **{
        name: sampling.variable(name, lower, upper, scaling="logarithmic")
        for name, (lower, upper) in _BOUNDS.items()
    },
    OFFSET: DesignVariable(OFFSET, -0.02, 0.02, "s", "linear"),
}
"""Parameters with default bounds: numbers that are hard to measure in any other way."""


class Experiment(NamedTuple):
    """A scene as it was set up, and its recording."""

    scene: AnyScene
    recording: Recording


class Problem:
    """Weighted residuals and their derivatives in the shares u of the parameters' ranges."""

    def __init__(self, experiments, parameters, fidelity, evaluations=0):
        self.experiments = experiments
        self.parameters = parameters
        self.chosen = tuple(p.name for p in parameters if not p.name.startswith(OFFSET))
        self.offsets = [k for k, p in enumerate(parameters) if p.name.startswith(OFFSET)]
        self.evaluations = evaluations
        self.fidelity = fidelity
        self.programs = []
        for scene, recording in experiments:
            structure = jax.tree.structure(scene)
            program = program_of(structure, self.chosen, recording.names, fidelity)
            self.programs.append((program, jax.tree.leaves(scene), jnp.asarray(recording.time)))
        self._at: np.ndarray | None = None
        self._found: list[tuple[np.ndarray, np.ndarray, int]] = []

    def values(self, shares) -> np.ndarray:
        """Parameters [SI] at shares of their ranges."""
        pairs = zip(self.parameters, shares, strict=True)
        return np.array([float(p.value(float(u))) for p, u in pairs])

    def stretch(self, values) -> np.ndarray:
        """dp/du [SI]."""
        return np.where(self.linear, 1.0, values) * self.spans

    @property
    def linear(self) -> np.ndarray:
        """Whether each parameter is linear in its share, (n,)."""
        return np.array([p.scaling == "linear" for p in self.parameters])

    def _offset(self, index: int) -> int | None:
        """The index of an experiment's time offset among the parameters."""
        if not self.offsets:
            return None
        return self.offsets[index if len(self.offsets) > 1 else 0]

    @property
    def spans(self) -> np.ndarray:
        """Factors from shares of the ranges to ln p, or to p where the scaling is linear, (n,)."""
        return np.array([
            p.upper - p.lower if p.scaling == "linear" else np.log(p.upper / p.lower)
            for p in self.parameters
        ])  # fmt: skip

    def curvature(self, shares, noise: Mapping[str, float]) -> np.ndarray:
        """Second derivatives in u of half the sum of the squared weighted residuals, (n, n), by the
        second derivatives of the simulation."""
        values = self.values(shares)
        stretch = self.stretch(values)
        residual, rows = self.stacked(shares, noise)
        # p is exponential in u with logarithmic scaling: d^2p/du^2 = dp/du ln(b / a).
        bends = np.where(self.linear, 0.0, self.spans)
        total = np.diag(bends * (rows.T @ residual))
        plain = [k for k in range(len(values)) if k not in self.offsets]
        for index, ((scene, recording), (_, leaves, time)) in enumerate(
            zip(self.experiments, self.programs, strict=True)
        ):
            own = self._offset(index)
            places = plain if own is None else [*plain, own]
            program = curvature_of(
                jax.tree.structure(scene), self.chosen, recording.names, self.fidelity,
                own is not None,
            )  # fmt: skip
            weight = np.array([1 / noise[name] for name in recording.names])[:, None]
            found = np.asarray(program(
                jnp.asarray(values[places]), leaves, time, jnp.asarray(recording.values),
                jnp.asarray(weight * recording.present),
            ))  # fmt: skip
            total[np.ix_(places, places)] += found * np.outer(stretch[places], stretch[places])
        return total

    def models(self, shares):
        """Values (signals, K), derivatives in u (signals, K, n) and status of every experiment."""
        shares = np.asarray(shares, dtype=float)
        if self._at is not None and np.array_equal(shares, self._at):
            return self._found
        values = self.values(shares)
        stretch = self.stretch(values)
        plain = [k for k in range(len(values)) if k not in self.offsets]
        found = []
        for index, (program, leaves, time) in enumerate(self.programs):
            own = self._offset(index)
            offset = 0.0 if own is None else values[own]
            given = tuple(jnp.asarray(values[k]) for k in plain)
            modelled, columns, status = jax.device_get(
                program(given, jnp.asarray(offset), leaves, time)
            )
            slopes = np.zeros((*modelled.shape, len(values)))
            slopes[..., plain] = columns[..., :-1]
            if own is not None:
                slopes[..., own] = columns[..., -1]
            found.append((modelled, slopes * stretch, int(status)))
        self.evaluations += 1
        self._at, self._found = shares.copy(), found
        return found

    def in_doubt(self, shares) -> bool:
        """Whether an experiment is in numerical doubt, so that a finer fidelity may help."""
        return any(Status(status).numerical for _, _, status in self.models(shares))

    def stacked(self, shares, noise: Mapping[str, float]):
        """Residuals (N,) and Jacobian (N, n) of all recorded samples, in units of the noise.
        """
        residuals, rows = [], []
        for (modelled, slopes, _), (_, recording) in zip(
            self.models(shares), self.experiments, strict=True
        ):
            weight = np.array([1 / noise[name] for name in recording.names])[:, None]
            there = recording.present
            residuals.append((weight * (modelled - recording.values))[there])
            rows.append((weight[..., None] * slopes)[there])
        return np.concatenate(residuals), np.concatenate(rows)


def parameters_of(given: Sequence[str | DesignVariable], experiments) -> tuple[DesignVariable, ...]:
    """Parameters with bounds; an offset of its own for every experiment."""
    if isinstance(given, (str, DesignVariable)) or not given:
        raise ValueError(
            "Argument `parameters` must be a sequence of at least one name or DesignVariable, but "
            f'is {given!r}. Write, for example, ["youngs_modulus", "damping_ratio"].'
        )
    chosen: list[DesignVariable] = []
    for parameter in given:
        if isinstance(parameter, str):
            if parameter not in PARAMETERS:
                raise ValueError(
                    f"Argument `parameters` must give bounds for {parameter!r}, which has no "
                    f"default ones. Write DesignVariable({parameter!r}, lower, upper, unit)."
                )
            parameter = PARAMETERS[parameter]
        if parameter.name == OFFSET and len(experiments) > 1:
            chosen += [
                dataclasses.replace(parameter, name=f"{OFFSET}[{k}]")
                for k in range(len(experiments))
            ]
        else:
            chosen.append(parameter)
    physical = [p for p in chosen if not p.name.startswith(OFFSET)]
    if not physical:
        raise ValueError(
            f"Argument `parameters` must name a number of the scene, but holds {OFFSET!r} alone."
        )
    for scene, _ in experiments:
        scene_numbers.together(scene, [p.name for p in physical])
        for p in physical:
            scene_numbers.check(scene, p.name, p.lower)
            scene_numbers.check(scene, p.name, p.upper)
    return tuple(chosen)


def starting_shares(parameters, scene: AnyScene) -> np.ndarray:
    """Shares at which the search starts: the first scene's own numbers."""
    shares = []
    for p in parameters:
        value = 0.0
        if not p.name.startswith(OFFSET):
            value = float(scene_numbers.read(scene, [p.name])[0])
        if not p.lower <= value <= p.upper:
            raise ValueError(
                f"Argument `{p.name}` of the scene must be within the bounds {p.lower:g} ... "
                f"{p.upper:g} [{p.unit}], since the search starts there, but is {value:g}. Widen "
                "the bounds, or change the scene."
            )
        shares.append(float(p.share(value)))
    return np.clip(np.array(shares), 1e-6, 1 - 1e-6)
