"""What is wrong with a shape."""


class GeometryFault(Exception):
    """One sentence on what is wrong with a shape; collected with the other faults of a model."""
