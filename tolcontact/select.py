"""Choose faces of a part by direction, region, nearness, size or number in its file (see `tolcontact.declaration`)."""

from tolcontact.declaration import Brep, Cylinder, Facing, Inside, Largest, Near

__all__ = ["Brep", "Cylinder", "Facing", "Inside", "Largest", "Near"]
