"use strict";
// Names in the scene, each in a box that keeps its size; boxes that would cover each other are stacked.

const LABEL_HEIGHT = 0.032; // of the distance 1 from the camera
const LIFT = 0.4; // of its height, between a point and the box of its name

/** A name at a point. */
function labelOf(text, at) {
  const canvas = document.createElement("canvas"), context = canvas.getContext("2d");
  context.font = "28px sans-serif";
  canvas.width = Math.ceil(context.measureText(text).width) + 16;
  canvas.height = 40;
  context.font = "28px sans-serif";
  context.fillStyle = "rgba(255,255,255,0.85)";
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.fillStyle = "#7c2d12";
  context.fillText(text, 8, 29);
  const material = new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false, sizeAttenuation: false });
  const sprite = new THREE.Sprite(material);
  sprite.scale.set((LABEL_HEIGHT * canvas.width) / canvas.height, LABEL_HEIGHT, 1);
  sprite.center.set(0, -LIFT);
  sprite.position.set(...at);
  return sprite;
}

/** Return the box [left, lower, right, upper] of a label on the screen, which reaches from -1 to 1, lifted by `level` heights. */
function boxOf(label, camera, level) {
  const place = label.getWorldPosition(new THREE.Vector3()).project(camera), scale = camera.projectionMatrix.elements;
  const width = scale[0] * label.scale.x, height = scale[5] * label.scale.y, lower = place.y + (LIFT + level) * height;
  return [place.x, lower, place.x + width, lower + height];
}

/** Lift visible labels until none covers another one. */
function stackLabels(scene, camera) {
  camera.updateMatrixWorld();
  const boxes = [], labels = [];
  scene.traverseVisible((drawn) => { if (drawn.isSprite && drawn.center.x === 0) labels.push(drawn); });
  const covers = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] - 1e-9 && b[1] < a[3] - 1e-9;
  for (const label of labels) {
    let level = 0;
    while (level < labels.length && boxes.some((box) => covers(box, boxOf(label, camera, level)))) level += 1;
    boxes.push(boxOf(label, camera, level));
    label.center.y = -LIFT - level;
  }
}
