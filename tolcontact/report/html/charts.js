"use strict";
// What all charts share, drawn with plotly.

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

const SETTINGS = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["lasso2d", "select2d"] };
const STATES = data.states;
const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

const limits = (measure) => measure.limits.filter((limit) => limit !== null).map((limit) => ({
  type: "line", x0: limit, x1: limit, y0: 0, y1: 1, yref: "paper", line: { color: "#d01c1c", width: 2 },
}));
