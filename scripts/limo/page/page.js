"use strict";
// Texts from configuration and results reach the page as text nodes, and plotly, which reads some markup, through plain().

const FONT = { family: 'system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif', size: 13, color: "#1a1a1a" };
const CONFIG = { displaylogo: false, responsive: true };
const byId = (id) => document.getElementById(id);

function make(tag, properties, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

/** Options of a select from [value, text] or [value, text, disabled]; the chosen one stays where it is among them. */
function fill(select, options) {
  const before = select.value;
  select.replaceChildren(...options.map(([value, text, disabled]) => make("option", { value, disabled: Boolean(disabled) }, text)));
  const usable = options.filter(([, , disabled]) => !disabled).map(([value]) => value);
  select.value = usable.includes(before) ? before : usable[0] ?? "";
}

const plain = (text) => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

/** The same for plotly with subscripts and Greek letters: V_v, Delta, E_hat. */
const pretty = (text) =>
  plain(text).replaceAll("Delta ", "Δ").replaceAll("E_hat", "Ê").replace(/\b([A-Za-z])_([A-Za-z0-9]+)\b/g, "$1<sub>$2</sub>");

const unit = (units) => (units === "" ? "" : ` [${units === "1" ? "–" : units === "degree" ? "°" : units}]`);
const short = (value) => String(Number(Number(value).toPrecision(4)));

/** Break a title into lines of at most so many characters, but no equation. */
function wrapped(text, most) {
  const lines = [""];
  for (const word of text.replaceAll(" = ", "\u00a0=\u00a0").split(" ")) {
    if (lines.at(-1) && lines.at(-1).length + word.length >= most) lines.push("");
    lines.push(`${lines.pop()} ${word}`.trim());
  }
  return lines.join("<br>");
}

async function unpackBytes(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Numbers of a typed array whose bytes of one significance lie together. */
async function unpack(text, Kind) {
  const planes = await unpackBytes(text);
  const size = Kind.BYTES_PER_ELEMENT;
  const count = planes.length / size;
  const bytes = new Uint8Array(planes.length);
  for (let s = 0; s < size; s++) for (let k = 0; k < count; k++) bytes[k * size + s] = planes[s * count + k];
  return new Kind(bytes.buffer);
}

/** Multiples of a step; NaN for no number. */
const unpackSteps = async (text, step) =>
  Float32Array.from(await unpack(text, Int16Array), (n) => (n === -32768 ? NaN : n * step));

async function start() {
  const text = (bytes) => new TextDecoder().decode(bytes);
  document.head.append(make("script", { textContent: text(await unpackBytes(byId("library").textContent)) }));
  const plots = JSON.parse(text(await unpackBytes(byId("plots").textContent)));
  if (Object.keys(plots.studies).length) showCurves(plots);
  else byId("curves").hidden = true;
  const devices = JSON.parse(byId("devices").textContent);
  if (Object.keys(devices.studies).length) await showDevices(devices);
  else byId("device").hidden = true;
  document.body.dataset.ready = "yes";
}
