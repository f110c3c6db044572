# SPDX-License-Identifier: MIT OR Apache-2.0
"""Checks that turn arguments into what the core takes, or raise an `InvalidInputError`.

Its message names the argument, what was expected and what it got.
"""

from __future__ import annotations

import math
import operator
import sys
from collections.abc import Sequence
from types import EllipsisType
from typing import Any, SupportsFloat, SupportsIndex, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bearslam.errors import InvalidInputError
from bearslam.progress import Progress

__all__ = [
    "SEED_LIMIT",
    "TURN",
    "FloatArray",
    "IntArray",
    "angles",
    "check_half_turn",
    "check_magnitudes",
    "check_turn",
    "choice",
    "flag",
    "floats",
    "indices",
    "instance",
    "observer",
    "plain",
    "posed",
    "quote",
    "real",
    "spread",
    "whole",
]

T = TypeVar("T")
FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]

SEED_LIMIT = 2**64 - 1
"""The largest seed."""
TURN = 2 * math.pi
"""Largest angle [rad]: a larger one is most likely in degrees."""
LARGEST = 1e60
"""Largest magnitude of a coordinate, as in the core: powers and quotients stay within the arithmetic."""
INDEX_LIMIT = 2**24
"""Largest number of views or landmarks: a larger index is most likely an identifier, not a number counted from 0."""


def plain(name: str, value: ArrayLike) -> NDArray[Any]:
    """Array of any dtype and shape."""
    if isinstance(value, np.ma.MaskedArray):
        raise InvalidInputError(f"{name}: expected a plain array, got a masked one; use .filled(numpy.nan)")
    try:
        return np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name}: expected an array of numbers, got rows that do not fit together") from error


def floats(name: str, value: ArrayLike, shape: Sequence[int | str], *, missing: bool = False) -> FloatArray:
    """Float64 array in C order, of the given shape, in which letters stand for any length.

    Every entry must be finite; with `missing`, NaN is allowed as well. The range of numbers is checked by the core.
    """
    array = plain(name, value)
    if array.dtype.kind not in "fiu":
        raise InvalidInputError(f"{name}: expected real numbers, got an array of dtype {array.dtype}")
    if array.ndim != len(shape) or any(
        isinstance(want, int) and want != got for want, got in zip(shape, array.shape, strict=True)
    ):
        raise InvalidInputError(f"{name}: expected an array of shape {_shape(shape)}, got {_shape(array.shape)}")
    numbers = np.asarray(array, dtype=np.float64, order="C")
    bad = np.isinf(numbers) if missing else ~np.isfinite(numbers)
    if bad.any():
        where, place = _first(bad)
        wanted = "a finite number, or NaN for what is missing" if missing else "a finite number"
        raise InvalidInputError(f"{name}{place}: expected {wanted}, got {numbers[where]}")
    return numbers


def angles(name: str, value: ArrayLike, shape: Sequence[int | str], *, missing: bool = False) -> FloatArray:
    """Float64 array of bearings [rad], of which none is beyond one turn."""
    numbers = floats(name, value, shape, missing=missing)
    check_turn(name, numbers)
    return numbers


def posed(name: str, value: ArrayLike, shape: Sequence[int | str], *, missing: bool = False) -> FloatArray:
    """Float64 array of poses (x, y, theta), of which no heading is beyond one turn."""
    numbers = floats(name, value, shape, missing=missing)
    check_turn(name, numbers, column=(2,))
    return numbers


def check_turn(
    name: str,
    values: ArrayLike,
    *,
    expected: str = "radians within one turn",
    turn: float = TURN,
    column: tuple[int, ...] = (),
) -> None:
    """Refuse angles beyond one turn, at these last indices if there are any, which are most likely in degrees."""
    if isinstance(values, float) and abs(values) <= turn:
        return  # without an array, line by line of a file
    given = np.asarray(values)
    index: tuple[EllipsisType | int, ...] = (..., *column)
    beyond = np.abs(given[index]) > turn
    if beyond.any():
        where, place = _first(beyond, column)
        raise InvalidInputError(f"{name}{place}: expected {expected}, got {given[where]:g}: degrees?")


def check_half_turn(name: str, sigma: ArrayLike) -> None:
    """Refuse standard deviations of angles beyond half a turn, which are most likely in degrees."""
    check_turn(name, sigma, expected="radians within half a turn", turn=math.pi)


def check_magnitudes(name: str, values: FloatArray) -> None:
    """Refuse coordinates of a map beyond the range of the core; they may be as near to zero as they like."""
    beyond = np.abs(values) > LARGEST
    if beyond.any():
        where, place = _first(beyond)
        expected = f"a magnitude of at most {LARGEST:g}"
        raise InvalidInputError(f"{name}{place}: expected {expected}, got {values[where]:g}; choose other units")


def _first(bad: NDArray[np.bool_], last: tuple[int, ...] = ()) -> tuple[tuple[int, ...], str]:
    """Where the first bad entry is, completed by the `last` indices, and the same as text."""
    where = tuple(int(i) for i in np.argwhere(bad)[0]) + last
    return where, f"[{', '.join(map(str, where))}]" if where else ""


def indices(name: str, value: ArrayLike) -> IntArray:
    """Int64 array of shape (k,) with 0-based indices."""
    array = plain(name, value)
    if array.ndim != 1:
        raise InvalidInputError(f"{name}: expected an array of shape (k,), got {_shape(array.shape)}")
    if array.size == 0:
        return np.empty(0, dtype=np.int64)
    if array.dtype.kind not in "iu":
        raise InvalidInputError(f"{name}: expected 0-based integers, got an array of dtype {array.dtype}")
    bad = (array < 0) | (array >= INDEX_LIMIT)
    if bad.any():
        where = int(np.argmax(bad))
        raise InvalidInputError(f"{name}[{where}]: expected an index from 0 to {INDEX_LIMIT - 1}, got {array[where]}")
    return np.ascontiguousarray(array, dtype=np.int64)


def quote(value: object) -> str:
    """The `repr` of a value, shortened if it is long."""
    text = repr(value)
    return text if len(text) <= 100 else f"{text[:80]}... ({len(text)} characters)"


def whole(name: str, value: SupportsIndex, low: int, high: int = 2**63 - 1) -> int:
    """Integer from `low` to `high`, by default up to the largest signed 64-bit integer."""
    try:
        number = operator.index(value)
    except TypeError:
        raise InvalidInputError(f"{name}: expected an integer, got {quote(value)}") from None
    if isinstance(value, bool | np.bool_) or not low <= number <= high:
        raise InvalidInputError(f"{name}: expected an integer from {low} to {high}, got {quote(value)}")
    return number


def real(
    name: str,
    value: SupportsFloat,
    low: float,
    high: float = sys.float_info.max,
    *,
    above: bool = False,
    infinite: bool = False,
) -> float:
    """Real number of at least `low` (with `above`, above it) and at most `high`; infinite only where allowed."""
    wanted = f"a number {'above' if above else 'of at least'} {low:g}"
    if high < sys.float_info.max:
        wanted += f" and at most {high:g}"
    if infinite:
        wanted += ", or infinity"
    try:
        number = math.nan if isinstance(value, str | bytes | bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (low < number if above else low <= number) or not (number <= high or (infinite and math.isinf(number))):
        raise InvalidInputError(f"{name}: expected {wanted}, got {quote(value)}")
    return number


def spread(name: str, value: SupportsFloat, *, above: bool = False) -> float:
    """Standard deviation of an angle [rad]: of at least 0 (with `above`, above it) and within half a turn."""
    number = real(name, value, 0.0, above=above)
    check_half_turn(name, number)
    return number


def choice(name: str, value: str, known: Sequence[str]) -> str:
    """One of the known words."""
    if value not in known:
        raise InvalidInputError(f"{name}: expected {' or '.join(map(repr, known))}, got {quote(value)}")
    return value


def flag(name: str, value: bool) -> bool:
    """True or False, not a number that stands for it."""
    if not isinstance(value, bool | np.bool_):
        raise InvalidInputError(f"{name}: expected True or False, got {quote(value)}")
    return bool(value)


def observer(progress: Progress | None) -> Progress | None:
    """A progress callback, or None."""
    if progress is not None and not callable(progress):
        raise InvalidInputError(f"progress: expected None or a function (stage, done, total), got {quote(progress)}")
    return progress


def _shape(shape: Sequence[int | str]) -> str:
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"


def instance(name: str, value: T, kind: type[T]) -> T:
    """A value of a type."""
    if not isinstance(value, kind):
        raise InvalidInputError(f"{name}: expected {kind.__name__}, got {quote(value)}")
    return value
