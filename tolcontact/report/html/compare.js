"use strict";
// Comparison of runs: the distributions of each measure, as shares, so that runs of different sizes can be compared.

// Okabe and Ito's colours, which are safe for colour-blind readers.
const OF_RUN = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#7f8894"];

function distribution(measure, state, box) {
  const name = escaped(measure.name), units = escaped(measure.units);
  const middles = measure.edges.slice(0, -1).map((edge, k) => (edge + measure.edges[k + 1]) / 2);
  const traces = measure.runs.map((run, k) => ({
    type: "scatter", mode: "lines", name: escaped(run.name), x: middles, y: run.shares[state],
    line: { color: OF_RUN[k % OF_RUN.length], shape: "hvh", dash: k < OF_RUN.length ? "solid" : "dot" },
    hovertemplate: `%{x:.4g} ${units}: %{y:.2f} %<extra>${escaped(run.name)}</extra>`,
  }));
  const shown = layout(`${name}, ${STATES[state]}`, `${name} [${units}]`, "% of realizations");
  showLimits(shown, measure);
  Plotly.newPlot(chart(`Distributions of ${measure.name}, ${STATES[state]}`, box), traces, shown, SETTINGS);
}

document.querySelectorAll(".charts").forEach((box) => {
  const measure = data.charts[box.dataset.measure];
  if (measure.edges.length) STATES.forEach((_, state) => distribution(measure, state, box));
});
