"""Code that a diagnosis uses: answers of two of them must not mix."""

from hil.workers.code import code_of

# Packages that a diagnosis uses, beside the modules at the root.
_ANSWERING = ("bench", "compiled", "control", "diagnosis", "files", "identification", "motion", "recording", "twin")


def code_sha256() -> str:
    """Return the SHA-256 of the code that a diagnosis uses."""
    return code_of(_ANSWERING)
