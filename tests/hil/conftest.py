"""Ctrl-C reaches what tests start, also where a shell that started the tests in the background had it ignored.

Kernels are compiled before the tests, so that commands say nothing of it.
"""

from __future__ import annotations

import signal

import pytest

from hil.commands.warm_up import compile_kernels

signal.signal(signal.SIGINT, signal.default_int_handler)  # a child would inherit that it is ignored


@pytest.fixture(scope="session", autouse=True)
def kernels() -> None:
    compile_kernels()
