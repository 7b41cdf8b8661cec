"""Functions per kind of body and pair: the QP of a group of many bodies is assembled from elements.

An element is a contact pair with the parts that its increments move, or a part with its forces and its two-sided locators, if
the objective or equations contain them. Elements of one kind share their functions, which take the constants of the element as
inputs. So they are compiled once for any number of bodies. The equations come from tolcontact.mechanics, and the QP equals the
QP of tolcontact.compilation.contact_qp up to rounding.
"""

from tolcontact.compilation.elements.element_qp import ElementQP, has_elements

__all__ = ["ElementQP", "has_elements"]
