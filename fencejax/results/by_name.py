"""A dictionary of measures that reads as fields."""

from collections.abc import Collection
from typing import Any, ClassVar

import equinox as eqx


class AbstractByName(eqx.Module):
    """Numbers by the names of measures, each of them a field: `self.peak_force`. One that is known
    and not there is `None`."""

    _table: ClassVar[str]
    """The field that holds the numbers by name."""
    _known: ClassVar[Collection[str]]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == self._table:
            raise AttributeError(name)
        numbers = getattr(self, self._table)
        if name in numbers:
            return numbers[name]
        if name in self._known:
            return None
        raise AttributeError(
            f"`{type(self).__name__}` has no field `{name}`. Its measures are "
            f"{', '.join(numbers)}."
        )

    def __dir__(self):
        return [*super().__dir__(), *getattr(self, self._table)]
