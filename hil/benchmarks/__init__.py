"""What the bench and its twin can do, measured on this machine: run by `hil bench`, never by the tests."""
