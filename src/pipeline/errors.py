"""The one error that a user can cause."""


class PipelineError(Exception):
    """Something in a user's files or options is wrong.

    The message is one sentence that names the file, object or key, says what was expected, what was found and what
    to do about it. `pipeline.command.run` turns it into that sentence and exit code 1.
    """
