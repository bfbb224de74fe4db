// The device in three dimensions. Plotly's z axis stands upright: it is the device's y, from the valve down to the apex.

const PARTS = { whole: "whole device", front: "front half", right: "half with x > 0", solved: "part that was solved" };
const VIEWS = { oblique: [0.6, 1.5, 0.42], front: [0, 1.65, 0.02], side: [1.65, 0, 0.02], back: [0, -1.65, 0.02], valve: [0, 0.8, 1.5] };
const COPIES = { quarter: [[1, 1], [-1, 1], [1, -1], [-1, -1]], front_back: [[1, 1], [1, -1]], full: [[1, 1]] }; // signs of x and z
const APART = { wall: 1.5, endo: 1.5, epi: 3 }; // mm of the layers from the plane of the flat pattern
const LAYER_NAMES = { wall: "wall", endo: "endocardium", epi: "epicardium" };
const GREY = "#c4c4c4"; // where there is no value
const STORED = ""; // what moves a device that does not beat
const TRACES = { // of a beat over time, in kPa
  ventricular_pressure: ["P_v", "#0072b2", "solid"], actuation_pressure: ["P_a", "#d55e00", "solid"], arterial_pressure: ["arteries", "#595959", "dot"],
};

async function showDevices(data) {
  const [study, chosen, quantity, part, slider, mover] = ["study", "case", "quantity", "part", "stop", "beat"].map((n) => byId(`device-${n}`));
  const shapes = {};
  for (const [divisions, text] of Object.entries(data.shapes)) shapes[divisions] = await unpack(text, Float32Array);
  const meshes = {};
  let drawn = 0; // number of the last drawing that was asked for

  const one = () => data.cases[chosen.value];
  const entry = () => data.studies[study.value].find((c) => c.case === chosen.value);
  /** The circulations in which the chosen device beats, and the beat that is shown, if any. */
  const circulations = () => data.beats[study.value]?.[entry().pouches] ?? {};
  const beat = () => circulations()[mover.value];
  const stop = () => (beat() ? moment() : one().stops[Number(slider.value)]);
  const shape = () => document.querySelector('input[name="shape"]:checked').value;
  const checkedLayers = () => data.layers.map((layer) => byId(`layer-${layer}`).checked);

  async function meshOf(name) {
    if (meshes[name]) return meshes[name];
    const packed = data.meshes[name];
    const mesh = { ...packed };
    for (const key of ["flat", "away"]) mesh[key] = await unpack(packed[key], Float32Array);
    for (const key of ["quads", "layer", "face", "first", "small", "joined", "borders"]) mesh[key] = await unpack(packed[key], Int32Array);
    // each small point is a sum over the 8 points of its quadrilateral
    const grid = (packed.divisions + 1) ** 2;
    mesh.count = mesh.first.length;
    mesh.element = mesh.first.map((f) => Math.floor(f / grid));
    mesh.node = new Int32Array(8 * mesh.count);
    mesh.weight = new Float32Array(8 * mesh.count);
    mesh.first.forEach((f, p) => {
      for (let k = 0; k < 8; k++) {
        mesh.node[8 * p + k] = mesh.quads[8 * mesh.element[p] + k];
        mesh.weight[8 * p + k] = shapes[packed.divisions][8 * (f % grid) + k];
      }
    });
    mesh.carry = (values, width, column) => {
      const carried = new Float32Array(mesh.count);
      for (let p = 0; p < mesh.count; p++)
        for (let k = 8 * p; k < 8 * p + 8; k++) carried[p] += mesh.weight[k] * values[width * mesh.node[k] + column];
      return carried;
    };
    mesh.x = mesh.carry(mesh.flat, 2, 0);
    mesh.y = mesh.carry(mesh.flat, 2, 1);
    mesh.away = mesh.carry(mesh.away, 1, 0);
    return (meshes[name] = mesh);
  }

  /** Corners of triangles and ends of borders that are shown, as points of the full device: those of each copy in turn. */
  function topology(mesh, symmetry) {
    const layers = checkedLayers();
    const key = [symmetry, part.value, layers].join();
    if (mesh.topology?.key === key) return mesh.topology;
    const copies = COPIES[symmetry];
    const triangles = [[], [], []], ends = [];
    copies.forEach(([sx, sz], c) => {
      // points in the plane of symmetry belong to both sides where no seam runs, so that no edge is seen there
      const plane = copies.findIndex(([x, z]) => x > 0 && z === sz);
      const index = (p) => mesh.count * (sx < 0 && mesh.joined[p] ? plane : c) + p;
      const isShown = (points) => {
        const e = mesh.element[points[0]];
        if (!layers[mesh.layer[e]]) return false;
        if (part.value === "front") return (mesh.face[e] === 0) === (sz > 0);
        if (part.value === "right") return points.every((p) => sx * mesh.x[p] > -1e-3);
        return part.value === "whole" || c === 0;
      };
      for (let q = 0; q < mesh.small.length; q += 4) {
        const corners = mesh.small.subarray(q, q + 4);
        if (!isShown(corners)) continue;
        const [i, j, k, l] = Array.from(corners, index);
        for (const triangle of sx * sz > 0 ? [[i, j, k], [i, k, l]] : [[i, k, j], [i, l, k]])
          triangle.forEach((p, n) => triangles[n].push(p));
      }
      for (let s = 0; s < mesh.borders.length; s += 2) {
        const pair = mesh.borders.subarray(s, s + 2);
        if (isShown(pair)) ends.push(...Array.from(pair, index), -1);
      }
    });
    return (mesh.topology = { key, triangles, ends, copies });
  }

  /** The triangles whose corners all have a value, and the others. */
  function parted(triangles, values) {
    const known = [[], [], []], unknown = [[], [], []];
    if (values.every(Number.isFinite)) return [triangles, unknown];
    for (let t = 0; t < triangles[0].length; t++) {
      const corners = triangles.map((of) => of[t]);
      const to = corners.every((p) => Number.isFinite(values[p])) ? known : unknown;
      corners.forEach((p, n) => to[n].push(p));
    }
    return [known, unknown];
  }

  /** Coordinates of all points of the full device as plotly has them: x, z, -y. */
  function coordinates(mesh, copies, displacement) {
    let [x, y, z] = [mesh.x, mesh.y, new Float32Array(mesh.count)];
    if (shape() === "deformed") {
      const u = [0, 1, 2].map((column) => mesh.carry(displacement, 3, column));
      [x, y, z] = [x.map((v, p) => v + u[0][p]), y.map((v, p) => v + u[1][p]), u[2]];
    } else {
      z = z.map((_, p) => APART[data.layers[mesh.layer[mesh.element[p]]]] * (mesh.face[mesh.element[p]] === 0 ? 1 : -1));
    }
    const joined = (values, sign) => copies.flatMap((copy) => Array.from(values, (v) => sign(copy) * v));
    return [joined(x, ([sx]) => sx), joined(z, ([, sz]) => sz), joined(y, () => -1)];
  }

  async function valuesOf(name) {
    const text = one().constant[name] ?? stop().values[name];
    return text === undefined ? null : unpackSteps(text, one().steps[name]);
  }

  /** The stored states of the device on the same mesh by P_v, each with its stops by P_a. */
  const neighbours = () =>
    data.studies[study.value]
      .filter((c) => c.pouches === entry().pouches && data.cases[c.case].mesh === one().mesh)
      .sort((a, b) => a.ventricular - b.ventricular);

  /** Places of the two values of a rising list beside a number, and the share of the second one. */
  function between(values, at) {
    const above = values.findIndex((v) => v >= at);
    if (above === 0 || values.length === 1) return [[0, 1]];
    if (above < 0) return [[values.length - 1, 1]];
    const share = (at - values[above - 1]) / (values[above] - values[above - 1]);
    return [[above - 1, 1 - share], [above, share]];
  }

  /** Pressures (kPa) and volumes (ml) at the moment of a beat that the slider is at. */
  function moment() {
    const k = Number(slider.value);
    const [t, ventricular, pressure, ventricle] = ["time", "ventricular_pressure", "actuation_pressure", "ventricle_volume"].map((n) => beat()[n][k]);
    return { t, ventricular, pressure, ventricle, values: {}, remark: "" };
  }

  /** Displacements at a moment: means of those of the states around it. */
  async function movedBy({ ventricular, pressure }) {
    const cases = neighbours();
    let mean = null;
    for (const [c, share] of between(cases.map((n) => n.ventricular), ventricular)) {
      const near = data.cases[cases[c].case];
      for (const [s, weight] of between(near.stops.map((of) => of.pressure), pressure)) {
        const values = await unpackSteps(near.stops[s].values.displacement, near.steps.displacement);
        mean ??= new Float32Array(values.length);
        values.forEach((v, k) => (mean[k] += share * weight * v));
      }
    }
    return mean;
  }

  async function draw() {
    const number = ++drawn;
    const name = quantity.value;
    const mesh = await meshOf(one().mesh);
    const displacement = beat() ? await movedBy(moment()) : await valuesOf("displacement");
    const values = name === "displacement" ? null : await valuesOf(name);
    if (number !== drawn) return; // another choice was made meanwhile
    const { triangles, ends, copies } = topology(mesh, one().symmetry);
    const [x, y, z] = coordinates(mesh, copies, displacement);
    let carried;
    if (name === "displacement") {
      const u = [0, 1, 2].map((column) => mesh.carry(displacement, 3, column));
      carried = u[0].map((_, p) => Math.hypot(u[0][p], u[1][p], u[2][p]));
    } else {
      carried = values ? mesh.carry(values, 1, 0) : new Float32Array(mesh.count).fill(NaN);
    }
    if (name === "cycles") carried = carried.map((v, p) => (mesh.away[p] <= one().near + 1e-3 ? v : NaN));
    const intensity = copies.flatMap(() => Array.from(carried));
    const [known, unknown] = parted(triangles, intensity);
    const { log, units, long_name } = data.quantities[name];
    const [low, high] = limits(name);
    const said = (v) => (Number.isFinite(v) ? `${short(log ? 10 ** v : v)}${units === "1" ? "" : ` ${units === "degree" ? "°" : units}`}` : "no value");
    const surface = (corners) => ({
      type: "mesh3d", x, y, z, i: corners[0], j: corners[1], k: corners[2], visible: corners[0].length > 0,
      text: intensity.map(said), hovertemplate: "%{text}<extra></extra>",
      lighting: { ambient: 0.62, diffuse: 0.55, specular: 0.06, roughness: 0.8, fresnel: 0.05 },
      lightposition: { x: 3000, y: 6000, z: 5000 },
    });
    const ticks = Array.from({ length: Math.max(Math.floor(high) - Math.ceil(low) + 1, 0) }, (_, k) => Math.ceil(low) + k);
    const bar = {
      title: { text: wrapped(pretty(`${long_name}${unit(units)}`), 55), side: "right" }, thickness: 14, len: 0.8, outlinewidth: 0,
      ...(log ? { tickvals: ticks, ticktext: ticks.map((t) => `10<sup>${t}</sup>`) } : {}),
    };
    // borders a little outside and inside of the surfaces, which would swallow them
    const lifts = shape() === "deformed" ? [[1.01, 1.01], [0.99, 0.99]] : [[1, 1.2], [1, 0.8]];
    const lifted = (values, axis) => lifts.flatMap((lift) => ends.map((p) => (p < 0 ? null : lift[axis] * values[p])));
    const upright = lifts.flatMap(() => ends.map((p) => (p < 0 ? null : z[p])));
    const traces = [
      { ...surface(known), intensity, colorscale: "Viridis", cmin: low, cmax: high, showscale: true, colorbar: bar },
      { ...surface(unknown), color: GREY },
      { type: "scatter3d", mode: "lines", x: lifted(x, 0), y: lifted(y, 1), z: upright, line: { color: "#202020", width: 2 }, hoverinfo: "skip" },
    ];
    await Plotly.react("device-plot", traces, layout(), CONFIG);
    if (beat()) await drawBeat();
    tell(name, values, unknown[0].length > 0);
  }

  /** The loop of V_v and P_v, and pressures over time, with the moment that the slider is at. */
  async function drawBeat() {
    const shown = beat(), at = moment();
    const closed = (values) => [...values, values[0]];
    const over = (values, extra) => ({ type: "scatter", mode: "lines", hoverinfo: "x+y", ...extra, y: values });
    const dot = (x, y, axes) => ({ type: "scatter", mode: "markers", x: [x], y: [y], marker: { color: "#1a1a1a", size: 10 }, showlegend: false, hoverinfo: "skip", ...axes });
    const second = { xaxis: "x2", yaxis: "y2" };
    const traces = [
      over(closed(shown.ventricular_pressure), { x: closed(shown.ventricle_volume), line: { color: TRACES.ventricular_pressure[1] }, showlegend: false }),
      dot(at.ventricle, at.ventricular, {}),
      ...Object.entries(TRACES).map(([key, [name, color, dash]]) => over(shown[key], { x: shown.time, name: pretty(name), line: { color, dash }, ...second })),
      dot(at.t, at.ventricular, second), dot(at.t, at.pressure, second),
    ];
    const grid = { gridcolor: "#e5e5e5", zerolinecolor: "#bfbfbf", linecolor: "#595959", ticks: "outside", automargin: true };
    const title = (text) => ({ title: { text: pretty(text) } });
    await Plotly.react("beat-plot", traces, {
      font: FONT, margin: { l: 55, r: 10, t: 10, b: 45 }, legend: { orientation: "h", y: 0.42, yanchor: "bottom", x: 0 },
      xaxis: { ...grid, ...title("V_v [ml]"), anchor: "y" }, yaxis: { ...grid, ...title("P_v [kPa]"), domain: [0.6, 1] },
      xaxis2: { ...grid, ...title("time [s]"), anchor: "y2" }, yaxis2: { ...grid, ...title("pressure [kPa]"), domain: [0, 0.4] },
    }, CONFIG);
  }

  /** One scale for all P_a and all cases of the study. */
  function limits(name) {
    const all = data.studies[study.value].map((c) => data.cases[c.case].limits[name]).filter(Boolean);
    return [Math.min(...all.map((l) => l[0])), Math.max(...all.map((l) => l[1]))];
  }

  function layout() {
    const [x, z, top, bottom] = one().reach[shape()];
    const ranges = [[-x, x], [-Math.max(z, x / 2), Math.max(z, x / 2)], [-bottom, -top]].map(([low, high]) => {
      const margin = 0.06 * Math.max(high - low, bottom - top);
      return [low - margin, high + margin];
    });
    const [across, deep, tall] = ranges.map(([low, high]) => (high - low) / (1.1 * (bottom - top)));
    const axis = { showbackground: false, gridcolor: "#e5e5e5", zerolinecolor: "#cccccc", showspikes: false, nticks: 6, tickfont: { size: 11 } };
    const ticks = Array.from({ length: 20 }, (_, k) => 20 * k).filter((t) => t <= bottom + 20);
    return {
      font: FONT, margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false,
      scene: {
        aspectmode: "manual", aspectratio: { x: across, y: deep, z: tall }, dragmode: "turntable",
        camera: byId("device-plot").layout?.scene?.camera ?? { eye: eye("oblique"), up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: -0.06 } },
        xaxis: { ...axis, title: { text: "x [mm]" }, range: ranges[0] },
        yaxis: { ...axis, title: { text: "z [mm]" }, range: ranges[1] },
        zaxis: { ...axis, title: { text: "y [mm]" }, range: ranges[2], tickvals: ticks.map((t) => -t), ticktext: ticks.map(String) },
      },
    };
  }

  const eye = (view) => ({ x: VIEWS[view][0], y: VIEWS[view][1], z: VIEWS[view][2] });

  function tell(name, values, unknown) {
    const { t, pressure, remark, ventricular, ventricle } = stop();
    const text = beat()
      ? `${t.toFixed(2)} s: P_a ${pressure.toFixed(1)}, P_v ${ventricular.toFixed(1)} kPa, V_v ${ventricle.toFixed(0)} ml`
      : `${short(pressure)} kPa${remark ? `, ${remark}` : ""}`;
    byId("device-pressure").textContent = text;
    slider.setAttribute("aria-valuetext", text);
    const said = [];
    if (name !== "displacement" && !values) said.push("Not stored at this pressure: grey.");
    else if (unknown) said.push(name === "cycles" ? "Grey: away from seams, where cycles are not estimated. The last colour is the endurance range, for which no number is given." : "Grey: no value.");
    if (beat()) said.push(`${beat().note}. The shape lies between stored states of loading with P_v and P_a around those of the moment.`);
    else if (one().stops.length < one().stored) said.push(`${one().stops.length} of ${one().stored} stored pressures are shown.`);
    said.push("The scale is that of all cases of the study; what lies beyond an end has its colour.");
    byId("device-note").textContent = said.join(" ");
  }

  function chooseStudy() {
    fill(chosen, data.studies[study.value].map((c) => [c.case, c.label]));
    chooseCase();
  }

  function chooseCase() {
    const beats = Object.entries(circulations());
    byId("device-beats").hidden = !beats.length;
    fill(mover, [[STORED, "stored pressures"], ...beats.map(([name, { time, note }]) => [name, time ? name.replaceAll("_", " ") : `${name.replaceAll("_", " ")} (${note})`, !time])]);
    return chooseMover();
  }

  function chooseMover() {
    const at = slider.max === "0" ? 0 : Number(slider.value) / Number(slider.max);
    slider.max = (beat() ? beat().time.length : one().stops.length) - 1;
    slider.value = Math.round((drawn ? at : 1) * slider.max); // first the highest pressure
    const before = byId("beat-plot").hidden;
    byId("beat-plot").hidden = !beat();
    if (before !== byId("beat-plot").hidden && drawn) Plotly.Plots.resize("device-plot");
    byId("device-stops").innerHTML = beat() ? "Time in the beat" : "Actuation pressure P<sub>a</sub>";
    const names = Object.keys(data.quantities).filter((name) => name in one().steps && (!beat() || name === "displacement"));
    fill(quantity, names.map((name) => [name, `${data.quantities[name].name}${unit(data.quantities[name].units)}`]));
    return draw();
  }

  fill(study, Object.keys(data.studies).map((name) => [name, name]));
  fill(part, Object.entries(PARTS));
  for (const layer of data.layers) {
    const box = make("input", { type: "checkbox", id: `layer-${layer}`, checked: true });
    box.addEventListener("change", draw);
    byId("device-layers").append(make("label", { className: "inline" }, box, ` ${LAYER_NAMES[layer]}`));
  }
  for (const view of Object.keys(VIEWS)) {
    const button = make("button", { type: "button" }, view);
    button.addEventListener("click", () => Plotly.relayout("device-plot", { "scene.camera.eye": eye(view) }));
    byId("device-views").append(button);
  }
  study.addEventListener("change", chooseStudy);
  chosen.addEventListener("change", chooseCase);
  mover.addEventListener("change", chooseMover);
  for (const control of [quantity, part]) control.addEventListener("change", draw);
  for (const radio of document.querySelectorAll('input[name="shape"]')) radio.addEventListener("change", draw);
  slider.addEventListener("input", draw);
  fill(chosen, data.studies[study.value].map((c) => [c.case, c.label]));
  await chooseCase();
}
