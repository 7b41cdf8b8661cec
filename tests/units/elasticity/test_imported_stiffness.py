"""Stiffness matrices of other programs: read, checked, and as flexible as the bodies they were assembled from."""

import numpy as np
import pytest

from tests.units.elasticity import matrix_files
from tests.units.elasticity.bricks import bernoulli_frame, bricks
from tolcontact.elasticity import flexibility, imported_body
from tolcontact.errors import GeometryFault

NODES, STIFFNESS = bricks((40, 10, 5), (4, 2, 2))
NUMBERS = 7 * np.arange(len(NODES)) + 100
FREEDOMS = [(int(number), direction) for number in NUMBERS for direction in (1, 2, 3)]
WRITERS = {
    "npz": (matrix_files.npz, 1e-12),
    "sparse npz": (matrix_files.sparse_npz, 1e-12),
    "Matrix Market": (matrix_files.matrix_market, 1e-12),
    "DMIG": (matrix_files.dmig, 1e-6),  # nine digits, and the body is a hundred times softer than its entries
    "free DMIG": (matrix_files.free_dmig, 1e-12),
    "Abaqus": (matrix_files.abaqus, 1e-9),
    "CalculiX": (matrix_files.calculix, 1e-9),
    "superelement": (matrix_files.superelement, 1e-6),
    "Abaqus with modes": (matrix_files.abaqus_with_modes, 1e-9),
    "labels": (matrix_files.labels, 1e-12),
    "coordinate": (matrix_files.coordinate, 1e-12),
}


def source(folder, writer=matrix_files.npz, matrix=STIFFNESS, freedoms=FREEDOMS, nodes=NODES, numbers=NUMBERS, **options):
    stiffness, table = folder / "part.npz" if "npz" in writer.__name__ else folder / "part.txt", folder / "nodes.csv"
    writer(stiffness, freedoms, matrix)
    rows = [f"{number};{x!r};{y!r};{z!r}" for number, (x, y, z) in zip(numbers, nodes.tolist(), strict=True)]
    table.write_text("\n".join(["node;x;y;z", *rows]))
    return {"stiffness": stiffness, "nodes": table, **options}


def exact_flexibility(nodes, stiffness, loads):
    """The displacements of loads that balance each other, by the pseudo-inverse."""
    return loads.T @ np.linalg.pinv(stiffness, rcond=1e-12, hermitian=True) @ loads


def balanced(nodes, loads):
    """Loads (force, load) without resultant and moment: combinations of unit forces, by a null space."""
    forces = loads.reshape(len(nodes), 3, -1)
    wrench = np.concatenate([forces.sum(axis=0), np.cross(nodes[:, None], forces.swapaxes(1, 2)).sum(axis=0).T])
    _, values, turned = np.linalg.svd(wrench)
    return turned[np.count_nonzero(values > 1e-9 * values[0]) :].T


@pytest.mark.parametrize("kind", WRITERS)
def test_a_matrix_from_a_file_is_as_flexible_as_the_body(tmp_path, kind):
    writer, tolerance = WRITERS[kind]
    body = imported_body(**source(tmp_path, writer))
    assert np.array_equal(body.nodes, NODES)
    at = NODES[[0, 8, 20, 31, 44, 3, 26]]
    loads = body.spread(np.repeat(at, 3, axis=0), np.tile(np.eye(3), (7, 1)), None)
    C = flexibility(body, loads)
    mix = balanced(NODES, loads.toarray())
    exact = mix.T @ exact_flexibility(NODES, STIFFNESS, loads.toarray()) @ mix
    assert mix.shape[1] == 15
    assert np.abs(mix.T @ C @ mix - exact).max() < tolerance * np.abs(exact).max()
    assert np.array_equal(C, C.T)
    assert np.linalg.eigvalsh(C)[0] > -1e-12 * np.linalg.eigvalsh(C)[-1]


def test_displacements_have_no_mean_rigid_motion_and_store_the_work_of_the_forces(tmp_path):
    body = imported_body(**source(tmp_path))
    force = np.random.default_rng(1).normal(size=(STIFFNESS.shape[0], 2))
    u = body.response(force)
    moved = u.reshape(len(NODES), 3, 2)
    assert np.abs(moved.sum(axis=0)).max() < 1e-12 * np.abs(u).sum()
    assert np.abs(np.cross(NODES[:, None], moved.swapaxes(1, 2)).sum(axis=0)).max() < 1e-10 * np.abs(u).sum()
    work, energy = np.einsum("fk,fk->k", force, u), np.einsum("fk,fg,gk->k", u, STIFFNESS, u)
    assert work == pytest.approx(energy, rel=1e-10)


def test_rotations_of_nodes_are_condensed(tmp_path):
    """A free frame of beams, bent by three forces: its middle deflects by F l^3 / 48 E I."""
    nodes = np.linspace(0, 1, 9)[:, None] * np.array([300.0, 200, 100])
    nodes = np.vstack([nodes, [20.0, -30, 0]])  # an arm at the first node, so that nodes are not on a line
    chain = bernoulli_frame(nodes[:9])
    stiffness = np.zeros((60, 60))
    stiffness[:54, :54] = chain
    arm = bernoulli_frame(nodes[[0, 9]])
    both = np.r_[0:6, 54:60]
    stiffness[np.ix_(both, both)] += arm
    freedoms = [(number, direction) for number in range(1, 11) for direction in range(1, 7)]
    body = imported_body(**source(tmp_path, matrix_files.abaqus, stiffness, freedoms, nodes, np.arange(1, 11)))
    assert body.nodes.shape == (10, 3)
    across = np.cross(nodes[8] - nodes[0], [0, 0, 1.0])
    across /= np.linalg.norm(across)
    loads = body.spread(nodes[[0, 4, 8]], np.tile(across, (3, 1)), None)
    force = np.array([-0.5, 1, -0.5])
    length = np.linalg.norm(nodes[8] - nodes[0])
    assert force @ flexibility(body, loads) @ force == pytest.approx(length**3 / 48 / 210e3 / (10**4 / 12), rel=1e-9)


def test_modes_of_a_substructure_are_condensed_too(tmp_path):
    """Fixed-interface modes are freedoms 0 of scalar points. They have no coupling to nodes, so no static force moves them."""
    matrix = np.zeros((len(STIFFNESS) + 2,) * 2)
    matrix[:-2, :-2], matrix[-2:, -2:] = STIFFNESS, np.diag([3e7, 4e8])
    body = imported_body(**source(tmp_path, matrix_files.dmig, matrix, [*FREEDOMS, (900001, 0), (900002, 0)]))
    plain = imported_body(**source(tmp_path, matrix_files.dmig))
    loads = plain.spread(NODES[[0, 8]], np.eye(3)[[2, 2]], None)
    assert flexibility(body, loads) == pytest.approx(flexibility(plain, loads), rel=1e-9)


def planted(change):
    matrix = STIFFNESS.copy()
    change(matrix)
    return matrix


def unsymmetric(matrix):
    matrix[0:3, 30:33] *= 1.001


def support(matrix):
    matrix[10, 10] += 1e-3 * matrix[10, 10]


def negative(matrix):
    matrix *= -1


def loose(matrix):
    """A node on one spring to each of three neighbours in x only: it may move in y and z."""
    matrix[6:9, :], matrix[:, 6:9] = 0, 0


FAULTS = {
    "unsymmetric": ({"matrix": planted(unsymmetric)}, r"not symmetric: its entries of node 100 direction \d and node 170"),
    "support": ({"matrix": planted(support)}, "resists rigid motions.*support or a spring.*at node 121"),
    "negative": ({"matrix": planted(negative)}, "negative stiffness at node 100"),
    "no stiffness": ({"matrix": planted(loose)}, "no stiffness at node 114|resists rigid"),
    "order of nodes": ({"nodes": np.roll(NODES, 1, axis=0)}, "rotation about.*do not belong to the matrix"),
    "missing node": ({"nodes": NODES[:-2], "numbers": NUMBERS[:-2]}, r'nodes.csv" has no node 401, 408'),
    "node twice": ({"numbers": [*NUMBERS[:-1], 100]}, "holds a node number twice"),
    "held": (
        {"matrix": STIFFNESS[4:, 4:], "freedoms": FREEDOMS[4:]},
        "lacks displacements of node 107|has no node 107",
    ),
}


WHOLE = [matrix_files.free_dmig, matrix_files.npz]  # Abaqus and CalculiX write one triangle
NUMBERED = [matrix_files.free_dmig, matrix_files.abaqus, matrix_files.calculix, matrix_files.labels]


@pytest.mark.parametrize(
    ("fault", "writer"),
    [(fault, writer) for fault in FAULTS for writer in (WHOLE if fault == "unsymmetric" else NUMBERED)],
)
def test_a_planted_fault_has_one_message(tmp_path, fault, writer):
    arguments, message = FAULTS[fault]
    with pytest.raises(GeometryFault, match=message) as caught:
        imported_body(**source(tmp_path, writer, **arguments))
    assert "part." in str(caught.value) or "nodes.csv" in str(caught.value)


@pytest.mark.parametrize("share", [0.3, 0.9])
@pytest.mark.parametrize(
    "kind", [kind for kind in WRITERS if kind not in ("Abaqus", "superelement")]
)  # no other matrix at the end
def test_a_truncated_file_has_one_message(tmp_path, kind, share):
    arguments = source(tmp_path, WRITERS[kind][0])
    content = arguments["stiffness"].read_bytes()
    arguments["stiffness"].write_bytes(content[: int(share * len(content))])
    with pytest.raises(GeometryFault) as caught:
        imported_body(**arguments)
    assert len(str(caught.value).splitlines()) == 1
    assert "cannot be read" in str(caught.value) or "cut off" in str(caught.value), str(caught.value)


def test_a_truncated_table_of_nodes_is_named(tmp_path):
    np.savez(tmp_path / "k.npz", K=STIFFNESS)
    np.savez(tmp_path / "n.npz", nodes=NODES)
    (tmp_path / "n.npz").write_bytes((tmp_path / "n.npz").read_bytes()[:500])
    with pytest.raises(GeometryFault, match=r'node file ".*n.npz" cannot be read'):
        imported_body(tmp_path / "k.npz", tmp_path / "n.npz")


def test_rows_without_numbers_are_as_many_as_the_table_has(tmp_path):
    with pytest.raises(GeometryFault, match=r"135 rows, and the 43 nodes of .* have 129 displacements"):
        imported_body(**source(tmp_path, nodes=NODES[:-2], numbers=NUMBERS[:-2]))


def test_a_mechanism_is_found(tmp_path):
    nodes, half = bricks((20, 10, 5), (2, 1, 1))
    stiffness = np.zeros((2 * len(half),) * 2)
    stiffness[: len(half), : len(half)], stiffness[len(half) :, len(half) :] = half, half
    with pytest.raises(GeometryFault, match=r"has 6 motions in addition to the six rigid ones"):
        two = np.concatenate([nodes, nodes + np.array([30, 0, 0])])
        freedoms = [(number, direction) for number in range(24) for direction in (1, 2, 3)]
        imported_body(**source(tmp_path, matrix_files.npz, stiffness, freedoms, two, np.arange(24)))


def test_single_precision_passes_where_it_suffices_and_not_where_a_motion_is_lost_in_it(tmp_path):
    single = STIFFNESS.astype(np.float32).astype(float)
    body, exact = imported_body(**source(tmp_path, matrix=single)), imported_body(**source(tmp_path))
    loads = exact.spread(NODES[[0, 8, 20]], np.eye(3), None)
    assert flexibility(body, loads) == pytest.approx(flexibility(exact, loads), rel=1e-2, abs=1e-2 * 1e-5)
    nodes, sheet = bricks((400, 400, 0.5), (4, 4, 1))
    numbers = np.arange(len(nodes))
    freedoms = [(number, direction) for number in numbers for direction in (1, 2, 3)]
    imported_body(**source(tmp_path, matrix_files.npz, sheet, freedoms, nodes, numbers))
    with pytest.raises(GeometryFault, match=r"lost in the rounding.*more digits"):
        coarse = sheet.astype(np.float32).astype(float)
        imported_body(**source(tmp_path, matrix_files.npz, coarse, freedoms, nodes, numbers))


@pytest.mark.parametrize(("factor", "unit"), [(1 / 25.4, "in"), (1e-3, "m"), (0.1, "cm")])
def test_nodes_in_other_units_are_found_on_the_part(tmp_path, factor, unit):
    surface = block((0, 0, 0), (40, 10, 5))
    imported_body(**source(tmp_path, vertices=surface[0], faces=surface[1], tolerance=3.0))
    with pytest.raises(GeometryFault, match=rf"nodes do not lie on the part.*they do if they are in {unit}"):
        imported_body(**source(tmp_path, nodes=factor * NODES, vertices=surface[0], faces=surface[1], tolerance=3.0))


def test_nodes_of_another_frame_are_found(tmp_path):
    surface = block((0, 0, 0), (40, 10, 5))
    with pytest.raises(GeometryFault, match=r"100 mm from its surface.*in the part's own frame"):
        imported_body(**source(tmp_path, nodes=NODES + np.array([0, 0, 100]), vertices=surface[0], faces=surface[1]))


def block(lower, upper):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.box(bounds=[lower, upper])
    return np.array(mesh.vertices), np.array(mesh.faces)


def test_a_force_between_nodes_is_refused_with_the_distance(tmp_path):
    body = imported_body(**source(tmp_path))
    with pytest.raises(GeometryFault, match=r"no node at \(3, 0, 0\).*3 mm away"):
        body.spread(np.array([[3.0, 0, 0]]), np.eye(3)[:1], 2.0)
    with pytest.raises(GeometryFault, match=r"mass is unknown.*density"):
        body.weight(np.array([0, 0, -9.81]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hello", "kind is not recognized; expected an .npz file"),
        ("BEGIN SUPER 102\nGRID,1,,0.,0.,0.\n", "bulk data of Nastran without a matrix; punch it with EXTSEOUT"),
        (
            "1,1, 1,1, 1.0e+36\n2,1, 1,1, -3.0e+02\n2,1, 2,1, 3.0e2\n",
            "a boundary condition holds node 1 and others, 1 freedoms",
        ),
        ("-1,1, -1,1, 3.3e+01\n1,1, -1,1, 2.5e+01\n", "internal node -1 of Abaqus, .*export a substructure"),
        ("1,1, 1,1, 1.0e+3\n2,1, 1,1\n", 'its entry "2,1, 1,1" has 4 numbers, and the first one 5'),
        ("1 1 1.0\n9000 9000 1.0\n", "it has 9000 freedoms, at most 6000"),
        ("*USER ELEMENT, NODES=2, LINEAR\n** ELEMENT NODES\n** 1,2\n1,2,3\n", r"0 \*MATRIX, TYPE=STIFFNESS"),
        (
            "*USER ELEMENT, NODES=2\n** 1,2\n1,2,3\n*MATRIX,TYPE=STIFFNESS\n1.,2.\n",
            "2 numbers.*lower triangle of 6 freedoms 21",
        ),
        ("DMIG,KAAX,0,6,3,0,,,9\nDMIG,KAAX,1,1,,1,1,5.,1.\n", "type 3; expected 6 or 1, and real"),
        ("DMIG,KAAX,0,6,1,0,,,9\nDMIG,KAAX,1,1,,1,1,abc\n", 'has "abc" in place of a real number'),
        ("DMIG,A,0,6,1\nDMIG,B,0,6,1\n", "DMIG matrices A, B; expected one whose name begins with K"),
        ("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1.0 2.0\n", "complex"),
        ("%%MatrixMarket matrix coordinate real general\n2 3 1\n1 1 1.0\n", r"matrix \(2, 3\); expected a square one"),
        ("%%MatrixMarket matrix coordinate real general\n90000 90000 1\n1 1 1.0\n", "90000 freedoms, at most 6000"),
    ],
)
def test_a_damaged_file_is_named(tmp_path, text, message):
    (tmp_path / "k.txt").write_text(text)
    np.savez(tmp_path / "n.npz", nodes=NODES, numbers=NUMBERS)
    with pytest.raises(GeometryFault, match=rf'stiffness file ".*k.txt".*{message}'):
        imported_body(tmp_path / "k.txt", tmp_path / "n.npz")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y\n1,2\n", "2 columns"),
        ("n,x,y,z\n1,a,2,3\n", 'line 2: an entry is "a"'),
        ("", "empty"),
        ("x,y,z\n1,2,3\n", "three or more"),
    ],
)
def test_a_damaged_table_of_nodes_is_named(tmp_path, text, message):
    np.savez(tmp_path / "k.npz", K=STIFFNESS)
    (tmp_path / "n.csv").write_text(text)
    with pytest.raises(GeometryFault, match=rf'node file ".*n.csv".*{message}'):
        imported_body(tmp_path / "k.npz", tmp_path / "n.csv")
