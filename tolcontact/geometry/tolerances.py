"""Tolerances for the equality of geometry. Tolerances of lengths are shares of the size of a face or part."""

ROUNDING = 1e-9  # of a size: positions that only rounding distinguishes
SAME_PLACE = 1e-6  # of a size: distance of a point that lies on a rim, in a plane or on an axis
SAME_DIRECTION = 1e-6  # [rad] between the normals of one plane
ON_FACE = 1e-4  # of a size: distance of a point that is stated on a face, or in a face's plane
SAME_SIZE = 1e-6  # of a size: difference of diameters, radii and distances that are equal
SQUARE = 1e-4  # [rad] between axes of equal holes, walls of a slot, or the normal of a seat and its fastener
PARALLEL = 1e-3  # [rad] between axes or directions that count as parallel
OPPOSING_COSINE = -0.5  # largest cosine between the outward normals of faces that face each other
RESIDUALS = 10  # times the residuals of fitted surfaces: distance between parts of one surface
MIN_PART = 1e-12  # of a unit vector: smaller entries are rounding
