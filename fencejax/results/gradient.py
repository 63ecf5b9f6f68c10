"""A gradient with the names and the units of the numbers that it is taken in."""

from typing import Any

import jax
import numpy as np

from ..printing import Readable, Table, known, multiple, shown
from ..scenes import numbers as scene_numbers
from .measures import MEASURES


class Gradient(Readable):
    """Derivatives of a number in all numbers of a scene, or of a part, by name.

        slope = jax.grad(lambda scene: fj.simulate(scene, only="peak_force").peak_force)(scene)
        fj.Gradient(slope, scene, of="peak_force")

    A gradient in a scene is a scene itself, whose numbers are derivatives; here they are printed
    as such, with their units, and beside each what one per cent more of that number does.
    `gradient["reach"]` is the derivative [SI] in a number by any name that the scene has for it.

    >>> belt = fj.Belt()
    >>> slope = jax.grad(lambda belt: belt.speed**2)(belt)
    >>> print(fj.Gradient(slope, belt, of="speed squared", unit="m^2/s^2"))
    derivatives of speed squared
      speed    4 m^2/s^2 per m/s; 1 % more: 0.08 m^2/s^2
      none in  width, kinetic, static, gravity
    """

    def __init__(self, gradient: Any, at: Any, of: str = "value", unit: str | None = None):
        """**Arguments:**

        - `gradient`: as `jax.grad` returns it.
        - `at`: the scene, or the part, where it was taken.
        - `of`: name of what was differentiated.
        - `unit`: its unit; by default that of the measure `of`, and else 1.

        Raises `ValueError` where the two have not the same structure and shapes.
        """
        shapes = [jax.tree.map(np.shape, tree) for tree in (gradient, at)]
        if jax.tree.structure(gradient) != jax.tree.structure(at) or shapes[0] != shapes[1]:
            raise ValueError(
                "Argument `gradient` must have the structure and shapes of `at`, what it was taken "
                f"in, but is a {type(gradient).__name__} beside a {type(at).__name__}. Write "
                "fj.Gradient(jax.grad(f)(scene), scene)."
            )
        self.gradient, self.at, self.of = gradient, at, of
        measure = MEASURES.get(of)
        self.unit = unit if unit is not None else "1" if measure is None else measure.unit

    @property
    def names(self) -> tuple[str, ...]:
        """The paths of all numbers, in order."""
        return scene_numbers.names(self.at)

    @property
    def values(self) -> np.ndarray:
        """The derivatives [SI], of shape (N,)."""
        return np.asarray(scene_numbers.values(self.gradient))

    def __getitem__(self, name: str) -> float:
        lanes = np.asarray(scene_numbers.values(self.at))[None]
        return float(
            scene_numbers.slopes_in(self.at, (name,), lanes, self.values[None, None])[0, 0, 0]
        )

    def elasticities(self, value: float) -> dict[str, float]:
        """The elasticities d ln Q / d ln p [1] of a quantity with the `value` Q, by the short name
        of the number p: as `fencejax.plot.gradient_bars` draws them. Numbers that are 0, or have no
        effect, are left out.

        >>> belt = fj.Belt()
        >>> slope = jax.grad(lambda belt: belt.speed**2)(belt)
        >>> fj.Gradient(slope, belt).elasticities(belt.speed**2)
        {'speed': 2.0}
        """
        at = np.asarray(scene_numbers.values(self.at))
        return {
            scene_numbers.short(self.at, path): float(slope * number / value)
            for path, slope, number in zip(self.names, self.values, at, strict=True)
            if slope * number != 0
        }

    def _printed(self) -> Table:
        title = f"derivatives of {self.of.replace('_', ' ')}"
        if not known(*jax.tree.leaves((self.gradient, self.at))):
            return Table(f"{title} (traced)")
        rows, without = [], []
        for path, slope, value in zip(
            self.names, self.values, np.asarray(scene_numbers.values(self.at)), strict=True
        ):
            name = scene_numbers.short(self.at, path)
            if slope == 0:
                without.append(name)
                continue
            size, per = multiple(value, scene_numbers.number(self.at, path).unit)
            text = shown(slope * size, self.unit) + ("" if per == "1" else f" per {per}")
            if value != 0:
                text = f"{text}; 1 % more: {shown(0.01 * slope * value, self.unit)}"
            rows.append((name, text))
        if without:
            rows.append(("none in", ", ".join(without)))
        return Table(title, tuple(rows))
