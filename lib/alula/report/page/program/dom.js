// Makes elements. Words of a run only ever become text nodes and attributes: nothing of them is read as markup.

const SVG = "http://www.w3.org/2000/svg";

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? "" : String(value));
  }
  for (const child of children.flat()) {
    if (child !== null && child !== undefined && child !== false) node.append(child);
  }
  return node;
}

const el = (name, attributes = {}, ...children) => fill(document.createElement(name), attributes, children);
const svg = (name, attributes = {}, ...children) => fill(document.createElementNS(SVG, name), attributes, children);
const byId = (id) => document.getElementById(id);

/** Sets a text only where it differs, so that screen readers and layout are left alone. */
function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

const fixed = (value, digits) => (Object.is(Math.round(value * 10 ** digits), -0) ? 0 : value).toFixed(digits);

/** Seconds since the departure as "12.3 s"; a dash for what has no time. */
const seconds = (value, digits = 1) => (Number.isFinite(value) ? `${fixed(value, digits)} s` : "–");

/** A number for people: four significant digits, no exponents of everyday sizes. */
function short(value) {
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value)) return String(value);
  return String(Number(value.toPrecision(4)));
}

/** Inputs and outputs of a skill as "height 3, speed 2". */
function listed(values) {
  return Object.entries(values ?? {})
    .map(([name, value]) => `${name} ${shown(value)}`)
    .join(", ");
}

function shown(value) {
  if (value === null || value === undefined) return "unknown";
  if (Array.isArray(value)) return `(${value.map(shown).join(", ")})`;
  if (typeof value === "object") return `(${Object.entries(value).map(([name, part]) => `${name} ${shown(part)}`).join(", ")})`;
  return short(value);
}

/** The unit that a field's name ends with, as the project names them. */
function unitOf(name) {
  const units = [["_m_s", "m/s"], ["_rad", "rad"], ["_ms", "ms"], ["_hz", "Hz"], ["_bps", "bit/s"], ["_s", "s"], ["_m", "m"], ["fps", "frames/s"], ["fps_margin", "frames/s"]];
  return (units.find(([ending]) => name.endsWith(ending)) ?? ["", ""])[1];
}
