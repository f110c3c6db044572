# SPDX-License-Identifier: MIT OR Apache-2.0
"""Wild changes of an input: absurd magnitudes, NaN and infinity, wrong shapes, empty arrays, wrong types."""

from __future__ import annotations

from typing import Any

import numpy as np

from .dice import Dice

CHANGES = {"magnitude": 5, "scale": 3, "nan": 2, "infinite": 1, "shape": 2, "empty": 1, "zero": 1, "type": 0.5}


def damage(dice: Dice, arguments: dict[str, Any]) -> list[str]:
    """Change one to three of the numbers or arrays of some arguments in place; what was done, in words."""
    done = []
    for _ in range(dice.pick([1, 1, 1, 2, 3])):
        paths = _paths(arguments)
        if not paths:
            break
        path = dice.pick(paths)
        change = dice.weighted(CHANGES)
        *way, last = path
        place = arguments
        for key in way:
            place = place[key]
        value = _changed(dice, change, place[last])
        if isinstance(place, tuple):
            pair = list(place)
            pair[last] = value
            arguments[way[-1]] = tuple(pair)
        else:
            place[last] = value
        done.append(f"{'.'.join(map(str, path))}: {change}")
    return done


def _paths(arguments: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Where the numbers are."""
    found: list[tuple[Any, ...]] = []
    for name, value in arguments.items():
        if isinstance(value, dict):
            found += [(name, key) for key in value] * 2
        elif isinstance(value, tuple):
            found += [(name, key) for key in range(len(value))]
        elif name != "form":
            found.append((name,))
    return found


def _changed(dice: Dice, change: str, value: Any) -> Any:
    if change == "type":
        return dice.pick([None, "text", [], {}, True, object, 1j, [[1.0], [2.0, 3.0]]])
    if not isinstance(value, np.ndarray):
        if isinstance(value, bool | str) or not isinstance(value, int | float):
            return value
        return {
            "nan": np.nan,
            "infinite": np.inf,
            "zero": 0,
            "shape": np.full(2, value),
            "empty": [],
        }.get(change, dice.pick([-1, 1]) * dice.power(-300, 300))
    array = np.array(value, dtype=float if change in ("magnitude", "scale", "nan", "infinite") else None)
    if change == "shape":
        return dice.pick([array[None], array[:-1], array.T, array.ravel(), np.append(array, array)])
    if change == "empty":
        return array[:0]
    if change == "scale":
        with np.errstate(over="ignore"):
            return array * dice.power(-300, 300)
    if array.size == 0:
        return array
    k = dice.whole(0, array.size - 1)
    sizes = {"nan": np.nan, "infinite": np.inf, "zero": 0}
    array.reshape(-1)[k] = sizes.get(change, dice.pick([-1, 1]) * dice.power(*dice.pick([(-300, 300), (-20, 20)])))
    return array
