// Any variable of a study over any of its axes, a line for each combination of the others.

const DASHES = ["solid", "dash", "dot", "dashdot", "longdash", "longdashdot"];
const MARKERS = ["circle", "square", "diamond", "triangle-up", "cross", "x", "star", "triangle-down"];
const MOST_LINES = 60;
const FIRST_LINES = 16; // that are drawn before anything is ticked
const MOST_BOXES = 12; // values of an axis that get a box each; of more one is chosen with a slider
const FRAME = "frame";

function showCurves({ studies, colors }) {
  const [study, quantity, axis] = ["curve-study", "curve-quantity", "curve-axis"].map(byId);
  let filters = {}; // chosen indices by dimension

  const data = () => studies[study.value];
  const variable = () => data().variables[quantity.value];
  const size = (dim) => data().dims[dim].values.length;
  const title = (dim) => (dim === FRAME ? "P_a of stored frames [kPa]" : named(data().dims[dim]));
  const named = ({ symbol, long_name, units }) =>
    `${long_name}${symbol === long_name || long_name.includes(symbol) ? "" : `, ${symbol}`}${unit(units === "1" ? "" : units)}`;
  const valueText = (dim, k) => {
    const { values, numeric, units, symbol } = data().dims[dim];
    const text = numeric ? `${values[k]}${units && units !== "1" ? ` ${units}` : ""}` : values[k];
    return dim === FRAME ? `P_a = ${values[k]}` : `${symbol} ${numeric ? "= " : ""}${text}`;
  };

  function chooseStudy() {
    const options = Object.entries(data().variables).map(([name, v]) => {
      const empty = v.values.every((value) => value === null);
      return [name, `${name.replaceAll("_", " ")}${unit(v.units)}${empty ? " (no values)" : ""}`, empty];
    });
    const kind = ([name]) => (data().variables[name].dims.includes("actuation_pressure") ? 0 : 1);
    options.sort((a, b) => kind(a) - kind(b));
    fill(quantity, options);
    if (!quantity.dataset.touched && data().variables.stroke_volume) quantity.value = "stroke_volume";
    chooseQuantity();
  }

  function chooseQuantity() {
    const dims = variable().dims;
    const order = (dim) => (dim === "actuation_pressure" || dim === FRAME ? 0 : size(dim) > 1 ? 1 : 2);
    fill(axis, [...dims].sort((a, b) => order(a) - order(b)).map((dim) => [dim, title(dim)]));
    byId("curve-log").checked = /cycles/.test(quantity.value);
    chooseAxis();
  }

  function chooseAxis() {
    filters = {};
    const parts = [];
    let lines = 1;
    for (const dim of variable().dims) {
      if (dim === axis.value) continue;
      const count = size(dim);
      const every = [...Array(count).keys()];
      const whole = count <= MOST_BOXES && dim !== FRAME && dim !== "event" && lines * count <= FIRST_LINES;
      filters[dim] = new Set(whole ? every : [preset(dim)]);
      lines *= filters[dim].size;
      if (count > 1) parts.push(count <= MOST_BOXES ? boxes(dim, every) : slider(dim));
    }
    byId("curve-filters").replaceChildren(...parts);
    draw();
  }

  /** The value that is shown first of an axis with many: of pressures the last at which most cases have a value. */
  function preset(dim) {
    if (dim !== FRAME && dim !== "actuation_pressure") return 0;
    const counts = new Array(size(dim)).fill(0);
    const { dims, values } = variable();
    const stride = dims.slice(dims.indexOf(dim) + 1).reduce((n, d) => n * size(d), 1);
    values.forEach((value, k) => (counts[Math.floor(k / stride) % size(dim)] += value !== null));
    return counts.lastIndexOf(Math.max(...counts));
  }

  function boxes(dim, every) {
    const field = make("fieldset", {}, make("legend", {}, dim === FRAME ? "Frame, P_a" : data().dims[dim].long_name));
    for (const k of every) {
      const box = make("input", { type: "checkbox", checked: filters[dim].has(k) });
      box.addEventListener("change", () => {
        filters[dim][box.checked ? "add" : "delete"](k);
        draw();
      });
      field.append(make("label", { className: "inline" }, box, ` ${data().dims[dim].values[k]}`));
    }
    return field;
  }

  function slider(dim) {
    const at = [...filters[dim]][0];
    const said = make("output", {}, valueText(dim, at));
    const range = make("input", { type: "range", min: 0, max: size(dim) - 1, step: 1, value: at });
    range.setAttribute("aria-valuetext", valueText(dim, at));
    range.addEventListener("input", () => {
      filters[dim] = new Set([Number(range.value)]);
      said.textContent = valueText(dim, Number(range.value));
      range.setAttribute("aria-valuetext", said.textContent);
      draw();
    });
    return make("label", {}, data().dims[dim].long_name, range, said);
  }

  /** Index into the values of a variable of indices by dimension. */
  const place = ({ dims }, at) => dims.reduce((k, dim) => k * size(dim) + at[dim], 0);

  /** Where the points of a line are: values of the axis; of frames the pressures that they came to. */
  function along(at) {
    const dim = axis.value;
    const pressures = data().variables.frame_pressure;
    if (dim !== FRAME || !pressures) return data().dims[dim].values;
    return data().dims[dim].values.map((_, k) => pressures.values[place(pressures, { ...at, [dim]: k })]);
  }

  function draw() {
    const shown = variable();
    const others = shown.dims.filter((dim) => dim !== axis.value);
    const varying = others.filter((dim) => filters[dim].size > 1);
    let lines = [{}];
    for (const dim of others) lines = lines.flatMap((at) => [...filters[dim]].sort((a, b) => a - b).map((k) => ({ ...at, [dim]: k })));
    const left = Math.max(lines.length - MOST_LINES, 0);
    const style = (at, dim) => (dim ? [...filters[dim]].sort((a, b) => a - b).indexOf(at[dim]) : 0);
    const traces = lines.slice(0, MOST_LINES).map((at) => {
      const points = along(at)
        .map((x, k) => [x, shown.values[place(shown, { ...at, [axis.value]: k })]])
        .filter(([x]) => x !== null);
      if (axis.value === FRAME) points.sort((a, b) => a[0] - b[0]);
      const [color, dash, symbol] = [0, 1, 2].map((k) => style(at, varying[k]));
      const name = varying.map((dim) => pretty(valueText(dim, at[dim]))).join(", ");
      return {
        type: "scatter", mode: points.length > 40 ? "lines" : "lines+markers", name,
        x: points.map((p) => p[0]), y: points.map((p) => p[1]),
        line: { color: colors[color % colors.length], dash: DASHES[dash % DASHES.length], width: 2 },
        marker: { symbol: MARKERS[symbol % MARKERS.length], size: 7 },
        hovertemplate: `%{x}: %{y:.4g}<extra>${name}</extra>`,
      };
    }).filter((trace) => trace.y.some((y) => y !== null));
    const numeric = data().dims[axis.value].numeric || (axis.value === FRAME && data().variables.frame_pressure);
    const grid = { gridcolor: "#e5e5e5", zerolinecolor: "#bfbfbf", linecolor: "#595959", ticks: "outside", automargin: true };
    const layout = {
      font: FONT, margin: { l: 60, r: 10, t: 10, b: 50 }, showlegend: traces.length > 1, hovermode: "closest",
      legend: { font: { size: 12 }, tracegroupgap: 2 },
      xaxis: { ...grid, title: { text: pretty(title(axis.value)) }, type: numeric ? "linear" : "category" },
      yaxis: {
        ...grid, title: { text: wrapped(pretty(`${shown.long_name}${unit(shown.units)}`), 50), standoff: 12 },
        type: byId("curve-log").checked ? "log" : "linear", exponentformat: "power",
      },
    };
    Plotly.react("curve-plot", traces, layout, CONFIG);
    const fixed = others.filter((dim) => filters[dim].size === 1 && dim !== "event").map((dim) => valueText(dim, [...filters[dim]][0]));
    const said = [];
    if (fixed.length) said.push(`For all lines: ${fixed.join(", ")}.`);
    if (left) said.push(`${left} lines more than ${MOST_LINES} are not drawn: choose fewer values.`);
    if (!traces.length) said.push("No values for this choice.");
    byId("curve-note").textContent = said.join(" ");
  }

  fill(study, Object.keys(studies).map((name) => [name, name]));
  study.addEventListener("change", chooseStudy);
  quantity.addEventListener("change", () => {
    quantity.dataset.touched = "yes";
    chooseQuantity();
  });
  axis.addEventListener("change", chooseAxis);
  byId("curve-log").addEventListener("change", draw);
  chooseStudy();
}
