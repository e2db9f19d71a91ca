"""A compensation for other controllers: one file per controller, each in the controller's own units and signs."""

from enum import StrEnum


class Controller(StrEnum):
    """Controllers, and neutral files, for which `hil compensate --for` writes tables."""

    LINUXCNC = "linuxcnc"
    SINUMERIK = "sinumerik"
    TWINCAT = "twincat"
    CIA402 = "cia402"
    CSV = "csv"
