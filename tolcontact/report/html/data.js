"use strict";
// The data of a page, for all pages.

const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);

/** An array of numbers from its base64 form: {shape, values}. */
function unpacked(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  const Kind = packed.kind === "f4" ? Float32Array : Int32Array;
  return { shape: packed.shape, values: new Kind(bytes.buffer) };
}

const figure = (x) => (Number.isFinite(x) ? Number(x.toPrecision(4)).toString() : "-");
