# SPDX-License-Identifier: MIT OR Apache-2.0
"""The exceptions and warnings of the package: bad input and degenerate geometry are told apart by type.

This is the lowest layer, so the results that errors carry are typed as `object` here; the docstrings say what they are.
"""

from __future__ import annotations

from functools import partial
from typing import Any

__all__ = [
    "AmbiguousWarning",
    "BearslamError",
    "BearslamWarning",
    "DegenerateError",
    "ExecutorError",
    "InvalidInputError",
    "NotConvergedWarning",
    "PoorFitWarning",
]


class BearslamError(Exception):
    """Base class of the errors of bearslam."""


class InvalidInputError(BearslamError, ValueError):
    """Invalid input: wrong shape, dtype, range or count, or an unreadable file.

    The message names the argument (or file and line), what was expected and what it got.
    """


class DegenerateError(BearslamError, ArithmeticError):
    """Valid input whose geometry does not determine the answer.

    Parameters
    ----------
    message : str
        What is not determined, and why.
    kind : str
        Name of the degeneracy, for programs: ``"parallel_rays"``, for example, or ``"coincident_views"``.
    value : float
        Value of the number that was tested; the message says which.
    bound : float
        The bound that it had to reach.

    Attributes
    ----------
    kind, value, bound
        As above.
    diagnosis : object
        The `Diagnosis` of what the bearings leave undetermined, and why; None where nothing was diagnosed.
    """

    diagnosis: object

    def __init__(self, message: str, *, kind: str, value: float, bound: float) -> None:
        super().__init__(message)
        self.kind = kind
        self.value = value
        self.bound = bound
        self.diagnosis = None

    def __reduce__(self) -> tuple[Any, ...]:
        # By default, pickling an exception loses its keyword-only arguments.
        make = partial(type(self), kind=self.kind, value=self.value, bound=self.bound)
        return make, self.args, self.__dict__


class ExecutorError(BearslamError, RuntimeError):
    """An executor accepts no more work, or keeps failing at the same piece.

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


class BearslamWarning(UserWarning):
    """Base class of the warnings of bearslam: reasons not to trust a result.

    ``warnings.simplefilter("error", BearslamWarning)`` makes errors of them.
    """


class PoorFitWarning(BearslamWarning):
    """The residuals are larger than the stated standard deviations allow, or an observation contradicts the others."""


class NotConvergedWarning(BearslamWarning):
    """The refinement has not ended in a minimum."""


class AmbiguousWarning(BearslamWarning):
    """Other maps explain the measurements nearly as well: the `alternatives`."""
