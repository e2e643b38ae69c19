"""Errors of roofbench.

::

    Exception
    └── RoofbenchError            every error that roofbench raises on purpose
        ├── InputError            a file, table or array that cannot be used as it is   (also ValueError)
        │   └── CRSError          no, no common, or no metric coordinate reference system
        ├── ParameterError        a parameter outside its range, or an unknown one       (also ValueError)
        ├── UnknownNameError      no detector, evaluator, preset or suite of that name   (also LookupError)
        ├── OutputError           a result that cannot be written                        (also OSError)
        ├── MissingInputError     a scene or a machine lacks what a detector requires: the run is skipped, not failed
        ├── ProgramError          an external program that failed or exceeded a limit
        └── UnsupportedError      the operation is not offered by this detector or evaluator

Each message is one sentence that says what is wrong, where, which rule it breaks and what to do. The command line
prints it and exits with code 2; it never shows a traceback for these.
"""

__all__ = [
    "CRSError",
    "InputError",
    "MissingInputError",
    "OutputError",
    "ParameterError",
    "ProgramError",
    "RoofbenchError",
    "UnknownNameError",
    "UnsupportedError",
]


class RoofbenchError(Exception):
    """Base of all errors that roofbench raises on purpose."""


class InputError(RoofbenchError, ValueError):
    """Input that cannot be used as it is."""


class CRSError(InputError):
    """A coordinate reference system that is absent, geographic, not metric, or not common to both inputs."""


class ParameterError(RoofbenchError, ValueError):
    """A parameter that does not exist or a value outside its range."""


class UnknownNameError(RoofbenchError, LookupError):
    """A name that no plugin, preset or suite has."""


class OutputError(RoofbenchError, OSError):
    """A result that cannot be written where it was asked for."""


class MissingInputError(RoofbenchError):
    """A scene lacks an input, or this machine a program, that a detector requires."""


class ProgramError(RoofbenchError):
    """An external program that failed, exceeded a limit, or wrote what cannot be used.

    Parameters
    ----------
    message : str
        One sentence.
    log : str, optional
        End of what the program printed; tracebacks show it.
    """

    def __init__(self, message: str, *, log: str = "") -> None:
        super().__init__(message)
        self.log = log
        if log:
            self.add_note(log)


class UnsupportedError(RoofbenchError):
    """An operation that this detector or evaluator does not offer."""
