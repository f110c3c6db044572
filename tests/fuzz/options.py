# SPDX-License-Identifier: MIT OR Apache-2.0
"""Options of the verbs: mostly defaults, each combination now and then, extremes rarely."""

from __future__ import annotations

from typing import Any

import numpy as np

from .dice import Dice
from .scenes import Scene

METHODS = {"search": 6, "incremental": 1.5, "calibrated": 1, "projective": 1, "global": 1}
LOSSES = ("huber", "cauchy", "truncated")
FRAMES = (True, "first_view", "free_network", "priors")


def of_map(dice: Dice, verb: str, joint: bool) -> dict[str, Any]:
    """What else is given with a table, according to the verb."""
    chosen: dict[str, Any] = {}
    if verb == "files":
        return chosen
    if dice.chance(0.08):
        chosen["oriented"] = False
    if verb == "diagnose":
        return chosen
    if dice.chance(0.25):
        chosen["loss"] = dice.pick(LOSSES)
    if verb in ("solve", "refine") and dice.chance(0.35):
        frames = FRAMES if joint else FRAMES[:3] + FRAMES[:3] + FRAMES[3:]
        chosen["covariance"] = dice.pick(frames)
    if dice.chance(0.2):
        chosen["refinement"] = _refinement(dice, "loss" in chosen)
    if verb == "refine":
        return chosen
    method = dice.weighted(METHODS)
    if method != "search":
        chosen["method"] = method
    if verb == "solve" and dice.chance(0.07):
        chosen["robust"] = True
    if dice.chance(0.15):
        chosen["search"] = _search(dice)
    if dice.chance(0.3):
        chosen["seed"] = dice.pick([1, 2**64 - 1, dice.whole(0, 2**62)])
    return chosen


def _refinement(dice: Dice, loss: bool) -> dict[str, Any]:
    makers: dict[str, Any] = {
        "max_iterations": lambda: dice.pick([1, 2, 10, 300, 1000, 2000]),
        "damping": lambda: dice.pick([0.0, 1e-12, 1e-2, 1.0, 1e6, 1e300]),
        "tolerance": lambda: dice.pick([0.0, 1e-14, 1e-6, 1e-2, 1.0]),
    }
    if loss:
        makers["loss_scale"] = lambda: dice.pick([0.5, 1.0, 10.0, dice.power(-300, 6)])
    return {name: maker() for name, maker in makers.items() if dice.chance(0.5)}


def _search(dice: Dice) -> dict[str, Any]:
    largest = {"triples": 100, "grown": 30, "candidates": 30, "swept": 10}
    return {
        name: dice.weighted({dice.whole(name != "swept", most): 9, int(name != "swept"): 3, 2**63 - 1: 0.3})
        for name, most in largest.items()
        if dice.chance(0.5)
    }


def sigma(dice: Dice, scene: Scene, *, needed: bool) -> Any:
    """The standard deviation of the bearings: true, wrong, one for each, extreme; None for the default."""
    true = max(scene.noise, 1e-3)
    kind = dice.weighted({"true": 5, "wrong": 2, "each": 2, "extreme": 0.3, "default": 0.2 if needed else 5})
    if kind == "default":
        return None
    if kind == "true":
        return true
    if kind == "wrong":
        return true * dice.power(-1.5, 1.5 if not needed else 0.7)
    if kind == "extreme":
        return dice.pick([dice.power(-12, -5), dice.power(-60, 60), 0.5, 0.35])
    return true * np.exp(0.7 * dice.normal(*scene.bearings.shape))


def of_fix(dice: Dice) -> dict[str, Any]:
    """Options of resection and triangulation."""
    chosen: dict[str, Any] = {}
    if dice.chance(0.7):
        chosen["details"] = True
    if dice.chance(0.5):
        chosen["sigma"] = dice.power(-5, 0)
    return chosen


def of_three_view(dice: Dice) -> dict[str, Any]:
    """Options of the closed forms of three views."""
    chosen: dict[str, Any] = {}
    if dice.chance(0.4):
        chosen["method"] = dice.pick(["calibrated", "projective"])
    if dice.chance(0.3):
        chosen["reweights"] = dice.pick([0, 1, 5, 50])
    return chosen
