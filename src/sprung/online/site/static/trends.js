// Charts of parts and modes over time.

const place = document.getElementById("part-trends");
const modePlace = document.getElementById("mode-trends");
const events = document.getElementById("trend-events");
const KINDS = ["spring", "damper", "tyre"];
const SIGNS = { baseline: "▮", verdict: "◆", alert: "▲" };
const SYMBOLS = ["circle", "square", "diamond"];
// After Okabe and Ito, for light and dark paper.
const SERIES = [["#0072b2", "#56b4e9"], ["#b34700", "#ff9c5a"], ["#00694e", "#3fc79a"]];

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const isDark = () => matchMedia("(prefers-color-scheme: dark)").matches;
/** A time [UTC ns] in the viewer's zone, as the charts read it. */
const local = (ns) => {
  const at = new Date(ns / 1e6);
  return new Date(at - 60000 * at.getTimezoneOffset()).toISOString().slice(0, 19).replace("T", " ");
};
/** A text as it is, where the charts would read markup. */
const plain = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;");
const percent = (value) => (value === null ? null : 100 * value);

function axes(n) {
  const room = 0.09;
  return Array.from({ length: n }, (_, k) => [1 - (k + 1) / n + (k === n - 1 ? 0 : room / 2), 1 - k / n - room / 2]);
}

/** Layout of panels above each other on one time axis. */
function layout(titles, range, marks, height) {
  const ink = colour("--ink"), line = colour("--line"), soft = colour("--soft");
  const domains = axes(titles.length);
  const shared = { gridcolor: line, zerolinecolor: soft, linecolor: line, tickfont: { color: soft }, fixedrange: true };
  const isTouched = matchMedia("(pointer: coarse)").matches; // there, dragging scrolls the page
  const result = {
    height, margin: { l: 56, r: 16, t: 24, b: 40 }, showlegend: false, hovermode: "closest", dragmode: isTouched ? false : "zoom", uirevision: "zoom",
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: ink },
    xaxis: { ...shared, type: "date", anchor: `y${titles.length === 1 ? "" : titles.length}`, range, fixedrange: isTouched, showgrid: false, zeroline: false },
    shapes: [], annotations: [],
  };
  titles.forEach((text, k) => {
    result[`yaxis${k ? k + 1 : ""}`] = { ...shared, domain: domains[k], anchor: "x", nticks: 5 };
    result.annotations.push({ text, x: 0, xref: "paper", xanchor: "left", y: domains[k][1], yref: "paper", yanchor: "bottom", showarrow: false, font: { color: ink } });
  });
  for (const mark of marks) {
    const tint = mark.kind === "alert" ? colour("--high") : colour("--accent");
    const x = local(mark.time);
    result.shapes.push({ type: "line", xref: "x", yref: "paper", x0: x, x1: x, y0: 0, y1: 1, line: { color: tint, width: 1, dash: mark.kind === "alert" ? "dash" : "solid" } });
    result.annotations.push({ text: SIGNS[mark.kind], x, xref: "x", y: 1, yref: "paper", yanchor: "bottom", showarrow: false, hovertext: plain(mark.text), font: { color: tint, size: 13 } });
  }
  return result;
}

/** Longest time for the values, and pause before the next attempt [ms]. */
const PATIENCE = 20000, PAUSE = 5000;
const options = { responsive: true, displayModeBar: false, displaylogo: false };

/** Range of all windows with a margin, the same for all charts. */
function timeRange(data) {
  const times = [...data.times, ...data.mode_times];
  const first = Math.min(...times), last = Math.max(...times);
  const margin = Math.max(0.02 * (last - first), 3e11);
  return [local(first - margin), local(last + margin)];
}

/** Zoom a chart as the other one was zoomed, or back. */
function follow(chart, other) {
  chart.removeAllListeners?.("plotly_relayout");
  chart.on("plotly_relayout", () => {
    const range = chart.layout.xaxis.range;
    if (other.layout && String(other.layout.xaxis.range) !== String(range)) window.Plotly.relayout(other, { "xaxis.range": [...range] });
  });
}

/** Show a sentence in place of a chart. */
function say(where, sentence) {
  window.Plotly?.purge(where);
  where.replaceChildren(Object.assign(document.createElement("p"), { className: "note", textContent: sentence }));
  where.style.minHeight = "0";
}

function drawParts(data) {
  // A page that was opened before the first window knows no corner yet.
  const corner = place.dataset.corner || data.parts[0]?.part.split(".")[0];
  const parts = KINDS.map((kind) => data.parts.find((part) => part.part === `${corner}.${kind}`)).filter(Boolean);
  if (!parts.length || !data.times.length) {
    say(place, data.times.length ? "No window in this range can be compared." : "No window in this range: choose a longer one.");
    return;
  }
  place.style.minHeight = "";
  const x = data.times.map(local), tint = SERIES[0][isDark() ? 1 : 0];
  const titles = parts.map((part) => `${plain(part.part).replace("_", " ").replace(".", " ")}, change [%]`);
  const figure = layout(titles, timeRange(data), data.marks, 560);
  const traces = parts.map((part, k) => {
    const y = part.change.map(percent);
    const ends = (own, sign) => own.map((end, n) => (end === null ? null : sign * (percent(end) - y[n])));
    if (part.band) {
      figure.shapes.unshift({ type: "rect", layer: "below", xref: "paper", x0: 0, x1: 1, yref: `y${k ? k + 1 : ""}`, y0: percent(part.band[0]), y1: percent(part.band[1]), fillcolor: colour("--tint"), line: { width: 1, color: colour("--line") } });
    }
    return {
      x, y, yaxis: `y${k ? k + 1 : ""}`, type: "scatter", mode: "lines+markers", connectgaps: false, name: part.part,
      line: { color: tint, width: 1 }, marker: { color: tint, size: 6, symbol: SYMBOLS[k] },
      error_y: { type: "data", symmetric: false, array: ends(part.high, 1), arrayminus: ends(part.low, -1), color: tint, thickness: 1, width: 0 },
      customdata: data.windows,
      text: y.map((value, n) => (value === null ? "" : `${value.toFixed(1)} % (${percent(part.low[n]).toFixed(1)} to ${percent(part.high[n]).toFixed(1)})`)),
      hovertemplate: "%{x}<br>%{text}<extra></extra>",
    };
  });
  place.querySelector(".note")?.remove();
  window.Plotly.react(place, traces, figure, options);
  place.setAttribute("role", "img");
  place.setAttribute("aria-label", `${titles.join("; ")} against ${data.reference}, over time with 95 % intervals; shaded: 95 % of usual windows. The list of windows has the values.`);
  place.removeAllListeners?.("plotly_click");
  place.on("plotly_click", (event) => {
    const where = event.points[0]?.customdata;
    if (where) location.assign(`${place.dataset.path}/windows/${where}`);
  });
}

function drawModes(data) {
  if (!data.modes.length) {
    say(modePlace, "No mode of the body was identified in this range.");
    return;
  }
  modePlace.style.minHeight = "";
  const x = data.mode_times.map(local), shade = isDark() ? 1 : 0;
  const figure = layout(["natural frequency [Hz]", "damping ratio [%]"], timeRange(data), data.marks, 420);
  Object.assign(figure, { showlegend: true, legend: { orientation: "h", x: 1, xanchor: "right", y: 1.02, yanchor: "bottom", font: { size: 12 } } });
  const traces = data.modes.flatMap((mode, k) => ["natural_frequency", "damping_ratio"].map((name, row) => {
    const factor = row ? 100 : 1;
    const y = mode[name].map((value) => (value === null ? null : factor * value));
    const half = mode[`${name}_std`].map((std) => (std === null ? 0 : Number(modePlace.dataset.halfWidth) * factor * std));
    return {
      x, y, yaxis: row ? "y2" : "y", type: "scatter", mode: "lines+markers", connectgaps: false,
      name: mode.label, legendgroup: mode.label, showlegend: !row,
      line: { color: SERIES[k][shade], width: 1 }, marker: { color: SERIES[k][shade], size: 6, symbol: SYMBOLS[k] },
      error_y: { type: "data", array: half, color: SERIES[k][shade], thickness: 1, width: 0 },
      text: y.map((value, n) => (value === null ? "" : `${value.toPrecision(3)} ± ${half[n].toPrecision(2)}`)),
      hovertemplate: `%{x}<br>${mode.label} %{text} ${row ? "%" : "Hz"}<extra></extra>`,
    };
  }));
  modePlace.querySelector(".note")?.remove();
  window.Plotly.react(modePlace, traces, figure, options);
  modePlace.setAttribute("role", "img");
  modePlace.setAttribute("aria-label", "Natural frequency and damping ratio of the body's modes over time with 95 % intervals");
}

/** The marks of the charts in words, for readers without the picture. */
function listEvents(data) {
  events.replaceChildren(...data.marks.map((mark) => {
    const row = document.createElement("li");
    const link = Object.assign(document.createElement("a"), { href: mark.link, textContent: mark.text });
    row.append(`${SIGNS[mark.kind]} ${local(mark.time).slice(0, 16)} ${mark.kind}: `, link);
    return row;
  }));
  if (data.is_cut) events.append(Object.assign(document.createElement("li"), { textContent: "Only the last 1000 windows of this range are shown." }));
  events.hidden = !events.children.length;
}

let last = null;

function draw() {
  if (last === null) return;
  drawParts(last);
  drawModes(last);
  if (place.on) follow(place, modePlace);
  if (modePlace.on) follow(modePlace, place);
  listEvents(last);
}

/** Load the values, and draw them; if they do not come, try again, as the connection may be poor. */
async function load() {
  try {
    const answer = await fetch(place.dataset.url, { signal: AbortSignal.timeout(PATIENCE) });
    if (!answer.ok) throw new Error((await answer.json()).detail);
    last = await answer.json();
  } catch (error) {
    if (last === null) {
      say(place, `The trends cannot be loaded (${error.message}): trying again.`);
      setTimeout(load, PAUSE);
    }
    return;
  }
  draw();
}

/** Load the library of the charts, however often it takes. */
function loadLibrary() {
  return new Promise((resolve) => {
    const script = Object.assign(document.createElement("script"), { src: "/static/plotly.js", onload: resolve });
    script.onerror = () => {
      script.remove();
      say(place, "The charts cannot be drawn yet: the library plotly.js did not load. Trying again.");
      setTimeout(() => loadLibrary().then(resolve), PAUSE);
    };
    document.head.append(script);
  });
}

if (place) {
  await loadLibrary();
  load();
  document.addEventListener("sprung:refreshed", load);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}
