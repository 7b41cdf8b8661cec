"use strict";
// Common parts of all charts, drawn with plotly.

const COLOURS = ["#7f8894", "#d97706"];

function layout(title, x, y) {
  const ink = getComputedStyle(document.body).color, line = "rgba(128,128,128,0.3)";
  return {
    title: { text: title, font: { size: 15 } }, font: { color: ink, family: "system-ui, sans-serif" }, barmode: "overlay", bargap: 0,
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", margin: { l: 60, r: 12, t: 40, b: 48 },
    xaxis: { title: { text: x }, gridcolor: line, zeroline: false }, yaxis: { title: { text: y }, gridcolor: line, zeroline: false },
    legend: { orientation: "h", y: 1.08, x: 1, xanchor: "right" },
  };
}

function chart(title, into = byId("charts")) {
  const box = document.createElement("div");
  box.className = "chart";
  box.setAttribute("role", "img");
  box.setAttribute("aria-label", title);
  into.append(box);
  return box;
}

// On devices without hover, the button bar would always cover the title.
const HAS_BUTTONS = window.matchMedia("(hover: hover)").matches ? "hover" : false;
const SETTINGS = {
  responsive: true, displaylogo: false, displayModeBar: HAS_BUTTONS, modeBarButtonsToRemove: ["lasso2d", "select2d"],
};
const STATES = data.states;
const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

/** Lines at the limits of a measurement, each with its value above it; a limit far outside widens the axis. */
function showLimits(shown, measure) {
  const names = ["lower limit", "upper limit"];
  const known = measure.limits.map((limit, k) => ({ limit, name: names[k] })).filter((each) => each.limit !== null);
  shown.shapes = known.map(({ limit }) => ({
    type: "line", x0: limit, x1: limit, y0: 0, y1: 1, yref: "paper", line: { color: "#d01c1c", width: 2 },
  }));
  shown.annotations = known.map(({ limit, name }) => ({
    x: limit, y: 1, yref: "paper", yanchor: "bottom", xanchor: name === names[0] ? "right" : "left", showarrow: false,
    text: `${name} ${figure(limit)}`, font: { color: "#e5484d", size: 11 },
  }));
}

/** Charts are drawn in the colours and the widths of the window, but printed in black, as wide as paper; settings are unfolded. */
const PAPER = [[".pictures .histogram", 520, 220], [".pictures .contributors", 520, 230], ["", 690, 300]]; // parent, px, px
function relayout(isPrinted) {
  const ink = isPrinted ? "#1a1c1f" : getComputedStyle(document.body).color;
  document.querySelectorAll(".js-plotly-plot").forEach((box) => {
    const [, width, height] = PAPER.find(([parent]) => !parent || box.closest(parent));
    Plotly.relayout(box, { "font.color": ink, autosize: !isPrinted, width: isPrinted ? width : null, height: isPrinted ? height : null });
  });
  document.querySelectorAll("details.printed").forEach((fold) => { fold.open = isPrinted; });
}
window.addEventListener("beforeprint", () => relayout(true));
window.addEventListener("afterprint", () => relayout(false));
