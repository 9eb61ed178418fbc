// Map, route, path and robot, orthographic: from above, or in 3D, which is the same drawing seen from another side.

const ABOVE = { yaw: 0, pitch: Math.PI / 2 };
const SLANTED = { yaw: -0.6, pitch: 0.65 };
// Dark blue to yellow by height, of even steps in lightness (after Smith and van der Walt's viridis): colour-blind people see heights, too.
const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];

class MapView {
  constructor() {
    this.canvas = byId("map");
    this.cloud = document.createElement("canvas");
    this.view = { ...ABOVE };
    this.scale = null; // pixels a metre; null: everything fits
    this.shift = [0, 0];
    byId("map-above").addEventListener("click", () => this.turn(ABOVE));
    byId("map-3d").addEventListener("click", () => this.turn(SLANTED));
    this.canvas.addEventListener("pointerdown", (event) => {
      this.drag = [event.clientX, event.clientY, event.shiftKey || this.view.pitch === ABOVE.pitch];
      this.canvas.setPointerCapture(event.pointerId);
    });
    this.canvas.addEventListener("pointermove", (event) => this.move(event));
    this.canvas.addEventListener("pointerup", () => (this.drag = null));
    this.canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.enlarge(event.deltaY > 0 ? 0.85 : 1.18);
    }, { passive: false });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(([{ contentRect }]) => {
      this.size = [contentRect.width, contentRect.height];
      if (this.run) this.draw(this.run, this.t, true);
    }).observe(this.canvas);
    const line = (colour, dashes = "") => svg("svg", { width: 22, height: 10 }, svg("line", { x2: 22, y1: 5, y2: 5, stroke: colour, "stroke-width": 2.5, "stroke-dasharray": dashes }));
    const dot = (colour) => svg("svg", { width: 10, height: 10 }, svg("circle", { cx: 5, cy: 5, r: 4.5, fill: colour }));
    const place = (letter) => svg("svg", { width: 16, height: 16 }, svg("circle", { cx: 8, cy: 8, r: 7, fill: "var(--card)", stroke: "var(--ink)", "stroke-width": 1.5 }), svg("text", { x: 8, y: 12, "text-anchor": "middle", "font-size": 10, "font-weight": 700, fill: "var(--ink)" }, letter));
    const legend = [[line("var(--path)"), "way"], [line("var(--route)", "5 4"), "route"], [dot("var(--place)"), "robot"], [place("H"), "home: where it departed"], [place("L"), "where it came to rest"], [line("var(--bad)", "2 2"), "obstacle ahead"], [line("var(--edge)"), "true surfaces"]];
    const coloured = [dot("rgb(33,145,140)"), "map, coloured by height"];
    /** Signs of what every map may show, and of the areas of this one. */
    this.explain = (areas, { fence, flat }) => {
      const told = new Map(areas.map(({ tone, told: text }) => [text, line(`var(${TONES[tone][0]})`, TONES[tone][1].join(" "))]));
      const signs = [...legend, ...(flat ? [] : [coloured]), ...[...told].map(([text, sign]) => [sign, text]), ...(fence ? [[line("var(--ink)", "1 4"), "fence"]] : [])];
      byId("map-legend").replaceChildren(...signs.map(([sign, text]) => el("li", {}, sign, text)));
    };
  }

  turn(view) {
    this.view = { ...view };
    [this.scale, this.shift] = [null, [0, 0]];
    this.draw(this.run, this.t, true);
  }

  enlarge(factor) {
    this.scale = (this.scale ?? this.fitted) * factor;
    this.draw(this.run, this.t, true);
  }

  move(event) {
    if (!this.drag) return;
    const [dx, dy] = [event.clientX - this.drag[0], event.clientY - this.drag[1]];
    if (this.drag[2]) this.shift = [this.shift[0] + dx, this.shift[1] + dy];
    else {
      this.view.yaw += dx * 0.008;
      this.view.pitch = Math.min(Math.PI / 2, Math.max(0.05, this.view.pitch + dy * 0.008));
    }
    [this.drag[0], this.drag[1]] = [event.clientX, event.clientY];
    this.draw(this.run, this.t, true);
  }

  key(event) {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
    if (event.key === "+") this.enlarge(1.18);
    else if (event.key === "-") this.enlarge(0.85);
    else if (turns[event.key] && !robotWords(this.run).flat) {
      this.view.yaw += turns[event.key][0];
      this.view.pitch = Math.min(Math.PI / 2, Math.max(0.05, this.view.pitch + turns[event.key][1]));
      this.draw(this.run, this.t, true);
    } else return;
    event.preventDefault();
  }

  draw(run, t, redrawn = false) {
    [this.run, this.t] = [run, t];
    const [areas, { fence, flat }] = [run.facts["/areas"] ?? [], robotWords(run)];
    byId("map-card").hidden = !run.path.t.length && !areas.length && !fence && !["/map", "/world", "/route"].some((topic) => run.facts[topic]?.length !== 0 && run.facts[topic]);
    byId("map-3d").parentElement.hidden = flat;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.size ??= [this.canvas.clientWidth, this.canvas.clientHeight]; // asking at each drawing would have the browser lay out the page each time
    const [width, height] = this.size;
    if (!width) return;
    const sized = this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio);
    if (sized) for (const canvas of [this.canvas, this.cloud]) [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    const facts = [run.facts["/map"], run.facts["/world"], run.facts["/route"], run.facts["/areas"], run.facts["/run"]];
    const changed = facts.some((fact, index) => fact !== this.facts?.[index]);
    if (changed) this.explain(areas, robotWords(run));
    if (facts[0] !== this.facts?.[0]) this.points = unpack(facts[0]);
    this.facts = facts;
    const box = this.box(changed);
    if (sized || redrawn || changed || String(box) !== String(this.boxed)) {
      this.boxed = box;
      this.fit(box);
      this.drawCloud(ratio);
    }
    this.drawMoment(ratio);
    this.tell();
  }

  /** What is to be seen: it only grows with the path, so each place is looked at once. */
  box(changed) {
    const { path } = this.run;
    if (changed || this.boxedPath !== path) [this.corners, this.boxedPath, this.boxedPlaces] = [[[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]], path, 0];
    const { corners } = this;
    const stretchBy = (x, y, z) => [x, y, z].forEach((value, axis) => {
      corners[0][axis] = Math.min(corners[0][axis], Math.floor(value) - 1);
      corners[1][axis] = Math.max(corners[1][axis], Math.ceil(value) + 1);
    });
    if (!this.boxedPlaces) {
      for (const place of this.run.facts["/route"] ?? []) stretchBy(...place);
      for (const [ring] of (this.run.facts["/areas"] ?? []).map(rings)) for (const place of ring) stretchBy(...place);
      if (robotWords(this.run).flat) for (const [x1, y1, z1, x2, y2, z2] of this.run.facts["/world"] ?? []) [[x1, y1, z1], [x2, y2, z2]].forEach((place) => stretchBy(...place));
      for (let at = 0; at < (this.points?.length ?? 0); at += 30) stretchBy(this.points[at], this.points[at + 1], this.points[at + 2]);
    }
    for (; this.boxedPlaces < path.v.length; this.boxedPlaces += 1) stretchBy(...path.v[this.boxedPlaces]);
    if (corners[0][0] === Infinity) stretchBy(0, 0, 0);
    return [...corners[0], ...corners[1]];
  }

  fit(box) {
    this.centre = [0, 1, 2].map((axis) => (box[axis] + box[axis + 3]) / 2);
    const [width, height] = this.size;
    const spans = [0, 1].map(() => 0);
    this.fitted = 1;
    const held = [this.scale, this.shift];
    [this.scale, this.shift] = [1, [0, 0]];
    for (const x of [box[0], box[3]]) for (const y of [box[1], box[4]]) for (const z of [box[2], box[5]]) {
      const [u, v] = this.project(x, y, z);
      spans[0] = Math.max(spans[0], Math.abs(u - width / 2));
      spans[1] = Math.max(spans[1], Math.abs(v - height / 2));
    }
    [this.scale, this.shift] = held;
    this.fitted = Math.min((width / 2 - 12) / spans[0], (height / 2 - 12) / spans[1]);
  }

  /** Pixel of a place in the frame map: turned by yaw about the vertical, then seen from the pitch. */
  project(x, y, z) {
    const scale = this.scale ?? this.fitted;
    const [dx, dy, dz] = [x - this.centre[0], y - this.centre[1], z - this.centre[2]];
    const { yaw, pitch } = this.view;
    const east = dx * Math.cos(yaw) - dy * Math.sin(yaw);
    const north = dx * Math.sin(yaw) + dy * Math.cos(yaw);
    return [this.size[0] / 2 + this.shift[0] + scale * east, this.size[1] / 2 + this.shift[1] - scale * (north * Math.sin(pitch) + dz * Math.cos(pitch))];
  }

  colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  drawCloud(ratio) {
    const pen = this.cloud.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, ...this.size);
    this.grid(pen);
    if (this.points) {
      const side = Math.max(1.4, Math.min(3.5, (this.scale ?? this.fitted) * 0.16));
      pen.globalAlpha = 0.8;
      for (const at of this.order()) {
        pen.fillStyle = heightColour((this.points[at + 2] - this.low) / (this.high - this.low));
        const [u, v] = this.project(this.points[at], this.points[at + 1], this.points[at + 2]);
        pen.fillRect(u, v, side, side);
      }
      pen.globalAlpha = 1;
    }
    pen.strokeStyle = this.colour("--edge");
    pen.lineWidth = 0.8;
    pen.beginPath();
    for (const [x1, y1, z1, x2, y2, z2] of this.run.facts["/world"] ?? []) {
      pen.moveTo(...this.project(x1, y1, z1));
      pen.lineTo(...this.project(x2, y2, z2));
    }
    pen.stroke();
    this.areas(pen);
    this.line(pen, this.run.facts["/route"] ?? [], "--route", 1.6, [6, 5]);
    for (const place of this.run.facts["/route"] ?? []) this.dot(pen, place, "--route", 3);
  }

  /** Points from low to high: what is high is seen from above. */
  order() {
    const heights = Array.from({ length: this.points.length / 3 }, (_, index) => this.points[3 * index + 2]).sort((a, b) => a - b);
    this.low = heights[Math.floor(0.01 * heights.length)];
    this.high = Math.max(this.low + 0.5, heights[Math.floor(0.99 * (heights.length - 1))]);
    this.sorted ??= new WeakMap();
    if (!this.sorted.has(this.points)) this.sorted.set(this.points, Array.from({ length: this.points.length / 3 }, (_, index) => 3 * index).sort((a, b) => this.points[a + 2] - this.points[b + 2]));
    return this.sorted.get(this.points);
  }

  grid(pen) {
    const scale = this.scale ?? this.fitted;
    const step = [1, 2, 5, 10, 20, 50, 100, 200, 500].find((metres) => metres * scale > 46) ?? 1000;
    const [x1, y1, , x2, y2] = this.boxed;
    pen.strokeStyle = this.colour("--line");
    pen.fillStyle = this.colour("--soft");
    pen.font = "11px system-ui, sans-serif";
    pen.lineWidth = 0.7;
    pen.beginPath();
    for (let x = Math.ceil(x1 / step) * step; x <= x2; x += step) {
      pen.moveTo(...this.project(x, y1, 0));
      pen.lineTo(...this.project(x, y2, 0));
      pen.fillText(`${x} m`, ...this.project(x, y1, 0));
    }
    for (let y = Math.ceil(y1 / step) * step; y <= y2; y += step) {
      pen.moveTo(...this.project(x1, y, 0));
      pen.lineTo(...this.project(x2, y, 0));
      pen.fillText(`${y} m`, ...this.project(x1, y, 0));
    }
    pen.stroke();
  }

  /** The robot's areas, filled from below to above, with their names; and the fence. */
  areas(pen) {
    const { fence } = robotWords(this.run);
    this.named = [];
    for (const zone of this.run.facts["/areas"] ?? []) {
      const [colour, dashes] = TONES[zone.tone];
      const outlines = rings(zone);
      pen.fillStyle = this.colour(colour);
      pen.globalAlpha = 0.1;
      pen.beginPath();
      last(outlines).forEach((place, index) => pen[index ? "lineTo" : "moveTo"](...this.project(...place)));
      pen.fill();
      pen.globalAlpha = 1;
      this.cage(pen, outlines, colour, dashes);
      this.name(pen, `${zone.name}: ${zone.told}`, last(outlines), colour);
    }
    if (fence) this.cage(pen, fence.z.map((z) => circle([0, 0], fence.radius_m, z)), "--ink", [1, 4]);
  }

  /** Rings above one another; in 3D also what joins them. */
  cage(pen, outlines, colour, dashes) {
    for (const ring of outlines) this.line(pen, [...ring, ring[0]], colour, 1.3, dashes);
    if (this.view.pitch === ABOVE.pitch) return;
    const step = Math.max(1, outlines[0].length / 4);
    for (let at = 0; at < outlines[0].length; at += step) this.line(pen, outlines.map((ring) => ring[at]), colour, 1, dashes);
  }

  /** Writes a name at the corner of a ring that is highest on the screen, within the picture and below other names. */
  name(pen, text, ring, colour) {
    const [u, v] = ring.map((place) => this.project(...place)).reduce((best, pixel) => (pixel[1] < best[1] ? pixel : best));
    pen.font = "11px system-ui, sans-serif";
    const width = pen.measureText(text).width;
    const x = Math.max(2, Math.min(u, this.size[0] - width - 2));
    let y = Math.max(12, v - 4);
    while (this.named.some((one) => Math.abs(one.y - y) < 13 && x < one.x + one.width && one.x < x + width)) y += 13;
    this.named.push({ x, y, width });
    [pen.strokeStyle, pen.fillStyle, pen.lineWidth] = [this.colour("--card"), this.colour(colour), 3];
    pen.strokeText(text, x, y);
    pen.fillText(text, x, y);
  }

  line(pen, places, colour, width, dashes = []) {
    pen.strokeStyle = this.colour(colour);
    pen.lineWidth = width;
    pen.setLineDash(dashes);
    pen.beginPath();
    places.forEach((place, index) => pen[index ? "lineTo" : "moveTo"](...this.project(...place)));
    pen.stroke();
    pen.setLineDash([]);
  }

  dot(pen, place, colour, radius) {
    pen.fillStyle = this.colour(colour);
    pen.beginPath();
    pen.arc(...this.project(...place), radius, 0, 2 * Math.PI);
    pen.fill();
  }

  drawMoment(ratio) {
    const pen = this.canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    pen.drawImage(this.cloud, 0, 0);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const { path } = this.run;
    const index = indexAt(path.t, this.t);
    pen.globalAlpha = 0.3;
    this.line(pen, thin(path.v, path.v.length), "--path", 1.5);
    pen.globalAlpha = 1;
    this.line(pen, thin(path.v, index + 1), "--path", 2.6);
    for (const entry of marks(this.run).filter(({ kind }) => kind === "failure")) {
      const where = indexAt(path.t, entry.t);
      if (where < 0) continue;
      const [u, v] = this.project(...path.v[where]);
      pen.strokeStyle = this.colour("--bad");
      pen.fillStyle = this.colour("--bad");
      pen.lineWidth = 3;
      pen.beginPath();
      for (const [a, b] of [[-6, -6], [-6, 6]]) {
        pen.moveTo(u + a, v + b);
        pen.lineTo(u - a, v - b);
      }
      pen.stroke();
      pen.font = "600 12px system-ui, sans-serif";
      pen.strokeStyle = this.colour("--card");
      pen.strokeText(entry.label, u + 10, v - 8);
      pen.fillText(entry.label, u + 10, v - 8);
    }
    const { home, rest } = places(this.run);
    const both = home && rest && Math.hypot(home[0] - rest[0], home[1] - rest[1]) <= AT_PLACE_M;
    if (home) this.sign(pen, home, "H", both ? `home, ${cameBack(this.run)} here` : "home");
    if (rest && !both) this.sign(pen, rest, "L", cameBack(this.run));
    if (index < 0) return;
    const here = path.v[index];
    if (this.t - path.t[index] > STALE_S) pen.globalAlpha = 0.4;
    const ahead = this.obstacle();
    if (ahead) {
      this.line(pen, [here, ahead.place], "--bad", 2, [3, 3]);
      this.dot(pen, ahead.place, "--bad", 4);
    }
    if (this.view.pitch !== ABOVE.pitch) this.line(pen, [here, [here[0], here[1], 0]], "--place", 1, [2, 2]);
    this.dot(pen, here, "--place", 6);
    pen.globalAlpha = 1;
  }

  /** A letter in a ring, with a word below it. */
  sign(pen, place, letter, text) {
    const [u, v] = this.project(...place);
    [pen.strokeStyle, pen.fillStyle, pen.lineWidth, pen.textAlign] = [this.colour("--ink"), this.colour("--card"), 1.5, "center"];
    pen.beginPath();
    pen.arc(u, v, 9, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [this.colour("--ink"), this.colour("--card"), 3];
    pen.font = "700 12px system-ui, sans-serif";
    pen.fillText(letter, u, v + 4);
    pen.font = "11px system-ui, sans-serif";
    const half = pen.measureText(text).width / 2 + 2;
    const x = Math.max(half, Math.min(u, this.size[0] - half));
    pen.strokeText(text, x, v + 22);
    pen.fillText(text, x, v + 22);
    pen.textAlign = "start";
  }

  /** The obstacle that a sensor sees ahead at the moment: its place and distance. */
  obstacle() {
    for (const [name, { t, columns }] of this.run.data) {
      const index = indexAt(t, this.t);
      if (index < 0 || this.t - t[index] > 1 || columns.get("detected")?.[index] !== true) continue;
      const place = ["x", "y", "z"].map((axis) => columns.get(`nearest_enu_m.${axis}`)?.[index]);
      if (place.every(Number.isFinite)) return { name: name.split(".")[1], place, distance: columns.get("distance_m")?.[index] };
    }
    return null;
  }

  /** Says in words what the picture shows. */
  tell() {
    const { path } = this.run;
    const index = indexAt(path.t, this.t);
    const map = this.run.facts["/map"];
    const ahead = this.obstacle();
    const old = index >= 0 && this.t - path.t[index] > STALE_S ? `No position since ${seconds(path.t[index] - origin(this.run))}; the last one: ` : "";
    const parts = [index < 0 ? "Nothing is recorded of the robot's place." : `${old}Robot at east ${fixed(path.v[index][0], 1)} m, north ${fixed(path.v[index][1], 1)} m${robotWords(this.run).flat ? "" : `, height ${fixed(path.v[index][2], 1)} m`}.`];
    if (ahead) parts.push(`Obstacle ${Number.isFinite(ahead.distance) ? `${fixed(ahead.distance, 1)} m ` : ""}ahead (${ahead.name}).`);
    const [back, where] = [comingBack(this.run), restWhere(this.run)];
    if (where && this.t >= back) parts.push(`${sentence(cameBack(this.run))} ${where}.`);
    const place = index < 0 ? null : path.v[index];
    const { fence } = robotWords(this.run);
    const zone = place && (this.run.facts["/areas"] ?? []).find((one) => holds(one, place)); // the first that is listed counts
    if (zone) parts.push(`In “${zone.name}”: ${zone.told}.`);
    if (fence) parts.push(`Fence: ${fixed(fence.radius_m, 0)} m around home${place ? `, ${fixed(fence.radius_m - Math.hypot(place[0], place[1]), 1)} m away` : ""}.`);
    if (map) parts.push(`Map: ${map.of} points, ${map.count} drawn${this.run.facts["/summary"] ? ", as it was at the end" : ""}.`);
    const text = parts.join(" ");
    setText(byId("map-words"), text);
    this.canvas.setAttribute("aria-label", `Map. ${text}`);
  }
}

const MAX_PLACES = 3000;

/** The first places of a path, at most so many, the last one among them. */
function thin(places, count) {
  const step = Math.ceil(count / MAX_PLACES);
  if (step <= 1) return places.slice(0, count);
  return [...Array.from({ length: Math.floor(count / step) }, (_, index) => places[index * step]), places[count - 1]];
}

const TONES = { good: ["--good", []], fair: ["--fair", [7, 4]], bad: ["--bad", [7, 3, 2, 3]] };

const circle = ([x, y], radius, z) => Array.from({ length: 48 }, (_, index) => [x + radius * Math.cos((index * Math.PI) / 24), y + radius * Math.sin((index * Math.PI) / 24), z]);

/** The outlines of an area, from below to above. */
function rings({ box, cylinder, sphere }) {
  if (box) return [box.low[2], box.high[2]].map((z) => [[box.low[0], box.low[1], z], [box.high[0], box.low[1], z], [box.high[0], box.high[1], z], [box.low[0], box.high[1], z]]);
  if (cylinder) return cylinder.z.map((z) => circle(cylinder.at, cylinder.radius_m, z));
  return [-0.7, 0, 0.7].map((share) => circle(sphere.at, sphere.radius_m * Math.sqrt(1 - share * share), sphere.at[2] + share * sphere.radius_m));
}

/** Whether a place lies in an area, its surface included. */
function holds({ box, cylinder, sphere }, place) {
  const away = (at) => Math.hypot(...at.map((value, axis) => value - place[axis]));
  if (box) return place.every((value, axis) => box.low[axis] <= value && value <= box.high[axis]);
  if (cylinder) return away(cylinder.at) <= cylinder.radius_m && cylinder.z[0] <= place[2] && place[2] <= cylinder.z[1];
  return away(sphere.at) <= sphere.radius_m;
}

function unpack(map) {
  if (!map?.count) return null;
  const bytes = Uint8Array.from(atob(map.data), (letter) => letter.charCodeAt(0));
  const numbers = new Uint16Array(bytes.buffer);
  return Float32Array.from(numbers, (number, index) => map.origin_m[index % 3] + map.step_m * number);
}

const SHADES = Array.from({ length: 64 }, (_, index) => {
  const place = (index / 63) * (RAMP.length - 1);
  const [low, share] = [Math.min(Math.floor(place), RAMP.length - 2), place - Math.min(Math.floor(place), RAMP.length - 2)];
  return `rgb(${RAMP[low].map((value, channel) => Math.round(value + share * (RAMP[low + 1][channel] - value))).join(",")})`;
});

function heightColour(share) {
  return SHADES[Math.max(0, Math.min(63, Math.round(63 * share)))];
}
