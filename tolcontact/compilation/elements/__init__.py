"""Functions per kind of body and pair: where a group has many bodies, its QP is assembled from elements.

An element is a contact pair with the parts that its increments move, or a part with its forces and its two-sided locators, if
the objective or equations contain them. Elements of one kind share their functions, whose inputs are the constants of the
element, too. So they are compiled once, however many bodies a model has. The equations are those of tolcontact.mechanics, and
the QP is that of tolcontact.compilation.contact_qp, up to rounding.
"""

from tolcontact.compilation.elements.element_qp import ElementQP, has_elements

__all__ = ["ElementQP", "has_elements"]
