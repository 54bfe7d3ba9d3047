"""The joint distribution of the dimensions of men and of women.

Of each dimension x, ``z = (((x / centre)^exponent - 1) / exponent) / spread`` is a normal deviate (Box and Cox 1964;
the logarithm where the exponent is 0). Of a dimension that has ends, x is the odds
``(x - low) (high - low) / (high - x)``, which with the exponent 0 is a bounded distribution of Johnson (1949). The
deviates of one person have a joint normal distribution with the correlations of the tables "population_male" and
"population_female". `tests.audits.population` estimates them from ANSUR II.

What is likely, given some dimensions, is the conditional mean of the deviates (Eaton 1983, "Multivariate Statistics",
section 3.4).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from wholebody.base.arrays import Array
from wholebody.figures.tables import table

SEXES = {"male": "men", "female": "women"}

UNITS = {"mass": "kg", "age": "years"}  # units of the dimensions that are not lengths


RARE = 1e-6
"""Share of people by the normal distribution: who differs more from those of the same stature and mass is nobody. Its
tails are thinner than people's, of whom up to one in 200 would differ by more than one in 16,000 does."""

RANKED = 50
"""People of a sample from which on each dimension has the shares of all people; of fewer, ranks would tear apart
dimensions that go together."""


def odds(x: Array, low: Array | float, high: Array | float) -> Array:
    """Return the odds of values between two ends; of ends 0 and infinity, the values.

    Of a value nearer to a finite end than two years, or beyond it, those of that distance from the end.
    """
    # few were measured within two years of an end of the ages: they have the dimensions of those at this distance
    inner = 2.0 * np.isfinite(high)
    above = np.clip(x, low + inner, high - inner) - low
    return np.asarray(above / (1.0 - above / (high - low)))


class Population:
    """The joint distribution of the dimensions of one sex.

    Attributes:
        sex: "male" or "female".
        names: of the n dimensions; the first are stature, mass and age. Metres, kilograms, years.
        correlation: (n, n) of the deviates.
    """

    def __init__(self, sex: str) -> None:
        rows = table(f"population_{sex}")
        self.sex = sex
        self.names = tuple(row["name"] for row in rows)
        self.correlation = np.array([[float(row[name]) for name in self.names] for row in rows])
        self._low, self._high, self._centre, self._exponent, self._spread = (
            np.array([float(row[column]) for row in rows]) for column in ("low", "high", "centre", "exponent", "spread")
        )

    def deviates(self, values: Mapping[str, float]) -> tuple[list[int], Array]:
        """Return the indices (k,) of some dimensions, and their normal deviates (k,)."""
        which = [self.names.index(name) for name in values]
        low, high = self._low[which], self._high[which]
        ratio = odds(np.array(list(values.values()), dtype=float), low, high) / self._centre[which]
        power = self._exponent[which]
        plain = np.where(power == 0.0, np.log(ratio), (ratio**power - 1.0) / np.where(power == 0.0, 1.0, power))
        return which, plain / self._spread[which]

    def values(self, deviates: Array) -> dict[str, float]:
        """Return the dimensions that have normal deviates (n,), by name."""
        plain, power = self._spread * deviates, self._exponent
        # Beyond the end of a distribution, eight standard deviations away or more, its end.
        base = np.maximum(1.0 + power * plain, 1e-3)
        ratio = np.where(power == 0.0, np.exp(plain), base ** (1.0 / np.where(power == 0.0, 1.0, power)))
        found = self._centre * ratio
        found = self._low + found / (1.0 + found / (self._high - self._low))
        return dict(zip(self.names, map(float, found), strict=True))

    def likely(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return all dimensions of those who have some of them: these, and the conditional mean of the others."""
        which, given = self.deviates(values)
        return self.values(self._conditional(which, given)) | dict(values)

    def unlikely(
        self, values: Mapping[str, float], size: Mapping[str, float]
    ) -> tuple[str, float, float, float] | None:
        """The dimension that makes a person too rare (`RARE`), by how many deviations, and its likely range."""
        from scipy.special import chdtri  # loading it takes longer than loading a person, and few are asked for so

        which, given = self.deviates({**size, **values})
        fixed, asked = len(size), len(which)
        inverse = np.linalg.inv(self.correlation[np.ix_(which, which)])
        left = given @ inverse @ given
        if fixed:
            some = given[:fixed]
            left -= some @ np.linalg.solve(self.correlation[np.ix_(which[:fixed], which[:fixed])], some)
        if left <= chdtri(asked - fixed, RARE):
            return None
        # Residual of each given all others, and its standard deviation, from the inverse of the correlation.
        scale = 1.0 / np.sqrt(np.diag(inverse))
        off = (inverse @ given) * scale
        worst = fixed + int(np.abs(off[fixed:]).argmax())
        middle = given[worst] - off[worst] * scale[worst]
        ends = []  # standard deviations that one dimension of a likely person is from what the others say, at most
        for side in (-1.0, 1.0):
            deviates = np.zeros(len(self.names))
            deviates[which[worst]] = middle + side * math.sqrt(chdtri(1, RARE)) * scale[worst]
            ends.append(self.values(deviates)[self.names[which[worst]]])
        return self.names[which[worst]], abs(float(off[worst])), ends[0], ends[1]

    def quantile(self, name: str, share: float) -> float:
        """Return the value of a dimension below which a share of the people, between 0 and 1, is."""
        from statistics import NormalDist

        return self.values(np.full(len(self.names), NormalDist().inv_cdf(share)))[name]

    def sample(self, count: int, rng: np.random.Generator) -> list[dict[str, float]]:
        """Draw people's dimensions; small samples represent the population better than independent draws."""
        # Scrambled Sobol along principal components (Acworth, Broadie, Glasserman 1998), then ranks as normal scores,
        # which leaves correlations (Iman and Conover 1982); of fewer than `RANKED` people they stay.
        from scipy.special import ndtri
        from scipy.stats.qmc import Sobol

        size, axes = np.linalg.eigh(self.correlation)
        points = Sobol(len(self.names), rng=rng).random_base2(max(count - 1, 0).bit_length())[:count]
        normal = ndtri(np.clip(points, 1e-9, 1.0 - 1e-9))
        deviates = normal[:, ::-1] @ (axes * np.sqrt(np.maximum(size, 0.0))).T
        if count >= RANKED:
            deviates = ndtri((deviates.argsort(axis=0).argsort(axis=0) + 0.5) / count)
        return [self.values(one) for one in deviates]

    def boundary(self, dimensions: Sequence[str], confidence: float) -> list[dict[str, float]]:
        """Return people on the boundary of a share of all people, in the space of some dimensions, and their middle."""
        # Bittner's (2000) A-CADRE in the principal components with nine tenths of the variance, four at most.
        from itertools import product

        from scipy.special import chdtri

        which = [self.names.index(name) for name in dimensions]
        size, axes = np.linalg.eigh(self.correlation[np.ix_(which, which)])
        size, axes = size[::-1], axes[:, ::-1]
        most = 1 + int(np.searchsorted(np.cumsum(size) / size.sum(), 0.9 - 1e-12))
        kept = min(most, 4, len(which))
        radius = math.sqrt(chdtri(kept, 1.0 - confidence))
        corners = np.array(list(product((-1.0, 1.0), repeat=kept))) / math.sqrt(kept)
        ends = np.vstack([np.zeros((1, kept)), np.eye(kept), -np.eye(kept), *([corners] if kept > 1 else [])])
        spread = axes[:, :kept] * np.sqrt(np.maximum(size[:kept], 0.0))
        return [self.values(self._conditional(which, spread @ (radius * end))) for end in ends]

    def _conditional(self, which: Sequence[int], given: Array) -> Array:
        """The conditional mean (n,) of the deviates, given some of them, by their indices."""
        known = list(which)
        found = self.correlation[:, known] @ np.linalg.solve(self.correlation[np.ix_(known, known)], given)
        found[known] = given
        return np.asarray(found)


population = cache(Population)  # of a sex, "male" or "female"
