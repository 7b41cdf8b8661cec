"use strict";
// The report: fields and single realizations in the scene, and charts with plotly.

const OF_CONTACT = ["touching", "reaction", "gapsLeft"];
const MOST_PORTRAITS = 40;

function drive(viewer) {
  const one = data.scene.realizations, motions = one.motions && unpacked(one.motions);
  const ofStations = data.scene.stations.map((station) => station.motions && unpacked(station.motions));
  const stations = new Stations(viewer, () => moved());
  const gaps = unpacked(one.gaps), measured = unpacked(one.measured), residual = unpacked(one.residual).values;
  const state = () => Number(document.querySelector("input[name=state]:checked").value);
  byId("which").max = Math.max(one.names.length - 1, 0);
  byId("single").disabled = byId("play").disabled = !one.names.length;

  function painted() {
    const name = byId("field").value, isOfContact = OF_CONTACT.includes(name);
    const bodies = viewer.paint(isOfContact ? "" : name, Number(byId("component").value), state());
    const single = byId("single").checked ? Number(byId("which").value) - one.worstCases : -1;
    const points = viewer.paintContacts(isOfContact ? name : "", single, Math.min(state(), CORRECTED)), range = isOfContact ? points : bodies;
    byId("bar").hidden = !range;
    if (!range) return;
    byId("low").textContent = figure(range.low);
    byId("high").textContent = figure(range.high);
    byId("units").textContent = { touching: "of realizations", reaction: data.scene.reactionUnits }[name] || "mm";
    byId("colours").style.background = `linear-gradient(to right, ${range.map.join(",")})`;
  }

  function moved() {
    if (!byId("single").checked) {
      byId("message").textContent = "";
      viewer.bend(-1);
      return viewer.move(null);
    }
    const k = Number(byId("which").value), seen = Math.min(state(), CORRECTED), pairs = gaps.shape[2];
    const own = Array.from(gaps.values.subarray((k * 2 + seen) * pairs, (k * 2 + seen + 1) * pairs));
    const values = data.charts.map((chart, m) => {
      const at = (s) => figure(measured.values[(k * 2 + s) * data.charts.length + m]);
      return `${chart.name}: ${STATES[RAW]} ${at(RAW)}, ${STATES[CORRECTED]} ${at(CORRECTED)} ${chart.units}`;
    });
    const deepest = pairs ? `smallest gap, ${STATES[seen]}: ${figure(Math.min(...own))} mm` : "no contact pairs";
    byId("message").textContent = [
      one.names[k], `status: ${one.status[k]}, residual ${figure(residual[k])} mm`, deepest, ...values,
    ].join("\n");
    viewer.bend(k - one.worstCases, Number(byId("factor").value));
    return viewer.move(ofStations[stations.chosen] ?? motions, k, seen, Number(byId("factor").value), own.map((gap) => gap < -1e-6));
  }

  const both = () => { painted(); moved(); };
  document.querySelectorAll("input[name=state]").forEach((input) => input.addEventListener("change", both));
  byId("field").addEventListener("change", () => {
    if (byId("field").value === "gapsLeft" && one.names.length) byId("single").checked = true;
    both();
  });
  byId("component").addEventListener("change", painted);
  ["single", "factor"].forEach((id) => byId(id).addEventListener("change", both));
  byId("which").addEventListener("input", () => { byId("single").checked = true; both(); });
  let playing = null;
  byId("play").addEventListener("click", () => {
    const stop = playing !== null;
    if (stop) playing = clearInterval(playing) ?? null;
    else {
      byId("single").checked = true;
      playing = setInterval(() => {
        if (stations.next()) byId("which").value = (Number(byId("which").value) + 1) % one.names.length;
        both();
      }, 300);
    }
    byId("play").textContent = stop ? "play" : "stop";
    byId("play").setAttribute("aria-pressed", String(!stop));
  });
  if (data.scene.parts.some((part) => part.sixSigma)) byId("field").value = "sixSigma";
  both();
}

// --- charts ----------------------------------------------------------------------------------------------------------

const placeOf = (number, name) => document.querySelector(`[data-measure="${number}"] .${name}`);

function histogram(measure, into) {
  if (!measure.edges.length) return;
  const name = escaped(measure.name), width = measure.edges[1] - measure.edges[0];
  const middles = measure.edges.slice(0, -1).map((edge) => edge + width / 2);
  const traces = measure.states.map((own, s) => ({
    type: "bar", name: STATES[s], x: middles, y: own.counts, marker: { color: COLOURS[s] }, opacity: 0.6, width,
    hovertemplate: `%{x:.4g} ${escaped(measure.units)}: %{y}<extra>${STATES[s]}</extra>`,
  }));
  measure.states.forEach((own, s) => {
    const mean = measure.mean[s], sigma = measure.sixSigma[s] / 6, total = own.counts.reduce((a, b) => a + b, 0);
    if (!(sigma > 0)) return;
    const x = Array.from({ length: 121 }, (_, k) => mean + sigma * (k / 15 - 4));
    const y = x.map((value) => (total * width * Math.exp(-(((value - mean) / sigma) ** 2) / 2)) / (sigma * Math.sqrt(2 * Math.PI)));
    traces.push({ type: "scatter", mode: "lines", name: `normal, ${STATES[s]}`, x, y, line: { color: COLOURS[s], dash: "dot" }, hoverinfo: "skip" });
  });
  const shown = layout("", `${name} [${escaped(measure.units)}]`, "realizations");
  Object.assign(shown, { margin: { ...shown.margin, t: 76 }, legend: { orientation: "h", y: 1.08, yanchor: "bottom", x: 0 } });
  showLimits(shown, measure);
  // A state that does not vary is one high bar, which would hide the shape of the other.
  const highest = (s) => Math.max(...measure.states[s].counts), varying = [RAW, CORRECTED].filter((s) => measure.sixSigma[s] > 0);
  if (varying.length === 1) shown.yaxis.range = [0, 1.1 * highest(varying[0])];
  Plotly.newPlot(chart(`Histogram of ${measure.name}, ${STATES.join(" and ")}`, into), traces, shown, SETTINGS);
}

/** Linear shares of the contributors of a measurement, the largest above. */
function contributors(measure, into) {
  const bars = measure.contributors.toReversed();
  if (!bars.length) return into.remove();
  const of = (k) => bars.map((bar) => bar.share[k]);
  const [share, low, high] = [0, 1, 2].map(of);
  const traces = [{
    type: "bar", orientation: "h", y: bars.map((bar) => escaped(bar.name)), x: share.map((x) => Math.max(x, 0)), marker: { color: COLOURS[1] },
    error_x: {
      type: "data", symmetric: false, thickness: 1,
      array: high.map((x, k) => x - share[k]), arrayminus: low.map((x, k) => Math.max(share[k], 0) - Math.max(x, 0)),
    },
    hovertemplate: "%{y}: %{x:.1f} %<extra></extra>",
  }];
  const shown = layout(measure.contributorsTitle, "% of variance", "");
  Object.assign(shown, { showlegend: false, bargap: 0.3 });
  Object.assign(shown.margin, { l: 12, t: 36 });
  Object.assign(shown.yaxis, { automargin: true, type: "category", dtick: 1 }); // all are labelled, on paper as well
  shown.xaxis.rangemode = "nonnegative";
  Plotly.newPlot(chart(`Contributors to the variance of ${measure.name}`, into), traces, shown, SETTINGS);
}

/** The position of a measurement on the assembly. */
function portrait(viewer, measure, into) {
  const marks = data.scene.measures.find((mark) => mark.name === measure.name);
  if (!marks) return;
  const image = document.createElement("img");
  image.alt = `The points of ${measure.name} on the assembly`;
  image.src = viewer.portrait(marks);
  into.append(image);
  into.hidden = false;
}

function settling(measure, into) {
  const name = escaped(measure.name);
  const traces = measure.states.flatMap((own, s) => {
    const { shape, values } = unpacked(own.settling);
    const column = (k) => Array.from({ length: shape[0] }, (_, n) => values[n * 3 + k]);
    return [{
      type: "scatter", mode: "lines+markers", name: STATES[s], x: column(0), y: column(1), marker: { size: 4 },
      line: { color: COLOURS[s] }, error_y: { type: "data", array: column(2), color: COLOURS[s], thickness: 1 },
    }];
  });
  const shown = layout(`${name}: mean with its 95 % interval`, "realizations", escaped(measure.units));
  shown.xaxis.type = "log";
  Plotly.newPlot(chart(`Mean of ${measure.name} after more and more realizations`, into), traces, shown, SETTINGS);
}

/** Shares of variance by contributor: total Sobol' indices of both states, with intervals, and linear percentages. */
function contributions(of) {
  const groups = of.groups.map(escaped).toReversed(), back = (list) => list.toReversed();
  const traces = of.states.map((own, s) => {
    const estimates = back(own.total);
    return {
      type: "bar", orientation: "h", name: STATES[s], y: groups, x: estimates.map((each) => each[0]), marker: { color: COLOURS[s] },
      error_x: {
        type: "data", symmetric: false, thickness: 1,
        array: estimates.map((each) => each[2] - each[0]), arrayminus: estimates.map((each) => each[0] - each[1]),
      },
      text: back(own.first).map((each) => (each[0] === null ? "" : `alone ${each[0].toFixed(1)} %`)), textposition: "none",
      hovertemplate: `%{x:.1f} % in total, %{text}<extra>${STATES[s]}</extra>`,
    };
  });
  traces.push({
    type: "scatter", mode: "markers", name: "linear", y: groups, x: back(of.linear), marker: { symbol: "line-ns-open", size: 14, color: "#2563eb" },
  });
  const shown = layout(`${escaped(of.measure)}: where its variance comes from`, "% of variance, in total", "");
  Object.assign(shown, { barmode: "group", bargap: 0.25, height: 140 + 34 * groups.length });
  shown.margin.l = 12;
  shown.yaxis.automargin = true;
  const box = chart(`Contributions to the variance of ${of.measure}, ${STATES.join(" and ")}`, byId("shares"));
  box.style.height = `${shown.height}px`;
  Plotly.newPlot(box, traces, shown, SETTINGS);
}

/** One measure against a contributor, or against another measure, both in their states. */
function relations() {
  const measured = unpacked(data.relations.measured), measures = data.charts.length;
  const deviations = data.relations.deviations && unpacked(data.relations.deviations), count = data.relations.contributors.length;
  const ofMeasure = (m, s) => Array.from({ length: measured.shape[0] }, (_, n) => measured.values[(n * 2 + s) * measures + m]);
  const ofContributor = (c) => Array.from({ length: deviations.shape[0] }, (_, n) => deviations.values[n * count + c]);
  const axes = [
    ...data.relations.contributors.map((each, c) => ({ ...each, values: () => ofContributor(c) })),
    ...data.charts.map((each, m) => ({ ...each, values: (s) => ofMeasure(m, s) })),
  ];
  const offer = (select, things) => things.forEach((thing, k) => select.append(new Option(thing.name, k)));
  offer(byId("ordinate"), data.charts);
  offer(byId("abscissa"), axes);
  const draw = () => {
    const across = axes[byId("abscissa").value], up = data.charts[byId("ordinate").value];
    const traces = STATES.map((name, s) => ({
      type: "scatter", mode: "markers", name, x: across.values(s), y: ofMeasure(Number(byId("ordinate").value), s),
      marker: { color: COLOURS[s], size: 4, opacity: 0.6 },
    }));
    const title = `${escaped(up.name)} against ${escaped(across.name)}`;
    const named = (axis) => `${escaped(axis.name)} [${escaped(axis.units)}]`;
    Plotly.react(byId("points-chart"), traces, layout(title, named(across), named(up)), SETTINGS);
  };
  ["ordinate", "abscissa"].forEach((id) => byId(id).addEventListener("change", draw));
  draw();
}

// Pictures come first: charts use the remaining room.
if (byId("scene")) try {
  window.viewer = new Viewer(data.scene);
  if (data.scene.reactions.length) window.viewer.marks.reactions = reactionArrows(window.viewer, data.scene.reactions);
  data.charts.slice(0, MOST_PORTRAITS).forEach((measure, number) => portrait(window.viewer, measure, placeOf(number, "portrait")));
  control(window.viewer);
  drive(window.viewer);
} catch (error) {
  byId("scene").replaceWith(`The assembly cannot be drawn here: ${error.message}`);
  console.warn(error);
}
data.charts.forEach((measure, number) => {
  histogram(measure, placeOf(number, "histogram"));
  contributors(measure, placeOf(number, "contributors"));
  const fold = placeOf(number, "convergence");
  fold.addEventListener("toggle", () => settling(measure, fold), { once: true });
});
data.contributions.forEach(contributions);
relations();
