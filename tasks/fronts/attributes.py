"""What the environments of a batch say of themselves, asked for by name."""

from robots import UnknownNameError


class UnknownAttributeError(UnknownNameError, AttributeError):
    """An attribute that environments do not have (also an ``AttributeError``)."""
