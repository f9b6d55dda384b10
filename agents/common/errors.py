"""The one exception that a user of the agents meets."""


class AgentError(ValueError):
    """A mistake that the user can cure, in one line: the thing, the place, the cure."""
