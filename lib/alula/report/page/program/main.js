// The page: entries in, one moment out. Every view draws the run at `moment()`; the slider, the keys and clicks choose it.

const run = newRun();
let cursor = null; // the moment that was chosen; null: the last one, whatever comes
let picked = null; // the event that was chosen, of several at one moment
let playing = null;
let drawn = false;

const moment_ = () => cursor ?? run.end ?? 0;
const choose = (t, event = null) => {
  picked = event;
  cursor = t === null || (run.end !== null && t >= run.end - 0.01) ? null : Math.max(t, run.begin ?? 0);
  draw();
};
const views = [new TimelineView(choose), new TreeView(choose), new MapView(), new PicturesView(), new FiguresView(choose)];

/** Asks for a drawing with the next picture of the screen; many changes in between are one. */
function draw() {
  if (drawn) return;
  drawn = true;
  requestAnimationFrame(() => {
    drawn = false;
    show();
  });
}

function show() {
  const t = moment_();
  document.body.classList.toggle("ticked", run.ticked.length > 0); // which has no skills, no map and no figures
  showAccount();
  showState(t);
  showScrub(t);
  if (run.begin !== null) for (const view of views) view.draw(run, t);
  showMoments(t);
}

function showAccount() {
  const news = `${run.news} ${run.over} ${repairs.news}`;
  if (showAccount.news === news) return;
  showAccount.news = news;
  const { text, tone, reason } = headline(run);
  setText(byId("headline"), text);
  setText(byId("reason"), reason);
  byId("state").style.setProperty("--tone", `var(--${tone})`);
  const asked = run.facts["/run"] ?? {};
  document.body.classList.toggle("between", Boolean(deploymentOf(run))); // there is no mission whose map, tree and times could be shown
  const parts = [asked.scenario, asked.world && `world ${asked.world}`, asked.seed != null && `seed ${asked.seed}`, asked.faults?.length && `failing ${asked.faults.join(", ")}`, deploymentOf(run) ? "between missions" : onWhat(run)];
  setText(byId("title"), asked.name ? `Alula · ${asked.name}` : "Alula");
  for (const node of document.querySelectorAll("[data-word]")) setText(node, run.departure === null ? "the first event" : robotWords(run)[node.dataset.word]);
  byId("slider").setAttribute("aria-label", `moment of the run, seconds since ${robotWords(run).departure}`);
  rewrite(byId("own-words"), Object.entries(robotWords(run).glossary), ([word, meaning]) => el("div", {}, el("dt", {}, word), el("dd", {}, meaning)));
  setText(byId("subtitle"), parts.filter(Boolean).join(" · "));
  rewrite(byId("figures-row"), keyFigures(run), ([label, value]) => el("div", {}, el("dt", {}, label), el("dd", {}, value)));
  const zero = origin(run);
  const go = (t) => el("button", { type: "button", onclick: () => choose(t), "aria-label": `go to ${seconds(t - zero)}` }, seconds(t - zero, 2));
  rewrite(byId("lines"), account(run), ({ t, text: sentence, kind }) => el("li", { class: kind }, go(t), el("span", {}, sentence)));
  const rows = answers(run).map((row) => ({ ...row, phase: row.repair ? repairs.phase(row.fault) : "" }));
  const cell = (label, ...content) => el("td", { "data-label": label }, ...content);
  rewrite(byId("answers").tBodies[0], rows, ({ what, why, t, until, done, cost, fault, repair }) => el("tr", {}, el("th", { scope: "row" }, what, why ? el("p", { class: "hint" }, why) : null), cell("when", ...(t === null ? [] : [go(t)]), ...(until == null ? [] : [" until ", go(until)])), cell("what was done", done), cell("what it cost", cost), repair ? cell("what could have been done", el("code", {}, ...repair.split(" ").flatMap((word) => [el("span", {}, word), " "])), repairs.of(fault)) : el("td", {})));
  byId("answers").hidden = !rows.length;
  const answered = new Map(rows.filter(({ phase }) => phase === "answered").map(({ fault, repair }) => [fault, repair]));
  rewrite(byId("repairs"), [...answered], ([fault, repair]) => repairs.whole(fault, repair));
  byId("answers").classList.toggle("unrepaired", !rows.some(({ repair }) => repair));
  const chains = failures(run).map(({ chain }) => chain);
  rewrite(byId("chains"), chains.length ? chains : [null], (chain) => (chain ? el("ol", { class: "chain" }, ...chain.map(({ step, t, text: sentence }) => el("li", {}, el("b", {}, step), go(t), el("span", {}, sentence)))) : el("p", {}, "No skill failed.")));
  rewrite(byId("problems"), run.facts["/summary"]?.problems ?? [], (sentence) => el("li", {}, sentence));
}

/** Rebuilds a list only when what it shows has changed: the values, or the moment that times count from. */
function rewrite(node, values, make) {
  const key = `${origin(run)} ${JSON.stringify(values)}`;
  if (node.dataset.shown === String(key.length) && node.shown === key) return;
  [node.shown, node.dataset.shown] = [key, key.length];
  node.replaceChildren(...values.map(make));
}

function showScrub(t) {
  const zero = origin(run);
  const slider = byId("slider");
  const bounds = { min: (run.begin ?? 0) - zero, max: (run.end ?? 1) - zero };
  for (const [name, value] of Object.entries(bounds)) if (Number(slider[name]) !== value) slider[name] = value;
  slider.value = t - zero;
  slider.setAttribute("aria-valuetext", seconds(t - zero));
  setText(byId("now"), seconds(t - zero));
  setText(byId("latest"), live.on ? "now" : "end");
  byId("latest").setAttribute("aria-pressed", String(cursor === null));
  const entry = run.moments[currentEvent(t)];
  const together = entry ? run.moments.filter((other) => sameMoment(other, entry)) : [];
  const which = together.length > 1 ? ` (${together.indexOf(entry) + 1} of ${together.length})` : "";
  setText(byId("at"), entry ? `${seconds(entry.t - zero, 2)}${which}  ${entry.text}` : "before the first event");
  byId("at").title = entry?.text ?? "";
}

const sameMoment = (one, other) => one.t === other.t || Math.abs(one.t - other.t) < 0.005; // they show the same time

/** Index of the event that is shown: the chosen one while its moment is, else the last that is not after t; -1 before the first. */
function currentEvent(t) {
  const index = picked && Math.abs(Math.max(picked.t, run.begin ?? t) - t) <= 0.01 ? run.moments.indexOf(picked) : -1;
  return index >= 0 ? index : momentsUpTo(t) - 1;
}

/** How many moments are not after t. */
function momentsUpTo(t) {
  return indexAt(run.moments.map((entry) => entry.t), t + 1e-6) + 1;
}

const SHOWN_MOMENTS = 400;

function showMoments(t) {
  const upTo = currentEvent(t) + 1;
  const body = byId("moments").querySelector("tbody");
  const first = Math.max(0, Math.min(upTo - SHOWN_MOMENTS / 2, run.moments.length - SHOWN_MOMENTS));
  const zero = origin(run);
  const key = `${run.moments.length} ${first} ${zero}`;
  if (body.shown !== key) {
    body.shown = key;
    body.replaceChildren(...run.moments.slice(first, first + SHOWN_MOMENTS).map((entry) => el("tr", { class: entry.bad ? "bad" : "", onclick: () => choose(entry.t, entry) }, el("td", {}, el("button", { type: "button" }, seconds(entry.t - zero, 2))), el("td", {}, entry.kind), el("td", {}, entry.text))));
    body.current = null;
  }
  if (body.current === upTo) return;
  body.current = upTo;
  [...body.rows].forEach((row, index) => {
    row.classList.toggle("current", first + index === upTo - 1);
    row.classList.toggle("later", first + index >= upTo);
  });
  const row = body.rows[upTo - 1 - first];
  const list = byId("moments");
  if (row && !list.contains(document.activeElement)) list.scrollTop = row.offsetTop - list.clientHeight / 2;
}

// --- choosing a moment -------------------------------------------------------------------------------------------------

/** Goes to the event before (-1) or after (+1) the one that is shown; of several at one moment to each. */
function step(direction) {
  const t = moment_();
  const index = currentEvent(t);
  const between = index >= 0 && run.moments[index].t < t - 0.01;
  const entry = run.moments[direction > 0 ? index + 1 : between ? index : index - 1];
  if (entry) choose(entry.t, entry);
}

const PLAY_SPEED = 5;

/** Sets what runs the playing, null to hold it, and what its button says. */
function setPlaying(request) {
  playing = request;
  const pressed = String(request !== null);
  if (byId("play").getAttribute("aria-pressed") === pressed) return;
  byId("play").setAttribute("aria-pressed", pressed);
  const label = request === null ? `play, ${PLAY_SPEED} times as fast as it was` : "pause";
  byId("play").setAttribute("aria-label", label);
  byId("play").title = `${label} (space)`;
}

setText(byId("speed"), `${PLAY_SPEED}×`);
setPlaying(null);

function play() {
  if (playing !== null) {
    cancelAnimationFrame(playing);
    return setPlaying(null);
  }
  if (cursor === null) cursor = run.begin;
  let before = performance.now();
  const advance = (now) => {
    if (cursor === null) return setPlaying(null);
    choose(cursor + (PLAY_SPEED * (now - before)) / 1000);
    before = now;
    setPlaying(requestAnimationFrame(advance));
  };
  return setPlaying(requestAnimationFrame(advance));
}

byId("slider").addEventListener("input", (event) => choose(Number(event.target.value) + origin(run)));
byId("previous").addEventListener("click", () => step(-1));
byId("next").addEventListener("click", () => step(1));
byId("play").addEventListener("click", play);
byId("latest").addEventListener("click", () => choose(null));
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA|BUTTON|SUMMARY|A)$/.test(event.target.tagName)) return;
  const acts = { n: () => step(1), p: () => step(-1), " ": play, Home: () => choose(run.begin), End: () => choose(null) };
  const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!act) return;
  event.preventDefault();
  act();
});

// --- light and dark ------------------------------------------------------------------------------------------------------

function paint(theme) {
  document.documentElement.dataset.theme = theme;
  setText(byId("theme"), theme === "dark" ? "Light" : "Dark");
  for (const view of views) if (view instanceof MapView && view.run) view.draw(view.run, view.t, true);
}

byId("theme").addEventListener("click", () => paint(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
paint(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");

// --- entries -----------------------------------------------------------------------------------------------------------

function take(entries) {
  for (const entry of entries) fold(run, entry);
  draw();
}

/** The entries inside the page: base64 of gzipped JSON. */
async function readRecord(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(stream).text());
}

const live = { on: false, state: "" };
const STALE_MS = 800; // the server speaks every 0.3 s
const AGAIN_MS = 250;

/** The live page: a socket that is opened again and again, and says so while what is shown may be old. */
class Link {
  constructor() {
    live.on = true;
    this.at = { session: "", entries: 0 };
    this.heard = 0;
    this.run = new URLSearchParams(location.hash.slice(1)).get("run") ?? "";
    this.key = sessionStorage.getItem("alula-key") ?? crypto.getRandomValues(new Uint32Array(4)).join("-");
    sessionStorage.setItem("alula-key", this.key);
    this.name = `viewer ${this.key.slice(0, 4)}`;
    this.bar = new OperatorBar((asked) => this.send(asked), (name) => this.watch(name));
    repairs.bar = this.bar;
    this.manual = new ManualControlView((asked) => this.send(asked), (...words_) => this.bar.armed(...words_));
    byId("link").hidden = false;
    this.open();
    this.judge();
    setInterval(() => this.judge(), 200);
  }

  open() {
    this.socket = new WebSocket(`${location.origin.replace(/^http/, "ws")}/feed`);
    this.begun = performance.now();
    this.socket.addEventListener("open", () => this.send({ key: this.key, name: this.name, run: this.run, manual: this.manual.box.open, ...this.at }));
    this.socket.addEventListener("message", ({ data }) => this.hear(JSON.parse(data)));
    this.socket.addEventListener("close", () => {
      this.bar.lose();
      setTimeout(() => this.open(), AGAIN_MS);
    });
  }

  /** Sends what is asked for; tells whether it could. */
  send(asked) {
    const open = this.socket.readyState === WebSocket.OPEN;
    if (open) this.socket.send(JSON.stringify(asked));
    return open;
  }

  watch(name) {
    this.run = name;
    this.send({ watch: name });
  }

  hear(said) {
    this.heard = performance.now();
    if (said.entries) {
      if (said.reset) clear();
      this.at = { session: said.session, entries: said.upTo };
      this.behind = said.of - said.upTo;
      take(said.entries);
    }
    if (said.answer !== undefined) {
      if (said.command === "skill") this.manual.say(said.answer);
      else this.bar.hear(said.command, said.answer);
      if (said.started) [this.run, this.bar.starting.open] = [said.started, false];
    }
    if (said.status) {
      this.status = said.status;
      if (this.run && said.status.run !== this.run && !said.status.runs.includes(this.run)) this.run = "";
      if (run.over === said.status.live) draw();
      run.over = !said.status.live;
      if (said.status.deployment && this.opened !== said.status.run) [this.opened, this.manual.box.open] = [said.status.run, true]; // once: it is what there is to see
      this.bar.show(said.status, last(run.start.v), last(run.held.v) ?? null, run.departure !== null);
    }
    if (said.searches) this.searches = said.searches;
    if (said.status && repairs.show(this.searches?.run === said.status.run ? this.searches.found : {}, said.status.underWay.length > 0)) draw();
    if (said.status && (!said.status.live || this.manual.run !== said.status.run)) this.manual.forget();
    if (said.manual && said.manual.run === this.status?.run) this.manual.show(said.manual);
    this.judge();
  }

  /** Says whether what is shown is true now; a server that hangs without closing is left. */
  judge() {
    const age = performance.now() - this.heard;
    const stale = age > STALE_MS;
    if (stale && this.socket.readyState === WebSocket.OPEN && performance.now() - this.begun > 3000 && age > 3000) this.socket.close();
    const state = stale ? "stale" : this.behind > 0 ? "catching up" : this.status?.live ? "live" : "over";
    const since = this.heard ? `disconnected: what is shown is ${seconds(age / 1000, 0)} old` : "connecting …";
    const problems = this.status?.problems ?? [];
    setText(byId("link"), stale ? since : { live: "live", over: this.status?.run ? "this run is over" : "no run yet; alula up starts what stays up between missions", "catching up": "catching up" }[state] + (problems.length ? ` (${problems.join("; ")})` : ""));
    byId("link").dataset.state = live.state = state;
    this.bar.enable();
    this.bar.showWaiting();
    this.manual.enable(Boolean(this.status?.commands && this.status.live) && !stale);
  }
}

/** Forgets what was folded: the server has restarted, or another run is shown. */
function clear() {
  Object.assign(run, newRun());
  [cursor, picked] = [null, null];
  showAccount.news = "";
  for (const view of views) view.news = -1;
}

const record = byId("record").textContent.trim();
if (record) readRecord(record).then(take, (error) => setText(byId("headline"), `The record inside this page can't be read: ${error.message}`));
else live.link = new Link();
window.alula = { run, take, choose, step, live, moment: moment_ };
