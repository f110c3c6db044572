# SPDX-License-Identifier: MIT OR Apache-2.0
"""The exceptions of the package: bad input and degenerate geometry are told apart by type.

This is the lowest layer, so the results that errors carry are typed as `object` here; the docstrings say what they are.
"""

from __future__ import annotations

from functools import partial
from typing import Any

__all__ = ["BearslamError", "DegenerateError", "ExecutorError", "InvalidInputError"]


class BearslamError(Exception):
    """Base of every error that bearslam raises on purpose."""


class InvalidInputError(BearslamError, ValueError):
    """Input that no geometry could satisfy: wrong shape, dtype, range or count, an unreadable file.

    The message names the argument (or file and line), what was expected and what came.
    """


class DegenerateError(BearslamError, ArithmeticError):
    """Well-formed input whose geometry leaves the answer undetermined.

    Parameters
    ----------
    message : str
        What could not be determined, and why.
    quantity : str
        Name of the number that failed, for example ``"singular value gap"``.
    value : float
        What it came to.
    bound : float
        What it would have had to reach.

    Attributes
    ----------
    diagnosis : object
        The `Diagnosis` of what the bearings leave undetermined, and why; None where nothing was diagnosed.
    """

    diagnosis: object

    def __init__(self, message: str, *, quantity: str, value: float, bound: float) -> None:
        super().__init__(message)
        self.quantity = quantity
        self.value = value
        self.bound = bound
        self.diagnosis = None

    def __reduce__(self) -> tuple[Any, ...]:
        # The keyword-only arguments would be lost in the way exceptions are pickled by default.
        make = partial(type(self), quantity=self.quantity, value=self.value, bound=self.bound)
        return make, self.args, self.__dict__


class ExecutorError(BearslamError, RuntimeError):
    """An executor that takes no more work, or fails at the same piece again and again.

    Parameters
    ----------
    message : str
        What happened.
    result : object
        The `SweepResult` of the trials done by then.
    """

    def __init__(self, message: str, *, result: object) -> None:
        super().__init__(message)
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), result=self.result), self.args, self.__dict__
