# SPDX-License-Identifier: MIT OR Apache-2.0
"""Conversion of information, in decimals, to standard deviations and covariances, and back without loss.

Information is the inverse of a covariance. A number inverted twice in floating point is rarely restored. Files are
therefore read with extra digits and rounded once, and written with as many digits as restore the number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext
from functools import lru_cache

__all__ = ["covariance", "information", "informations", "is_diagonal", "sigma"]

EXACT = Context(prec=120, Emax=MAX_EMAX, Emin=MIN_EMIN)
"""More than three times the digits of the longest numbers that are written."""
DIGITS = (20, 25, 30, 35, 40)
"""Numbers of significant digits to try if those of a double do not suffice."""
INDEX = {3: ((0, 1), (1, 2)), 6: ((0, 1, 2), (1, 3, 4), (2, 4, 5))}
"""Indices of the rows of a symmetric matrix in its upper triangle of 3 or 6 numbers."""


@lru_cache(2**16)
def sigma(text: str) -> float:
    """Standard deviation of an information above 0: the double nearest to 1/sqrt(information)."""
    return float(EXACT.divide(Decimal(1), EXACT.sqrt(EXACT.create_decimal(text))))


@lru_cache(2**16)
def information(deviation: float) -> str:
    """Information of a standard deviation above 0, which `sigma` restores exactly."""
    exact = EXACT.divide(Decimal(1), EXACT.power(Decimal(deviation), Decimal(2)))
    for text in _shorter(exact):
        if sigma(text) == deviation:
            return text
    raise AssertionError(deviation)  # 20 digits resolve every double


@lru_cache(2**16)
def covariance(texts: tuple[str, ...]) -> tuple[float, ...] | None:
    """Upper triangle of a covariance, row by row, from that of the information.

    None if the matrix is not positive definite, or its inverse exceeds the range of doubles.
    """
    inverse = _inverse([EXACT.create_decimal(text) for text in texts])
    if inverse is None:
        return None
    rounded = tuple(float(value) + 0.0 for value in inverse)  # no -0
    return rounded if all(map(math.isfinite, rounded)) else None


@lru_cache(2**16)
def informations(values: tuple[float, ...]) -> tuple[tuple[str, ...], bool]:
    """Upper triangle of the information from that of a covariance, and whether `covariance` restores it exactly.

    It does not if the covariance is nearly singular, or has a zero where the information has none.

    Raises
    ------
    ArithmeticError
        If the matrix is not positive definite, or its inverse exceeds the range of doubles.
    """
    inverse = _inverse([Decimal(value) for value in values])
    if inverse is None or not all(math.isfinite(float(value)) for value in inverse):
        raise ArithmeticError("expected a positive definite covariance whose inverse doubles can hold")
    choices = list(zip(*map(_shorter, inverse), strict=True))
    for texts in choices:
        if covariance(texts) == values:
            return texts, True
    return choices[0], False


def is_diagonal(values: Sequence[float] | Sequence[Decimal]) -> bool:
    """Whether an upper triangle is zero off the diagonal."""
    return not any(values[i] for row in range(len(INDEX[len(values)])) for i in INDEX[len(values)][row][row + 1 :])


def _inverse(values: Sequence[Decimal]) -> list[Decimal] | None:
    """The upper triangle of the inverse of a positive definite matrix, by cofactors."""
    with localcontext(EXACT):
        if len(values) == 3:
            xx, xy, yy = values
            determinant = xx * yy - xy * xy
            if not (xx > 0 and determinant > 0):
                return None
            return [yy / determinant, -xy / determinant, xx / determinant]
        xx, xy, xt, yy, yt, tt = values
        minor = xx * yy - xy * xy
        cofactors = [
            yy * tt - yt * yt,
            xt * yt - xy * tt,
            xy * yt - xt * yy,
            xx * tt - xt * xt,
            xy * xt - xx * yt,
            minor,
        ]
        determinant = xx * cofactors[0] + xy * cofactors[1] + xt * cofactors[2]
        if not (xx > 0 and minor > 0 and determinant > 0):
            return None
        return [cofactor / determinant for cofactor in cofactors]


def _shorter(value: Decimal) -> list[str]:
    """A number with an increasing number of digits."""
    if not value:
        return ["0"] * (2 + len(DIGITS))
    near = float(value)
    return [f"{near:.15g}", repr(near), *(str(Context(prec=digits).plus(value)) for digits in DIGITS)]
