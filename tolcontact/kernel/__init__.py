"""The CAD kernel, Open CASCADE Technology through the package OCP, which only processes of their own import.

Of tolcontact, the modules here import only `child` and each other, so these processes start quickly.
"""
