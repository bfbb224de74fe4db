"""The errors a user may meet, each one message without a traceback."""

import reprlib

_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxdict, _SHORT.maxlist, _SHORT.maxtuple = 3, 8, 8, 8
_SHORT.maxstring = _SHORT.maxother = 200


class LimoError(Exception):
    """Base of every error that is the user's to mend."""


class ConfigError(LimoError):
    """A configuration value that cannot be used; names file, key, value, range and an example."""

    def __init__(self, file: object, key: str, value: object, expected: str, example: str):
        self.file, self.key, self.value = str(file), key, value
        self.expected, self.example = expected, example
        # a value may be of any size: a few lines of YAML can stand for gigabytes
        super().__init__(f"{file}: {key} = {_SHORT.repr(value)}: expected {expected}; for example {example}")


class MeshError(LimoError):
    """A flat pattern that gmsh could not turn into valid quadrilaterals."""


class SolverNotFoundError(LimoError):
    """No usable CalculiX executable on this machine."""


class ResultError(LimoError):
    """A result file that is missing, truncated, or not what its name says."""


class ClusterError(LimoError):
    """A cluster that is not there, refuses, or does not have what a sweep needs."""
