"""Tolerances for the equality of geometry. Tolerances of lengths are shares of the size of a face or part."""

ROUNDING = 1e-9  # of a size: positions that only rounding distinguishes
SAME_PLACE = 1e-6  # of a size: distance of a point that lies on a rim, in a plane or on an axis
SAME_DIRECTION = 1e-6  # [rad] between the normals of one plane
PARALLEL = 1e-3  # [rad] between axes or directions that count as parallel
OPPOSING_COSINE = -0.5  # largest cosine between the outward normals of faces that face each other
