"""The methods that comparisons set beside each other, under one interface."""

from wholebody.bench.entrants.base import Budget, Entrant, Prepared, set_up
from wholebody.bench.entrants.registry import entrants, missing, names

__all__ = ["Budget", "Entrant", "Prepared", "entrants", "missing", "names", "set_up"]
