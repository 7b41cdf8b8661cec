"""Functions per kind of contact pair: where a group has many bodies, its QP is assembled from elements, pair by pair.

An element is a contact pair with the parts that its increments move. Elements of one kind share their functions, whose inputs
are the constants of the element, too. So they are compiled once, however many bodies a model has. The equations are those of
tolcontact.mechanics, and the QP is that of tolcontact.compilation.contact_qp, up to rounding.
"""

from tolcontact.compilation.elements.element_qp import ElementQP, has_elements

__all__ = ["ElementQP", "has_elements"]
