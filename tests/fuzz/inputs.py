# SPDX-License-Identifier: MIT OR Apache-2.0
"""Inputs from seeds: a verb, and its arguments as plain numbers and arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import known, options, scenes, wild
from .dice import Dice

GENERATOR = 3
"""Raised whenever a seed no longer means the same input."""

VERBS = {
    "solve": 26,
    "refine": 18,
    "diagnose": 8,
    "initialize": 7,
    "resect": 7,
    "triangulate": 7,
    "three_view": 6,
    "three_view_batch": 2,
    "tensor": 3,
    "align": 3,
    "files": 4,
    "simulate": 3,
    "sweep": 0.5,
}
"""How often each verb is called."""
MAPS = ("solve", "refine", "initialize", "diagnose", "files")
"""Verbs of a table of bearings with everything that may be known besides."""


@dataclass
class Input:
    """One call: `arguments` has only what is given; `truth` is the scene behind it, None after wild changes."""

    seed: int
    verb: str
    arguments: dict[str, Any]
    truth: scenes.Scene | None = None
    wild: list[str] = field(default_factory=list)


def make(seed: int) -> Input:
    """The input of a seed."""
    dice = Dice(seed)
    verb = dice.weighted(VERBS)
    scene = scenes.draw(dice)
    if verb in MAPS:
        arguments = _of_table(dice, scene, verb)
    else:
        arguments = {
            "resect": _resect,
            "triangulate": _triangulate,
            "three_view": _three_view,
            "three_view_batch": _three_view_batch,
            "tensor": _three_view,
            "align": _align,
            "simulate": _simulate,
            "sweep": _sweep,
        }[verb](dice, scene)
    made = Input(seed, verb, arguments, scene)
    if dice.chance(0.1):
        made.wild = wild.damage(dice, made.arguments)
        made.truth = None
    return made


def _of_table(dice: Dice, scene: scenes.Scene, verb: str) -> dict[str, Any]:
    arguments: dict[str, Any] = {
        "bearings": scene.bearings,
        "form": "problem" if verb == "files" else dice.weighted({"dense": 5, "sightings": 2, "problem": 2}),
    }
    if dice.chance(0.55):
        makers = {
            "odometry": (0.7, known.odometry),
            "pose_priors": (0.4, known.pose_priors),
            "landmark_priors": (0.3, known.landmark_priors),
        }
        for name, (share, maker) in makers.items():
            if dice.chance(share) and (given := maker(dice, scene)) is not None:
                arguments[name] = given
    joint = any(name in arguments for name in ("odometry", "pose_priors", "landmark_priors"))
    if verb == "initialize":
        for name in ("odometry", "pose_priors", "landmark_priors"):
            arguments.pop(name, None)
        joint = False
    if verb == "refine" or (verb in ("diagnose", "files") and dice.chance(0.4)):
        arguments["start"] = known.start(dice, scene)
    arguments |= options.of_map(dice, verb, joint)
    sigma = options.sigma(dice, scene, needed=joint or "robust" in arguments or "loss" in arguments)
    if sigma is not None:
        arguments["sigma"] = sigma
    return arguments


def _resect(dice: Dice, scene: scenes.Scene) -> dict[str, Any]:
    bearings = scene.bearings[0] if dice.chance(0.3) else scene.bearings
    arguments: dict[str, Any] = {"landmarks": scene.landmarks, "bearings": bearings}
    return arguments | options.of_fix(dice)


def _triangulate(dice: Dice, scene: scenes.Scene) -> dict[str, Any]:
    bearings = scene.bearings[:, 0] if dice.chance(0.3) else scene.bearings
    arguments: dict[str, Any] = {"poses": scene.poses, "bearings": bearings}
    return arguments | options.of_fix(dice)


def _three_view(dice: Dice, scene: scenes.Scene) -> dict[str, Any]:
    return {"bearings": _three(dice, scene)} | options.of_three_view(dice)


def _three_view_batch(dice: Dice, scene: scenes.Scene) -> dict[str, Any]:
    first = _three(dice, scene)
    others = [first + dice.pick([0.0, 1e-3, 0.1, 2.0]) * dice.normal(*first.shape) for _ in range(dice.whole(0, 12))]
    return {"bearings": np.stack([first, *others])} | options.of_three_view(dice)


def _three(dice: Dice, scene: scenes.Scene) -> Any:
    """Three views of the landmarks that all of them see, of at least some landmarks."""
    bearings = np.resize(scene.bearings, (max(3, len(scene.bearings)), scene.bearings.shape[1]))[:3]
    seen = bearings[:, np.isfinite(bearings).all(axis=0)]
    if seen.shape[1] < 5 and dice.chance(0.8):
        points = dice.numbers.uniform([0, 0], [7, 5], (dice.whole(5, 9), 2))
        offset = points[None] - dice.numbers.uniform([0, 0], [7, 5], (3, 1, 2))
        return np.arctan2(offset[..., 1], offset[..., 0])
    return seen


def _align(dice: Dice, scene: scenes.Scene) -> dict[str, Any]:
    source = scene.landmarks
    angle = dice.real(-np.pi, np.pi)
    turn = dice.power(-3, 3) * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    target = source @ turn.T + dice.normal(2) + dice.pick([0.0, 1e-3, 1.0, 100.0]) * dice.normal(*source.shape)
    return {"source": source, "target": target}


def _simulate(dice: Dice, scene: scenes.Scene) -> dict[str, Any]:
    return {
        "layout": dice.pick(["mixed", "enclosed", "trajectory"]),
        "views": len(scene.poses),
        "landmarks": len(scene.landmarks),
        "noise": scene.noise,
        "seed": dice.whole(0, 2**62),
        "sight": dice.pick([np.inf, dice.power(-2, 1)]),
    }


def _sweep(dice: Dice, scene: scenes.Scene) -> dict[str, Any]:
    return {
        "layout": dice.pick(["mixed", "enclosed"]),
        "views": [dice.whole(3, 6)],
        "landmarks": [dice.whole(4, 9), 10][: dice.whole(1, 2)],
        "noise": [max(scene.noise, 1e-6)],
        "trials": dice.whole(1, 6),
        "starts": dice.pick([["solve"], ["random", "projective"], ["calibrated", "solve"]]),
        "seed": dice.whole(0, 2**62),
        "chunk": dice.whole(1, 4),
    }
