"use strict";
// Features and patterns with their tolerances: a list next to the scene, and their faces in it.

const OF_FEATURE = "#2563eb", OF_FACE = "#f59e0b";
const BEHIND = 0.35; // opacity of a highlighted face behind other faces
const GREATER_DEPTH = 6; // of three.js; the bundle does not export its name

/** Faces in colours over the colours of the parts, and names of members. `level` is the order of colours on a face, at most FRONT. */
class Highlights {
  constructor(viewer) {
    this.viewer = viewer;
    this.entries = [];
  }

  clear() {
    for (const { part, drawn } of this.entries) {
      part.group.remove(drawn);
      part.materials = part.materials.filter((material) => material !== drawn.material);
      if (drawn.isMesh) drawn.geometry.dispose();
      else drawn.material.map.dispose();
      drawn.material.dispose();
    }
    this.entries = [];
  }

  keep(part, drawn) {
    part.group.add(drawn);
    this.entries.push({ part, drawn });
  }

  /** Write a name at the centre of faces {runs, boundary}, or at the centre of the part inside their boundaries. */
  name(part, faces, text) {
    const corners = part.mesh.geometry.getAttribute("position").array, all = faces.flatMap((face) => face.runs);
    const box = new THREE.Box3().setFromArray(sliced(corners, all)), middle = box.getCenter(new THREE.Vector3());
    for (const plane of faces.flatMap((face) => face.boundary)) {
      const depth = plane.distanceToPoint(middle);
      if (depth < 0) middle.addScaledVector(plane.normal, -depth);
    }
    this.keep(part, labelOf(text, middle.toArray()));
  }

  add(part, runs, boundary, colour, level) {
    const FRONT = 4, offset = (k) => ({ polygonOffset: true, polygonOffsetFactor: -k, polygonOffsetUnits: -k });
    const geometry = new THREE.BufferGeometry(), whole = part.mesh.geometry;
    for (const name of ["position", "normal"])
      geometry.setAttribute(name, new THREE.BufferAttribute(sliced(whole.getAttribute(name).array, runs), 3));
    const hidden = { ...offset(FRONT), depthFunc: GREATER_DEPTH, depthWrite: false, transparent: true, opacity: BEHIND };
    for (const options of [offset(level), hidden]) {
      const material = new THREE.MeshLambertMaterial({ color: colour, side: THREE.DoubleSide, ...options });
      material.userData.planes = boundary;
      material.clippingPlanes = [...part.materials[0].clippingPlanes, ...boundary];
      part.materials.push(material);
      this.keep(part, new THREE.Mesh(geometry, material));
    }
  }
}

/** The corners of the triangles in runs [first, after the last, ...], from the corners of all triangles. */
function sliced(corners, runs) {
  const pieces = [];
  for (let k = 0; k < runs.length; k += 2) pieces.push(corners.subarray(9 * runs[k], 9 * runs[k + 1]));
  const joined = new Float32Array(pieces.reduce((sum, piece) => sum + piece.length, 0));
  let start = 0;
  for (const piece of pieces) {
    joined.set(piece, start);
    start += piece.length;
  }
  return joined;
}

/** The runs of the triangles of one face. */
function runsOf(faces, number) {
  const runs = [];
  for (let k = 0; k <= faces.length; k++) if ((faces[k] === number) !== (k > 0 && faces[k - 1] === number)) runs.push(k);
  return runs;
}

/** The planes around the boxes of a face in the assembly's frame; the boxes are in the frame of its part. */
function boundaryOf(face, placement, margin) {
  return face.boxes.flatMap(([lower, upper]) => [0, 1, 2].flatMap((k) => {
    const axis = new THREE.Vector3(placement[k], placement[3 + k], placement[6 + k]);
    const start = axis.dot(new THREE.Vector3(...placement.slice(9)));
    return [
      new THREE.Plane(axis, margin - lower[k] - start),
      new THREE.Plane(axis.clone().negate(), margin + upper[k] + start),
    ];
  }));
}

function hasTriangle(runs, triangle) {
  for (let k = 0; k < runs.length; k += 2) if (runs[k] <= triangle && triangle < runs[k + 1]) return true;
  return false;
}

/** The features of a page, and their selection in the list and in the scene. */
class FeatureList {
  constructor(viewer) {
    const margin = 1e-6 * viewer.size;
    this.viewer = viewer;
    this.highlights = new Highlights(viewer);
    this.entries = data.scene.toleranced.flatMap((group) => {
      this.heading(`part ${group.part}`);
      return group.features.map((feature) => {
        const faces = feature.members.flatMap((member) => member.faces.map((face) => (
          { member, runs: face.runs, boundary: boundaryOf(face, data.scene.parts[group.number].placement, margin) })));
        return { feature, faces, partName: group.part, part: viewer.parts[group.number], button: this.button(feature) };
      });
    });
    this.entries.forEach((entry) => entry.button.addEventListener("click", () => this.toggle(entry)));
  }

  heading(text) {
    const heading = document.createElement("h3");
    heading.textContent = text;
    byId("toleranced").append(heading);
  }

  button(feature) {
    const button = document.createElement("button"), name = document.createElement("strong");
    const [title, ...tolerances] = linesOf(feature);
    name.textContent = title;
    button.append(name, tolerances.map((line) => `\n${line}`).join(""));
    button.type = "button";
    button.setAttribute("aria-pressed", "false");
    byId("toleranced").append(button);
    return button;
  }

  /** The entries with a triangle of a part, at a point on it in the assembly's frame, and its members. */
  at(part, triangle, point) {
    return this.entries.filter((entry) => entry.part === part).flatMap((entry) => {
      const face = entry.faces.find(({ runs, boundary }) =>
        hasTriangle(runs, triangle) && boundary.every((plane) => plane.distanceToPoint(point) >= 0));
      return face ? [{ entry, member: face.member }] : [];
    });
  }

  /** Choose one entry, with its tolerances, or none if it was chosen before. */
  toggle(entry) {
    const isChosen = entry.button.getAttribute("aria-pressed") === "true";
    this.choose(isChosen ? [] : [entry]);
    this.viewer.draw();
    const lost = entry.faces.length ? [] : ["Its faces were not found."];
    show(isChosen ? null : [`part ${entry.partName}`, ...linesOf(entry.feature), ...lost]);
  }

  /** Choose entries; none without any. */
  choose(entries) {
    this.highlights.clear();
    for (const entry of this.entries) entry.button.setAttribute("aria-pressed", String(entries.includes(entry)));
    for (const { part, faces, feature } of entries) {
      for (const { runs, boundary } of faces) this.highlights.add(part, runs, boundary, OF_FEATURE, 1);
      for (const member of feature.members) {
        const ofMember = faces.filter((face) => face.member === member);
        if (ofMember.length) this.highlights.name(part, ofMember, member.name);
      }
    }
    if (entries.length) reveal(entries[0].button);
  }
}

/** Show a text about the selection; without one, a hint at what can be selected. */
const HINT = byId("message")?.textContent;
function show(lines) {
  byId("message").textContent = lines ? lines.join("\n") : HINT;
}

/** Scroll a list so that an entry is visible, without scrolling the page. */
function reveal(button) {
  const list = button.parentElement, top = button.offsetTop - list.offsetTop;
  if (top < list.scrollTop || top + button.offsetHeight > list.scrollTop + list.clientHeight)
    list.scrollTop = top - (list.clientHeight - button.offsetHeight) / 2;
}

/** A feature or pattern in words, or a member of a pattern: its name, then its tolerances. */
function linesOf(feature, member) {
  const letter = feature.datum === null ? "" : ` (datum ${feature.datum})`;
  const count = feature.noun === "feature" ? "" : member ? `, member ${member.name}` : `, ${feature.members.length} members`;
  return [`${feature.noun} ${feature.name}${letter}${count}`, ...feature.tolerances];
}
