// Skills and resources in time (paper, Figures 11 and 12): a row a skill, a row a resource, a line for each moment that matters.

const ROW = 22;
const BAND_ROW = 17;
const GROUP = 18;
const AXIS = 22;
const MARK_ROW = 15;
const MARK_COLOURS = { failure: "var(--bad)", detected: "var(--detected)", fallback_running: "var(--now)", moving_again: "var(--good)", pause: "var(--fair)" };

class TimelineView {
  constructor(choose) {
    this.box = byId("timeline");
    this.choose = choose;
    this.built = [0, 1]; // what is drawn
    this.window = null; // [from, to], seconds of mission clock; null: the whole run, growing
    byId("zoom-in").addEventListener("click", () => this.zoom(0.5));
    byId("zoom-out").addEventListener("click", () => this.zoom(2));
    byId("zoom-all").addEventListener("click", () => this.look(null));
    this.box.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.box.addEventListener("pointerdown", (event) => this.down(event));
    this.box.addEventListener("pointermove", (event) => this.move(event));
    this.box.addEventListener("pointerup", (event) => this.up(event));
    new ResizeObserver(() => this.run && this.draw(this.run, this.t, true)).observe(this.box);
    const keys = Object.entries(ENDINGS).map(([name, { words: text, mark }]) => el("li", {}, svg("svg", { width: 22, height: 12 }, svg("rect", { width: 22, height: 12, rx: 2, fill: `var(--${name})` }), svg("text", { x: 11, y: 10, "text-anchor": "middle", "font-size": 10, fill: "var(--bar-ink)" }, mark)), text));
    byId("legend").append(...keys);
  }

  span() {
    const begin = Math.min(this.run.begin ?? 0, origin(this.run));
    const end = Math.max(this.run.end ?? 1, begin + 1);
    return this.window ?? [begin - 0.01 * (end - begin), end + 0.015 * (end - begin)];
  }

  look(window) {
    this.window = window;
    this.draw(this.run, this.t, true);
  }

  zoom(factor, around = this.t) {
    const [from, to] = this.span();
    const width = Math.min(Math.max((to - from) * factor, 0.5), 2 * (this.run.end - this.run.begin) + 2);
    const share = (around - from) / (to - from);
    const inside = share >= 0 && share <= 1 ? share : 0.5;
    const centre = inside === share ? around : (from + to) / 2;
    this.look([centre - inside * width, centre + (1 - inside) * width]);
  }

  draw(run, t, whole = false) {
    const stale = whole || this.news !== run.news || this.run !== run || outgrown(run, this.end);
    [this.run, this.t] = [run, t];
    if (stale) this.build();
    const x = this.x(t);
    this.cursor.setAttribute("x1", x);
    this.cursor.setAttribute("x2", x);
    this.cursor.setAttribute("visibility", x >= this.left && x <= this.width ? "visible" : "hidden");
  }

  x(t) {
    const [from, to] = this.built;
    return this.left + ((t - from) / (to - from)) * (this.width - this.left - 6);
  }

  timeAt(clientX) {
    const [from, to] = this.built;
    return from + ((clientX - this.box.getBoundingClientRect().left - this.left) / (this.width - this.left - 6)) * (to - from);
  }

  build() {
    [this.news, this.end, this.built] = [this.run.news, this.run.end, this.span()];
    this.width = Math.max(this.box.clientWidth, 260);
    this.left = this.width < 560 ? 104 : 170;
    const moments = marks(this.run);
    const parts = [];
    let y = MARK_ROW * moments.length + 6;
    const top = y;
    const bySkill = new Map();
    for (const execution of this.run.executions.values()) {
      const row = `${execution.skillset}.${execution.skill}`;
      bySkill.set(row, [...(bySkill.get(row) ?? []), execution]);
    }
    const skillsets = [...new Set([...bySkill.keys()].map((row) => row.split(".")[0]))];
    for (const skillset of skillsets) {
      parts.push(svg("text", { x: 0, y: y + 13, class: "group" }, skillset));
      y += GROUP;
      for (const [row, executions] of bySkill) {
        if (row.split(".")[0] !== skillset) continue;
        parts.push(this.label(row.split(".")[1], y + ROW / 2), ...executions.flatMap((execution) => this.bar(execution, y)));
        y += ROW;
      }
    }
    if (this.run.resources.size) {
      parts.push(svg("text", { x: 0, y: y + 13, class: "group" }, "resources"));
      y += GROUP;
    }
    for (const [name, track] of this.run.resources) {
      parts.push(this.label(name.split(".")[1], y + BAND_ROW / 2, "soft"), ...this.bands(name, track, y));
      y += BAND_ROW;
    }
    const lines = moments.flatMap((entry, index) => this.mark(entry, index * MARK_ROW + 12, y));
    this.cursor = svg("line", { class: "cursor", y1: top - 4, y2: y });
    const drawing = svg("svg", { height: y + AXIS + 14, viewBox: `0 0 ${this.width} ${y + AXIS + 14}`, role: "img", "aria-label": `Timeline of ${bySkill.size} skills and ${this.run.resources.size} resources` }, this.axis(top, y), parts, lines, this.cursor);
    this.box.replaceChildren(drawing);
  }

  label(text, y, kind = "") {
    const letters = Math.floor((this.left - 8) / 7.1);
    const cut = text.length > letters ? `${text.slice(0, letters - 1)}…` : text;
    return svg("text", { x: this.left - 6, y: y + 4, "text-anchor": "end", class: kind }, cut, svg("title", {}, text));
  }

  axis(top, bottom) {
    const [from, to] = this.span();
    const zero = origin(this.run);
    const rough = (to - from) / Math.max(2, (this.width - this.left) / 90);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= rough);
    const parts = [];
    for (let tick = Math.ceil((from - zero) / step) * step; tick <= to - zero; tick += step) {
      const x = this.x(zero + tick);
      parts.push(svg("line", { class: "grid", x1: x, x2: x, y1: top, y2: bottom }), svg("text", { x, y: bottom + 15, "text-anchor": "middle", class: "soft" }, String(Number(tick.toPrecision(10)))));
    }
    parts.push(svg("text", { x: this.left, y: bottom + 31, class: "soft" }, this.run.departure === null ? "time since the first event (s)" : `time since ${robotWords(this.run).departure} (s)`));
    return parts;
  }

  /** Left and right of a stretch inside the window, or null. */
  stretch(from, to) {
    const [x1, x2] = [Math.max(this.x(from), this.left), Math.min(this.x(to), this.width - 4)];
    return x2 < this.left || x1 > this.width - 4 ? null : [x1, Math.max(x2 - x1, 2)];
  }

  bar(execution, y) {
    const place = this.stretch(execution.start, execution.end ?? this.run.end);
    if (!place) return [];
    const [x, width] = place;
    const ending = endingOf(execution);
    const mark = ENDINGS[ending].mark;
    const text = `${execution.skillset}.${execution.skill}: ${ENDINGS[ending].words}${execution.result ? ` (${execution.result})` : ""}${execution.message ? `: ${execution.message}` : ""}; ${listed(execution.inputs) || "no inputs"}`;
    const parts = [svg("rect", { x, y: y + 3, width, height: ROW - 6, rx: 2, fill: `var(--${ending})`, "data-text": text, "data-from": execution.start, "data-to": execution.end ?? "" }, svg("title", {}, text))];
    const name = execution.result || words(execution.state);
    const inside = width > 7 * name.length + 20 ? `${mark} ${name}` : width > 14 ? mark : "";
    if (inside) parts.push(svg("text", { x: x + 5, y: y + ROW / 2 + 4, class: "on-bar", "pointer-events": "none" }, inside));
    return parts;
  }

  bands(name, track, y) {
    const states = [...new Set(track.v.map(({ state }) => state))];
    return track.v.flatMap(({ state, cause, alarm: told }, index) => {
      const place = this.stretch(track.t[index], track.t[index + 1] ?? this.run.end);
      if (!place) return [];
      const [x, width] = place;
      const alarm = isAlarm(this.run, told, track.t[index]);
      const text = `${name} is ${state}${cause ? ` (${cause})` : ""}`;
      const fill = alarm ? "var(--alarm)" : states.indexOf(state) % 2 ? "var(--band-b)" : "var(--band-a)";
      const parts = [svg("rect", { x, y: y + 1.5, width, height: BAND_ROW - 3, fill, "data-text": text, "data-from": track.t[index], "data-to": track.t[index + 1] ?? "" }, svg("title", {}, text))];
      if (width > 6.6 * state.length + 8) parts.push(svg("text", { x: x + 4, y: y + BAND_ROW / 2 + 4, class: "band", "pointer-events": "none" }, state));
      return parts;
    });
  }

  mark({ t, kind, label }, y, bottom) {
    const x = this.x(t);
    if (x < this.left || x > this.width) return [];
    const stroke = MARK_COLOURS[kind] ?? "var(--soft)";
    const right = x > this.width - 130;
    const text = `${label} ${seconds(t - origin(this.run), 2)}`;
    const label_ = svg("text", { x: right ? x - 4 : x + 4, y: y - 2, "text-anchor": right ? "end" : "start" }, text);
    label_.style.fill = stroke;
    return [svg("line", { x1: x, x2: x, y1: y - 10, y2: bottom, stroke, "stroke-width": 1.5, "stroke-dasharray": { failure: "", detected: "6 3", fallback_running: "8 3 2 3", moving_again: "2 3", pause: "1 3" }[kind] ?? "4 4", "pointer-events": "none" }), label_];
  }

  // --- by hand -----------------------------------------------------------------------------------------------------------

  wheel(event) {
    if (!event.ctrlKey && !event.shiftKey) return; // the page scrolls
    event.preventDefault();
    if (event.ctrlKey) return this.zoom(event.deltaY > 0 ? 1.25 : 0.8, this.timeAt(event.clientX));
    const [from, to] = this.span();
    const shift = ((event.deltaY || event.deltaX) / 400) * (to - from);
    return this.look([from + shift, to + shift]);
  }

  down(event) {
    this.drag = { x: event.clientX, window: this.span(), moved: false };
  }

  move(event) {
    const text = event.target.dataset?.text;
    if (text) {
      const zero = origin(this.run);
      const { from, to } = event.target.dataset;
      setText(byId("hover"), `${seconds(from - zero)} – ${to === "" ? "now" : seconds(to - zero)}  ${text}`);
    }
    if (!this.drag || !event.buttons) return;
    const shift = event.clientX - this.drag.x;
    if (Math.abs(shift) < 5 && !this.drag.moved) return;
    this.drag.moved = true;
    const [from, to] = this.drag.window;
    const dt = (shift / (this.width - this.left)) * (to - from);
    this.look([from - dt, to - dt]);
  }

  up(event) {
    if (this.drag && !this.drag.moved) this.choose(this.timeAt(event.clientX));
    this.drag = null;
  }
}
