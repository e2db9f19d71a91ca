"""Settings of hypothesis: the same examples in every run, and no time limit that a busy machine would exceed."""

from hypothesis import settings

settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")
