// Numbers in time, a small chart each: height and speed of the path, and what the skillsets' data hold.

const MAX_CHARTS = 9;
const FIRST_CHARTS = 3; // of a robot that names none
const CHART = { width: 320, height: 96, left: 58, bottom: 16 };

class FiguresView {
  constructor(choose) {
    this.choose = choose;
    this.added = [];
    byId("more").addEventListener("change", (event) => {
      if (event.target.value) this.added.unshift(event.target.value);
      event.target.value = "";
      this.draw(this.run, this.t);
    });
  }

  draw(run, t) {
    [this.run, this.t] = [run, t];
    const names = this.names();
    if (String(names) !== String(this.shown)) {
      this.shown = names;
      this.charts = new Map(names.map((name) => [name, this.frame(name)]));
      byId("charts").replaceChildren(...[...this.charts.values()].map(({ figure }) => figure));
      if (!names.length) byId("charts").append(el("p", { class: "hint" }, "The record holds no figures that change."));
    }
    if (run.data.size !== this.offeredOf || this.news !== run.news) this.offer();
    [this.offeredOf, this.news] = [run.data.size, run.news];
    if (this.end === undefined || this.end > run.end || outgrown(run, this.end)) this.end = run.end;
    for (const [name, chart] of this.charts) this.update(name, chart);
  }

  names() {
    const all = this.all();
    const named = robotWords(this.run).charts.filter((name) => all.includes(name));
    const wanted = named.length ? named : all.filter((name) => this.changes(name)).slice(0, FIRST_CHARTS);
    const path = this.run.path.t.length ? [...(robotWords(this.run).flat ? [] : ["height"]), "ground speed"] : [];
    return [...new Set([...this.added.filter((name) => all.includes(name)), ...path, ...wanted])].slice(0, MAX_CHARTS);
  }

  all() {
    return [...this.run.data].flatMap(([name, { columns }]) => [...columns].filter(([, column]) => column.some((value) => typeof value === "number")).map(([field]) => `${name}.${field}`));
  }

  changes(name) {
    const values = this.series(name).v.filter((value) => typeof value === "number");
    return values.some((value) => value !== values[0]);
  }

  offer() {
    const all = this.all();
    if (String(all) === String(this.offered)) return;
    this.offered = all;
    byId("more").replaceChildren(el("option", { value: "" }, "a figure …"), ...all.map((name) => el("option", { value: name }, name)));
  }

  /** Times and values of a figure. */
  series(name) {
    const { path, data } = this.run;
    if (name === "height") return { t: path.t, v: this.grown(path).heights, unit: "m" };
    if (name === "ground speed") return { t: path.t, v: this.grown(path).speeds, unit: "m/s" };
    const [skillset, sample, ...field] = name.split(".");
    const samples = data.get(`${skillset}.${sample}`);
    return { t: samples.t, v: samples.columns.get(field.join(".")), unit: unitOf(name) };
  }

  /** Heights and speeds of the path; each place is looked at once, as paths only grow. */
  grown(path) {
    if (this.known?.path !== path) this.known = { path, heights: [], speeds: [] };
    const { heights, speeds } = this.known;
    for (let index = heights.length; index < path.v.length; index += 1) {
      const [place, before] = [path.v[index], Math.max(0, index - 2)];
      const dt = path.t[index] - path.t[before];
      heights.push(place[2]);
      speeds.push(dt > 0 ? Math.hypot(place[0] - path.v[before][0], place[1] - path.v[before][1]) / dt : 0);
    }
    return this.known;
  }

  frame(name) {
    const value = el("b", {}, "–");
    const drawing = svg("svg", { viewBox: `0 0 ${CHART.width} ${CHART.height}`, preserveAspectRatio: "none", role: "img", "aria-label": `${name} in time` });
    const figure = el("figure", {}, el("figcaption", {}, el("span", { title: name }, name), value), drawing);
    drawing.addEventListener("click", (event) => {
      const box = drawing.getBoundingClientRect();
      const share = ((event.clientX - box.left) / box.width - CHART.left / CHART.width) / (1 - CHART.left / CHART.width);
      this.choose(this.run.begin + share * (this.run.end - this.run.begin));
    });
    return { figure, drawing, value, end: null, cursor: svg("line", { y1: 4, y2: CHART.height - CHART.bottom, stroke: "var(--ink)", "stroke-width": 1.2 }) };
  }

  update(name, chart) {
    const { t, v, unit } = this.series(name);
    if (chart.end !== this.end || chart.first !== t[0]) this.curve(chart, t, v, unit);
    [chart.end, chart.first] = [this.end, t[0]];
    const { value, since } = readingAt(t, v, this.t);
    setText(chart.value, typeof value === "number" ? `${short(Number(fixed(value, 2)))} ${unit}` : since === null ? "–" : `no data since ${seconds(since - origin(this.run))}`);
    const x = this.x(this.t);
    chart.cursor.setAttribute("x1", x);
    chart.cursor.setAttribute("x2", x);
  }

  x(t) {
    const span = Math.max(this.end - this.run.begin, 1e-6);
    return CHART.left + ((t - this.run.begin) / span) * (CHART.width - CHART.left - 2);
  }

  curve(chart, t, v, unit) {
    const numbers = v.filter((value) => typeof value === "number");
    let [low, high] = [Math.min(0, ...extremes(numbers)), Math.max(...extremes(numbers), 0)];
    if (high - low < 1e-9) high = low + 1;
    const y = (value) => 6 + (1 - (value - low) / (high - low)) * (CHART.height - CHART.bottom - 8);
    const step = Math.max(1, Math.floor(t.length / 900));
    let drawn = "";
    let open = false;
    for (let index = 0; index < t.length; index += 1) {
      if (typeof v[index] !== "number" || t[index] - t[index - 1] > STALE_S) open = false;
      if (typeof v[index] === "number" && (!open || index % step === 0 || typeof v[index + 1] !== "number" || t[index + 1] - t[index] > STALE_S)) {
        drawn += `${open ? "L" : "M"}${this.x(t[index]).toFixed(1)} ${y(v[index]).toFixed(1)}`;
        open = true;
      }
    }
    const zero = origin(this.run);
    const tidy = (value) => short(Number((Math.abs(value) < (high - low) / 100 ? 0 : value).toPrecision(3)));
    const text = (x, at, words_, anchor = "end") => svg("text", { x, y: at, "text-anchor": anchor }, words_);
    chart.drawing.replaceChildren(
      svg("line", { x1: CHART.left, x2: CHART.width, y1: y(low), y2: y(low), stroke: "var(--line)" }),
      svg("path", { d: drawn, fill: "none", stroke: "var(--path)", "stroke-width": 1.6, "vector-effect": "non-scaling-stroke" }),
      text(CHART.left - 4, 12, tidy(high)),
      text(CHART.left - 4, CHART.height - CHART.bottom + 2, `${tidy(low)} ${unit}`),
      text(CHART.left, CHART.height - 2, seconds(this.run.begin - zero, 0), "start"),
      text(CHART.width - 2, CHART.height - 2, seconds(this.end - zero, 0)),
      chart.cursor,
    );
  }
}

/** Least and greatest of numbers, however many. */
function extremes(numbers) {
  if (!numbers.length) return [0, 1];
  return numbers.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
}
