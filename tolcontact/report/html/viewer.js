"use strict";
// The assembly in 3D, drawn with three.js.

// --- colours ---------------------------------------------------------------------------------------------------------

// Viridis, and a diverging map from blue over white to orange: both are safe for colour-blind readers.
const VIRIDIS = ["#440154", "#482878", "#3e4a89", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
const DIVERGING = ["#2166ac", "#67a9cf", "#d1e5f0", "#f7f7f7", "#fee0b6", "#f1a340", "#b35806"];

function colourOf(map, share) {
  const place = Math.min(Math.max(share, 0), 1) * (map.length - 1);
  const first = Math.min(Math.floor(place), map.length - 2);
  return new THREE.Color(map[first]).lerp(new THREE.Color(map[first + 1]), place - first);
}

/** 256 colours of a map, as numbers between 0 and 1. */
function table(map) {
  return Array.from({ length: 256 }, (_, k) => colourOf(map, k / 255).toArray());
}

const TABLES = new Map([VIRIDIS, DIVERGING].map((map) => [map, table(map)]));

// --- the scene -------------------------------------------------------------------------------------------------------

const GREYS = ["#9fb3c8", "#c8b79f", "#a8c89f", "#c89fb8", "#b3a8d0", "#9fc8c0"];
const FAULTY = "#e38a84";
const RAW = 0, CORRECTED = 1, DIFFERENCE = 2;
const TOUCHED = "#0a7d4f";
const RED = "#d01c1c";
const MANY = 30_000; // triangles

class Viewer {
  constructor(scene) {
    this.data = scene;
    this.canvas = byId("scene");
    // Without a graphics card, smooth edges cost as much as everything else.
    const antialias = scene.parts.reduce((sum, part) => sum + part.faces.shape[0], 0) < MANY;
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias, alpha: true, preserveDrawingBuffer: true });
    this.renderer.localClippingEnabled = true;
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb0b0b0, Math.PI));
    this.section = new THREE.Plane(new THREE.Vector3(1, 0, 0), 0);
    this.parts = scene.parts.map((part, k) => this.part(part, k));
    this.box = new THREE.Box3();
    this.parts.forEach((part) => this.box.expandByObject(part.group));
    this.size = this.box.getSize(new THREE.Vector3()).length();
    this.marks = {
      locators: this.arrows(scene.locators, "#1f5fa8", 0.05),
      forces: this.arrows(scene.forces.filter((force) => force.at), "#7a3fb0", 0.09),
      contacts: this.contacts(),
      points: this.points(),
      features: this.features(),
    };
    this.axes();
    this.look();
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
    this.resize();
  }

  part(part, number) {
    const vertices = unpacked(part.vertices), faces = unpacked(part.faces);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(vertices.values, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(vertices.values.length), 3));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(faces.values), 1));
    const sharp = geometry.toNonIndexed();
    sharp.computeVertexNormals();
    const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide, clippingPlanes: [] });
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    const mesh = new THREE.Mesh(sharp, material);
    const ink = new THREE.LineBasicMaterial({ color: "#30363d", clippingPlanes: [] });
    group.add(mesh, new THREE.LineSegments(new THREE.EdgesGeometry(geometry, 25), ink));
    this.scene.add(group);
    const fields = {};
    for (const name of ["mean", "sixSigma"]) if (part[name]) fields[name] = unpacked(part[name]);
    const forms = (part.forms || []).map((form) => ({ normal: form.normal, vertices: unpacked(form.vertices).values,
      modes: unpacked(form.modes), coefficients: unpacked(form.coefficients) }));
    return { name: part.name, group, mesh, materials: [material, ink], faces: faces.values, fields, forms, flat: vertices.values,
      own: part.faulty ? FAULTY : GREYS[number % GREYS.length] };
  }

  arrows(things, colour, share) {
    const group = new THREE.Group(), length = share * this.size;
    const shape = new THREE.ConeGeometry(0.3 * length, length, 12);
    shape.translate(0, -length / 2, 0);
    const material = new THREE.MeshLambertMaterial({ color: colour });
    for (const thing of things) {
      const cone = new THREE.Mesh(shape, material), along = new THREE.Vector3(...thing.along).normalize();
      cone.position.set(...thing.at);
      cone.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along);
      cone.name = thing.name;
      group.add(cone);
    }
    this.scene.add(group);
    return group;
  }

  contacts() {
    const group = new THREE.Group();
    this.pairs = this.data.contacts.map((pair) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(unpacked(pair.points).values, 3));
      const material = new THREE.PointsMaterial({ color: TOUCHED, size: 4, sizeAttenuation: false, depthTest: false });
      const points = new THREE.Points(geometry, material);
      points.matrixAutoUpdate = false;
      group.add(points);
      return { name: pair.name, part: pair.part, points, material, map: this.map(pair, geometry, group) };
    });
    this.scene.add(group);
    return group;
  }

  /** The area between the contact points of two planes, coloured as these are; null for other pairs. */
  map(pair, points, group) {
    if (!pair.triangles || !pair.triangles.shape[0]) return null;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", points.getAttribute("position"));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(unpacked(pair.triangles).values), 1));
    const material = new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide, depthTest: false, transparent: true });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.matrixAutoUpdate = mesh.visible = false;
    mesh.renderOrder = -1;
    group.add(mesh);
    return mesh;
  }

  /** The axes of the assembly, next to it. */
  axes() {
    const length = 0.12 * this.size, start = this.box.min.clone().addScalar(-0.04 * this.size);
    ["x", "y", "z"].forEach((name, k) => {
      const end = start.clone();
      end.setComponent(k, end.getComponent(k) + length);
      const line = new THREE.BufferGeometry().setFromPoints([start, end]);
      this.scene.add(new THREE.LineSegments(line, new THREE.LineBasicMaterial({ color: "#5b6470" })));
      const label = labelOf(name, end.toArray());
      label.center.set(0.5, 0.5);
      this.scene.add(label);
    });
  }

  points() {
    const group = new THREE.Group();
    const shape = new THREE.SphereGeometry(0.008 * this.size, 16, 12);
    const material = new THREE.MeshBasicMaterial({ color: "#c2410c", depthTest: false });
    const stroke = new THREE.LineBasicMaterial({ color: "#c2410c", depthTest: false });
    for (const measure of this.data.measures) {
      for (const at of measure.points) {
        const ball = new THREE.Mesh(shape, material);
        ball.position.set(...at);
        ball.name = measure.name;
        group.add(ball);
      }
      const ends = measure.lines.flat().map((at) => new THREE.Vector3(...at));
      const lines = new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(ends), stroke);
      const label = labelOf(measure.name, measure.at);
      lines.name = label.name = measure.name;
      group.add(lines, label);
    }
    this.scene.add(group);
    return group;
  }

  /** A picture of the assembly with the points of one measurement, and an arrow along its direction. */
  portrait(measure, width = 480, height = 360) {
    this.paint("", 3, RAW);
    const shown = Object.values(this.marks).map((group) => [group, group.visible]);
    for (const [group] of shown) group.visible = false;
    const group = new THREE.Group(), colour = "#d01c1c", material = new THREE.MeshBasicMaterial({ color: colour, depthTest: false });
    const ball = new THREE.SphereGeometry(0.015 * this.size, 16, 12);
    const points = measure.points.map((at) => new THREE.Vector3(...at));
    for (const point of points) {
      const mark = new THREE.Mesh(ball, material);
      mark.position.copy(point);
      group.add(mark);
    }
    const lines = measure.lines.map((line) => line.map((at) => new THREE.Vector3(...at)));
    if (measure.along) {
      const end = points[0].clone().addScaledVector(new THREE.Vector3(...measure.along).normalize(), 0.16 * this.size);
      lines.push([points[0], end]);
      const tip = this.arrows([{ name: measure.name, at: end.toArray(), along: measure.along }], colour, 0.05);
      tip.children.forEach((cone) => { cone.material.depthTest = false; });
      group.add(tip);
    }
    for (const line of lines) {
      const geometry = new THREE.BufferGeometry().setFromPoints(line);
      group.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour, depthTest: false })));
    }
    this.scene.add(group);
    this.renderer.setPixelRatio(1);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
    const picture = this.canvas.toDataURL();
    this.scene.remove(group);
    for (const [marks, visible] of shown) marks.visible = visible;
    this.resize();
    return picture;
  }

  /** The names of features, where they are; not shown at first: there may be many. */
  features() {
    const group = new THREE.Group();
    for (const feature of this.data.features) group.add(labelOf(feature.name, feature.at));
    group.visible = false;
    this.scene.add(group);
    return group;
  }

  look() {
    const middle = this.box.getCenter(new THREE.Vector3());
    this.camera = new THREE.PerspectiveCamera(35, 1, this.size / 100, this.size * 20);
    this.camera.up.set(0, 0, 1);
    this.camera.position.copy(middle).add(new THREE.Vector3(0.9, -1.3, 0.8).normalize().multiplyScalar(1.45 * this.size));
    this.turn = new THREE.OrbitControls(this.camera, this.canvas);
    this.turn.target.copy(middle);
    this.turn.listenToKeyEvents(this.canvas);
    this.turn.keys = { LEFT: "ArrowLeft", UP: "ArrowUp", RIGHT: "ArrowRight", BOTTOM: "ArrowDown" };
    this.turn.addEventListener("change", () => this.draw());
    this.turn.update();
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    stackLabels(this.scene, this.camera);
    this.renderer.render(this.scene, this.camera);
  }

  /** Colour the parts by a field, and return its range; without one in their own colours. */
  paint(name, component, state) {
    const known = name ? this.parts.filter((part) => part.fields[name]) : [];
    const valueOf = (field, vertex) => {
      const [, vertices, components] = field.shape;
      const at = (s) => field.values[(s * vertices + vertex) * components + component];
      return state === DIFFERENCE ? at(CORRECTED) - at(RAW) : at(state);
    };
    // One scale for both states, so that they can be compared.
    let low = Infinity, high = -Infinity;
    for (const part of known) {
      const field = part.fields[name], vertices = field.shape[1];
      for (let v = 0; v < vertices; v++) {
        const values = state === DIFFERENCE ? [valueOf(field, v)] : [0, 1].map((s) => field.values[(s * vertices + v) * field.shape[2] + component]);
        for (const value of values) if (Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
      }
    }
    const signed = state === DIFFERENCE || (name === "mean" && component < 3);
    if (signed) [low, high] = [-Math.max(-low, high), Math.max(-low, high)];
    const map = signed ? DIVERGING : VIRIDIS, colours = TABLES.get(map);
    for (const part of this.parts) {
      const colour = part.mesh.geometry.getAttribute("color"), field = name && part.fields[name];
      const own = new THREE.Color(part.own).toArray();
      part.faces.forEach((vertex, corner) => {
        const value = field ? valueOf(field, vertex) : NaN;
        const share = high > low ? (value - low) / (high - low) : 0.5;
        colour.setXYZ(corner, ...(Number.isFinite(value) ? colours[Math.round(255 * Math.min(Math.max(share, 0), 1))] : own));
      });
      colour.needsUpdate = true;
    }
    this.draw();
    return known.length && high >= low ? { low, high, map } : null;
  }

  /** Colour contact points, and the areas between them, by their values, and return the range; without values, in their own colour. */
  paintContacts(name, single, state) {
    const known = name ? this.data.contacts.map((pair) => this.ofPoints(pair, name, single, state)) : [];
    const every = known.flatMap((values) => Array.from(values || [])).filter(Number.isFinite);
    const high = every.reduce((most, value) => Math.max(most, value), 0), colour = new THREE.Color();
    this.pairs.forEach((pair, k) => {
      const geometry = pair.points.geometry, own = every.length && known[k];
      if (own) {
        const grey = colour.set("#7f8894").toArray(), table = TABLES.get(VIRIDIS);
        const place = (value) => Math.round((255 * Math.max(value, 0)) / (high || 1));
        const colours = Array.from(own).flatMap((value) => (Number.isFinite(value) ? table[place(value)] : grey));
        geometry.setAttribute("color", new THREE.BufferAttribute(Float32Array.from(colours), 3));
        if (pair.map) pair.map.geometry.setAttribute("color", geometry.getAttribute("color"));
      }
      if (pair.map) pair.map.visible = Boolean(own);
      Object.assign(pair.material, { vertexColors: Boolean(own), size: own ? 7 : 4, needsUpdate: true });
      pair.material.color.set(own ? "#ffffff" : TOUCHED);
    });
    this.draw();
    return every.length ? { low: 0, high, map: VIRIDIS } : null;
  }

  /** A value for each contact point of a pair; null if the archive does not contain it. */
  ofPoints(pair, name, single, state) {
    if (name === "gapsLeft") {
      if (!pair.gapsLeft || single < 0) return null;
      const gaps = unpacked(pair.gapsLeft), count = gaps.shape[2], start = (2 * single + state) * count;
      return gaps.values.subarray(start, start + count);
    }
    if (name === "touching") return pair.touching ? unpacked(pair.touching).values : null;
    return Number.isFinite(pair.reaction) ? new Float32Array(pair.points.shape[0]).fill(pair.reaction) : null;
  }

  /** Give faces their form in one realization, exaggerated by a factor; flat for a negative number. */
  bend(number, factor) {
    for (const part of this.parts.filter((own) => own.forms.length)) {
      const bent = part.flat.slice();
      for (const form of number < 0 ? [] : part.forms) {
        const count = form.modes.shape[1];
        form.vertices.forEach((vertex, k) => {
          let height = 0;
          for (let m = 0; m < count; m++) height += form.modes.values[k * count + m] * form.coefficients.values[number * count + m];
          for (let axis = 0; axis < 3; axis++) bent[3 * vertex + axis] += factor * height * form.normal[axis];
        });
      }
      const position = part.mesh.geometry.getAttribute("position");
      part.faces.forEach((vertex, corner) => position.setXYZ(corner, bent[3 * vertex], bent[3 * vertex + 1], bent[3 * vertex + 2]));
      position.needsUpdate = true;
      part.mesh.geometry.computeVertexNormals();
    }
  }

  /** Move the parts as in one realization, exaggerated by a factor; back to nominal without one. */
  move(motions, number, state, factor, penetrating) {
    this.parts.forEach((part, k) => {
      part.group.matrix.copy(motions ? this.motion(motions, number, state, k, factor) : new THREE.Matrix4());
      part.group.matrixWorldNeedsUpdate = true;
    });
    this.pairs.forEach((pair, k) => {
      pair.points.matrix.copy(this.parts[pair.part].group.matrix);
      pair.points.matrixWorldNeedsUpdate = true;
      if (pair.map) {
        pair.map.matrix.copy(pair.points.matrix);
        pair.map.matrixWorldNeedsUpdate = true;
      }
      if (!pair.material.vertexColors) pair.material.color.set(penetrating && penetrating[k] ? RED : TOUCHED);
    });
    this.draw();
  }

  motion(motions, number, state, part, factor) {
    const parts = motions.shape[2], start = ((number * 2 + state) * parts + part) * 12;
    const m = Array.from(motions.values.subarray(start, start + 12), (x) => factor * x);
    return new THREE.Matrix4().set(1 + m[0], m[1], m[2], m[9], m[3], 1 + m[4], m[5], m[10], m[6], m[7], 1 + m[8], m[11], 0, 0, 0, 1);
  }

  cut(axis, share) {
    const k = "xyz".indexOf(axis), planes = axis ? [this.section] : [];
    if (axis) {
      this.section.normal.setComponent(0, 0).setComponent(1, 0).setComponent(2, 0).setComponent(k, -1);
      const low = this.box.min.getComponent(k), high = this.box.max.getComponent(k);
      this.section.constant = low + share * (high - low) + 1e-6 * this.size;
    }
    for (const part of this.parts)
      for (const material of part.materials) material.clippingPlanes = [...planes, ...(material.userData.planes || [])];
    this.draw();
  }
}

/** What is shown, and cut: the same controls on every page. */
function control(viewer) {
  Object.keys(viewer.marks).forEach((id) =>
    byId(id).addEventListener("change", () => { viewer.marks[id].visible = byId(id).checked; viewer.draw(); }));
  const cut = () => viewer.cut(byId("across").value, Number(byId("cut").value) / 1000);
  byId("across").addEventListener("change", cut);
  byId("cut").addEventListener("input", cut);
  for (const part of viewer.parts) {
    const label = document.createElement("label"), box = document.createElement("input");
    Object.assign(box, { type: "checkbox", checked: true });
    box.addEventListener("change", () => { part.group.visible = box.checked; viewer.draw(); });
    label.append(box, ` ${part.name}`);
    byId("parts").append(label);
  }
}
