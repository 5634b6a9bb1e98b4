"""The errors that users see: one message that says what, where, why and what to do."""


class LayerfitError(Exception):
    """Something outside the program is at fault: an input file, an argument or the machine. Exit code 2, no traceback."""


class InputError(LayerfitError):
    """A file or an argument cannot be used as it is."""


class MachineError(LayerfitError):
    """Something that the machine should have is missing: a GL driver, an extra, a writable directory."""
