"""Commands of the program `hil`, one file each. A file imports at its top only what is light: `hil --help` reads them
all; the work is imported inside the command."""
