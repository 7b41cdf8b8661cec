"use strict";
// The view before a run: a click on a face shows its selector in a script, and the features of this face.

const GAP_TOLERANCE = 1e-6; // mm
const SNAP_DISTANCE = 0.03; // of the size of the assembly, between a click and a corner

function pick(viewer, features) {
  const ray = new THREE.Raycaster(), place = new THREE.Vector2();
  let pressed = null;
  viewer.canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
  viewer.canvas.addEventListener("pointerup", (event) => {
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return; // the view was rotated
    const box = viewer.canvas.getBoundingClientRect();
    place.set((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    ray.setFromCamera(place, viewer.camera);
    const shown = viewer.parts.filter((part) => part.group.visible);
    const inside = (hit) => !viewer.parts[0].materials[0].clippingPlanes.length || viewer.section.distanceToPoint(hit.point) >= 0;
    const hit = ray.intersectObjects(shown.map((part) => part.mesh)).find(inside);
    choose(viewer, features, hit && viewer.parts.find((part) => part.mesh === hit.object), hit);
  });
}

function choose(viewer, features, part, hit) {
  const owners = part ? features.at(part, hit.faceIndex, hit.point) : [];
  features.choose(owners.map(({ entry }) => entry));
  if (!part) {
    viewer.draw();
    show(null);
    return;
  }
  const known = data.scene.parts[viewer.parts.indexOf(part)], faces = unpacked(known.faceOfTriangle).values;
  const face = known.described[faces[hit.faceIndex]];
  for (const number of face.whole) features.highlights.add(part, runsOf(faces, number - 1), [], OF_FACE, 2);
  viewer.draw();
  const ofFeatures = owners.flatMap(({ entry, member }) => ["", ...linesOf(entry.feature, member)]);
  show([`part ${part.name}`, face.description, face.snippet, ...face.groups, pointAt(known, part, hit), ...ofFeatures]);
}

/** Return the selector of the nearest corner of the triangle, or of the hit if no corner is near, in the frame of the part. */
function pointAt(known, part, hit) {
  const place = part.mesh.geometry.getAttribute("position");
  const corners = [0, 1, 2].map((corner) => new THREE.Vector3().fromBufferAttribute(place, 3 * hit.faceIndex + corner));
  const nearest = corners.reduce((one, other) => (other.distanceTo(hit.point) < one.distanceTo(hit.point) ? other : one));
  const isNear = nearest.distanceTo(hit.point) < SNAP_DISTANCE * window.viewer.size;
  const [a, b] = [(isNear ? nearest : hit.point).toArray(), known.placement];
  const off = a.map((x, k) => x - b[9 + k]);
  const own = [0, 1, 2].map((k) => off[0] * b[k] + off[1] * b[3 + k] + off[2] * b[6 + k]); // R transposed
  return `point(${own.map((x) => Number(x.toFixed(3)) + 0).join(", ")})${isNear ? "" : " on it"}`;
}

function gaps(viewer) {
  data.scene.contacts.forEach((pair, k) => {
    const values = unpacked(pair.gaps).values, points = viewer.pairs[k].points, colour = new THREE.Color();
    const colours = Float32Array.from(Array.from(values).flatMap((gap) =>
      colour.set(gap < -GAP_TOLERANCE ? RED : gap > GAP_TOLERANCE ? "#2563eb" : TOUCHED).toArray()));
    points.geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    Object.assign(points.material, { vertexColors: true, needsUpdate: true });
    points.material.color.set("#ffffff");
  });
}

if (byId("scene")) { // a stack has no parts
  const viewer = new Viewer(data.scene);
  control(viewer);
  window.stations = new Stations(viewer, () => {});
  gaps(viewer);
  viewer.paint("", 3, CORRECTED);
  pick(viewer, new FeatureList(viewer));
  window.viewer = viewer;
}
