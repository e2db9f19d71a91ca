"""Ctrl-C reaches what tests start, also where a shell that started the tests in the background had it ignored."""

from __future__ import annotations

import signal

signal.signal(signal.SIGINT, signal.default_int_handler)  # a child would inherit that it is ignored
