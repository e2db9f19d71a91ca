"""Hypothesis for the driver tests: the same examples every run, and no verdict by the speed of the machine."""

from hypothesis import settings

settings.register_profile("drivers", deadline=None, derandomize=True)
settings.load_profile("drivers")
