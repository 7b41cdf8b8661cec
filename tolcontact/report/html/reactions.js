"use strict";
// Reactions of elastic parts: arrows as long as their means, and bars from the 2.5th to the 97.5th percentile.

const REACTION = "#b3261e", REACTION_SPREAD = "#f0a64b";
const LONGEST = 0.2; // of the size of the assembly: the largest force of all
const HEAD = 0.03; // of that size: arrows shorter than half of it have no head

const SIDES = [0, 4, 1, 1, 4, 5, 1, 5, 2, 2, 5, 6, 2, 6, 3, 3, 6, 7, 3, 7, 0, 0, 7, 4, 0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6];

/** A square bar along y, about its centre. */
function bar(radius, length) {
  const shape = new THREE.BufferGeometry(), corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
  const at = [-0.5, 0.5].flatMap((end) => corners.flatMap(([x, z]) => [radius * x, length * end, radius * z]));
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(at), 3));
  shape.setIndex(new THREE.BufferAttribute(new Uint32Array(SIDES), 1));
  return shape;
}

/** A group with an arrow and a bar for each reaction; its tip is where the force acts. */
function reactionArrows(viewer, reactions) {
  const group = new THREE.Group();
  const largest = reactions.reduce((most, own) => Math.max(most, ...[own.mean, own.low, own.high].map(Math.abs)), 0);
  const scale = (LONGEST * viewer.size) / (largest || 1), thin = 0.0025 * viewer.size;
  const rod = (from, to, radius, colour, tip) => {
    const length = from.distanceTo(to);
    if (!(length > 1e-4 * viewer.size)) return;
    const shape = tip ? new THREE.ConeGeometry(radius, length, 12) : bar(radius, length);
    const mesh = new THREE.Mesh(shape, new THREE.MeshBasicMaterial({ color: colour, depthTest: false, transparent: true }));
    mesh.position.copy(from).lerp(to, 0.5);
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), to.clone().sub(from).normalize());
    mesh.renderOrder = colour === REACTION ? 2 : 1;
    return mesh;
  };
  for (const own of reactions) {
    const arrow = new THREE.Group(), end = new THREE.Vector3(...own.at), along = new THREE.Vector3(...own.along).normalize();
    const back = (force) => end.clone().addScaledVector(along, -scale * force); // pulls have their tail on the other side
    const longest = (HEAD * viewer.size) / scale, length = Math.min(Math.abs(own.mean), longest);
    const head = length < longest / 2 ? 0 : Math.sign(own.mean) * length;
    const pieces = [
      rod(back(own.low), back(own.high), thin, REACTION_SPREAD),
      rod(back(own.mean), back(head), 1.8 * thin, REACTION),
      rod(back(head), end, 4 * thin, REACTION, true),
    ];
    for (const piece of pieces) if (piece) arrow.add(piece);
    arrow.name = own.pair;
    group.add(arrow);
  }
  viewer.scene.add(group);
  return group;
}
