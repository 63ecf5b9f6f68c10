"""A dictionary of measures whose entries are fields."""

import abc
from collections.abc import Collection
from typing import Any, ClassVar

import equinox as eqx

from ..printing import Readable, Table


class AbstractByName(Readable, eqx.Module):
    """Numbers by the names of measures, each of them a field: `self.peak_force`. A known measure
    without a number is `None`."""

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

    @abc.abstractmethod
    def _rows(self) -> list[tuple[str, str]] | None:
        """Pairs of a name and its text, or of no name and a line; `None` where numbers are
        traced."""

    def _printed(self) -> Table:
        rows, title = self._rows(), type(self).__name__
        return Table(f"{title}(traced)") if rows is None else Table(title, tuple(rows))

    def __str__(self) -> str:
        rows = self._rows()
        if rows is None:
            return self._printed().title
        lines = (f"{name:>18}  {text}" if name else text for name, text in rows)
        return "\n".join(line.rstrip() for line in lines)

    def __dir__(self):
        return [*super().__dir__(), *getattr(self, self._table)]
