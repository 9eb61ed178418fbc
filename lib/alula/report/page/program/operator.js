// The operator's acts, on the live page: take over, start, pause, stop, everything off. Each needs more than a slip of the
// finger: two presses in turn, and for everything off a word that is typed. The acts on a run under way stay in sight.

const ARMED_MS = 4000;
const CALLED = { resume: "go on", off: "everything off", take: "take over", search: "what could have been done", "stop search": "stop" };
const SIGNS = { pause: "M1 1h4v10h-4zM7 1h4v10h-4z", resume: "M2 1v10l9 -5z", abort: "M6 11l-5 -6h3v-4h4v4h3z" };
const DOUBT_MS = 3000; // an answer takes some milliseconds; after so long the operator is told that it is late

/** An act as its button has it. */
const called = (command) => (command === "abort" ? robotWords(run).stop : CALLED[command] ?? command);

/** Fills a select or a datalist with names; what was chosen stays chosen. */
function offer(node, names, marked = []) {
  const key = JSON.stringify([names, marked]);
  if (node.offered === key) return;
  const chosen = node.value;
  node.offered = key;
  node.replaceChildren(...names.map((name) => el("option", { value: name }, marked.includes(name) ? `● ${name}` : name)));
  if (names.includes(chosen)) node.value = chosen;
}

class OperatorBar {
  constructor(send, watch) {
    [this.send, this.watch] = [send, watch];
    this.answer = el("output", { role: "status" });
    this.waiting = new Map(); // what was sent and is not answered yet -> when
    this.role = el("span", {});
    this.runs = el("select", { "aria-label": "run that is shown", onchange: (event) => watch(event.target.value) });
    this.take = el("button", { type: "button", onclick: () => this.tell("take") }, "take over");
    this.report = el("a", { target: "_blank", rel: "noopener", hidden: true }, "open the report");
    this.checks = el("ul", { class: "checks", "aria-label": "What the mission needs to start" });
    this.pause = this.armed("pause", "press again: pause", () => this.tell("pause"), "hold", SIGNS.pause);
    this.resume = this.armed("go on", "press again: go on", () => this.tell("resume"), "go", SIGNS.resume);
    this.held = el("p", { class: "held", role: "status" });
    this.abort = this.armed(robotWords(run).stop, `press again: ${robotWords(run).stop}`, () => this.tell("abort"), "stop", SIGNS.abort);
    this.word = el("input", { type: "text", size: 5, "aria-label": "type OFF to switch everything off", placeholder: "type OFF", oninput: () => this.enable() });
    this.off = this.armed("everything off", "press again: end all processes", () => {
      this.tell("off");
      this.word.value = "";
    });
    this.form = this.startForm();
    this.starting = el("details", {}, el("summary", {}, "start a mission"), this.form);
    this.met = el("summary", {}, "before the start");
    this.before = el("details", { open: true }, this.met, this.checks);
    byId("operator").hidden = false;
    byId("operator").append(
      el("div", { class: "acts" }, el("label", {}, "run ", this.runs), this.report, this.role, this.take),
      this.starting,
      this.before,
    );
    byId("acts").hidden = false;
    byId("acts").append(this.pause, this.resume, this.abort, el("div", { class: "said" }, this.held, this.answer), el("span", { class: "off" }, this.word, this.off));
  }

  startForm() {
    const field = (label, input) => el("label", {}, `${label} `, input);
    const text = (placeholder, label, attributes = {}) => el("input", { type: "text", placeholder, "aria-label": label, autocomplete: "off", ...attributes });
    this.scenario = el("select", { name: "scenario" });
    this.seed = el("input", { type: "number", min: 0, max: 2147483647, value: 0 });
    this.faults = text("WHAT@SECONDS, ...", "failures, as WHAT@SECONDS");
    this.worlds = el("datalist", { id: "worlds" });
    this.world = text("the scenario's", "world: a name, or a file on the robot's computer", { list: "worlds" });
    this.over = el("select", { name: "over", onchange: () => this.enable() });
    this.own = el("span", { class: "own", "aria-label": "Options of the robot" });
    this.begin = this.armed("start", "press again: start", () => {
      const faults = this.faults.value.split(/[\s,]+/).filter(Boolean);
      this.tell("start", { scenario: this.scenario.value, seed: Number(this.seed.value), faults, world: this.world.value.trim(), over: this.over.value, options: this.ownOptions() });
    }, "go");
    this.worldField = field("world", this.world);
    return el("form", { "aria-label": "Start a mission", onsubmit: (event) => event.preventDefault() }, field("scenario", this.scenario), this.worldField, this.worlds, field("run", this.over), field("seed", this.seed), field("failures", this.faults), this.own, this.begin);
  }

  /** Makes a field for each option that the robot's live runs have. */
  offerOwn(options) {
    const key = JSON.stringify(options);
    if (this.own.offered === key) return;
    this.own.offered = key;
    const input = ({ name, about, metavar, default: usual, choices, takes_value: value }) => {
      const attributes = { name, title: about, "aria-label": `${name}: ${about}` };
      if (!value) return el("input", { type: "checkbox", ...attributes });
      if (choices.length) return el("select", attributes, el("option", { value: "" }, usual || "–"), ...choices.filter((one) => one !== usual).map((one) => el("option", { value: one }, one)));
      return el("input", { type: "text", autocomplete: "off", placeholder: usual || metavar, ...attributes });
    };
    this.own.replaceChildren(...options.map((option) => el("label", {}, `${option.name.replaceAll("-", " ")} `, input(option))));
  }

  /** What was filled in, by name; a run over mocks has none of these. */
  ownOptions() {
    if (this.over.value === "mocks") return {};
    const given = [...this.own.querySelectorAll("input, select")].filter((input) => (input.type === "checkbox" ? input.checked : input.value.trim()));
    return Object.fromEntries(given.map((input) => [input.name, input.type === "checkbox" ? "" : input.value.trim()]));
  }

  /** Sends an act, and says so until its answer comes. */
  tell(command, asked = {}) {
    if (!this.send({ command, run: this.status?.run, ...asked })) return this.say("not connected: nothing was asked for");
    this.waiting.set(command, performance.now());
    return this.showWaiting();
  }

  /** An answer came. */
  hear(command, answer) {
    this.waiting.delete(command);
    this.say(`${called(command)}: ${answer}`);
    if (this.waiting.size) this.showWaiting();
  }

  /** The connection broke: what was sent may have been done, its answer will not come. */
  lose() {
    if (this.waiting.size) this.say(`${this.names()}: the connection broke before an answer came; look whether it is done, or press again`);
    this.waiting.clear();
  }

  names() {
    return [...this.waiting.keys()].map(called).join(", ");
  }

  showWaiting() {
    if (!this.waiting.size) return;
    const late = performance.now() - Math.min(...this.waiting.values());
    this.say(`${this.names()}: sent${late > DOUBT_MS ? `, no answer for ${seconds(late / 1000, 0)}` : " …"}`);
  }

  /** A button that acts on the second press within some seconds. */
  armed(text, again, act, kind = "danger", sign = "") {
    const words_ = el("span", {}, text);
    const button = el("button", { type: "button", class: kind }, sign && svg("svg", { class: "sign", viewBox: "0 0 12 12", "aria-hidden": "true" }, svg("path", { d: sign })), words_);
    let timer = null;
    const disarm = () => {
      clearTimeout(timer);
      timer = null;
      button.classList.remove("armed");
      setText(words_, text);
    };
    button.rename = (name) => {
      if (name === text) return;
      [text, again] = [name, `press again: ${name}`];
      setText(words_, timer === null ? text : again);
    };
    button.addEventListener("click", () => {
      if (timer !== null) {
        disarm();
        act();
        return;
      }
      button.classList.add("armed");
      setText(words_, again);
      timer = setTimeout(disarm, ARMED_MS);
    });
    return button;
  }

  say(text) {
    setText(this.answer, text);
  }

  /** How things are; `start`: what the mission needs to start, `held`: what a pause holds, null when there is none; `left`: it has departed. */
  show(status, start, held, left) {
    if (this.status?.run !== status.run || (left && !this.left)) this.before.open = !left; // once a run and at the departure: what is opened later stays so
    this.left = left;
    [this.status, this.paused] = [status, held !== null];
    const met = (start ?? []).filter(([, otherwise]) => !otherwise).length;
    setText(this.met, start?.length ? `before the start: ${met} of ${start.length} conditions met` : "before the start");
    offer(this.runs, status.runs, status.underWay);
    if (this.runs.value !== status.run && document.activeElement !== this.runs) this.runs.value = status.run;
    offer(this.scenario, status.scenarios);
    offer(this.worlds, status.worlds);
    offer(this.over, status.over);
    this.offerOwn(status.options);
    this.worldField.hidden = !status.worlds.length;
    this.report.hidden = !status.report;
    if (status.report) this.report.href = `/runs/${encodeURIComponent(status.run)}/report.html`;
    const viewers = `${status.viewers} ${status.viewers === 1 ? "viewer" : "viewers"}`;
    setText(this.role, `${status.commands ? "you command" : `${status.commander || "no viewer"} commands; you ${status.may ? "watch" : "may only watch, as this page comes without TLS"}`} (${viewers})`);
    this.take.hidden = status.commands || !status.may;
    rewrite(this.checks, start ?? [], ([needed, otherwise]) => el("li", { class: otherwise ? "" : "met" }, el("span", { class: "sr" }, otherwise ? "not met: " : "met: "), otherwise || needed));
    setText(this.held, held === null ? "" : `The mission is paused. ${held}`);
    this.enable();
  }

  enable() {
    const may = Boolean(this.status?.commands) && live.state !== "stale";
    this.abort.rename(robotWords(run).stop);
    this.begin.disabled = !may;
    this.abort.disabled = this.pause.disabled = this.resume.disabled = !may || !this.status.live || this.status.deployment;
    [this.pause.hidden, this.resume.hidden] = [this.paused, !this.paused];
    this.own.hidden = this.over.value === "mocks";
    this.off.disabled = this.abort.disabled || this.word.value.trim().toUpperCase() !== "OFF";
  }
}
