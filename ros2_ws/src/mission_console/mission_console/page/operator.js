// The operator's acts, on the live page: who commands, start, stop and land, everything off. Each needs more than a slip of the finger:
// two presses in turn, and for everything off a word that is typed.

const ARMED_MS = 4000;

class OperatorBar {
  constructor(send, watch) {
    [this.send, this.watch] = [send, watch];
    this.answer = el("output", { role: "status" });
    this.role = el("span", {});
    this.runs = el("select", { "aria-label": "run that is shown", onchange: (event) => watch(event.target.value) });
    this.take = el("button", { type: "button", onclick: () => send({ command: "take" }) }, "take over");
    this.report = el("a", { target: "_blank", rel: "noopener", hidden: true }, "open the report");
    this.checks = el("ul", { class: "checks", "aria-label": "What keeps the mission from starting" });
    this.abort = this.armed("stop and land", "press again: stop and land", () => send({ command: "abort", run: this.status.run }));
    this.word = el("input", { type: "text", size: 5, "aria-label": "type OFF to switch everything off", placeholder: "type OFF", oninput: () => this.enable() });
    this.off = this.armed("everything off", "press again: end all processes", () => {
      send({ command: "off", run: this.status.run });
      this.word.value = "";
    });
    this.form = this.startForm();
    byId("operator").hidden = false;
    byId("operator").append(
      el("div", { class: "acts" }, el("label", {}, "run ", this.runs), this.report, this.role, this.take),
      el("details", {}, el("summary", {}, "start a mission"), this.form),
      el("div", { class: "acts" }, this.abort, this.word, this.off),
      this.checks,
      this.answer,
    );
  }

  startForm() {
    const field = (label, input) => el("label", {}, `${label} `, input);
    this.scenario = el("select", { name: "scenario" });
    this.seed = el("input", { type: "number", min: 0, max: 2147483647, value: 0 });
    this.faults = el("input", { type: "text", placeholder: "zed@30, lidar@60", "aria-label": "failures, as zed@30" });
    this.over = el("select", {}, el("option", { value: "simulator" }, "simulator"), el("option", { value: "mocks" }, "mocks"));
    this.begin = this.armed("start", "press again: start", () => {
      const faults = this.faults.value.split(/[\s,]+/).filter(Boolean);
      this.send({ command: "start", scenario: this.scenario.value, seed: Number(this.seed.value), faults, mock: this.over.value === "mocks" });
      this.say("starting …");
    }, "go");
    return el("form", { "aria-label": "Start a mission", onsubmit: (event) => event.preventDefault() }, field("scenario", this.scenario), field("seed", this.seed), field("failures", this.faults), field("over", this.over), this.begin);
  }

  /** A button that acts on the second press within some seconds. */
  armed(text, again, act, kind = "danger") {
    const button = el("button", { type: "button", class: kind }, text);
    let timer = null;
    const disarm = () => {
      clearTimeout(timer);
      timer = null;
      button.classList.remove("armed");
      setText(button, text);
    };
    button.addEventListener("click", () => {
      if (timer !== null) {
        disarm();
        act();
        return;
      }
      button.classList.add("armed");
      setText(button, again);
      timer = setTimeout(disarm, ARMED_MS);
    });
    return button;
  }

  say(text) {
    setText(this.answer, text);
  }

  show(status, unmet) {
    this.status = status;
    rewrite(this.runs, status.runs, (name) => el("option", { value: name }, name));
    if (this.runs.value !== status.run && document.activeElement !== this.runs) this.runs.value = status.run;
    rewrite(this.scenario, status.scenarios, (name) => el("option", { value: name }, name));
    this.report.hidden = !status.report;
    if (status.report) this.report.href = `/runs/${encodeURIComponent(status.run)}/report.html${location.search}`;
    setText(this.role, status.commands ? `you command; ${status.viewers} watching` : `${status.commander || "nobody"} commands; you watch`);
    this.take.hidden = status.commands;
    rewrite(this.checks, unmet ?? [], (sentence) => el("li", {}, sentence));
    this.enable();
  }

  enable() {
    const may = Boolean(this.status?.commands) && live.state !== "stale";
    this.begin.disabled = !may;
    this.abort.disabled = !may || !this.status.live;
    this.off.disabled = this.abort.disabled || this.word.value.trim().toUpperCase() !== "OFF";
  }
}
