"""The errors that users see: one message that says what, where, why and what to do."""

INTERRUPTED, INTERRUPT_CODE = "layerfit: interrupted; every file that was written is whole", 130
"""What is said after Ctrl-C, and the exit code: 128 and the number of the signal, as shells have it."""

PIPE_CODE = 141
"""The exit code where whoever reads standard output has gone, by the same rule."""


class LayerfitError(Exception):
    """Something outside the program is at fault: an input file, an argument or the machine. Exit code 2, no traceback."""

    LONGEST = 2000
    """Letters of a message: what a file holds is cut out of its middle, the advice at its end is not."""

    def __str__(self) -> str:
        text, half = super().__str__(), self.LONGEST // 2
        return text if len(text) <= self.LONGEST else f"{text[:half]} ... {text[-half:]}"


class InputError(LayerfitError):
    """A file or an argument cannot be used as it is."""


class MachineError(LayerfitError):
    """Something that the machine should have is missing: a GL driver, an extra, a writable directory."""
