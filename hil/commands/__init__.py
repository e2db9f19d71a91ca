"""Commands of the program `hil`, one file each.

`hil --help` imports all of them, so a file imports only light modules at its top and the others in the command.
"""
