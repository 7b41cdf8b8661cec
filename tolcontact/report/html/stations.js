"use strict";
// Stations: the scene shows the parts that the selected one holds; playing realizations steps through all of them.

class Stations {
  constructor(viewer, changed) {
    this.viewer = viewer;
    this.all = viewer.data.stations;
    if (!this.all.length) return;
    this.select = byId("station");
    this.all.forEach((station, k) => this.select.append(new Option(station.name, k)));
    this.select.value = this.all.length - 1;
    this.select.addEventListener("change", () => { this.show(); changed(); });
    this.show();
  }

  /** The index of the selected station; -1 without stations. */
  get chosen() {
    return this.all.length ? Number(this.select.value) : -1;
  }

  /** Choose the next station, and return whether it is the first one again. */
  next() {
    if (!this.all.length) return true;
    this.select.value = (this.chosen + 1) % this.all.length;
    this.show();
    return this.chosen === 0;
  }

  show() {
    const { parts, locators, contacts, measures } = this.all[this.chosen], { viewer } = this;
    viewer.parts.forEach((part, k) => { part.group.visible = parts.includes(k); });
    viewer.marks.locators.children.forEach((cone) => { cone.visible = locators.includes(cone.name); });
    viewer.pairs.forEach((pair) => { pair.points.visible = contacts.includes(pair.name); });
    viewer.marks.reactions?.children.forEach((arrow) => { arrow.visible = contacts.includes(arrow.name); });
    viewer.marks.points.children.forEach((mark) => { mark.visible = measures.includes(mark.name); });
    document.querySelectorAll("#parts input").forEach((box, k) => { box.checked = parts.includes(k); });
    viewer.draw();
  }
}
